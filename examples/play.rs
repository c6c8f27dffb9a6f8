//! Plays a capture in a window, with a lit ball standing in it: what is behind the ball is hidden, what is before it hides it.
//!
//! ```text
//! cargo run --release --features viewer --example play -- [CAPTURE] [--headless FOLDER] [--frames N]
//! ```
//!
//! * drag with the left button: go round; wheel: nearer and farther
//! * space: play and pause; left and right: a 30th of a second back and on
//! * drop a `.gs4d` or `.pth` on the window: play that
//!
//! With `--headless FOLDER`, or where there is no display, it writes N (8) pictures to FOLDER (`out`) instead.

mod common;
#[path = "common/controls.rs"]
mod controls;

use bevy::asset::UnapprovedPathMode;
use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::prelude::*;
use bevy_egui::input::{egui_wants_any_keyboard_input, egui_wants_any_pointer_input};
use bevy_egui::{EguiContexts, EguiPlugin, EguiPrimaryContextPass, egui};
use bevy_gs4d::asset::GaussianCapture;
use bevy_gs4d::playback::Playback;
use bevy_gs4d::render::{GaussianCapture3d, GaussianCapturePlugin};
use common::{Orbit, offscreen};
use controls::{follow, mouse};
use std::path::PathBuf;
use std::time::Duration;

#[derive(Resource)]
struct Capture(PathBuf);

#[derive(Component)]
struct Ball;

fn main() -> Result {
    let arguments = controls::arguments("toybox.gs4d")?;
    let capture = Capture(common::asset_path(&arguments.file));
    match arguments.headless {
        Some(folder) => {
            let mut app = offscreen::app(UVec2::new(960, 540));
            scene(&mut app, capture);
            common::save_pictures(&mut app, arguments.frames, Duration::from_secs_f64(1.0 / 30.0), &folder)
        }
        None => {
            let mut app = App::new();
            // Captures may be dropped from any folder.
            let files = AssetPlugin { unapproved_path_mode: UnapprovedPathMode::Allow, ..default() };
            app.add_plugins((DefaultPlugins.set(files), EguiPlugin::default()));
            scene(&mut app, capture);
            let keys = keys.run_if(not(egui_wants_any_keyboard_input));
            let mouse = mouse.run_if(not(egui_wants_any_pointer_input));
            app.add_systems(Update, (drop_file, keys, mouse).before(follow)).add_systems(EguiPrimaryContextPass, panel);
            app.run();
            Ok(())
        }
    }
}

/// What is shown with and without a window.
fn scene(app: &mut App, capture: Capture) {
    app.add_plugins(GaussianCapturePlugin)
        .insert_resource(capture)
        .insert_resource(ClearColor(Color::srgb(0.06, 0.06, 0.08)))
        .add_systems(Startup, setup)
        .add_systems(Update, (frame_capture, follow).chain());
}

fn setup(
    mut commands: Commands,
    assets: Res<AssetServer>,
    capture: Res<Capture>,
    offscreen: Option<Res<offscreen::Offscreen>>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    commands.spawn(GaussianCapture3d(assets.load(capture.0.clone())));
    commands.spawn((
        Ball,
        Mesh3d(meshes.add(Sphere::new(1.0).mesh().uv(48, 24))),
        MeshMaterial3d(materials.add(StandardMaterial::from(Color::srgb(0.45, 0.25, 0.8)))),
        Visibility::Hidden,
    ));
    commands.spawn((
        DirectionalLight { illuminance: 4000.0, ..default() },
        Transform::from_xyz(2.0, 4.0, 3.0).looking_at(Vec3::ZERO, Vec3::Y),
    ));
    let mut camera = commands.spawn((
        Camera3d::default(),
        // Meshes hide what is behind them only without multisampling.
        Msaa::Off,
        // Colours of the capture as trained.
        Tonemapping::None,
        Orbit { center: Vec3::ZERO, distance: 4.0, yaw: 0.6, pitch: 0.3 },
    ));
    if let Some(offscreen) = offscreen {
        camera.insert(offscreen.target());
    }
}

/// Stands a capture that has just been loaded upright, looks at it, and puts the ball into its middle.
fn frame_capture(
    captures: Res<Assets<GaussianCapture>>,
    mut framed: Local<Option<AssetId<GaussianCapture>>>,
    capture: Single<(&GaussianCapture3d, &mut Transform), Without<Ball>>,
    mut orbit: Single<&mut Orbit>,
    ball: Single<(&mut Transform, &mut Visibility), With<Ball>>,
) {
    let (handle, mut transform) = capture.into_inner();
    let Some(loaded) = captures.get(&handle.0).filter(|_| *framed != Some(handle.0.id())) else { return };
    *framed = Some(handle.0.id());
    transform.rotation = loaded.upright();
    **orbit = Orbit::around(loaded);
    let (mut place, mut visibility) = ball.into_inner();
    *place = Transform::from_translation(orbit.center).with_scale(Vec3::splat(orbit.distance * 0.08));
    *visibility = Visibility::Visible;
}

fn keys(
    keys: Res<ButtonInput<KeyCode>>,
    captures: Res<Assets<GaussianCapture>>,
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
        playback.step(steps, 30.0, capture.duration_seconds());
    }
}

fn drop_file(
    mut drops: MessageReader<FileDragAndDrop>,
    assets: Res<AssetServer>,
    mut capture: Single<(&mut GaussianCapture3d, &mut Playback)>,
) {
    for drop in drops.read() {
        if let FileDragAndDrop::DroppedFile { path_buf, .. } = drop {
            let (shown, playback) = &mut *capture;
            shown.0 = assets.load(path_buf.clone());
            **playback = Playback::default();
        }
    }
}

fn panel(
    mut contexts: EguiContexts,
    assets: Res<AssetServer>,
    captures: Res<Assets<GaussianCapture>>,
    player: Single<(&GaussianCapture3d, &mut Playback)>,
) -> Result {
    let (handle, mut playback) = player.into_inner();
    let window = egui::Window::new("playback").title_bar(false).resizable(false);
    window.anchor(egui::Align2::CENTER_BOTTOM, [0.0, -12.0]).show(contexts.ctx_mut()?, |ui| {
        let Some(capture) = captures.get(&handle.0) else {
            let failed = assets.load_state(&handle.0).is_failed();
            ui.label(if failed { "not a capture that can be read; the log says why" } else { "loading ..." });
            return;
        };
        ui.horizontal(|ui| {
            if ui.button(if playback.playing { "pause" } else { "play" }).clicked() {
                playback.toggle();
            }
            ui.spacing_mut().slider_width = 320.0;
            ui.add(egui::Slider::new(&mut playback.time, 0.0..=capture.duration_seconds()).suffix(" s"));
            ui.spacing_mut().slider_width = 80.0;
            ui.add(egui::Slider::new(&mut playback.speed, -2.0..=2.0).text("speed"));
        });
    });
    Ok(())
}
