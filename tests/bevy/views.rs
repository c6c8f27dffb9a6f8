//! Views of captures in Bevy apps: environment maps, sub views, shared and resized targets, reverse playback, and
//! comparison with the command.
//!
//! In: small scenes made by hand, synthetic scenes and the bundled capture, in headless apps. Out: proof that
//! environment maps follow the settings of their captures and have no holes, that sub views and parts of targets match
//! the CPU reference, that temporal filters and the direction of playback change no pixel, and that extreme values stay
//! finite. Skipped without a GPU; a software driver is enough.

use crate::support::blob::blob;
use crate::support::cpu_reference::{
    DURATION, SIZE, add, color, difference, difference_between, eye, rgb, scene, view, view_of,
};
use crate::support::fixtures::{
    BLACK, MIDDLE, check, crowd, front, insert, lone, orthographic, reference_picture, spawn, spawn_flat_box, synthetic,
};
use crate::support::gpu;
use crate::support::offscreen_app::{FOV_Y, app, picture, spawn_camera};
use crate::support::skip::skip;
use bevy::camera::visibility::{NoFrustumCulling, RenderLayers};
use bevy::camera::{Hdr, SubCameraView, Viewport};
use bevy::prelude::*;
use bevy::render::RenderApp;
use bevy::render::render_resource::{Extent3d, TextureFormat};
use bevy::render::renderer::{RenderAdapter, RenderDevice};
use bevy::render::settings::WgpuFeatures;
use bevy_gs4d::asset::GaussianCapture;
use bevy_gs4d::codec::ReadOptions;
use bevy_gs4d::playback::{ClipFade, Playback, Repeat};
use bevy_gs4d::render::{CaptureSettings, CaptureStatistics, CaptureViewSettings};
use bevy_gs4d::scene::{Environment, RuntimeScene};
use bevy_gs4d::testing::{self, Offscreen};
use bevy_gs4d::view::srgb::{decode, encode};
use bevy_gs4d::view::{Appearance, Background, Camera as PinholeCamera, DebugView, Lens, Picture, RasterFov};
use bevy_gs4d::{GaussianCapture3d, codec};
use image::RgbaImage;
use image::imageops::crop_imm;
use std::path::Path;

/// Picture size of tests that need many pictures.
const SMALL: UVec2 = UVec2::new(96, 72);

/// Returns a gray environment map, and a Gaussian that no camera of these tests sees.
fn surrounded() -> RuntimeScene {
    let map = Environment { width: 8, height: 4, texels: vec![0.5; 8 * 4 * 3] };
    let far = scene(&[(blob(Vec3::NEG_X * 9.0, Vec3::splat(0.4), 0.98), Vec3::X)]);
    RuntimeScene { environment: Some(map), ..far }
}

/// Returns the pose of a camera at the origin that does not see the seam of the map.
fn ahead() -> Transform {
    Transform::default().looking_to(Vec3::X, Vec3::Y)
}

#[test]
fn opacity_tint_and_exposure_apply_to_the_environment_map() {
    let Some(mut app) = app(SIZE) else { return };
    app.insert_resource(ClearColor(Color::srgb(0.0, 0.0, 1.0)));
    let entity = spawn(&mut app, &surrounded(), ());
    spawn_camera(&mut app, Msaa::Off, ahead());
    let lit = |light: Vec3| encode(decode(Vec3::splat(0.5)) * light);
    let settings = CaptureSettings::default();
    let red = LinearRgba::rgb(1.0, 0.0, 0.0);
    let (half, gone) = (CaptureSettings { opacity: 0.5, ..settings }, CaptureSettings { opacity: 0.0, ..settings });
    let cases = [
        ("as trained", settings, ClipFade(1.0), lit(Vec3::ONE)),
        ("tinted", CaptureSettings { tint: red, ..settings }, ClipFade(1.0), lit(Vec3::X)),
        ("a stop brighter", CaptureSettings { exposure: 1.0, ..settings }, ClipFade(1.0), lit(Vec3::splat(2.0))),
        // Encoded values are blended.
        ("at half opacity", half, ClipFade(1.0), 0.5 * lit(Vec3::ONE) + 0.5 * Vec3::Z),
        ("without opacity", gone, ClipFade(1.0), Vec3::Z),
        ("faded out by a timeline", settings, ClipFade(0.0), Vec3::Z),
    ];
    for (what, settings, fade, expected) in cases {
        insert(&mut app, entity, (settings, fade));
        let seen = color(&picture(&mut app, 0.0), MIDDLE.x, MIDDLE.y);
        let apart = (seen - expected * 255.0).abs().max_element();
        assert!(apart <= 2.0, "a map {what} is {seen}, which differs by {apart} / 255");
    }
}

#[test]
fn an_environment_map_has_no_hole_where_rays_miss_its_sphere() {
    let Some(mut app) = app(SIZE) else { return };
    spawn(&mut app, &surrounded(), ());
    // Far outside, with the sphere out of view.
    let aside = Transform::from_xyz(0.0, 400.0, 0.0).looking_to(Vec3::X, Vec3::Z);
    let camera = spawn_camera(&mut app, Msaa::Off, aside);
    insert(&mut app, camera, Hdr);
    let picture = picture(&mut app, 0.0);
    // NaN would be black. Towards the poles the map fades to half.
    let darkest = picture.pixels().flat_map(|pixel| pixel.0).min();
    assert!(darkest > Some(20), "every pixel has a color; the darkest is {darkest:?}");
    let middle = rgb(&picture, MIDDLE.x, MIDDLE.y);
    assert!(middle.iter().all(|value| value.abs_diff(128) <= 2), "the center has the color of the map: {middle:?}");
}

#[test]
fn an_environment_map_needs_a_pinhole_and_the_depth_of_meshes() {
    let Some(mut app) = app(SIZE) else { return };
    app.insert_resource(ClearColor(Color::srgb(0.0, 0.0, 1.0)));
    spawn(&mut app, &surrounded(), ());
    let camera = spawn_camera(&mut app, Msaa::Off, ahead());
    let near_clip_plane = Vec3::new(0.1, 0.0, -1.0).normalize().extend(-0.4);
    let oblique = PerspectiveProjection { fov: FOV_Y, near_clip_plane, ..default() };
    let projections = [
        ("its own near clip plane", Projection::Perspective(oblique)),
        ("parallel rays", Projection::Orthographic(orthographic())),
    ];
    for (what, projection) in projections {
        insert(&mut app, camera, projection);
        let picture = picture(&mut app, 0.0);
        let empty = picture.pixels().all(|pixel| pixel.0[..3] == [0, 0, 255]);
        assert!(empty, "a camera with {what} shows the clear color, not {:?}", rgb(&picture, MIDDLE.x, MIDDLE.y));
    }
}

/// Returns a part of a picture.
fn part(whole: &Picture, offset: UVec2, size: UVec2) -> Picture {
    let row = |y| (0..size.x).map(move |x| whole.pixel(offset.x + x, offset.y + y));
    Picture { size, pixels: (0..size.y).flat_map(row).collect() }
}

/// Returns the largest difference over all channels and pixels, in 255ths.
fn apart(picture: &Picture, expected: &Picture) -> f32 {
    assert_eq!(picture.size, expected.size, "the pictures have the same size");
    let channel = |(pixel, expected): (&Vec3, &Vec3)| (*pixel - *expected).abs().max_element() * 255.0;
    picture.pixels.iter().zip(&expected.pixels).map(channel).fold(0.0, f32::max)
}

#[test]
fn a_sub_view_equals_its_part_of_the_whole_picture() {
    // The borders of the part are borders of tiles or of the picture: a splat ends at the last tile that its three
    // standard deviations touch.
    let (offset, size) = (UVec2::new(112, 32), UVec2::new(88, 96));
    let Some(mut app) = app(size) else { return };
    let Some(mut headless) = gpu::headless() else { return };
    // The first Gaussian is near the right edge and long in depth: its footprint depends on the viewing angle.
    let scene = scene(&[
        (blob(Vec3::new(1.9, 0.5, 0.0), Vec3::new(0.05, 0.05, 0.8), 0.9), Vec3::new(0.9, 0.3, 0.1)),
        (blob(Vec3::new(0.9, -0.3, 0.4), Vec3::new(0.2, 0.1, 0.3), 0.8), Vec3::new(0.1, 0.6, 0.9)),
    ]);
    let whole = view(&front(), SIZE, 0.0);
    let expected = part(&reference_picture(&scene, whole, Appearance::default()), offset, size);
    assert!(expected.pixel(72, 20).x > 0.3, "the long splat is in the sub view: {}", expected.pixel(72, 20));

    // The same pixels with an off-center lens.
    let lens = Lens::Intrinsics { focal: whole.focal(), center: SIZE.as_vec2() / 2.0 - offset.as_vec2() };
    let pinhole = PinholeCamera { world_to_camera: whole.world_to_camera, size, lens };
    let sub = pinhole.view(0.0, RasterFov::Corrected);
    let difference = apart(&reference_picture(&scene, sub, Appearance::default()), &expected);
    assert!(difference <= 2.0, "the sub view and the whole picture of the CPU reference differ by {difference} / 255");
    let capture = headless.upload(&scene).expect("it fits");
    let drawn = headless.render(&capture, &sub, BLACK).expect("it is drawn").picture;
    let difference = apart(&drawn, &expected);
    assert!(
        difference <= 2.0,
        "the sub view of the GPU and the whole picture of the CPU reference differ by {difference} / 255"
    );

    // Bevy culls by the frustum of the whole target, not of the part.
    spawn(&mut app, &scene, NoFrustumCulling);
    let camera = spawn_camera(&mut app, Msaa::Off, front());
    let sub_camera_view = Some(SubCameraView { full_size: SIZE, offset: offset.as_vec2(), size });
    insert(&mut app, camera, Camera { sub_camera_view, ..default() });
    check(&mut app, &expected, "a sub view");
}

/// Returns whether this GPU supports the sample count.
fn can_sample(app: &App, msaa: Msaa) -> bool {
    let world = app.sub_app(RenderApp).world();
    let (adapter, device) = (world.resource::<RenderAdapter>(), world.resource::<RenderDevice>());
    let specific = device.features().contains(WgpuFeatures::TEXTURE_ADAPTER_SPECIFIC_FORMAT_FEATURES);
    let supported = |format| {
        let features = adapter.get_texture_format_features(format);
        features.flags.sample_count_supported(msaa.samples())
    };
    // Every device supports these two counts; others need the feature.
    let everywhere = matches!(msaa, Msaa::Off | Msaa::Sample4);
    everywhere || specific && supported(TextureFormat::Depth32Float) && supported(TextureFormat::Rgba8UnormSrgb)
}

#[test]
fn depth_tests_use_the_right_pixels_of_a_viewport_for_every_sample_count() {
    let Some(mut app) = app(SIZE) else { return };
    // A Gaussian larger than the viewport.
    spawn(&mut app, &scene(&[(blob(Vec3::ZERO, Vec3::new(2.0, 2.0, 0.1), 0.98), Vec3::X)]), ());
    let (corner, size) = (UVec2::new(37, 21), UVec2::new(120, 90));
    let viewport = Some(Viewport { physical_position: corner, physical_size: size, ..default() });
    let camera = spawn_camera(&mut app, Msaa::Off, front());
    insert(&mut app, camera, Camera { viewport, ..default() });
    // The lower right quarter of the view.
    let green = Color::srgb(0.0, 1.0, 0.0);
    let quarter = spawn_flat_box(&mut app, Vec3::new(6.0, 6.0, 0.1), Vec3::ZERO, green);
    testing::settle(&mut app).expect("the app draws without an error");
    let middle = corner + size / 2;
    let last = corner + size - 1;
    for msaa in [Msaa::Off, Msaa::Sample2, Msaa::Sample4, Msaa::Sample8] {
        if !can_sample(&app, msaa) {
            skip(format_args!("{msaa:?}: this GPU has no such targets"));
            continue;
        }
        insert(&mut app, camera, msaa);
        for (depth, hides) in [(1.5, true), (-1.5, false)] {
            insert(&mut app, quarter, Transform::from_xyz(3.0, -3.0, depth));
            let picture = picture(&mut app, 0.0);
            let name = format!("{msaa:?}, a mesh at {depth}");
            let is_red = |[r, g, b]: [u8; 3]| r > 200 && g < 60 && b < 60;
            for (left, up) in [(1, 1), (0, 1), (1, 0)] {
                let seen = rgb(&picture, middle.x - left, middle.y - up);
                assert!(is_red(seen), "{name}: the pixel {left} left of and {up} above the mesh's corner is {seen:?}");
            }
            let seen = rgb(&picture, middle.x, middle.y);
            let right = if hides { seen == [0, 255, 0] } else { is_red(seen) };
            assert!(right, "{name}: the first pixel of the mesh is {seen:?}");
            // The other quarters reach to the edges of the viewport.
            let edges = [
                ([corner.x, 40], [corner.x - 1, 40]),
                ([last.x, 40], [last.x + 1, 40]),
                ([97, corner.y], [97, corner.y - 1]),
                ([60, last.y], [60, last.y + 1]),
            ];
            for ([x, y], [u, v]) in edges {
                assert!(rgb(&picture, x, y)[0] > 60, "{name}: inside the viewport, at {x}, {y}, the capture is drawn");
                assert_eq!(
                    rgb(&picture, u, v),
                    [0, 0, 0],
                    "{name}: outside the viewport, at {u}, {v}, the target is black"
                );
            }
        }
    }
}

/// Returns a synthetic scene with a filter of four segments, and the same scene without a filter.
fn twice(count: usize, seed: u64) -> [RuntimeScene; 2] {
    [true, false].map(|filtered| synthetic(count, seed, filtered))
}

/// An app with each capture twice, with and without a temporal filter, and a camera for each variant.
struct Both {
    app: App,
    cameras: [Entity; 2],
    /// The target of the camera without filters.
    plain: Offscreen,
}

impl Both {
    fn new() -> Option<Self> {
        let mut app = app(SMALL)?;
        let eye = Transform::from_xyz(0.5, -3.0, 1.5).looking_at(Vec3::ZERO, Vec3::Z);
        let cameras = [(); 2].map(|()| spawn_camera(&mut app, Msaa::Off, eye));
        let plain = Offscreen::new(&mut app.world_mut().resource_mut::<Assets<Image>>(), SMALL);
        insert(&mut app, cameras[1], (plain.target(), RenderLayers::layer(1)));
        Some(Self { app, cameras, plain })
    }

    fn add(&mut self, scenes: &[RuntimeScene; 2]) -> [Handle<GaussianCapture>; 2] {
        [0, 1].map(|index| add(&mut self.app, &scenes[index]))
    }

    fn place(&mut self, captures: &[Handle<GaussianCapture>; 2], seconds: f32, place: Transform) -> [Entity; 2] {
        [0, 1].map(|index| {
            let capture = GaussianCapture3d(captures[index].clone());
            let placed = (capture, Playback::paused_at(seconds), place, RenderLayers::layer(index));
            self.app.world_mut().spawn(placed).id()
        })
    }

    fn change<B: Bundle>(&mut self, entities: [Entity; 2], bundle: impl Fn(usize) -> B) {
        for (index, entity) in entities.into_iter().enumerate() {
            insert(&mut self.app, entity, bundle(index));
        }
    }

    /// Checks that both cameras draw the same picture and, if filters are on, that the first camera has inactive
    /// Gaussians.
    fn check(&mut self, what: &str, filters: bool) {
        let filtered = picture(&mut self.app, 0.0);
        let plain = testing::read(&mut self.app, &self.plain).expect("the second camera's picture");
        assert!(plain.pixels().any(|pixel| pixel.0[..3] != [0, 0, 0]), "{what}: the capture is drawn");
        assert_eq!(difference_between(&filtered, &plain), 0, "{what}: the filter changes no pixel");
        let statistics = self.app.world().resource::<CaptureStatistics>();
        let [with, without] = self.cameras.map(|camera| statistics.view(camera).expect("the camera draws captures"));
        assert_eq!(
            (with.total, without.active),
            (without.total, without.total),
            "{what}: both cameras have the same Gaussians"
        );
        assert_eq!(with.active < with.total, filters, "{what}: {} of {} Gaussians are active", with.active, with.total);
    }
}

#[test]
fn a_filter_changes_no_pixel_after_any_change_of_its_capture() {
    let Some(mut both) = Both::new() else { return };
    let [first, other] = [(400, 1), (300, 2)].map(|(count, seed)| both.add(&twice(count, seed)));
    let placed = both.place(&first, 0.1, Transform::default());
    both.check("at the start", true);
    for seconds in [0.6, 1.1, 1.9, 0.1] {
        both.change(placed, |_| Playback::paused_at(seconds));
        both.check(&format!("at {seconds} s"), true);
    }
    both.change(placed, |index| GaussianCapture3d(other[index].clone()));
    both.check("with another capture", true);
    both.change(placed, |_| (CaptureSettings { filter: false, ..default() }, Playback::paused_at(1.4)));
    both.check("with the filter off", false);
    both.change(placed, |_| (CaptureSettings::default(), Playback::paused_at(0.7)));
    both.check("with the filter on again", true);
    both.change(placed, |_| Visibility::Hidden);
    picture(&mut both.app, 0.0);
    both.change(placed, |_| (Visibility::Inherited, Playback::paused_at(1.7)));
    both.check("at another time than when it was hidden", true);
    for (handle, scene) in other.iter().zip(twice(500, 3)) {
        let mut captures = both.app.world_mut().resource_mut::<Assets<GaussianCapture>>();
        captures.insert(handle, GaussianCapture::new(scene)).expect("its handle is alive");
    }
    both.check("with another scene under the same name", true);
    let second = both.place(&other, 0.2, Transform::from_xyz(0.4, 0.3, 0.0));
    both.check("at two times at once", true);
    both.change(second, |_| Playback::paused_at(1.2));
    both.check("at two times, one of which has moved on", true);
}

#[test]
fn captures_are_drawn_at_the_new_size_of_a_resized_target() {
    let Some(mut app) = app(SIZE) else { return };
    let scene = crowd();
    spawn(&mut app, &scene, ());
    spawn_camera(&mut app, Msaa::Off, eye());
    let image = app.world().resource::<Offscreen>().image.clone();
    for size in [SIZE, UVec2::new(120, 100), UVec2::new(230, 160), SIZE] {
        let extent = Extent3d { width: size.x, height: size.y, ..default() };
        app.world_mut().resource_mut::<Assets<Image>>().get_mut(&image).expect("the image of the app").resize(extent);
        app.insert_resource(Offscreen { image: image.clone(), size });
        let expected = reference_picture(&scene, view(&eye(), size, 0.0), Appearance::default());
        check(&mut app, &expected, &format!("{} x {}", size.x, size.y));
    }
}

#[test]
fn two_cameras_draw_into_halves_of_one_target() {
    let Some(mut app) = app(SIZE) else { return };
    let scene = crowd();
    let place = Transform::from_xyz(0.2, -0.1, 0.3).with_rotation(Quat::from_rotation_y(0.6));
    spawn(&mut app, &scene, place);
    let half = UVec2::new(SIZE.x / 2, SIZE.y);
    let behind = Transform::from_xyz(-0.6, 0.4, -3.5).looking_at(Vec3::ZERO, Vec3::Y);
    let halves = [(0, eye(), ClearColorConfig::Default), (1, behind, ClearColorConfig::None)];
    for (order, pose, clear_color) in halves {
        let camera = spawn_camera(&mut app, Msaa::Off, pose);
        let physical_position = UVec2::new(order * half.x, 0);
        let viewport = Some(Viewport { physical_position, physical_size: half, ..default() });
        insert(&mut app, camera, Camera { viewport, order: order as isize, clear_color, ..default() });
    }
    let picture = picture(&mut app, 0.0);
    for (order, pose, _) in halves {
        let seen = crop_imm(&picture, order * half.x, 0, half.x, half.y).to_image();
        let expected = reference_picture(&scene, view_of(&pose, &place, half, 0.0), Appearance::default());
        let apart = difference(&seen, &expected);
        assert!(apart <= 2.0, "half {order}: Bevy and the CPU reference differ by {apart} / 255");
    }
}

#[test]
fn reverse_and_ping_pong_match_forward_playback() {
    let Some(mut app) = app(SMALL) else { return };
    spawn_camera(&mut app, Msaa::Off, eye());
    let capture = add(&mut app, &crowd());
    // Pictures at steps of a quarter of the duration.
    let mut play = |playback: Playback, steps: usize| -> Vec<RgbaImage> {
        let entity = app.world_mut().spawn((GaussianCapture3d(capture.clone()), playback)).id();
        let pictures = (0..steps).map(|_| picture(&mut app, DURATION / 4.0)).collect();
        app.world_mut().despawn(entity);
        pictures
    };
    let forward = play(Playback::default(), 3);
    assert!(forward[0] != forward[1] && forward[1] != forward[2], "the pictures of forward playback differ");
    let mut reverse = play(Playback { speed: -1.0, ..default() }, 3);
    reverse.reverse();
    assert!(reverse == forward, "reverse playback from the end matches forward playback");
    let to_and_fro = play(Playback { repeat: Repeat::PingPong, ..default() }, 7);
    assert!(to_and_fro[..3] == forward[..], "ping-pong matches forward playback before the turn");
    let mut fro = to_and_fro[4..].to_vec();
    fro.reverse();
    assert!(fro == forward, "ping-pong matches forward playback after the turn");
}

#[test]
fn the_depth_view_of_an_orthographic_camera_is_brighter_for_near_splats() {
    let Some(mut app) = app(SIZE) else { return };
    let ball = |x, z| (blob(Vec3::new(x, 0.0, z), Vec3::splat(0.2), 0.98), Vec3::ONE);
    spawn(&mut app, &scene(&[ball(-0.7, 0.5), ball(0.7, -1.5)]), ());
    let camera = spawn_camera(&mut app, Msaa::Off, front());
    let depth = CaptureViewSettings { debug: DebugView::Depth, ..default() };
    insert(&mut app, camera, (Projection::Orthographic(orthographic()), depth));
    let picture = picture(&mut app, 0.0);
    // Three units are 150 pixels high.
    let [near, far] = [MIDDLE.x - 35, MIDDLE.x + 35].map(|x| rgb(&picture, x, MIDDLE.y));
    assert!(far[0] > 20, "the far splat is dim, not black: {far:?}");
    assert!(near[0].saturating_sub(far[0]) > 10, "the near splat is brighter: {near:?}, the far one {far:?}");
    assert!([near, far].iter().all(|[r, g, b]| r == g && g == b), "depth is gray: {near:?}, {far:?}");
}

#[test]
fn extreme_exposure_draws_white_and_finite_values() {
    let Some(mut app) = app(SIZE) else { return };
    app.insert_resource(ClearColor(Color::srgb_u8(51, 76, 102)));
    spawn(&mut app, &lone(Vec3::splat(0.8)), CaptureSettings { exposure: 120.0, ..default() });
    let camera = spawn_camera(&mut app, Msaa::Off, front());
    insert(&mut app, camera, Hdr);
    // The target of a second camera keeps half floats, which the first one rounds to 8 bits.
    let halves = Offscreen::hdr(&mut app.world_mut().resource_mut::<Assets<Image>>(), SIZE);
    let second = spawn_camera(&mut app, Msaa::Off, front());
    insert(&mut app, second, (Hdr, halves.target()));
    let picture = picture(&mut app, 0.0);
    assert_eq!(rgb(&picture, MIDDLE.x, MIDDLE.y), [255; 3], "the capture is white");
    let corner = rgb(&picture, 2, 2);
    let apart = corner.iter().zip([51u8, 76, 102]).map(|(seen, clear)| seen.abs_diff(clear)).max();
    assert!(apart <= Some(1), "pixels without the capture have the clear color: {corner:?}");
    let halves = testing::read_hdr(&mut app, &halves).expect("the second camera's picture");
    assert!(halves.as_raw().iter().all(|value| value.is_finite()), "every value of the HDR target is finite");
}

#[test]
fn without_tonemapping_bevy_matches_the_command() {
    let size = UVec2::new(160, 120);
    let Some(mut app) = app(size) else { return };
    let Some(mut headless) = gpu::headless() else { return };
    let package = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/toybox.gs4d");
    let scene = codec::load(&package, &ReadOptions::default()).expect("a readable package");
    let scene = scene.into_runtime().expect("a drawable capture");
    let pose = Transform::from_xyz(2.5, -3.0, 1.5).looking_at(Vec3::ZERO, Vec3::Z);
    let seconds = 1.3;
    let time = GaussianCapture::new(scene.clone()).time_at(seconds);

    let clear = [51u8, 102, 153];
    let background = Background::Color(clear.map(|value| f32::from(value) / 255.0));
    let capture = headless.upload(&scene).expect("it fits");
    // As with `--antialias`.
    let shown = view(&pose, size, time).antialiased(scene.trained_with.pixel);
    let frame = headless.render(&capture, &shown, background).expect("it is drawn");
    let expected = frame.picture.to_rgb8();
    assert!(expected.pixels().filter(|pixel| pixel.0 != clear).count() > 2000, "the capture is in view");

    let [r, g, b] = clear;
    app.insert_resource(ClearColor(Color::srgb_u8(r, g, b)));
    let entity = spawn(&mut app, &scene, ());
    insert(&mut app, entity, Playback::paused_at(seconds));
    let camera = spawn_camera(&mut app, Msaa::Off, pose);
    for target in ["8 bits", "HDR"] {
        if target == "HDR" {
            insert(&mut app, camera, Hdr);
        }
        let picture = picture(&mut app, 0.0);
        let channel = |(seen, expected): (&image::Rgba<u8>, &image::Rgb<u8>)| {
            seen.0.iter().zip(expected.0).map(|(seen, expected)| seen.abs_diff(expected)).max()
        };
        let apart = picture.pixels().zip(expected.pixels()).filter_map(channel).max();
        assert!(apart <= Some(1), "{target}: Bevy and the command differ by {apart:?} / 255");
    }
}
