//! Captures with another appearance than trained: light, opacity and crop, linear blending, parallel rays, multisampled
//! surfaces.
//!
//! In: synthetic scenes, the same for GPU and CPU. Out: proof that both draw the same, or that a pixel has the expected
//! value.

use crate::support::blob::blob;
use crate::support::gpu;
use crate::support::surfaces::edge;
use bevy_gs4d::gaussian::Harmonics;
use bevy_gs4d::reference::{Layer, render_layers};
use bevy_gs4d::renderer::{Headless, Instance, OpaqueDepth, ViewParameters};
use bevy_gs4d::scene::RuntimeScene;
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use bevy_gs4d::view::srgb::decode;
use bevy_gs4d::view::{Appearance, Background, BlendSpace, Camera, DebugView, Frame, RasterFov, View};
use glam::{Affine3A, Mat4, Quat, UVec2, Vec2, Vec3, Vec4};

const SIZE: UVec2 = UVec2::new(192, 128);
const BACKGROUND: Background = Background::Color([0.2, 0.3, 0.4]);

fn scene() -> RuntimeScene {
    let settings = SynthSettings { count: 2_000, ..SynthSettings::default() };
    synthesize(&settings).into_runtime().expect("a scene that can be drawn")
}

fn camera() -> Camera {
    Camera::look_at(Vec3::new(2.0, 1.0, 1.2), Vec3::ZERO, Vec3::Z, 0.8, SIZE)
}

fn view() -> View {
    camera().view(0.4, RasterFov::default())
}

/// Returns grey Gaussians at rest that are always active: mean, deviation, opacity.
fn blobs(blobs: &[(Vec3, f32, f32)]) -> RuntimeScene {
    let gaussian = |&(mean, deviation, opacity): &(Vec3, f32, f32)| blob(mean, Vec3::splat(deviation), opacity);
    let harmonics = Harmonics { coefficients: 1, degree: 0, degree_t: 0, values: vec![0.0; blobs.len() * 3] };
    RuntimeScene::sliced(blobs.iter().map(gaussian).collect(), harmonics)
}

/// Draws one scene with that appearance, on the GPU and on the CPU.
fn both(
    headless: &mut Headless,
    scene: &RuntimeScene,
    view: View,
    appearance: Appearance,
    space: BlendSpace,
) -> [Frame; 2] {
    let capture = headless.upload(scene).expect("it fits");
    let instance = Instance { capture: &capture, active: None, view, appearance };
    let parameters = ViewParameters { background: BACKGROUND, blend_space: space, ..ViewParameters::default() };
    let drawn = headless.render_all(&[instance], &parameters).expect("it is drawn");
    [drawn, render_layers(&[Layer { scene, view, appearance }], BACKGROUND, space)]
}

fn assert_same([drawn, expected]: &[Frame; 2], what: &str) {
    let colors = drawn.picture.pixels.iter().zip(&expected.picture.pixels).map(|(a, b)| (*a - *b).abs().max_element());
    let apart = colors.fold(0.0, f32::max);
    // A splat whose alpha is at the threshold of 1/255 may be on either side of it.
    assert!(apart < 5e-3, "{what}: colours are {apart} apart");
    let left = drawn.transmittance.iter().zip(&expected.transmittance).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    assert!(left < 5e-3, "{what}: transmittances are {left} apart");
    let depth = drawn.depth.iter().zip(&expected.depth).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    assert!(depth < 2e-2, "{what}: depths are {depth} apart");
    let mean = |frame: &Frame| frame.depth.iter().map(|d| f64::from(*d)).sum::<f64>() / frame.depth.len() as f64;
    let (a, b) = (mean(drawn), mean(expected));
    assert!((a - b).abs() < 1e-3 * b.max(1e-3), "{what}: mean depth {a}, expected {b}");
    let medians =
        drawn.median_depth.iter().zip(&expected.median_depth).filter(|(a, b)| (**a - **b).abs() > 1e-3).count();
    assert!(medians <= 4, "{what}: the median depth of {medians} pixels is another splat's");
}

/// Checks that a look changes most of what the scene covers, and nothing where no splat is.
fn assert_shows(look: &Frame, plain: &Frame, what: &str) {
    let Background::Color(behind) = BACKGROUND else { panic!("one color") };
    let (mut covered, mut changed) = (0, 0);
    for (index, left) in plain.transmittance.iter().enumerate() {
        let pixel = look.picture.pixels[index];
        if *left == 1.0 {
            assert_eq!(pixel, Vec3::from(behind), "{what}: the background at pixel {index}");
        } else if *left < 0.5 {
            covered += 1;
            changed += usize::from((pixel - plain.picture.pixels[index]).abs().max_element() > 0.01);
        }
    }
    assert!(covered > 1000, "the scene is in the picture: it covers {covered} pixels");
    assert!(2 * changed > covered, "{what}: {changed} of {covered} covered pixels change");
}

#[test]
fn look_is_what_the_twin_shows() {
    let Some(mut headless) = gpu::headless() else { return };
    let scene = scene();
    let plain = both(&mut headless, &scene, view(), Appearance::default(), BlendSpace::Encoded);
    assert_same(&plain, "as trained");
    let crop = Affine3A::from_scale(Vec3::new(2.0, 1.5, 3.0)) * Affine3A::from_quat(Quat::from_rotation_y(0.4));
    let looks = [
        ("half as opaque", Appearance { opacity: 0.5, ..Appearance::default() }),
        ("tinted and brighter", Appearance { light: Vec3::new(2.5, 1.0, 0.1), ..Appearance::default() }),
        ("cropped", Appearance { crop: Some(crop), ..Appearance::default() }),
        ("all at once", Appearance { opacity: 0.7, light: Vec3::new(0.3, 1.4, 0.9), crop: Some(crop) }),
    ];
    for (what, appearance) in looks {
        for space in [BlendSpace::Encoded, BlendSpace::Linear] {
            let pictures = both(&mut headless, &scene, view(), appearance, space);
            assert_same(&pictures, &format!("{what}, {space:?}"));
            assert_shows(&pictures[0], &plain[0], &format!("{what}, {space:?}"));
        }
    }
}

#[test]
fn a_crop_leaves_what_a_scene_of_the_means_inside_shows() {
    let Some(mut headless) = gpu::headless() else { return };
    let inside = [(Vec3::ZERO, 0.2, 0.9), (Vec3::new(0.3, 0.2, -0.3), 0.1, 0.7)];
    let outside = [(Vec3::new(0.7, 0.0, 0.0), 0.3, 0.8), (Vec3::new(0.0, 0.0, -0.9), 0.3, 0.8)];
    let all = blobs(&[inside[0], outside[0], inside[1], outside[1]]);
    let appearance = Appearance { crop: Some(Affine3A::from_scale(Vec3::splat(2.0))), ..Appearance::default() };
    let [cropped, _] = both(&mut headless, &all, view(), appearance, BlendSpace::Encoded);
    let [expected, _] = both(&mut headless, &blobs(&inside), view(), Appearance::default(), BlendSpace::Encoded);
    assert!(cropped == expected, "half a unit about the origin: bit for bit the scene without the others");
}

#[test]
fn linear_blending_averages_light() {
    let Some(mut headless) = gpu::headless() else { return };
    // Wide and half opaque: the middle pixel is half of it and half of the background, in linear light.
    let scene = blobs(&[(Vec3::ZERO, 4.0, 0.5)]);
    let [frame, _] = both(&mut headless, &scene, view(), Appearance::default(), BlendSpace::Linear);
    let middle = frame.picture.pixels[(SIZE.y / 2 * SIZE.x + SIZE.x / 2) as usize];
    let expected = 0.5 * decode(Vec3::splat(0.5)) + 0.5 * Vec3::new(0.2, 0.3, 0.4);
    assert!(middle.abs_diff_eq(expected, 2e-3), "{middle} is half and half, {expected}");
}

#[test]
fn parallel_rays_are_what_the_twin_shows() {
    let Some(mut headless) = gpu::headless() else { return };
    let scene = scene();
    for (near, shift) in [(0.0, Vec2::ZERO), (-5.0, Vec2::new(0.2, -0.1))] {
        let projection = Vec4::new(0.8, 1.2, shift.x, shift.y);
        let view = View::orthographic(SIZE, 0.4, camera().world_to_camera, projection, near);
        let pictures = both(&mut headless, &scene, view, Appearance::default(), BlendSpace::Encoded);
        assert!(pictures[1].counts.visible > 500, "the scene is in view");
        assert_same(&pictures, &format!("near {near}, shifted by {shift}"));
    }
}

#[test]
fn parallel_rays_show_far_and_near_at_one_size() {
    let Some(mut headless) = gpu::headless() else { return };
    // Two alike, one unit left and right of the axis, three and nine units away; 20 pixels to a unit.
    let scene = blobs(&[(Vec3::new(-1.0, 0.0, 3.0), 0.3, 0.9), (Vec3::new(1.0, 0.0, 9.0), 0.3, 0.9)]);
    let scale = 2.0 * 20.0 / SIZE.as_vec2();
    let view = View::orthographic(SIZE, 0.0, Mat4::IDENTITY, Vec4::new(scale.x, scale.y, 0.0, 0.0), 0.0);
    let [frame, _] = both(&mut headless, &scene, view, Appearance::default(), BlendSpace::Encoded);
    let left = |x: u32, y: u32| 1.0 - frame.transmittance[(y * SIZE.x + x) as usize];
    let middle = SIZE / 2;
    for (dx, dy) in [(0, 0), (4, 0), (3, 7), (9, 2)] {
        // The picture is mirrored about the seam between its two middle columns.
        let (near, far) = (left(middle.x - 21 + dx, middle.y + dy), left(middle.x + 20 - dx, middle.y + dy));
        assert!((near - far).abs() < 1e-5 && near > 0.0, "({dx}, {dy}): {near} near and {far} far");
    }
}

#[test]
fn multisampled_surfaces_hide_a_share_of_a_pixel() {
    let Some(mut headless) = gpu::headless() else { return };
    let (near, distance) = (0.1, 2.5);
    let (texture, column) = edge(headless.context(), SIZE, near, distance, 0.0);
    // Wide ones before and behind the surface, which is 2.5 away from a camera at the origin.
    let scene = blobs(&[(Vec3::Z * 2.0, 3.0, 0.5), (Vec3::Z * 4.0, 6.0, 0.6)]);
    let view = View::new(SIZE, 0.0, Mat4::IDENTITY, Vec4::new(1.0, 1.5, 0.0, 0.0), Vec2::new(1.0, 1.0 / 1.5));
    let capture = headless.upload(&scene).expect("it fits");
    let instance = Instance { capture: &capture, active: None, view, appearance: Appearance::default() };
    let depth = texture.create_view(&wgpu::TextureViewDescriptor::default());
    let opaque = OpaqueDepth { texture: &depth, samples: 4, origin: UVec2::ZERO, distance: [near, 0.0, 0.0, 1.0] };
    let parameters = ViewParameters { opaque: Some(opaque), ..ViewParameters::default() };
    let frame = headless.render_all(&[instance], &parameters).expect("it is drawn");
    let free = headless.render_all(&[instance], &ViewParameters::default()).expect("it is drawn");
    let front = headless.upload(&blobs(&[(Vec3::Z * 2.0, 3.0, 0.5)])).expect("it fits");
    let cut = headless.render_all(&[Instance { capture: &front, ..instance }], &ViewParameters::default());
    let cut = cut.expect("it is drawn");
    let row = SIZE.y / 2 * SIZE.x;
    let at = |frame: &Frame, x: u32| {
        let index = (row + x) as usize;
        (frame.picture.pixels[index], frame.transmittance[index], frame.depth[index])
    };
    assert_eq!(at(&frame, column - 9), at(&cut, column - 9), "behind the surface nothing shows");
    assert_eq!(at(&frame, column + 9), at(&free, column + 9), "beside it everything does");
    let ((color, left, z), (front, most, near_z), (all, least, far_z)) =
        (at(&frame, column), at(&cut, column), at(&free, column));
    assert!(least < most, "the second Gaussian takes away light");
    assert!(
        (left - 0.5 * (most + least)).abs() < 1e-6,
        "half of the samples are covered: {left} of {most} and {least}"
    );
    assert!(color.abs_diff_eq(0.5 * (front + all), 1e-6), "{color} is half of {front} and half of {all}");
    assert!((z - 0.5 * (near_z + far_z)).abs() < 1e-5, "so is the expected depth");
}

#[test]
fn a_surface_has_its_distance_from_any_projection() {
    let Some(mut headless) = gpu::headless() else { return };
    let scene = blobs(&[(Vec3::Z * 2.0, 3.0, 0.5), (Vec3::Z * 4.0, 6.0, 0.6)]);
    let capture = headless.upload(&scene).expect("it fits");
    let (texture, _) = edge(headless.context(), SIZE, 0.25, 1.0, 0.0);
    let view = View::new(SIZE, 0.0, Mat4::IDENTITY, Vec4::new(1.0, 1.5, 0.0, 0.0), Vec2::new(1.0, 1.0 / 1.5));
    let instance = Instance { capture: &capture, active: None, view, appearance: Appearance::default() };
    let depth = texture.create_view(&wgpu::TextureViewDescriptor::default());
    let mut left = |distance: [f32; 4]| {
        let opaque = OpaqueDepth { texture: &depth, samples: 4, origin: UVec2::ZERO, distance };
        let parameters = ViewParameters { opaque: Some(opaque), ..ViewParameters::default() };
        let frame = headless.render_all(&[instance], &parameters).expect("it is drawn");
        frame.transmittance[(SIZE.y / 2 * SIZE.x) as usize + 20]
    };
    // The depth is 0.25. Of a pinhole with near 0.75, an infinite far plane: 3 away, between the two.
    let between = left([0.75, 0.0, 0.0, 1.0]);
    // Parallel, near 0 and far 4, reversed: (4 - 4 d) = 3 away, too.
    assert_eq!(left([4.0, -4.0, 1.0, 0.0]), between, "the same surface");
    // Near 2, far 6, reversed: 12 / (2 + 4 d) = 4 away, no longer before the second one.
    assert!(left([12.0, 0.0, 2.0, 4.0]) < between, "farther away");
    assert_eq!(left([0.25, 0.0, 0.0, 1.0]), 1.0, "before both");
}

#[test]
fn debug_views_show_what_they_say() {
    let Some(mut headless) = gpu::headless() else { return };
    let mut scene = blobs(&[(Vec3::new(-0.6, 0.0, 2.0), 0.2, 0.95), (Vec3::new(0.6, 0.0, 4.0), 0.4, 0.95)]);
    // The right one flies along +x and is there for a moment around 0.5.
    let right = &mut scene.form.as_sliced_mut().expect("sliced").gaussians[1];
    right.velocity = [9.0, 0.0, 0.0];
    right.sigma_t = 0.02;
    let view = |time| View::new(SIZE, time, Mat4::IDENTITY, Vec4::new(1.0, 1.5, 0.0, 0.0), Vec2::new(1.0, 1.0 / 1.5));
    let capture = headless.upload(&scene).expect("it fits");
    let mut pixels = |debug, time| {
        let instance =
            Instance { capture: &capture, active: None, view: view(time), appearance: Appearance::default() };
        let parameters = ViewParameters { debug, ..ViewParameters::default() };
        let frame = headless.render_all(&[instance], &parameters).expect("it is drawn");
        let at = |ndc: f32| {
            let index = (SIZE.y / 2 * SIZE.x) as usize + ((ndc + 1.0) / 2.0 * SIZE.x as f32) as usize;
            // Not premultiplied.
            frame.picture.pixels[index] / (1.0 - frame.transmittance[index]).max(1e-6)
        };
        [at(-0.3), at(0.15)]
    };
    let [near, far] = pixels(DebugView::Depth, 0.5);
    assert!(near.x > far.x && far.x > 0.0 && near.x == near.y, "near is brighter: {near} and {far}");
    let [once, _] = pixels(DebugView::Overdraw, 0.5);
    assert!(once.z > 0.0 && once.x == 0.0, "one splat is the cold end: {once}");
    let [rests, flies] = pixels(DebugView::Velocity, 0.5);
    assert!(rests.abs_diff_eq(Vec3::splat(0.5), 1e-3), "what rests is grey: {rests}");
    assert!(flies.x > 0.9 && (flies.y - 0.5).abs() < 1e-3, "what flies along x is red: {flies}");
    let [always, moment] = pixels(DebugView::Lifespan, 0.5);
    assert!(always.abs_diff_eq(Vec3::X, 1e-3), "what is always there is red: {always}");
    assert!(moment.z > moment.x, "what is there for a moment is colder: {moment}");
    let [shows, gone] = pixels(DebugView::Active, 0.5);
    assert!(shows.y > 0.5 && gone.y > 0.5, "both show at 0.5: {shows} and {gone}");
    let colored = pixels(DebugView::Color, 0.5);
    assert!(colored[0].abs_diff_eq(Vec3::splat(0.5), 1e-3), "colours are grey: {}", colored[0]);
}

#[test]
fn what_is_active_in_vain_is_red() {
    let Some(mut headless) = gpu::headless() else { return };
    let mut scene = blobs(&[(Vec3::Z * 2.0, 0.4, 0.95)]);
    scene.form.as_sliced_mut().expect("sliced").gaussians[0].sigma_t = 0.05;
    let capture = headless.upload(&scene).expect("it fits");
    let mut middle = |debug| {
        let projection = Vec4::new(1.0, 1.5, 0.0, 0.0);
        let view = View::new(SIZE, 0.9, Mat4::IDENTITY, projection, Vec2::new(1.0, 1.0 / 1.5));
        let instance = Instance { capture: &capture, active: None, view, appearance: Appearance::default() };
        let parameters = ViewParameters { debug, ..ViewParameters::default() };
        let frame = headless.render_all(&[instance], &parameters).expect("it is drawn");
        let index = (SIZE.y / 2 * SIZE.x + SIZE.x / 2) as usize;
        (frame.picture.pixels[index], frame.transmittance[index])
    };
    assert_eq!(middle(DebugView::Color), (Vec3::ZERO, 1.0), "at 0.9 it does not show");
    let (color, _) = middle(DebugView::Active);
    assert!(color.x > color.y * 2.0, "but it is active: {color}");
}

#[test]
fn anti_aliased_views_are_as_the_cpu_draws_them() {
    let Some(mut headless) = gpu::headless() else { return };
    let scene = scene();
    let far = Camera::look_at(Vec3::new(9.0, 5.0, 4.0), Vec3::ZERO, Vec3::Z, 0.8, SIZE).view(0.4, RasterFov::default());
    let trained_pixel = Some(0.3 * far.camera_position.length() / far.focal().x);
    let shown = Appearance::default();
    let plain = both(&mut headless, &scene, far, shown, BlendSpace::Encoded);
    let smooth = both(&mut headless, &scene, far.antialiased(trained_pixel), shown, BlendSpace::Encoded);
    assert_same(&smooth, "pixels three times as large as in training");
    let covered = |frame: &Frame| frame.transmittance.iter().map(|left| 1.0 - left).sum::<f32>();
    let (before, after) = (covered(&plain[0]), covered(&smooth[0]));
    assert!(after < 0.95 * before, "splats are fainter: {after} pixels are covered, {before} without");
}
