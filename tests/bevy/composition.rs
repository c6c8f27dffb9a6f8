//! Captures in a Bevy frame with meshes and cameras: appearance, visibility, depth, color.
//!
//! In: small scenes made by hand, in headless apps. Out: proof that opacity, light, crop and blend spaces match the CPU
//! reference, that every camera draws the captures of its layers from its own pose, and that captures and meshes hide
//! each other in the documented order. Skipped without a GPU; a software driver is enough.

use crate::support::blob::blob;
use crate::support::cpu_reference::{
    DURATION, SIZE, add, color, difference, difference_between, eye, rgb, scene, view, view_of,
};
use crate::support::fixtures::{
    BLACK, MIDDLE, check, crowd, debug_picture, front, insert, lone, orthographic, reference_picture, spawn, spawn_box,
    spawn_flat_box,
};
use crate::support::gpu;
use crate::support::offscreen_app::{FOV_Y, app, picture, spawn_camera};
use bevy::camera::primitives::Aabb;
use bevy::camera::visibility::{NoFrustumCulling, RenderLayers};
use bevy::camera::{CameraProjection, Hdr, SubCameraView};
use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::math::{Affine3A, Vec3A};
use bevy::prelude::*;
use bevy_gs4d::GaussianCapture3d;
use bevy_gs4d::gaussian::Gaussian;
use bevy_gs4d::playback::{ClipFade, Playback};
use bevy_gs4d::reference::{self, Layer};
use bevy_gs4d::render::{CaptureSettings, CaptureStatistics, CaptureViewSettings, CropBox, DepthWrite};
use bevy_gs4d::renderer::Design;
use bevy_gs4d::scene::{Environment, RuntimeScene, Sliced};
use bevy_gs4d::testing::{self, Offscreen};
use bevy_gs4d::view::srgb::{decode, encode};
use bevy_gs4d::view::{Appearance, Background, BlendSpace, DebugView, View};

fn red() -> RuntimeScene {
    lone(Vec3::X)
}

#[test]
fn opacity_light_and_crop_match_the_cpu_reference() {
    let Some(mut app) = app(SIZE) else { return };
    let scene = crowd();
    let entity = spawn(&mut app, &scene, ());
    spawn_camera(&mut app, Msaa::Off, eye());
    let crop = CropBox {
        center: Vec3::new(0.2, 0.0, 0.0),
        half_size: Vec3::new(0.5, 0.35, 2.0),
        rotation: Quat::from_rotation_z(0.5),
    };
    let cube = Affine3A::from_scale_rotation_translation(crop.half_size, crop.rotation, crop.center).inverse();
    let (settings, appearance) = (CaptureSettings::default(), Appearance::default());
    let tint = LinearRgba::rgb(0.2, 1.0, 3.0);
    let cases = [
        ("opacity", CaptureSettings { opacity: 0.4, ..settings }, Appearance { opacity: 0.4, ..appearance }),
        ("tint", CaptureSettings { tint, ..settings }, Appearance { light: Vec3::new(0.2, 1.0, 3.0), ..appearance }),
        (
            "exposure",
            CaptureSettings { exposure: -1.0, ..settings },
            Appearance { light: Vec3::splat(0.5), ..appearance },
        ),
        ("crop", CaptureSettings { crop: Some(crop), ..settings }, Appearance { crop: Some(cube), ..appearance }),
    ];
    let plain = reference_picture(&scene, view(&eye(), SIZE, 0.0), appearance);
    for (what, settings, appearance) in cases {
        insert(&mut app, entity, settings);
        let expected = reference_picture(&scene, view(&eye(), SIZE, 0.0), appearance);
        let changes = expected.pixels.iter().zip(&plain.pixels).map(|(a, b)| (*a - *b).abs().max_element());
        let most = changes.fold(0.0, f32::max);
        assert!(most > 0.1, "{what} changes the picture by more than the tolerance: {most}");
        check(&mut app, &expected, what);
    }
}

#[test]
fn the_fade_of_a_timeline_multiplies_the_opacity() {
    let Some(mut app) = app(SIZE) else { return };
    let scene = crowd();
    let half = CaptureSettings { opacity: 0.5, ..default() };
    spawn(&mut app, &scene, (half, ClipFade(0.5)));
    spawn_camera(&mut app, Msaa::Off, eye());
    let expected =
        reference_picture(&scene, view(&eye(), SIZE, 0.0), Appearance { opacity: 0.25, ..Appearance::default() });
    check(&mut app, &expected, "an opacity of 0.5 with a fade of 0.5");
}

#[test]
fn a_red_tint_leaves_only_red() {
    let Some(mut app) = app(SIZE) else { return };
    let tint = LinearRgba::rgb(1.0, 0.0, 0.0);
    spawn(&mut app, &lone(Vec3::new(0.6, 0.7, 0.8)), CaptureSettings { tint, ..default() });
    spawn_camera(&mut app, Msaa::Off, eye());
    let picture = picture(&mut app, 0.0);
    assert!(rgb(&picture, MIDDLE.x, MIDDLE.y)[0] > 130, "the red channel stays");
    assert!(picture.pixels().all(|pixel| pixel.0[1..3] == [0, 0]), "green and blue are 0");
}

#[test]
fn a_stop_doubles_linear_light() {
    let Some(mut app) = app(SIZE) else { return };
    let entity = spawn(&mut app, &lone(Vec3::splat(0.4)), ());
    spawn_camera(&mut app, Msaa::Off, front());
    // The splat is blended as an encoded value with an alpha of 0.98 over black.
    let mut light = |exposure| {
        insert(&mut app, entity, CaptureSettings { exposure, ..default() });
        let value = f32::from(rgb(&picture(&mut app, 0.0), MIDDLE.x, MIDDLE.y)[0]);
        decode(Vec3::splat(value / 255.0 / 0.98)).x
    };
    let (before, after) = (light(0.0), light(1.0));
    // Half an 8-bit step is 1.3 % of the light of an encoded 0.4, and less of the brighter value.
    assert!((after / before - 2.0).abs() < 0.05, "one stop doubles the light: {before} becomes {after}");
}

#[test]
fn a_crop_box_hides_exactly_the_gaussians_outside_it() {
    let Some(mut app) = app(SIZE) else { return };
    let crop = CropBox { half_size: Vec3::new(0.42, 1.0, f32::INFINITY), ..default() };
    let whole = crowd();
    let inside: Vec<bool> = whole.iter().map(|gaussian| crop.contains(gaussian.mean_at(0.0))).collect();
    assert!(inside.contains(&true) && inside.contains(&false), "the box contains some of the Gaussians: {inside:?}");
    spawn(&mut app, &whole, CaptureSettings { crop: Some(crop), ..default() });
    spawn_camera(&mut app, Msaa::Off, eye());
    let mut kept = whole.clone();
    let Sliced { gaussians, harmonics } = kept.form.as_sliced_mut().expect("sliced");
    *gaussians = whole.iter().zip(&inside).filter(|(_, inside)| **inside).map(|(g, _)| g).collect();
    let colors = harmonics.values.chunks(3).zip(&inside).filter(|(_, inside)| **inside);
    harmonics.values = colors.flat_map(|(color, _)| color.to_vec()).collect();
    check(
        &mut app,
        &reference_picture(&kept, view(&eye(), SIZE, 0.0), Appearance::default()),
        "the scene without the Gaussians outside the box",
    );
}

#[test]
fn captures_in_one_view_have_their_own_settings() {
    let Some(mut app) = app(SIZE) else { return };
    let place = Transform::from_xyz(0.3, 0.1, -0.2).with_rotation(Quat::from_rotation_y(0.8));
    let (near, far) = (crowd(), red());
    let faint = CaptureSettings { opacity: 0.5, ..default() };
    let bright = CaptureSettings { exposure: 1.0, ..default() };
    spawn(&mut app, &near, (place, faint));
    spawn(&mut app, &far, bright);
    spawn_camera(&mut app, Msaa::Off, eye());
    let layers = [
        Layer {
            scene: &near,
            view: view_of(&eye(), &place, SIZE, 0.0),
            appearance: Appearance { opacity: 0.5, ..Appearance::default() },
        },
        Layer {
            scene: &far,
            view: view(&eye(), SIZE, 0.0),
            appearance: Appearance { light: Vec3::splat(2.0), ..Appearance::default() },
        },
    ];
    check(&mut app, &reference::render_layers(&layers, BLACK, BlendSpace::Encoded).picture, "two captures");
}

#[test]
fn splats_of_equal_depth_blend_in_the_order_of_entities_not_of_assets() {
    let color_of = |assets: [usize; 2]| {
        let mut app = app(SIZE)?;
        let colors = [Vec3::X, Vec3::Y];
        let mut handles: Vec<_> = assets.iter().map(|&index| (index, add(&mut app, &lone(colors[index])))).collect();
        handles.sort_by_key(|(index, _)| *index);
        for (_, handle) in handles {
            app.world_mut().spawn((GaussianCapture3d(handle), Playback::paused_at(0.0)));
        }
        spawn_camera(&mut app, Msaa::Off, front());
        Some(rgb(&picture(&mut app, 0.0), MIDDLE.x, MIDDLE.y))
    };
    let Some(usual) = color_of([0, 1]) else { return };
    assert!(usual[0].abs_diff(usual[1]) > 225, "one splat covers the other: {usual:?}");
    assert_eq!(color_of([1, 0]), Some(usual), "the order of the assets has no effect");
}

#[test]
fn blend_spaces_match_the_cpu_reference_on_every_kind_of_target() {
    let clear = Vec3::new(0.2, 0.5, 0.9);
    for (target, hdr, space) in
        [("8 bits", false, None), ("HDR", true, None), ("sRGB-encoded", false, Some(CompositingSpace::Srgb))]
    {
        let Some(mut app) = app(SIZE) else { return };
        app.insert_resource(ClearColor(Color::srgb(clear.x, clear.y, clear.z)));
        let scene = crowd();
        spawn(&mut app, &scene, ());
        let camera = spawn_camera(&mut app, Msaa::Off, eye());
        if hdr {
            insert(&mut app, camera, Hdr);
        }
        if let Some(space) = space {
            insert(&mut app, camera, space);
        }
        let layer = Layer { scene: &scene, view: view(&eye(), SIZE, 0.0), appearance: Appearance::default() };
        let expected = |background: Vec3, space| {
            reference::render_layers(&[layer], Background::Color(background.to_array()), space).picture
        };
        check(&mut app, &expected(clear, BlendSpace::Encoded), &format!("encoded, {target}"));
        insert(&mut app, camera, CaptureViewSettings { blend_space: BlendSpace::Linear, ..default() });
        let mut linear = expected(decode(clear), BlendSpace::Linear);
        linear.pixels.iter_mut().for_each(|pixel| *pixel = encode(*pixel));
        check(&mut app, &linear, &format!("linear, {target}"));
    }
}

#[test]
fn every_design_draws_the_same_picture_among_meshes() {
    let Some(mut app) = app(SIZE) else { return };
    spawn(&mut app, &crowd(), ());
    spawn_flat_box(&mut app, Vec3::splat(0.3), Vec3::ZERO, Color::srgb(0.1, 0.6, 0.2));
    let camera = spawn_camera(&mut app, Msaa::Off, eye());
    // Two of the variants: a software driver draws slowly by tile bins.
    for (msaa, depth) in [(Msaa::Off, DepthWrite::None), (Msaa::Sample4, DepthWrite::Expected)] {
        insert(&mut app, camera, msaa);
        let mut drawn = |design| {
            insert(&mut app, camera, CaptureViewSettings { design, depth, ..default() });
            picture(&mut app, 0.0)
        };
        let [sorted, binned, again] = [Design::GlobalSort, Design::TileBins, Design::GlobalSort].map(&mut drawn);
        let apart = difference_between(&binned, &sorted);
        assert!(apart <= 1, "{msaa:?}, {depth:?}: the designs differ by {apart} / 255");
        assert_eq!(
            difference_between(&again, &sorted),
            0,
            "{msaa:?}, {depth:?}: the global sort draws the same picture again"
        );
    }
}

#[test]
fn tonemapping_applies_to_captures_only_on_hdr_cameras() {
    // The formulas that Bevy documents for two methods; the others are tables or long formulas.
    let reinhard: fn(Vec3) -> Vec3 = |light| light / (light + 1.0);
    let of_luminance: fn(Vec3) -> Vec3 = |light| light / (1.0 + light.dot(Vec3::new(0.2126, 0.7152, 0.0722)));
    let Some(mut app) = app(SIZE) else { return };
    app.insert_resource(ClearColor(Color::srgb(0.2, 0.3, 0.4)));
    let entity = spawn(&mut app, &crowd(), ());
    let camera = spawn_camera(&mut app, Msaa::Off, eye());
    let as_trained = picture(&mut app, 0.0);
    insert(&mut app, camera, Tonemapping::TonyMcMapface);
    let apart = difference_between(&picture(&mut app, 0.0), &as_trained);
    assert_eq!(apart, 0, "without HDR Bevy tonemaps only meshes, in their shaders");
    insert(&mut app, camera, Hdr);
    let all = [
        (Tonemapping::Reinhard, Some(reinhard)),
        (Tonemapping::ReinhardLuminance, Some(of_luminance)),
        (Tonemapping::AcesFitted, None),
        (Tonemapping::AgX, None),
        (Tonemapping::SomewhatBoringDisplayTransform, None),
        (Tonemapping::TonyMcMapface, None),
        (Tonemapping::BlenderFilmic, None),
        (Tonemapping::KhronosPbrNeutral, None),
    ];
    let clear = *as_trained.get_pixel(2, 2);
    let apart = |a: &image::Rgba<u8>, b: &image::Rgba<u8>| {
        a.0.iter().zip(b.0).map(|(a, b)| a.abs_diff(b)).max().unwrap_or_default()
    };
    for (tonemapping, curve) in all {
        insert(&mut app, camera, tonemapping);
        insert(&mut app, entity, Visibility::Hidden);
        let without = picture(&mut app, 0.0);
        insert(&mut app, entity, Visibility::Inherited);
        let with = picture(&mut app, 0.0);
        let (mut covered, mut changed) = (0, 0);
        for (x, y, trained) in as_trained.enumerate_pixels() {
            let toned = with.get_pixel(x, y);
            if let Some(curve) = curve {
                let light = decode(color(&as_trained, x, y) / 255.0);
                let expected = encode(curve(light)) * 255.0;
                let off = (color(&with, x, y) - expected).abs().max_element();
                assert!(off <= 2.0, "{tonemapping:?}: at {x}, {y} {trained:?} becomes {toned:?}, not {expected}");
            }
            if *trained == clear {
                let off = apart(toned, without.get_pixel(x, y));
                assert!(off <= 1, "{tonemapping:?}: at {x}, {y} without a splat the pixel changes by {off} / 255");
            } else if apart(trained, &clear) > 30 {
                covered += 1;
                changed += usize::from(apart(toned, trained) > 2);
            }
        }
        assert!(covered > 1000, "the capture is in the picture: it covers {covered} pixels");
        // The smallest fraction is 72 %, with TonyMcMapface.
        assert!(5 * changed > 3 * covered, "{tonemapping:?} changes {changed} of {covered} pixels of the capture");
    }
}

#[test]
fn every_camera_draws_the_captures_of_its_layers() {
    let Some(mut app) = app(SIZE) else { return };
    let blue = lone(Vec3::Z);
    spawn(&mut app, &red(), ());
    spawn(&mut app, &blue, RenderLayers::layer(1));
    spawn_camera(&mut app, Msaa::Off, eye());
    let second = Offscreen::new(&mut app.world_mut().resource_mut::<Assets<Image>>(), SIZE);
    let camera = spawn_camera(&mut app, Msaa::Off, eye());
    insert(&mut app, camera, (second.target(), RenderLayers::layer(1)));
    let appearance = Appearance::default();
    check(&mut app, &reference_picture(&red(), view(&eye(), SIZE, 0.0), appearance), "layer 0");
    let seen = testing::read(&mut app, &second).expect("the second camera's picture");
    let apart = difference(&seen, &reference_picture(&blue, view(&eye(), SIZE, 0.0), appearance));
    assert!(apart <= 2.0, "layer 1: Bevy and the CPU reference differ by {apart} / 255");
}

#[test]
fn a_second_camera_sorts_splats_from_its_own_pose() {
    let Some(mut app) = app(SIZE) else { return };
    let scene = crowd();
    spawn(&mut app, &scene, ());
    let behind = Transform::from_xyz(-0.6, 0.4, -3.5).looking_at(Vec3::ZERO, Vec3::Y);
    spawn_camera(&mut app, Msaa::Off, eye());
    let second = Offscreen::new(&mut app.world_mut().resource_mut::<Assets<Image>>(), SIZE);
    let camera = spawn_camera(&mut app, Msaa::Off, behind);
    insert(&mut app, camera, second.target());
    check(&mut app, &reference_picture(&scene, view(&eye(), SIZE, 0.0), Appearance::default()), "from the front");
    // No time has passed: the same frame from the other camera.
    let seen = testing::read(&mut app, &second).expect("the second camera's picture");
    let apart = difference(&seen, &reference_picture(&scene, view(&behind, SIZE, 0.0), Appearance::default()));
    assert!(apart <= 2.0, "from behind: Bevy and the CPU reference differ by {apart} / 255");
}

#[test]
fn a_capture_is_culled_by_its_bounds_at_the_current_time() {
    let Some(mut app) = app(SIZE) else { return };
    // Forty units away at the start, at the origin at the end.
    let coming = Gaussian { velocity: [40.0, 0.0, 0.0], ..blob(Vec3::NEG_X * 20.0, Vec3::splat(0.4), 0.98) };
    let entity = spawn(&mut app, &scene(&[(coming, Vec3::X)]), ());
    spawn_camera(&mut app, Msaa::Off, eye());
    let seen = |app: &App| app.world().get::<ViewVisibility>(entity).expect("a required component").get();
    let bounds = |app: &App| *app.world().get::<Aabb>(entity).expect("kept by the plugin");
    let away = picture(&mut app, 0.0);
    assert!(!seen(&app), "the capture is out of view");
    assert!(bounds(&app).max().x < -10.0, "the box is far to the left: {:?}", bounds(&app));
    assert!(away.pixels().all(|pixel| pixel.0[..3] == [0, 0, 0]), "a culled capture is not drawn");
    insert(&mut app, entity, Playback::paused_at(DURATION));
    let here = picture(&mut app, 0.0);
    assert!(seen(&app), "the capture is in view");
    let bounds = bounds(&app);
    assert!(
        bounds.min().x < 0.0 && bounds.max().x > 0.0 && bounds.min().x > -30.0,
        "the box has moved with the Gaussian: {bounds:?}"
    );
    assert!(rgb(&here, MIDDLE.x, MIDDLE.y)[0] > 200, "the capture is drawn");
}

#[test]
fn no_frustum_culling_and_environment_maps_prevent_culling() {
    let Some(mut app) = app(SIZE) else { return };
    let behind = Transform::from_xyz(-9.0, 0.0, 0.0);
    let plain = spawn(&mut app, &red(), behind);
    let kept = spawn(&mut app, &red(), (behind, NoFrustumCulling));
    // Its Gaussians are also behind the camera, but its map surrounds the camera.
    let map = Environment { width: 8, height: 4, texels: vec![0.5; 8 * 4 * 3] };
    let far = scene(&[(blob(Vec3::NEG_X * 9.0, Vec3::splat(0.4), 0.98), Vec3::X)]);
    let around = spawn(&mut app, &RuntimeScene { environment: Some(map), ..far }, ());
    spawn_camera(&mut app, Msaa::Off, Transform::default().looking_to(Vec3::X, Vec3::Y));
    let picture = picture(&mut app, 0.0);
    let seen = |entity| app.world().get::<ViewVisibility>(entity).expect("a required component").get();
    assert!(!seen(plain), "a capture behind the camera is culled");
    assert!(seen(kept), "a capture with NoFrustumCulling is not culled");
    assert!(seen(around), "a capture with an environment map is not culled");
    assert!(app.world().get::<Aabb>(around).is_none(), "a capture with an environment map has no box");
    assert!(rgb(&picture, MIDDLE.x, MIDDLE.y).iter().all(|value| *value > 100), "the environment map is drawn");
}

#[test]
fn an_orthographic_camera_matches_the_cpu_reference() {
    let Some(mut app) = app(SIZE) else { return };
    let scene = crowd();
    spawn(&mut app, &scene, ());
    let camera = spawn_camera(&mut app, Msaa::Off, eye());
    let lens = OrthographicProjection { viewport_origin: Vec2::new(0.4, 0.6), ..orthographic() };
    insert(&mut app, camera, Projection::Orthographic(lens));
    // Three units high and four wide, the camera at 0.4 of the width and 0.6 of the height from the lower left.
    let projection = Vec4::new(2.0 / 4.0, 2.0 / 3.0, -0.2, -0.2);
    let world_to_camera = view(&eye(), SIZE, 0.0).world_to_camera;
    let view = View::orthographic(SIZE, 0.0, world_to_camera, projection, 0.0);
    check(&mut app, &reference_picture(&scene, view, Appearance::default()), "parallel rays");
}

/// A perspective projection with a finite far plane, as in games with their own projections.
#[derive(Debug, Clone)]
struct FiniteFar(PerspectiveProjection);

impl CameraProjection for FiniteFar {
    fn get_clip_from_view(&self) -> Mat4 {
        // Near and far are swapped: depth is reversed.
        Mat4::perspective_rh(self.0.fov, self.0.aspect_ratio, self.0.far, self.0.near)
    }

    fn get_clip_from_view_for_sub(&self, _: &SubCameraView) -> Mat4 {
        self.get_clip_from_view()
    }

    fn update(&mut self, width: f32, height: f32) {
        self.0.update(width, height);
    }

    fn far(&self) -> f32 {
        self.0.far
    }

    fn get_frustum_corners(&self, z_near: f32, z_far: f32) -> [Vec3A; 8] {
        self.0.get_frustum_corners(z_near, z_far)
    }
}

fn finite_far() -> Projection {
    Projection::custom(FiniteFar(PerspectiveProjection { fov: FOV_Y, far: 30.0, ..default() }))
}

#[test]
fn a_finite_far_plane_does_not_change_captures() {
    let Some(mut app) = app(SIZE) else { return };
    let scene = crowd();
    spawn(&mut app, &scene, ());
    let camera = spawn_camera(&mut app, Msaa::Off, eye());
    insert(&mut app, camera, finite_far());
    check(&mut app, &reference_picture(&scene, view(&eye(), SIZE, 0.0), Appearance::default()), "a finite far plane");
}

#[test]
fn captures_are_depth_tested_against_meshes_for_every_kind_of_camera() {
    let Some(mut app) = app(SIZE) else { return };
    spawn(&mut app, &red(), ());
    let camera = spawn_camera(&mut app, Msaa::Off, front());
    // The right half of the view.
    let green = Color::srgb(0.0, 1.0, 0.0);
    let half = spawn_flat_box(&mut app, Vec3::new(6.0, 12.0, 0.1), Vec3::X * 3.0, green);
    let perspective = || Projection::Perspective(PerspectiveProjection { fov: FOV_Y, ..default() });
    let cameras = [
        ("orthographic", Projection::Orthographic(orthographic()), Msaa::Off),
        ("finite far plane", finite_far(), Msaa::Off),
        ("multisampled", perspective(), Msaa::Sample4),
        ("multisampled and orthographic", Projection::Orthographic(orthographic()), Msaa::Sample4),
    ];
    for (name, projection, msaa) in cameras {
        insert(&mut app, camera, (projection, msaa));
        for (depth, hides) in [(1.5, true), (0.2, true), (-0.2, false), (-1.5, false)] {
            insert(&mut app, half, Transform::from_xyz(3.0, 0.0, depth));
            let picture = picture(&mut app, 0.0);
            let [[r, g, _], [x, y, _]] = [MIDDLE.x - 8, MIDDLE.x + 8].map(|x| rgb(&picture, x, MIDDLE.y));
            assert!(r > 200 && g < 60, "{name}, {depth}: next to the mesh the pixel shows the capture, not {r}, {g}");
            if hides {
                assert_eq!((x, y), (0, 255), "{name}: a mesh at {depth} hides the capture");
            } else {
                assert!(x > 200 && y < 60, "{name}: the capture hides a mesh at {depth}, but the pixel is {x}, {y}");
            }
        }
    }
}

#[test]
fn transparent_meshes_are_drawn_in_the_documented_order() {
    let Some(mut app) = app(SIZE) else { return };
    spawn(&mut app, &red(), ());
    let camera = spawn_camera(&mut app, Msaa::Off, front());
    let blue = Color::srgba(0.0, 0.0, 1.0, 0.8);
    let pane = spawn_box(&mut app, Vec3::new(12.0, 12.0, 0.01), Vec3::ZERO, blue, AlphaMode::Blend);
    let perspective = || Projection::Perspective(PerspectiveProjection { fov: FOV_Y, ..default() });
    let parallel = || Projection::Orthographic(orthographic());
    let [none, expected, median] = [DepthWrite::None, DepthWrite::Expected, DepthWrite::Median];
    // The camera, the depth setting, the position of the pane, and whether the pane is in front.
    let cases = [
        (Msaa::Off, perspective(), none, 1.5, true),
        (Msaa::Off, perspective(), none, -1.5, false),
        // The depth of the single Gaussian is the depth of its center.
        (Msaa::Off, perspective(), median, 0.1, true),
        (Msaa::Off, perspective(), median, -0.1, false),
        (Msaa::Off, perspective(), expected, 0.1, true),
        (Msaa::Off, perspective(), expected, -0.1, false),
        (Msaa::Off, parallel(), median, 0.1, true),
        (Msaa::Off, parallel(), median, -0.1, false),
        (Msaa::Off, finite_far(), median, 0.1, true),
        (Msaa::Off, finite_far(), median, -0.1, false),
        (Msaa::Off, parallel(), none, 1.5, true),
        (Msaa::Off, parallel(), none, -1.5, false),
        (Msaa::Sample4, perspective(), none, 1.5, true),
        (Msaa::Sample4, perspective(), none, -1.5, false),
        (Msaa::Sample4, perspective(), median, 0.1, true),
        (Msaa::Sample4, perspective(), median, -0.1, false),
    ];
    for (msaa, projection, depth, place, shows) in cases {
        let name = format!("{msaa:?}, {depth:?}, {projection:?}, at {place}");
        insert(&mut app, camera, (msaa, projection, CaptureViewSettings { depth, ..default() }));
        insert(&mut app, pane, Transform::from_xyz(0.0, 0.0, place));
        let picture = picture(&mut app, 0.0);
        let [r, _, b] = rgb(&picture, MIDDLE.x, MIDDLE.y);
        if shows {
            assert!(b > 150 && r < 200, "{name}: the pane is over the capture, not {r}, {b}");
        } else {
            assert!(r > 200 && b < 60, "{name}: the capture is over the pane, not {r}, {b}");
        }
        assert!(rgb(&picture, 10, 10)[2] > 150, "{name}: next to the capture the pane is visible");
    }
}

#[test]
fn debug_views_match_the_renderer_without_bevy() {
    let Some(mut app) = app(SIZE) else { return };
    let Some(mut headless) = gpu::headless() else { return };
    let scene = crowd();
    spawn(&mut app, &scene, ());
    let camera = spawn_camera(&mut app, Msaa::Off, eye());
    let color = picture(&mut app, 0.0);
    let mut seen = vec![color];
    for debug in [DebugView::Depth, DebugView::Overdraw, DebugView::Active, DebugView::Lifespan, DebugView::Velocity] {
        insert(&mut app, camera, CaptureViewSettings { debug, ..default() });
        let picture = picture(&mut app, 0.0);
        let expected = debug_picture(&mut headless, &scene, view(&eye(), SIZE, 0.0), debug);
        let apart = difference(&picture, &expected);
        assert!(apart <= 2.0, "{debug:?}: pictures with and without Bevy differ by {apart} / 255");
        for other in &seen {
            assert!(difference_between(&picture, other) > 10, "{debug:?} differs from the other debug views");
        }
        seen.push(picture);
    }
}

#[test]
fn statistics_count_the_gaussians_of_each_camera() {
    let Some(mut app) = app(SIZE) else { return };
    let entity = spawn(&mut app, &crowd(), ());
    let camera = spawn_camera(&mut app, Msaa::Off, eye());
    // Counts arrive some frames later.
    for _ in 0..3 {
        picture(&mut app, 0.0);
    }
    let statistics = app.world().resource::<CaptureStatistics>().clone();
    assert_eq!(statistics.renderer_missing(), None, "the renderer is available");
    assert_eq!(statistics.uploaded_captures(), 1, "one capture is uploaded");
    assert!(statistics.capture_bytes() >= 5 * 64, "at least 64 bytes for each of five Gaussians");
    let view = statistics.view(camera).expect("the camera sees it");
    assert_eq!((view.total, view.visible), (5, 5), "all five Gaussians are visible");
    assert!(view.pairs >= 5 && view.bytes > 0, "at least one pair per splat, and buffers: {view:?}");
    assert_eq!(statistics.views(), [(camera, view)], "only this camera draws captures");
    insert(&mut app, entity, Visibility::Hidden);
    picture(&mut app, 0.0);
    let hidden = statistics.view(camera).expect("its buffers are kept for a while");
    assert_eq!(
        (hidden.total, hidden.active, hidden.visible, hidden.pairs),
        (0, 0, 0, 0),
        "all counts are 0 for a hidden capture"
    );
}
