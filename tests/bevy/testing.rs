//! The module `testing`: time without pictures, keys, cameras of the window, pictures in HDR, and errors for apps
//! without a required plugin.
//!
//! In: apps with and without a renderer. Out: proof that the game's systems receive time and keys as in a game, and
//! that a picture contains the content of the window. Tests that draw are skipped without a GPU; a software driver is
//! enough.

use crate::support::cpu_reference::{SIZE, add, rgb};
use crate::support::fixtures::{MIDDLE, crowd, front, lone, spawn};
use crate::support::offscreen_app::{app, picture, spawn_camera};
use crate::support::playback_app::{self, get};
use bevy::camera::{Hdr, RenderTarget};
use bevy::core_pipeline::tonemapping::{DebandDither, Tonemapping};
use bevy::input::InputPlugin;
use bevy::prelude::*;
use bevy::window::{PrimaryWindow, WindowRef};
use bevy_egui::{EguiContexts, EguiGlobalSettings, EguiPlugin, EguiPrimaryContextPass, PrimaryEguiContext, egui};
use bevy_gs4d::asset::GaussianCapture;
use bevy_gs4d::playback::{Clip, Playback, Timeline, TimelinePlayer, Track};
use bevy_gs4d::render::CaptureUploadBudget;
use bevy_gs4d::testing::{self, Offscreen, TestingError};
use bevy_gs4d::{GaussianCapture3d, GaussianCapturePlugins};
use std::time::Duration;

/// The time steps and key states that systems have received.
#[derive(Resource, Default)]
struct Seen {
    deltas: Vec<Duration>,
    pressed: u32,
    just_pressed: u32,
    just_released: u32,
}

fn watch_time(time: Res<Time>, mut seen: ResMut<Seen>) {
    seen.deltas.push(time.delta());
}

fn watch_space(keys: Res<ButtonInput<KeyCode>>, mut seen: ResMut<Seen>) {
    seen.pressed += u32::from(keys.pressed(KeyCode::Space));
    seen.just_pressed += u32::from(keys.just_pressed(KeyCode::Space));
    seen.just_released += u32::from(keys.just_released(KeyCode::Space));
}

#[test]
fn a_step_has_the_exact_duration_in_frames_of_a_60th_second() {
    let mut app = playback_app::app("assets");
    app.init_resource::<Seen>().add_systems(Update, watch_time);
    let capture = playback_app::capture(&mut app, 2.0, 1);
    let entity = app.world_mut().spawn((GaussianCapture3d(capture), Playback::default())).id();
    let duration = Duration::from_millis(750);
    testing::step(&mut app, duration).expect("the app has the required plugins");
    let deltas = &app.world().resource::<Seen>().deltas;
    assert_eq!(deltas.iter().sum::<Duration>(), duration, "the sum of the frames is the duration");
    let frames = deltas.iter().filter(|delta| !delta.is_zero()).count();
    assert_eq!(frames, 45, "frames of a 60th of a second");
    let time = get::<Playback>(&app, entity).time;
    assert!((time - 0.75).abs() < 1e-4, "captures play during a step: {time}");
    app.update();
    assert_eq!(
        app.world().resource::<Seen>().deltas.iter().sum::<Duration>(),
        duration,
        "no time passes after the step"
    );
}

#[test]
fn a_zero_step_waits_for_captures_and_passes_no_time() {
    let mut app = playback_app::app("assets");
    app.init_resource::<Seen>().add_systems(Update, watch_time);
    let handle = app.world().resource::<AssetServer>().load("toybox.gs4d");
    let entity = app.world_mut().spawn((GaussianCapture3d(handle), Playback::default())).id();
    testing::step(&mut app, Duration::ZERO).expect("the app has the required plugins");
    let loaded = app.world().resource::<Assets<GaussianCapture>>();
    assert_eq!(loaded.len(), 1, "the bundled capture has been loaded");
    assert_eq!(get::<Playback>(&app, entity).time, 0.0, "playback is at the start");
}

#[test]
fn a_picture_of_a_timeline_waits_for_the_captures_of_all_clips() {
    let Some(mut app) = app(SIZE) else { return };
    // One Gaussian per frame.
    app.insert_resource(CaptureUploadBudget { bytes_per_frame: 1 });
    spawn_camera(&mut app, Msaa::Off, front());
    let clips = [0.0, 1.0].map(|start| {
        let capture = add(&mut app, &crowd());
        Clip { capture, start, range: [0.0, 1.0], speed: 1.0, fade: [0.0; 2] }
    });
    let track = Track { name: "left".into(), clips: clips.to_vec() };
    let timeline = Timeline::new(vec![track], Vec::new(), None).expect("a valid timeline");
    let timeline = app.world_mut().resource_mut::<Assets<Timeline>>().add(timeline);
    let player = app.world_mut().spawn(TimelinePlayer(timeline)).id();
    picture(&mut app, 0.25);
    assert_eq!(
        get::<Playback>(&app, player).time,
        0.25,
        "time passes only after the captures of all clips are uploaded"
    );
}

#[test]
fn a_key_is_down_from_its_press_to_its_release() {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, InputPlugin)).init_resource::<Seen>().add_systems(Update, watch_space);
    testing::press(&mut app, KeyCode::Space).expect("there is a keyboard");
    testing::step(&mut app, Duration::from_millis(100)).expect("the app has the required plugins");
    testing::release(&mut app, KeyCode::Space).expect("there is a keyboard");
    testing::step(&mut app, Duration::from_millis(100)).expect("the app has the required plugins");
    let seen = std::mem::take(&mut *app.world_mut().resource_mut::<Seen>());
    // One update that waits for assets, and six frames.
    assert_eq!(
        (seen.just_pressed, seen.just_released, seen.pressed),
        (1, 1, 7),
        "the key is held during the first step"
    );

    testing::tap(&mut app, KeyCode::Space).expect("there is a keyboard");
    let seen = std::mem::take(&mut *app.world_mut().resource_mut::<Seen>());
    assert_eq!((seen.just_pressed, seen.just_released, seen.pressed), (1, 1, 1), "a tap lasts for one update");
    testing::tap(&mut app, KeyCode::Enter).expect("there is a keyboard");
    assert_eq!(app.world().resource::<Seen>().just_pressed, 0, "another key does not press space");
}

#[test]
fn errors_name_the_missing_plugin() {
    let mut bare = App::new();
    let refused = testing::step(&mut bare, Duration::from_secs(1)).expect_err("a step without TimePlugin is an error");
    assert!(refused.to_string().contains("TimePlugin"), "{refused} names the missing plugin");
    let refused = testing::tap(&mut bare, KeyCode::Space).expect_err("a key without InputPlugin is an error");
    assert!(refused.to_string().contains("InputPlugin"), "{refused} names the missing plugin");

    let mut without = App::new();
    without.add_plugins(MinimalPlugins).world_mut().spawn(GaussianCapture3d::default());
    let refused = testing::step(&mut without, Duration::ZERO).expect_err("captures without their plugin are an error");
    assert!(refused.to_string().contains("GaussianCapturePlugins"), "{refused} names the missing plugin");

    let mut unseen = App::new();
    unseen.add_plugins((MinimalPlugins, AssetPlugin::default(), GaussianCapturePlugins));
    for refused in [testing::settle(&mut unseen).err(), testing::picture(&mut unseen, Duration::ZERO).err()] {
        let expected = match refused {
            Some(TestingError::NoRenderer) => testing::has_gpu(),
            Some(TestingError::NoGpu) => !testing::has_gpu(),
            _ => false,
        };
        assert!(expected, "the error names the missing renderer or GPU: {refused:?}");
    }
}

#[test]
fn a_picture_can_be_read_before_the_first_update() {
    let Some(mut app) = app(SIZE) else { return };
    let offscreen = app.world().resource::<Offscreen>().clone();
    let empty = testing::read(&mut app, &offscreen).expect("reading finishes the plugins");
    assert_eq!(empty.dimensions(), (SIZE.x, SIZE.y), "the picture has the size of the target");
}

/// Adds a camera of the window, as in a game, with settings for comparing pixels.
fn window_camera(app: &mut App) -> Entity {
    let appearance = (Msaa::Off, Tonemapping::None, DebandDither::Disabled);
    app.world_mut().spawn((Camera3d::default(), appearance, front())).id()
}

/// Whether all cameras had the window, at the size of the picture, as their target; one entry per run of a system.
#[derive(Resource, Default)]
struct Targets(Vec<bool>);

fn watch_targets(
    targets: Query<&RenderTarget>,
    window: Single<&Window, With<PrimaryWindow>>,
    mut seen: ResMut<Targets>,
) {
    let in_window = targets.iter().all(|target| matches!(target, RenderTarget::Window(WindowRef::Primary)));
    seen.0.push(in_window && window.physical_size() == SIZE);
}

#[test]
fn cameras_of_the_window_draw_into_the_picture_and_keep_their_target() {
    let Some(mut app) = app(SIZE) else { return };
    spawn(&mut app, &lone(Vec3::X), ());
    let camera = window_camera(&mut app);
    app.init_resource::<Targets>();
    app.add_systems(PreUpdate, watch_targets).add_systems(PostUpdate, watch_targets);
    let seen = rgb(&picture(&mut app, 0.0), MIDDLE.x, MIDDLE.y);
    assert!(seen[0] > 200 && seen[1] < 60, "the capture is in the picture: {seen:?}");
    let targets = &app.world().resource::<Targets>().0;
    assert!(targets.len() > 4 && targets.iter().all(|right| *right), "systems always find the window as the target");

    let other = Offscreen::new(&mut app.world_mut().resource_mut::<Assets<Image>>(), SIZE);
    app.world_mut().entity_mut(camera).insert(other.target());
    app.update();
    let target = app.world().get::<RenderTarget>(camera).expect("every camera has a target");
    assert_eq!(target.as_image(), Some(&other.image), "a target set by the game is not changed");
}

/// Paints the left quarter of the picture green.
fn paint(mut contexts: EguiContexts) -> Result {
    let area = egui::Rect::from_min_max(egui::Pos2::ZERO, egui::pos2(SIZE.x as f32 / 4.0, SIZE.y as f32));
    contexts.ctx_mut()?.debug_painter().rect_filled(area, 0.0, egui::Color32::GREEN);
    Ok(())
}

#[test]
fn a_user_interface_on_a_separate_camera_is_in_the_picture() {
    let Some(mut app) = app(SIZE) else { return };
    app.add_plugins(EguiPlugin::default()).add_systems(EguiPrimaryContextPass, paint);
    app.world_mut().resource_mut::<EguiGlobalSettings>().auto_create_primary_context = false;
    spawn(&mut app, &lone(Vec3::X), ());
    let over = Camera { order: 1, clear_color: ClearColorConfig::None, ..default() };
    app.world_mut().spawn((Camera2d, over, Msaa::Off, PrimaryEguiContext));
    // This camera targets the picture and the camera of the interface targets the window, which are the same.
    spawn_camera(&mut app, Msaa::Off, front());
    let picture = picture(&mut app, 0.0);
    let [interface, capture] = [SIZE.x / 8, MIDDLE.x].map(|x| rgb(&picture, x, MIDDLE.y));
    assert!(interface[1] > 200 && interface[0] < 60, "the interface covers its quarter: {interface:?}");
    assert!(capture[0] > 200 && capture[1] < 60, "the capture is visible next to the interface: {capture:?}");
}

#[test]
fn the_window_keeps_the_size_of_the_picture() {
    let Some(mut app) = app(SIZE) else { return };
    spawn(&mut app, &lone(Vec3::X), ());
    let camera = window_camera(&mut app);
    let before = picture(&mut app, 0.0);
    let mut windows = app.world_mut().query_filtered::<&mut Window, With<PrimaryWindow>>();
    windows.single_mut(app.world_mut()).expect("one window").resolution.set(1280.0, 720.0);
    assert!(picture(&mut app, 0.0) == before, "resizing the window does not change the picture");
    let size = app.world().get::<Camera>(camera).and_then(Camera::physical_target_size);
    assert_eq!(size, Some(SIZE), "the camera keeps its size");
}

#[test]
fn pictures_in_hdr_are_not_clamped() {
    let Some(mut app) = app(SIZE) else { return };
    // Half floats represent these values exactly.
    app.insert_resource(ClearColor(Color::LinearRgba(LinearRgba::rgb(4.0, 0.5, 0.0625))));
    let bright = Offscreen::hdr(&mut app.world_mut().resource_mut::<Assets<Image>>(), SIZE);
    let camera = spawn_camera(&mut app, Msaa::Off, front());
    app.world_mut().entity_mut(camera).insert((Hdr, bright.target()));
    testing::settle(&mut app).expect("the app draws without an error");
    let picture = testing::read_hdr(&mut app, &bright).expect("a picture in HDR");
    assert_eq!(picture.dimensions(), (SIZE.x, SIZE.y), "the picture has the size of the target");
    for (x, y) in [(0, 0), (SIZE.x - 1, 0), (SIZE.x - 1, SIZE.y - 1)] {
        let [r, g, b, _] = picture.get_pixel(x, y).0;
        let apart = (r - 4.0).abs().max((g - 0.5).abs()).max((b - 0.0625).abs());
        assert!(apart < 1e-3, "the pixel has the light of the clear color, not {r}, {g}, {b}");
    }
    let refused = testing::read(&mut app, &bright).expect_err("reading an HDR target as 8 bits is an error");
    assert!(refused.to_string().contains("read_hdr"), "{refused} names the right function");
    let plain = app.world().resource::<Offscreen>().clone();
    let refused = testing::read_hdr(&mut app, &plain).expect_err("reading an 8-bit target as HDR is an error");
    assert!(refused.to_string().ends_with("read"), "{refused} names the right function");
}
