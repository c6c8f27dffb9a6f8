//! Plays a capture in a window, with a lit ball in its middle: the ball hides the splats behind it, and splats in front
//! hide the ball. The panel on the right plays, crops and tints the capture, shows counts and GPU times, and switches
//! to debug views.
//!
//! ```text
//! cargo run --release --features viewer --example play -- \
//!     [CAPTURE] [--edits FILE] [--headless FOLDER] [--frames N]
//! ```
//!
//! * drag with the left button: orbit; wheel: nearer and farther
//! * click: mark the Gaussian there; the panel names it
//! * space: play and pause; left and right: one frame back and forward, at the panel's frame rate
//! * F1: close and open the panel
//! * drop a capture on the window, a file of any format or the folder of a sequence: play it; if it cannot be read, the
//!   panel shows the reason
//!
//! A capture whose file changes is loaded again, so that the output of a running `gs4d train` is shown as it becomes
//! better.
//!
//! With `--edits FILE` it shows the capture without what a list of edits removes, as `gs4d edit` writes it. The list is
//! applied again whenever its file is saved: to undo an edit, remove its line. A list with an error changes nothing
//! that is shown; the log and the panel name the line. `remove_floaters` is such an error, because it needs the
//! training cameras.
//!
//! With `--headless FOLDER`, or without a display, it writes N (8) pictures to FOLDER (`out`) instead, without the
//! panel.

mod common;
#[path = "common/controls.rs"]
mod controls;
#[path = "play/drop.rs"]
mod drop;
#[path = "play/edits.rs"]
mod edits;
#[path = "play/live.rs"]
mod live;
#[path = "play/stamp.rs"]
mod stamp;

use bevy::asset::UnapprovedPathMode;
use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::input::mouse::AccumulatedMouseMotion;
use bevy::prelude::*;
use bevy::time::common_conditions::on_real_timer;
use bevy::window::PrimaryWindow;
use bevy_egui::input::{egui_wants_any_keyboard_input, egui_wants_any_pointer_input};
use bevy_gs4d::Upright;
use bevy_gs4d::asset::GaussianCapture;
use bevy_gs4d::inspector::{Inspector, InspectorPlugin};
use bevy_gs4d::picker::CapturePicker;
use bevy_gs4d::playback::Playback;
use bevy_gs4d::testing::{self, Offscreen};
use bevy_gs4d::{GaussianCapture3d, GaussianCapturePlugins};
use common::Orbit;
use common::arguments::value;
use controls::{follow, mouse};
use drop::drop_file;
use edits::{Edits, apply_edits, look_at_edits};
use live::reload_changed;
use std::path::PathBuf;
use std::time::Duration;

#[derive(Resource)]
struct Capture(PathBuf);

#[derive(Component)]
struct Ball;

/// The small ball at the point that a click hit.
#[derive(Component)]
struct Marker;

/// Maximum motion of the mouse during a click, in pixels.
const CLICK: f32 = 4.0;
/// Time between two looks at the file of the capture, and at that of the edits.
const LOOK_AGAIN: Duration = Duration::from_millis(500);

fn main() -> Result {
    let mut list = None;
    let arguments = controls::arguments("island.gs4d", |option, values| {
        if option == "--edits" {
            list = Some(PathBuf::from(value(option, "a file", values)?));
        }
        Ok(option == "--edits")
    })?;
    let capture = Capture(common::asset_path(&arguments.file));
    let edits = list.map(Edits::of);
    match arguments.headless {
        Some(folder) => {
            let mut app = testing::app(UVec2::new(960, 540));
            scene(&mut app, capture);
            if let Some(edits) = edits {
                app.insert_resource(edits).add_systems(Update, apply_edits);
                wait_for_edits(&mut app)?;
            }
            common::save_pictures(&mut app, arguments.frames, Duration::from_secs_f64(1.0 / 30.0), &folder)
        }
        None => {
            let mut app = App::new();
            // Captures may be dropped from any folder.
            let files = AssetPlugin { unapproved_path_mode: UnapprovedPathMode::Allow, ..default() };
            app.add_plugins(DefaultPlugins.set(files));
            scene(&mut app, capture);
            let keys = keys.run_if(not(egui_wants_any_keyboard_input));
            let mouse = (mouse, pick).run_if(not(egui_wants_any_pointer_input));
            let reload = reload_changed.run_if(on_real_timer(LOOK_AGAIN));
            if let Some(edits) = edits {
                let look = look_at_edits.run_if(on_real_timer(LOOK_AGAIN));
                app.insert_resource(edits).add_systems(Update, (look, apply_edits).chain());
            }
            app.add_plugins(InspectorPlugin).add_systems(Update, (drop_file, keys, mouse, reload).before(follow)).run();
            Ok(())
        }
    }
}

/// Runs the app until its capture is shown with its edits.
///
/// # Errors
/// A capture that cannot be loaded; a list of edits that cannot be read or applied.
fn wait_for_edits(app: &mut App) -> Result {
    loop {
        testing::step(app, Duration::ZERO)?;
        let edits = app.world().resource::<Edits>();
        match edits.fault() {
            Some(fault) => return Err(fault.into()),
            None if edits.is_waiting() => {}
            None => return Ok(()),
        }
    }
}

/// Adds the scene, with or without a window.
fn scene(app: &mut App, capture: Capture) {
    app.add_plugins(GaussianCapturePlugins)
        .insert_resource(capture)
        .insert_resource(ClearColor(Color::srgb(0.06, 0.06, 0.08)))
        .add_systems(Startup, setup)
        .add_systems(Update, (frame_capture, follow).chain());
}

fn setup(
    mut commands: Commands,
    assets: Res<AssetServer>,
    capture: Res<Capture>,
    offscreen: Option<Res<Offscreen>>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    commands.spawn((GaussianCapture3d(assets.load(capture.0.clone())), Upright));
    let sphere = Mesh3d(meshes.add(Sphere::new(1.0).mesh().uv(48, 24)));
    let violet = materials.add(StandardMaterial::from(Color::srgb(0.45, 0.25, 0.8)));
    commands.spawn((Ball, sphere.clone(), MeshMaterial3d(violet), Visibility::Hidden));
    let yellow = StandardMaterial { unlit: true, ..StandardMaterial::from(Color::srgb(1.0, 0.85, 0.1)) };
    commands.spawn((Marker, sphere, MeshMaterial3d(materials.add(yellow)), Visibility::Hidden));
    commands.spawn((
        DirectionalLight { illuminance: 4000.0, ..default() },
        Transform::from_xyz(2.0, 4.0, 3.0).looking_at(Vec3::ZERO, Vec3::Y),
    ));
    let mut camera = commands.spawn((
        Camera3d::default(),
        // Captures need no multisampling.
        Msaa::Off,
        // The capture keeps its trained colors.
        Tonemapping::None,
        Orbit { center: Vec3::ZERO, distance: 4.0, yaw: 0.6, pitch: 0.3 },
    ));
    if let Some(offscreen) = offscreen {
        camera.insert(offscreen.target());
    }
}

/// Points the camera at a newly loaded capture, and places the ball at its center.
fn frame_capture(
    captures: Res<Assets<GaussianCapture>>,
    mut framed: Local<Option<AssetId<GaussianCapture>>>,
    capture: Single<&GaussianCapture3d>,
    mut orbit: Single<&mut Orbit>,
    ball: Single<(&mut Transform, &mut Visibility), With<Ball>>,
) {
    let Some(loaded) = captures.get(&capture.0).filter(|_| *framed != Some(capture.0.id())) else { return };
    *framed = Some(capture.0.id());
    **orbit = Orbit::around(loaded);
    let (mut place, mut visibility) = ball.into_inner();
    *place = Transform::from_translation(orbit.center).with_scale(Vec3::splat(orbit.distance * 0.08));
    *visibility = Visibility::Visible;
}

fn keys(
    keys: Res<ButtonInput<KeyCode>>,
    captures: Res<Assets<GaussianCapture>>,
    inspector: Res<Inspector>,
    player: Single<(&GaussianCapture3d, &mut Playback)>,
) {
    let (handle, mut playback) = player.into_inner();
    if keys.just_pressed(KeyCode::Space) {
        playback.toggle();
    }
    let steps = i32::from(keys.just_pressed(KeyCode::ArrowRight)) - i32::from(keys.just_pressed(KeyCode::ArrowLeft));
    if steps != 0
        && let Some(capture) = captures.get(&handle.0)
    {
        playback.step(steps, inspector.fps, capture.duration_seconds());
    }
}

/// Marks the point that a click hits, and shows the Gaussian's number in the panel.
fn pick(
    buttons: Res<ButtonInput<MouseButton>>,
    motion: Res<AccumulatedMouseMotion>,
    mut dragged: Local<f32>,
    window: Single<&Window, With<PrimaryWindow>>,
    camera: Single<(&Camera, &GlobalTransform)>,
    picker: CapturePicker,
    marker: Single<(&mut Transform, &mut Visibility), (With<Marker>, Without<GaussianCapture3d>)>,
    mut inspector: ResMut<Inspector>,
) {
    if buttons.just_pressed(MouseButton::Left) {
        *dragged = 0.0;
    }
    *dragged += motion.delta.length();
    if !buttons.just_released(MouseButton::Left) || *dragged > CLICK {
        return;
    }
    let (camera, pose) = camera.into_inner();
    let ray = window.cursor_position().and_then(|cursor| camera.viewport_to_world(pose, cursor).ok());
    let (mut place, mut visibility) = marker.into_inner();
    let Some(hit) = ray.and_then(|ray| picker.cast(ray)) else {
        *visibility = Visibility::Hidden;
        inspector.note = "no Gaussian at this point".into();
        return;
    };
    *visibility = Visibility::Visible;
    *place = Transform::from_translation(hit.point).with_scale(Vec3::splat(hit.distance * 0.008));
    inspector.note = format!("Gaussian {}, {:.2} away", hit.gaussian, hit.distance);
}
