//! The testing module itself: time without pictures, keys, cameras of the window, pictures in HDR, and what it says of apps that lack
//! something.
//!
//! In: apps with and without a renderer. Out: proof that time and keys arrive in the game's systems as in a game, and that whatever a
//! display would show is in the picture. What draws is skipped where there is no GPU, not even a software one.

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
use bevy_gs4d::{GaussianCapture3d, GaussianCapturePlugin};
use std::time::Duration;

/// What systems have seen, update by update.
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
fn a_step_is_exact_and_made_of_frames() {
    let mut app = playback_app::app("assets");
    app.init_resource::<Seen>().add_systems(Update, watch_time);
    let capture = playback_app::capture(&mut app, 2.0, 1);
    let entity = app.world_mut().spawn((GaussianCapture3d(capture), Playback::default())).id();
    let duration = Duration::from_millis(750);
    testing::step(&mut app, duration).expect("nothing is missing");
    let deltas = &app.world().resource::<Seen>().deltas;
    assert_eq!(deltas.iter().sum::<Duration>(), duration, "all of it passes, and no more");
    let frames = deltas.iter().filter(|delta| !delta.is_zero()).count();
    assert_eq!(frames, 45, "in frames of a 60th of a second");
    let time = get::<Playback>(&app, entity).time;
    assert!((time - 0.75).abs() < 1e-4, "captures play along: {time}");
    app.update();
    assert_eq!(app.world().resource::<Seen>().deltas.iter().sum::<Duration>(), duration, "then time stands still");
}

#[test]
fn a_step_of_nothing_waits_for_captures_and_passes_no_time() {
    let mut app = playback_app::app("assets");
    app.init_resource::<Seen>().add_systems(Update, watch_time);
    let handle = app.world().resource::<AssetServer>().load("toybox.gs4d");
    let entity = app.world_mut().spawn((GaussianCapture3d(handle), Playback::default())).id();
    testing::step(&mut app, Duration::ZERO).expect("nothing is missing");
    let loaded = app.world().resource::<Assets<GaussianCapture>>();
    assert_eq!(loaded.len(), 1, "the bundled capture has been loaded");
    assert_eq!(get::<Playback>(&app, entity).time, 0.0, "and is at its start");
}

#[test]
fn a_picture_of_a_timeline_is_of_the_time_that_was_asked_for() {
    let Some(mut app) = app(SIZE) else { return };
    // A Gaussian in each frame.
    app.insert_resource(CaptureUploadBudget { bytes_per_frame: 1 });
    spawn_camera(&mut app, Msaa::Off, front());
    let clips = [0.0, 1.0].map(|start| {
        let capture = add(&mut app, &crowd());
        Clip { capture, start, range: [0.0, 1.0], speed: 1.0, fade: [0.0; 2] }
    });
    let track = Track { name: "left".into(), clips: clips.to_vec() };
    let timeline = Timeline::new(vec![track], Vec::new(), None).expect("makes sense");
    let timeline = app.world_mut().resource_mut::<Assets<Timeline>>().add(timeline);
    let player = app.world_mut().spawn(TimelinePlayer(timeline)).id();
    picture(&mut app, 0.25);
    assert_eq!(get::<Playback>(&app, player).time, 0.25, "it waits for the captures of all clips first");
}

#[test]
fn a_key_is_down_from_its_press_to_its_release() {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, InputPlugin)).init_resource::<Seen>().add_systems(Update, watch_space);
    testing::press(&mut app, KeyCode::Space).expect("there is a keyboard");
    testing::step(&mut app, Duration::from_millis(100)).expect("nothing is missing");
    testing::release(&mut app, KeyCode::Space).expect("there is a keyboard");
    testing::step(&mut app, Duration::from_millis(100)).expect("nothing is missing");
    let seen = std::mem::take(&mut *app.world_mut().resource_mut::<Seen>());
    // One update while assets are waited for, and six frames.
    assert_eq!((seen.just_pressed, seen.just_released, seen.pressed), (1, 1, 7), "held for the first step");

    testing::tap(&mut app, KeyCode::Space).expect("there is a keyboard");
    let seen = std::mem::take(&mut *app.world_mut().resource_mut::<Seen>());
    assert_eq!((seen.just_pressed, seen.just_released, seen.pressed), (1, 1, 1), "a tap lasts for one update");
    testing::tap(&mut app, KeyCode::Enter).expect("there is a keyboard");
    assert_eq!(app.world().resource::<Seen>().just_pressed, 0, "other keys are other keys");
}

#[test]
fn what_an_app_lacks_is_named() {
    let mut bare = App::new();
    let refused = testing::step(&mut bare, Duration::from_secs(1)).expect_err("no time can pass");
    assert!(refused.to_string().contains("TimePlugin"), "{refused} names the plugin");
    let refused = testing::tap(&mut bare, KeyCode::Space).expect_err("there is no keyboard");
    assert!(refused.to_string().contains("InputPlugin"), "{refused} names the plugin");

    let mut without = App::new();
    without.add_plugins(MinimalPlugins).world_mut().spawn(GaussianCapture3d::default());
    let refused = testing::step(&mut without, Duration::ZERO).expect_err("captures are nothing without their plugin");
    assert!(refused.to_string().contains("GaussianCapturePlugin"), "{refused} names the plugin");

    let mut unseen = App::new();
    unseen.add_plugins((MinimalPlugins, AssetPlugin::default(), GaussianCapturePlugin));
    for refused in [testing::settle(&mut unseen).err(), testing::picture(&mut unseen, Duration::ZERO).err()] {
        let expected = match refused {
            Some(TestingError::NoRenderer) => testing::has_gpu(),
            Some(TestingError::NoGpu) => !testing::has_gpu(),
            _ => false,
        };
        assert!(expected, "without a renderer nothing is drawn: {refused:?}");
    }
}

#[test]
fn a_picture_can_be_read_before_anything_has_run() {
    let Some(mut app) = app(SIZE) else { return };
    let offscreen = app.world().resource::<Offscreen>().clone();
    let empty = testing::read(&mut app, &offscreen).expect("its plugins are finished first");
    assert_eq!(empty.dimensions(), (SIZE.x, SIZE.y), "a picture of nothing is a picture");
}

/// Adds a camera of the window, as a game does, whose pixels are compared.
fn window_camera(app: &mut App) -> Entity {
    let appearance = (Msaa::Off, Tonemapping::None, DebandDither::Disabled);
    app.world_mut().spawn((Camera3d::default(), appearance, front())).id()
}

/// Whether all cameras were those of a window as large as the picture, each time that a system looked.
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
fn cameras_of_the_window_draw_into_the_picture_and_stay_cameras_of_the_window() {
    let Some(mut app) = app(SIZE) else { return };
    spawn(&mut app, &lone(Vec3::X), ());
    let camera = window_camera(&mut app);
    app.init_resource::<Targets>();
    app.add_systems(PreUpdate, watch_targets).add_systems(PostUpdate, watch_targets);
    let seen = rgb(&picture(&mut app, 0.0), MIDDLE.x, MIDDLE.y);
    assert!(seen[0] > 200 && seen[1] < 60, "the capture is in the picture: {seen:?}");
    let targets = &app.world().resource::<Targets>().0;
    assert!(targets.len() > 4 && targets.iter().all(|right| *right), "user interfaces find it, every time");

    let other = Offscreen::new(&mut app.world_mut().resource_mut::<Assets<Image>>(), SIZE);
    app.world_mut().entity_mut(camera).insert(other.target());
    app.update();
    let target = app.world().get::<RenderTarget>(camera).expect("every camera has one");
    assert_eq!(target.as_image(), Some(&other.image), "a target that the game sets is left alone");
}

/// Paints the left quarter of the picture green.
fn paint(mut contexts: EguiContexts) -> Result {
    let area = egui::Rect::from_min_max(egui::Pos2::ZERO, egui::pos2(SIZE.x as f32 / 4.0, SIZE.y as f32));
    contexts.ctx_mut()?.debug_painter().rect_filled(area, 0.0, egui::Color32::GREEN);
    Ok(())
}

#[test]
fn a_user_interface_on_a_camera_of_its_own_is_in_the_picture() {
    let Some(mut app) = app(SIZE) else { return };
    app.add_plugins(EguiPlugin::default()).add_systems(EguiPrimaryContextPass, paint);
    app.world_mut().resource_mut::<EguiGlobalSettings>().auto_create_primary_context = false;
    spawn(&mut app, &lone(Vec3::X), ());
    let over = Camera { order: 1, clear_color: ClearColorConfig::None, ..default() };
    app.world_mut().spawn((Camera2d, over, Msaa::Off, PrimaryEguiContext));
    // Its target is the picture itself, and that of the interface the window: they are the same.
    spawn_camera(&mut app, Msaa::Off, front());
    let picture = picture(&mut app, 0.0);
    let [interface, capture] = [SIZE.x / 8, MIDDLE.x].map(|x| rgb(&picture, x, MIDDLE.y));
    assert!(interface[1] > 200 && interface[0] < 60, "the interface covers its quarter: {interface:?}");
    assert!(capture[0] > 200 && capture[1] < 60, "and the capture is seen beside it: {capture:?}");
}

#[test]
fn the_window_is_as_large_as_the_picture_whatever_the_game_sets() {
    let Some(mut app) = app(SIZE) else { return };
    spawn(&mut app, &lone(Vec3::X), ());
    let camera = window_camera(&mut app);
    let before = picture(&mut app, 0.0);
    let mut windows = app.world_mut().query_filtered::<&mut Window, With<PrimaryWindow>>();
    windows.single_mut(app.world_mut()).expect("one window").resolution.set(1280.0, 720.0);
    assert!(picture(&mut app, 0.0) == before, "nothing changes");
    let size = app.world().get::<Camera>(camera).and_then(Camera::physical_target_size);
    assert_eq!(size, Some(SIZE), "the camera keeps its size");
}

#[test]
fn pictures_in_hdr_are_not_clamped() {
    let Some(mut app) = app(SIZE) else { return };
    // Halves hold these exactly.
    app.insert_resource(ClearColor(Color::LinearRgba(LinearRgba::rgb(4.0, 0.5, 0.0625))));
    let bright = Offscreen::hdr(&mut app.world_mut().resource_mut::<Assets<Image>>(), SIZE);
    let camera = spawn_camera(&mut app, Msaa::Off, front());
    app.world_mut().entity_mut(camera).insert((Hdr, bright.target()));
    testing::settle(&mut app).expect("the app draws without an error");
    let picture = testing::read_hdr(&mut app, &bright).expect("a picture in HDR");
    assert_eq!(picture.dimensions(), (SIZE.x, SIZE.y), "all of it");
    for (x, y) in [(0, 0), (SIZE.x - 1, 0), (SIZE.x - 1, SIZE.y - 1)] {
        let [r, g, b, _] = picture.get_pixel(x, y).0;
        let apart = (r - 4.0).abs().max((g - 0.5).abs()).max((b - 0.0625).abs());
        assert!(apart < 1e-3, "light is as it was set, not {r}, {g}, {b}");
    }
    let refused = testing::read(&mut app, &bright).expect_err("its pixels do not fit into 8 bits");
    assert!(refused.to_string().contains("read_hdr"), "{refused} names the function that reads it");
    let plain = app.world().resource::<Offscreen>().clone();
    let refused = testing::read_hdr(&mut app, &plain).expect_err("it is not in HDR");
    assert!(refused.to_string().ends_with("read"), "{refused} names the function that reads it");
}
