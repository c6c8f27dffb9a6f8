//! Captures with a changed appearance: light, opacity and crop, linear blending, orthographic cameras, multisampled
//! surfaces, debug views, anti-aliasing.
//!
//! In: synthetic scenes, the same for GPU and CPU. Out: proof that both draw the same picture, or that a pixel has the
//! expected value. Skipped where there is no GPU.

use crate::support::blob::blob;
use crate::support::gpu;
use crate::support::surfaces::edge;
use bevy_gs4d::gaussian::Harmonics;
use bevy_gs4d::reference::{Layer, render_layers};
use bevy_gs4d::renderer::{Headless, Instance, OpaqueDepth, ViewParameters};
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use bevy_gs4d::scene::{Packing, RuntimeScene};
use bevy_gs4d::view::srgb::decode;
use bevy_gs4d::view::{Appearance, Background, BlendSpace, Camera, DebugView, Frame, RasterFov, Thinning, View};
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

/// Returns a scene of gray static Gaussians that are present at every time, given by mean, deviation and opacity.
fn blobs(blobs: &[(Vec3, f32, f32)]) -> RuntimeScene {
    let gaussian = |&(mean, deviation, opacity): &(Vec3, f32, f32)| blob(mean, Vec3::splat(deviation), opacity);
    let harmonics = Harmonics { coefficients: 1, degree: 0, degree_t: 0, values: vec![0.0; blobs.len() * 3] };
    RuntimeScene::sliced(blobs.iter().map(gaussian).collect(), harmonics)
}

/// Returns the importance that half of the Gaussians exceed.
fn median_importance(scene: &RuntimeScene) -> f32 {
    let mut all: Vec<f32> = scene.iter().map(|gaussian| gaussian.importance()).collect();
    all.sort_unstable_by(f32::total_cmp);
    all[all.len() / 2]
}

/// Draws one scene with an appearance, on the GPU and on the CPU.
fn both(
    headless: &mut Headless,
    scene: &RuntimeScene,
    view: View,
    appearance: Appearance,
    space: BlendSpace,
) -> [Frame; 2] {
    let capture = headless.upload(scene).expect("the scene fits the GPU");
    let instance = Instance { capture: &capture, active: None, view, appearance };
    let parameters = ViewParameters { background: BACKGROUND, blend_space: space, ..ViewParameters::default() };
    let drawn = headless.render_all(&[instance], &parameters).expect("the view is drawn");
    [drawn, render_layers(&[Layer { scene, view, appearance }], BACKGROUND, space)]
}

fn assert_same([drawn, expected]: &[Frame; 2], what: &str) {
    let colors = drawn.picture.pixels.iter().zip(&expected.picture.pixels).map(|(a, b)| (*a - *b).abs().max_element());
    let apart = colors.fold(0.0, f32::max);
    // The alpha of a splat near the threshold of 1/255 may be above it on one side and below it on the other.
    assert!(apart < 5e-3, "{what}: colors differ by {apart}");
    let left = drawn.transmittance.iter().zip(&expected.transmittance).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    assert!(left < 5e-3, "{what}: transmittances differ by {left}");
    let depth = drawn.depth.iter().zip(&expected.depth).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    assert!(depth < 2e-2, "{what}: depths differ by {depth}");
    let mean = |frame: &Frame| frame.depth.iter().map(|d| f64::from(*d)).sum::<f64>() / frame.depth.len() as f64;
    let (a, b) = (mean(drawn), mean(expected));
    assert!((a - b).abs() < 1e-3 * b.max(1e-3), "{what}: mean depth {a}, expected {b}");
    let medians =
        drawn.median_depth.iter().zip(&expected.median_depth).filter(|(a, b)| (**a - **b).abs() > 1e-3).count();
    assert!(medians <= 4, "{what}: the median depth of {medians} pixels belongs to another splat");
}

/// Checks that an appearance changes most of the pixels that the scene covers, and no pixel without splats.
fn assert_shows(look: &Frame, plain: &Frame, what: &str) {
    let Background::Color(behind) = BACKGROUND else { panic!("one color") };
    let (mut covered, mut changed) = (0, 0);
    for (index, left) in plain.transmittance.iter().enumerate() {
        let pixel = look.picture.pixels[index];
        if *left == 1.0 {
            assert_eq!(pixel, Vec3::from(behind), "{what}: pixel {index} without splats is the background");
        } else if *left < 0.5 {
            covered += 1;
            changed += usize::from((pixel - plain.picture.pixels[index]).abs().max_element() > 0.01);
        }
    }
    assert!(covered > 1000, "the scene covers more than 1000 pixels, found {covered}");
    assert!(2 * changed > covered, "{what}: {changed} of {covered} covered pixels change");
}

#[test]
fn appearances_match_the_cpu_reference() {
    let Some(mut headless) = gpu::headless() else { return };
    let scene = scene();
    let plain = both(&mut headless, &scene, view(), Appearance::default(), BlendSpace::Encoded);
    assert_same(&plain, "as trained");
    let crop = Affine3A::from_scale(Vec3::new(2.0, 1.5, 3.0)) * Affine3A::from_quat(Quat::from_rotation_y(0.4));
    let looks = [
        ("half as opaque", Appearance { opacity: 0.5, ..Appearance::default() }),
        ("tinted and brighter", Appearance { light: Vec3::new(2.5, 1.0, 0.1), ..Appearance::default() }),
        ("cropped", Appearance { crop: Some(crop), ..Appearance::default() }),
        (
            "all at once",
            Appearance { opacity: 0.7, light: Vec3::new(0.3, 1.4, 0.9), crop: Some(crop), ..Appearance::default() },
        ),
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
fn thinned_captures_match_the_cpu_reference() {
    let Some(mut headless) = gpu::headless() else { return };
    let sliced = scene();
    let packed = sliced.clone().pack(&Packing::default()).expect("the scene fits");
    // Twice the median is above all Gaussians of the last layer: the passes do not read it.
    let layered = sliced.clone().pack(&Packing { progressive: true, ..Packing::default() }).expect("the scene fits");
    for (form, scene, times) in [("sliced", sliced, 1.0), ("packed", packed, 1.0), ("in layers", layered, 2.0)] {
        let [whole, _] = both(&mut headless, &scene, view(), Appearance::default(), BlendSpace::Encoded);
        let thinning = Thinning::new(times * median_importance(&scene), 0.5);
        for opacity in [1.0, 0.6] {
            let appearance = Appearance { opacity, thinning, ..Appearance::default() };
            let pictures = both(&mut headless, &scene, view(), appearance, BlendSpace::Encoded);
            assert_same(&pictures, &format!("{form}, opacity {opacity}"));
            let counts = [&whole, &pictures[0]].map(|frame| frame.counts.visible);
            assert!(counts[1] * 4 < counts[0] * 3, "{form}: fewer splats are visible: {counts:?}");
        }
    }
}

#[test]
fn a_cropped_scene_is_the_scene_of_the_gaussians_inside() {
    let Some(mut headless) = gpu::headless() else { return };
    let inside = [(Vec3::ZERO, 0.2, 0.9), (Vec3::new(0.3, 0.2, -0.3), 0.1, 0.7)];
    let outside = [(Vec3::new(0.7, 0.0, 0.0), 0.3, 0.8), (Vec3::new(0.0, 0.0, -0.9), 0.3, 0.8)];
    let all = blobs(&[inside[0], outside[0], inside[1], outside[1]]);
    let appearance = Appearance { crop: Some(Affine3A::from_scale(Vec3::splat(2.0))), ..Appearance::default() };
    let [cropped, _] = both(&mut headless, &all, view(), appearance, BlendSpace::Encoded);
    let [expected, _] = both(&mut headless, &blobs(&inside), view(), Appearance::default(), BlendSpace::Encoded);
    assert!(
        cropped == expected,
        "a crop of half a unit around the origin equals, bit for bit, the scene without outer Gaussians"
    );
}

#[test]
fn linear_blending_averages_light() {
    let Some(mut headless) = gpu::headless() else { return };
    // A wide Gaussian of opacity one half: the middle pixel is the mean of its color and the background, in linear
    // light.
    let scene = blobs(&[(Vec3::ZERO, 4.0, 0.5)]);
    let [frame, _] = both(&mut headless, &scene, view(), Appearance::default(), BlendSpace::Linear);
    let middle = frame.picture.pixels[(SIZE.y / 2 * SIZE.x + SIZE.x / 2) as usize];
    let expected = 0.5 * decode(Vec3::splat(0.5)) + 0.5 * Vec3::new(0.2, 0.3, 0.4);
    assert!(middle.abs_diff_eq(expected, 2e-3), "the middle pixel is {middle}, expected the mean {expected}");
}

#[test]
fn orthographic_views_match_the_cpu_reference() {
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
fn size_does_not_depend_on_distance_in_orthographic_views() {
    let Some(mut headless) = gpu::headless() else { return };
    // Two equal Gaussians, one unit left and right of the axis, three and nine units away; 20 pixels per unit.
    let scene = blobs(&[(Vec3::new(-1.0, 0.0, 3.0), 0.3, 0.9), (Vec3::new(1.0, 0.0, 9.0), 0.3, 0.9)]);
    let scale = 2.0 * 20.0 / SIZE.as_vec2();
    let view = View::orthographic(SIZE, 0.0, Mat4::IDENTITY, Vec4::new(scale.x, scale.y, 0.0, 0.0), 0.0);
    let [frame, _] = both(&mut headless, &scene, view, Appearance::default(), BlendSpace::Encoded);
    let left = |x: u32, y: u32| 1.0 - frame.transmittance[(y * SIZE.x + x) as usize];
    let middle = SIZE / 2;
    for (dx, dy) in [(0, 0), (4, 0), (3, 7), (9, 2)] {
        // The picture is symmetric about the boundary between its two middle columns.
        let (near, far) = (left(middle.x - 21 + dx, middle.y + dy), left(middle.x + 20 - dx, middle.y + dy));
        assert!(
            (near - far).abs() < 1e-5 && near > 0.0,
            "({dx}, {dy}): opacity {near} near, {far} far, expected equal"
        );
    }
}

#[test]
fn multisampled_surfaces_hide_a_fraction_of_a_pixel() {
    let Some(mut headless) = gpu::headless() else { return };
    let (near, distance) = (0.1, 2.5);
    let (texture, column) = edge(headless.context(), SIZE, near, distance, 0.0);
    // Wide Gaussians in front of and behind the surface, which is 2.5 units away from a camera at the origin.
    let scene = blobs(&[(Vec3::Z * 2.0, 3.0, 0.5), (Vec3::Z * 4.0, 6.0, 0.6)]);
    let view = View::new(SIZE, 0.0, Mat4::IDENTITY, Vec4::new(1.0, 1.5, 0.0, 0.0), Vec2::new(1.0, 1.0 / 1.5));
    let capture = headless.upload(&scene).expect("the scene fits the GPU");
    let instance = Instance { capture: &capture, active: None, view, appearance: Appearance::default() };
    let depth = texture.create_view(&wgpu::TextureViewDescriptor::default());
    let opaque = OpaqueDepth { texture: &depth, samples: 4, origin: UVec2::ZERO, distance: [near, 0.0, 0.0, 1.0] };
    let parameters = ViewParameters { opaque: Some(opaque), ..ViewParameters::default() };
    let frame = headless.render_all(&[instance], &parameters).expect("the view is drawn");
    let free = headless.render_all(&[instance], &ViewParameters::default()).expect("the view is drawn");
    let front = headless.upload(&blobs(&[(Vec3::Z * 2.0, 3.0, 0.5)])).expect("the scene fits the GPU");
    let cut = headless.render_all(&[Instance { capture: &front, ..instance }], &ViewParameters::default());
    let cut = cut.expect("the view is drawn");
    let row = SIZE.y / 2 * SIZE.x;
    let at = |frame: &Frame, x: u32| {
        let index = (row + x) as usize;
        (frame.picture.pixels[index], frame.transmittance[index], frame.depth[index])
    };
    assert_eq!(at(&frame, column - 9), at(&cut, column - 9), "the surface hides the Gaussian behind it");
    assert_eq!(at(&frame, column + 9), at(&free, column + 9), "both Gaussians are visible next to the surface");
    let ((color, left, z), (front, most, near_z), (all, least, far_z)) =
        (at(&frame, column), at(&cut, column), at(&free, column));
    assert!(least < most, "the second Gaussian reduces the transmittance");
    assert!(
        (left - 0.5 * (most + least)).abs() < 1e-6,
        "half of the samples are covered: transmittance {left} is the mean of {most} and {least}"
    );
    assert!(color.abs_diff_eq(0.5 * (front + all), 1e-6), "color {color} is the mean of {front} and {all}");
    assert!((z - 0.5 * (near_z + far_z)).abs() < 1e-5, "depth {z} is the mean of {near_z} and {far_z}");
}

#[test]
fn the_distance_of_a_surface_is_computed_for_every_projection() {
    let Some(mut headless) = gpu::headless() else { return };
    let scene = blobs(&[(Vec3::Z * 2.0, 3.0, 0.5), (Vec3::Z * 4.0, 6.0, 0.6)]);
    let capture = headless.upload(&scene).expect("the scene fits the GPU");
    let (texture, _) = edge(headless.context(), SIZE, 0.25, 1.0, 0.0);
    let view = View::new(SIZE, 0.0, Mat4::IDENTITY, Vec4::new(1.0, 1.5, 0.0, 0.0), Vec2::new(1.0, 1.0 / 1.5));
    let instance = Instance { capture: &capture, active: None, view, appearance: Appearance::default() };
    let depth = texture.create_view(&wgpu::TextureViewDescriptor::default());
    let mut left = |distance: [f32; 4]| {
        let opaque = OpaqueDepth { texture: &depth, samples: 4, origin: UVec2::ZERO, distance };
        let parameters = ViewParameters { opaque: Some(opaque), ..ViewParameters::default() };
        let frame = headless.render_all(&[instance], &parameters).expect("the view is drawn");
        frame.transmittance[(SIZE.y / 2 * SIZE.x) as usize + 20]
    };
    // The depth is 0.25. Perspective, near 0.75, infinite far plane: distance 3, between the Gaussians.
    let between = left([0.75, 0.0, 0.0, 1.0]);
    // Orthographic, near 0, far 4, reversed: distance 4 - 4 d = 3.
    assert_eq!(left([4.0, -4.0, 1.0, 0.0]), between, "an orthographic surface at the same distance");
    // Perspective, near 2, far 6, reversed: distance 12 / (2 + 4 d) = 4, not in front of the second Gaussian.
    assert!(left([12.0, 0.0, 2.0, 4.0]) < between, "a surface behind the second Gaussian hides less");
    assert_eq!(left([0.25, 0.0, 0.0, 1.0]), 1.0, "a surface in front of both Gaussians hides both");
}

#[test]
fn debug_views_show_their_quantity() {
    let Some(mut headless) = gpu::headless() else { return };
    let mut scene = blobs(&[(Vec3::new(-0.6, 0.0, 2.0), 0.2, 0.95), (Vec3::new(0.6, 0.0, 4.0), 0.4, 0.95)]);
    // The right Gaussian moves along +x and is present for a moment around time 0.5.
    let right = &mut scene.form.as_sliced_mut().expect("sliced").gaussians[1];
    right.velocity = [9.0, 0.0, 0.0];
    right.sigma_t = 0.02;
    let view = |time| View::new(SIZE, time, Mat4::IDENTITY, Vec4::new(1.0, 1.5, 0.0, 0.0), Vec2::new(1.0, 1.0 / 1.5));
    let capture = headless.upload(&scene).expect("the scene fits the GPU");
    let mut pixels = |debug, time| {
        let instance =
            Instance { capture: &capture, active: None, view: view(time), appearance: Appearance::default() };
        let parameters = ViewParameters { debug, ..ViewParameters::default() };
        let frame = headless.render_all(&[instance], &parameters).expect("the view is drawn");
        let at = |ndc: f32| {
            let index = (SIZE.y / 2 * SIZE.x) as usize + ((ndc + 1.0) / 2.0 * SIZE.x as f32) as usize;
            // Divided by opacity.
            frame.picture.pixels[index] / (1.0 - frame.transmittance[index]).max(1e-6)
        };
        [at(-0.3), at(0.15)]
    };
    let [near, far] = pixels(DebugView::Depth, 0.5);
    assert!(near.x > far.x && far.x > 0.0 && near.x == near.y, "the near Gaussian is brighter: {near} and {far}");
    let [once, _] = pixels(DebugView::Overdraw, 0.5);
    assert!(once.z > 0.0 && once.x == 0.0, "one splat is blue, the lower end of the scale: {once}");
    let [still, moving] = pixels(DebugView::Velocity, 0.5);
    assert!(still.abs_diff_eq(Vec3::splat(0.5), 1e-3), "a static Gaussian is gray: {still}");
    assert!(moving.x > 0.9 && (moving.y - 0.5).abs() < 1e-3, "a Gaussian that moves along x is red: {moving}");
    let [always, moment] = pixels(DebugView::Lifespan, 0.5);
    assert!(always.abs_diff_eq(Vec3::X, 1e-3), "a Gaussian that is always present is red: {always}");
    assert!(moment.z > moment.x, "a Gaussian of short lifespan is lower on the scale: {moment}");
    let [left, right] = pixels(DebugView::Active, 0.5);
    assert!(left.y > 0.5 && right.y > 0.5, "Gaussians that are present at 0.5 are green: {left} and {right}");
    let colored = pixels(DebugView::Color, 0.5);
    assert!(colored[0].abs_diff_eq(Vec3::splat(0.5), 1e-3), "the color is gray: {}", colored[0]);
}

#[test]
fn active_gaussians_that_are_absent_are_red_in_the_debug_view() {
    let Some(mut headless) = gpu::headless() else { return };
    let mut scene = blobs(&[(Vec3::Z * 2.0, 0.4, 0.95)]);
    scene.form.as_sliced_mut().expect("sliced").gaussians[0].sigma_t = 0.05;
    let capture = headless.upload(&scene).expect("the scene fits the GPU");
    let mut middle = |debug| {
        let projection = Vec4::new(1.0, 1.5, 0.0, 0.0);
        let view = View::new(SIZE, 0.9, Mat4::IDENTITY, projection, Vec2::new(1.0, 1.0 / 1.5));
        let instance = Instance { capture: &capture, active: None, view, appearance: Appearance::default() };
        let parameters = ViewParameters { debug, ..ViewParameters::default() };
        let frame = headless.render_all(&[instance], &parameters).expect("the view is drawn");
        let index = (SIZE.y / 2 * SIZE.x + SIZE.x / 2) as usize;
        (frame.picture.pixels[index], frame.transmittance[index])
    };
    assert_eq!(middle(DebugView::Color), (Vec3::ZERO, 1.0), "the Gaussian is absent at 0.9");
    let (color, _) = middle(DebugView::Active);
    assert!(color.x > color.y * 2.0, "the Gaussian is active and therefore red: {color}");
}

#[test]
fn anti_aliased_views_match_the_cpu_reference() {
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
    assert!(after < 0.95 * before, "splats are fainter: {after} pixels are covered, {before} without anti-aliasing");
}
