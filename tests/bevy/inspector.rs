//! The inspector's panel, in Bevy apps without a window.
//!
//! In: captures that have been loaded, failed to load, or are missing. Out: proof that the panel covers only its edge
//! of the picture, changes no component without input, and warns of faults, and that debug views change pixels. Skipped
//! without a GPU; a software driver is enough.

use crate::support::cpu_reference::{difference, view};
use crate::support::fixtures::debug_picture;
use crate::support::gpu;
use crate::support::offscreen_app::{app, picture, spawn_camera};
use crate::support::skip::skip;
use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::input::ButtonState;
use bevy::input::keyboard::{Key, KeyboardInput};
use bevy::prelude::*;
use bevy::render::RenderApp;
use bevy::render::render_resource::WgpuFeatures;
use bevy::render::renderer::RenderDevice;
use bevy::time::TimeUpdateStrategy;
use bevy_egui::EguiContext;
use bevy_gs4d::asset::{CaptureState, GaussianCapture};
use bevy_gs4d::inspector::{Inspector, InspectorPlugin};
use bevy_gs4d::playback::{Playback, PlaybackSeeked};
use bevy_gs4d::render::{CaptureSettings, CaptureStatistics, CaptureViewSettings};
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use bevy_gs4d::view::DebugView;
use bevy_gs4d::{GaussianCapture3d, testing};
use image::RgbaImage;
use std::collections::HashMap;
use std::ops::Range;
use std::time::Duration;

/// The panel is 300 points wide, at 8 points from the right edge.
const SIZE: UVec2 = UVec2::new(420, 200);
/// Columns that neither the panel nor its shadow reaches.
const BESIDE: Range<u32> = 0..64;
/// Columns that the panel covers.
const PANEL: Range<u32> = 114..410;

/// Numbers of seek events and of changed components.
#[derive(Resource, Default)]
struct Seen {
    seeks: usize,
    changes: usize,
}

/// Returns an app with a camera and the panel, and the camera; `None` if there is no GPU.
fn inspected() -> Option<(App, Entity)> {
    let mut app = app(SIZE)?;
    app.add_plugins(InspectorPlugin).init_resource::<Seen>();
    app.add_observer(|_: On<PlaybackSeeked>, mut seen: ResMut<Seen>| seen.seeks += 1);
    let camera = spawn_camera(&mut app, Msaa::Off, place());
    Some((app, camera))
}

fn place() -> Transform {
    Transform::from_xyz(2.5, 2.0, 1.5).looking_at(Vec3::ZERO, Vec3::Z)
}

fn capture() -> GaussianCapture {
    let settings = SynthSettings { count: 300, degree: 0, duration_seconds: 2.0, ..SynthSettings::default() };
    GaussianCapture::new(synthesize(&settings).into_runtime().expect("a synthetic scene can be drawn"))
}

fn spawn_capture(app: &mut App, playback: Playback) -> Entity {
    let handle = app.world_mut().resource_mut::<Assets<GaussianCapture>>().add(capture());
    app.world_mut().spawn((GaussianCapture3d(handle), playback)).id()
}

fn set_open(app: &mut App, open: bool) {
    app.world_mut().resource_mut::<Inspector>().open = open;
}

/// Runs updates `seconds` apart. No update may fail.
fn run(app: &mut App, updates: usize, seconds: f32) {
    app.insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_secs_f32(seconds)));
    for _ in 0..updates {
        app.update();
        assert_eq!(app.should_exit(), None, "the app does not exit");
    }
}

/// Returns the fraction of differing pixels in some columns.
fn changed(a: &RgbaImage, b: &RgbaImage, columns: Range<u32>) -> f64 {
    let all = f64::from(columns.end - columns.start) * f64::from(SIZE.y);
    let differs = |&(x, y): &(u32, u32)| a.get_pixel(x, y) != b.get_pixel(x, y);
    columns.flat_map(|x| (0..SIZE.y).map(move |y| (x, y))).filter(differs).count() as f64 / all
}

/// Returns the most common color in some columns, and the fraction of its pixels.
fn commonest(picture: &RgbaImage, columns: Range<u32>) -> ([u8; 3], f64) {
    let all = f64::from(columns.end - columns.start) * f64::from(SIZE.y);
    let mut counts: HashMap<[u8; 3], u32> = HashMap::new();
    for (x, y) in columns.flat_map(|x| (0..SIZE.y).map(move |y| (x, y))) {
        let [r, g, b, _] = picture.get_pixel(x, y).0;
        *counts.entry([r, g, b]).or_default() += 1;
    }
    let (color, count) = counts.into_iter().max_by_key(|(_, count)| *count).expect("there are pixels");
    (color, f64::from(count) / all)
}

#[test]
fn the_panel_covers_only_its_edge_of_the_picture() {
    let Some((mut app, _)) = inspected() else { return };
    spawn_capture(&mut app, Playback::paused_at(0.5));
    let open = picture(&mut app, 0.0);
    set_open(&mut app, false);
    let closed = picture(&mut app, 0.0);
    let covered = changed(&open, &closed, PANEL);
    assert!(covered > 0.5, "the panel changes most pixels in its columns, not {covered}");
    let ([r, g, b], fraction) = commonest(&open, PANEL);
    let is_dark_gray = r == g && g == b && (10..70).contains(&r);
    assert!(
        is_dark_gray && fraction > 0.3,
        "the background of the panel is dark gray: {fraction} of it is {r}, {g}, {b}"
    );
    assert_eq!(changed(&open, &closed, BESIDE), 0.0, "pixels next to the panel are unchanged");
    set_open(&mut app, true);
    assert_eq!(changed(&open, &picture(&mut app, 0.0), 0..SIZE.x), 0.0, "the reopened panel looks the same");
    let Some(mut without) = app_without_panel() else { return };
    assert_eq!(
        changed(&closed, &picture(&mut without, 0.0), 0..SIZE.x),
        0.0,
        "a closed panel leaves the picture of an app without it"
    );
}

/// Returns an app with the same capture and camera, but no panel.
fn app_without_panel() -> Option<App> {
    let mut app = app(SIZE)?;
    spawn_camera(&mut app, Msaa::Off, place());
    spawn_capture(&mut app, Playback::paused_at(0.5));
    Some(app)
}

#[test]
fn the_panel_runs_without_a_capture_with_one_and_with_a_failed_one() {
    let Some((mut app, _)) = inspected() else { return };
    testing::settle(&mut app).expect("the app runs without a capture");
    run(&mut app, 5, 0.1);
    let good = spawn_capture(&mut app, Playback::default());
    testing::settle(&mut app).expect("the capture is drawn");
    run(&mut app, 5, 0.1);
    let state = |app: &App, entity| format!("{:?}", app.world().get::<CaptureState>(entity));
    assert!(state(&app, good).contains("Ready"), "the capture is ready: {}", state(&app, good));

    let handle = app.world().resource::<AssetServer>().load("there-is-none.gs4d");
    let bad = app.world_mut().spawn(GaussianCapture3d(handle)).id();
    app.world_mut().resource_mut::<Inspector>().selected = Some(bad);
    for _ in 0..1000 {
        if state(&app, bad).contains("Failed") {
            break;
        }
        std::thread::sleep(Duration::from_millis(2));
        run(&mut app, 1, 0.0);
    }
    assert!(state(&app, bad).contains("there-is-none.gs4d"), "the failure names the file: {}", state(&app, bad));
    run(&mut app, 5, 0.1);
    app.world_mut().despawn(bad);
    run(&mut app, 5, 0.1);
    assert_eq!(
        app.world().resource::<Inspector>().selected,
        Some(bad),
        "showing another capture does not change the selection"
    );
}

#[test]
fn an_open_panel_without_input_neither_seeks_nor_changes_components() {
    let Some((mut app, _)) = inspected() else { return };
    let odd = Playback { time: 0.123_45, speed: 3.5, start: 0.1, end: 7.0, ..Playback::default() };
    let entity = spawn_capture(&mut app, odd);
    app.add_systems(Last, count_changes);
    testing::settle(&mut app).expect("the capture is drawn");
    run(&mut app, 5, 0.1);
    assert_eq!(app.world().resource::<Seen>().seeks, 0, "playing sends no seek");

    app.world_mut().get_mut::<Playback>(entity).expect("a required component").pause();
    run(&mut app, 1, 0.1);
    app.world_mut().resource_mut::<Seen>().changes = 0;
    run(&mut app, 5, 0.1);
    let seen = app.world().resource::<Seen>();
    assert_eq!((seen.seeks, seen.changes), (0, 0), "a paused capture does not change");

    app.world_mut().get_mut::<Playback>(entity).expect("a required component").seek(1.5);
    run(&mut app, 1, 0.1);
    let seen = app.world().resource::<Seen>();
    assert_eq!((seen.seeks, seen.changes), (1, 1), "a seek by the game is counted");
}

type Changes = Or<(
    Changed<Playback>,
    Changed<CaptureSettings>,
    Changed<CaptureViewSettings>,
    Changed<Msaa>,
    Changed<Tonemapping>,
)>;

fn count_changes(changed: Query<(), Changes>, inspector: Res<Inspector>, mut seen: ResMut<Seen>) {
    seen.changes += changed.iter().count() + usize::from(inspector.is_changed());
}

/// Returns the number of reddish pixels of the panel. Only warnings are red.
fn reddish(picture: &RgbaImage) -> usize {
    let red = |&(x, y): &(u32, u32)| {
        let [r, _, b, _] = picture.get_pixel(x, y).0;
        i32::from(r) - i32::from(b) > 100
    };
    PANEL.flat_map(|x| (16..SIZE.y - 16).map(move |y| (x, y))).filter(red).count()
}

fn warnings(app: &App) -> Vec<String> {
    app.world().resource::<Inspector>().warnings.clone()
}

#[test]
fn the_panel_warns_of_unseen_captures_and_of_cameras_that_cannot_draw() {
    let Some((mut app, camera)) = inspected() else { return };
    let entity = spawn_capture(&mut app, Playback::paused_at(0.5));
    app.world_mut().entity_mut(entity).insert(Name::new("dancer"));
    app.world_mut().entity_mut(camera).insert(Name::new("eye"));
    let plain = picture(&mut app, 0.0);
    assert_eq!(warnings(&app), [""; 0], "no warning for a capture in front of the camera");

    app.world_mut().entity_mut(entity).insert(Transform::from_xyz(0.0, 0.0, 500.0));
    let warned = picture(&mut app, 0.0);
    let said = warnings(&app);
    assert!(
        matches!(&said[..], [said] if said.starts_with("dancer: no camera sees it")),
        "a warning for a capture out of view: {said:?}"
    );
    let [before, after] = [&plain, &warned].map(reddish);
    assert!(after > before + 20, "the warning is red: {before} reddish pixels become {after}");
    app.world_mut().entity_mut(entity).insert(Visibility::Hidden);
    picture(&mut app, 0.0);
    assert_eq!(warnings(&app), [""; 0], "no warning for a hidden capture");

    let near_clip_plane = Vec3::new(0.1, 0.0, -1.0).normalize().extend(-0.4);
    let oblique = PerspectiveProjection { near_clip_plane, ..default() };
    app.world_mut().entity_mut(camera).insert(Projection::Perspective(oblique));
    picture(&mut app, 0.0);
    let said = warnings(&app);
    assert!(
        matches!(&said[..], [said] if said.starts_with("eye: captures are drawn over")),
        "a warning for the near clip plane: {said:?}"
    );
    app.world_mut().entity_mut(camera).insert(Projection::default());
    picture(&mut app, 0.0);
    assert_eq!(warnings(&app), [""; 0], "no warning for the default projection");

    let handle = app.world().resource::<AssetServer>().load("there-is-none.gs4d");
    app.world_mut().spawn(GaussianCapture3d(handle));
    for _ in 0..1000 {
        if !warnings(&app).is_empty() {
            break;
        }
        std::thread::sleep(Duration::from_millis(2));
        run(&mut app, 1, 0.0);
    }
    let said = warnings(&app);
    assert!(
        matches!(&said[..], [said] if said.contains("there-is-none.gs4d")),
        "a warning that names the missing file: {said:?}"
    );
}

#[test]
fn warnings_are_found_while_the_panel_is_closed_and_without_a_camera() {
    let Some((mut app, camera)) = inspected() else { return };
    set_open(&mut app, false);
    let entity = spawn_capture(&mut app, Playback::paused_at(0.5));
    app.world_mut().entity_mut(entity).insert(Name::new("dancer"));
    picture(&mut app, 0.0);
    assert_eq!(warnings(&app), [""; 0], "no warning for a capture in front of the camera");
    app.world_mut().entity_mut(entity).insert(Transform::from_xyz(0.0, 0.0, 500.0));
    picture(&mut app, 0.0);
    let said = warnings(&app);
    assert!(
        matches!(&said[..], [said] if said.starts_with("dancer: no camera sees it")),
        "a warning for a capture out of view: {said:?}"
    );
    app.world_mut().despawn(camera);
    run(&mut app, 3, 0.0);
    let said = warnings(&app);
    assert!(matches!(&said[..], [said] if said.contains("no active Camera3d")), "a warning without a camera: {said:?}");
}

#[test]
fn debug_views_match_the_renderer_without_bevy() {
    let Some((mut app, camera)) = inspected() else { return };
    let Some(mut headless) = gpu::headless() else { return };
    spawn_capture(&mut app, Playback::paused_at(0.5));
    set_open(&mut app, false);
    let as_trained = picture(&mut app, 0.0);
    app.world_mut().entity_mut(camera).insert(CaptureViewSettings::default());
    assert_eq!(
        changed(&as_trained, &picture(&mut app, 0.0), 0..SIZE.x),
        0.0,
        "the default settings draw the same as no settings"
    );
    for debug in [DebugView::Depth, DebugView::Overdraw, DebugView::Lifespan, DebugView::Velocity] {
        app.world_mut().entity_mut(camera).insert(CaptureViewSettings { debug, ..default() });
        let seen = picture(&mut app, 0.0);
        let fraction = changed(&as_trained, &seen, 0..SIZE.x);
        assert!(fraction > 0.01, "{debug:?} differs from the color view: in {fraction} of the pixels");
        let shown = capture();
        let view = view(&place(), SIZE, shown.time_at(0.5));
        let apart = difference(&seen, &debug_picture(&mut headless, shown.scene(), view, debug));
        assert!(apart <= 2.0, "{debug:?}: pictures with and without Bevy differ by {apart} / 255");
    }
}

#[test]
fn the_panel_moves_to_another_camera_when_its_camera_is_despawned() {
    let Some((mut app, first)) = inspected() else { return };
    let with_first = picture(&mut app, 0.0);
    app.world_mut().despawn(first);
    run(&mut app, 3, 0.0);
    let second = spawn_camera(&mut app, Msaa::Off, place());
    let with_second = picture(&mut app, 0.0);
    assert_eq!(changed(&with_first, &with_second, 0..SIZE.x), 0.0, "a new camera shows the same panel");
    let contexts = app.world_mut().query::<&EguiContext>().iter(app.world()).count();
    assert!(
        contexts == 1 && app.world().get::<EguiContext>(second).is_some(),
        "the new camera has the only egui context of {contexts}"
    );
    let third = spawn_camera(&mut app, Msaa::Off, place());
    app.world_mut().despawn(second);
    assert_eq!(
        changed(&with_first, &picture(&mut app, 0.0), 0..SIZE.x),
        0.0,
        "an existing camera shows the same panel"
    );
    assert!(app.world().get::<EguiContext>(third).is_some(), "the existing camera has the egui context");
    set_open(&mut app, false);
    let covered = changed(&with_first, &picture(&mut app, 0.0), PANEL);
    assert!(covered > 0.5, "the panel was in the picture: closing it changes {covered} of its pixels");
}

fn key(state: ButtonState) -> KeyboardInput {
    let window = Entity::PLACEHOLDER;
    KeyboardInput { key_code: KeyCode::F1, logical_key: Key::F1, state, text: None, repeat: false, window }
}

#[test]
fn f1_toggles_once_per_press() {
    let Some((mut app, _)) = inspected() else { return };
    testing::settle(&mut app).expect("the app runs");
    let is_open = |app: &App| app.world().resource::<Inspector>().open;
    assert!(is_open(&app), "the panel is open at first");
    for expected in [false, true] {
        for _ in 0..5 {
            // Held keys are repeated.
            app.world_mut().write_message(key(ButtonState::Pressed));
            run(&mut app, 1, 0.1);
            assert_eq!(is_open(&app), expected, "only the first of five repeated presses toggles");
        }
        app.world_mut().write_message(key(ButtonState::Released));
        run(&mut app, 2, 0.1);
        assert_eq!(is_open(&app), expected, "releasing the key does not toggle");
    }
}

#[test]
fn gpu_time_is_measured_only_while_its_section_is_open() {
    let Some((mut app, camera)) = inspected() else { return };
    spawn_capture(&mut app, Playback::paused_at(0.5));
    testing::settle(&mut app).expect("the capture is drawn");
    let renderer = app.get_sub_app(RenderApp).expect("the app has a renderer");
    let features = renderer.world().resource::<RenderDevice>().features();
    if !features.contains(WgpuFeatures::TIMESTAMP_QUERY_INSIDE_PASSES) {
        skip("this GPU has no timestamps inside passes");
        return;
    }
    let measured = |app: &App| {
        let view = app.world().resource::<CaptureStatistics>().view(camera).expect("it draws the capture");
        !view.passes.is_empty()
    };
    // Opens all sections, or restores their state.
    let unfold = |app: &mut App, all: bool| {
        let mut context = app.world_mut().get_mut::<EguiContext>(camera).expect("the egui context of the panel");
        context.get_mut().memory_mut(|memory| memory.set_everything_is_visible(all));
    };
    run(&mut app, 20, 0.0);
    assert!(!measured(&app), "times are not measured while the section is closed");
    unfold(&mut app, true);
    let mut updates = 0;
    while !measured(&app) && updates < 500 {
        run(&mut app, 1, 0.0);
        updates += 1;
    }
    assert!(measured(&app), "times are measured while the section is open");
    unfold(&mut app, false);
    run(&mut app, 20, 0.0);
    assert!(!measured(&app), "times are not measured after the section is closed");
    unfold(&mut app, true);
    set_open(&mut app, false);
    run(&mut app, 20, 0.0);
    assert!(!measured(&app), "times are not measured while the panel is closed");
}
