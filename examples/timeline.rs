//! One capture twice and a flying ball, directed by a timeline: `assets/demo.timeline.ron` defines when captures play,
//! fade and reverse, and the ball's animation follows the same playhead. The file is reloaded when it changes.
//!
//! ```text
//! cargo run --release --features viewer --example timeline -- [TIMELINE] [--headless FOLDER] [--frames N]
//! ```
//!
//! * click or drag in the panel below: scrub. Bars are clips (red: backwards), their cut corners are fades, short marks
//!   are key-frames of captures and of the ball's animation, and flags are markers
//! * space: play and pause; left and right: a 30th of a second back and forward; R: reverse; Home: to the start. The
//!   panel has buttons for the same actions
//! * drag elsewhere with the left button: orbit; wheel: nearer and farther
//!
//! With `--headless FOLDER`, or without a display, it writes N (8) pictures, a 30th of a second apart, to FOLDER
//! (`out`) instead.

#[path = "timeline/chart.rs"]
mod chart;
mod common;
#[path = "common/controls.rs"]
mod controls;

use bevy::animation::{AnimatedBy, AnimationTargetId, animated_field};
use bevy::asset::UnapprovedPathMode;
use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::prelude::*;
use bevy_egui::input::{egui_wants_any_keyboard_input, egui_wants_any_pointer_input};
use bevy_egui::{EguiContexts, EguiPlugin, EguiPrimaryContextPass, egui};
use bevy_gs4d::playback::{MarkerReached, PlaybackSystems, Timeline, TimelinePlayer, TimelineTrack};
use bevy_gs4d::prelude::*;
use bevy_gs4d::testing;
use chart::Chart;
use common::Orbit;
use controls::{follow, mouse};
use std::path::PathBuf;
use std::time::Duration;

/// The asset path of the timeline.
#[derive(Resource)]
struct Show(PathBuf);

/// The name of the last marker, for the panel.
#[derive(Resource, Default)]
struct LastMarker(String);

/// The ball and the node of its animation.
#[derive(Component)]
struct Flight(AnimationNodeIndex);

/// Positions of the ball at its key-frames.
const WAY: [Vec3; 4] =
    [Vec3::new(-1.5, 0.9, 0.6), Vec3::new(0.0, 0.4, -0.8), Vec3::new(1.5, 0.9, 0.6), Vec3::new(0.0, 1.2, 1.0)];
/// Duration of the ball's loop, in seconds.
const FLIGHT_SECONDS: f32 = 4.0;
/// Pictures, and manual steps, per second.
const FPS: f32 = 30.0;
/// Maximum number of marked key-frames, since a timeline may have any length.
const MOST_MARKS: u32 = 1000;

fn main() -> Result {
    let arguments = controls::arguments("demo.timeline.ron", |_, _| Ok(false))?;
    let show = Show(common::asset_path(&arguments.file));
    match arguments.headless {
        Some(folder) => {
            let mut app = testing::app(UVec2::new(960, 540));
            scene(&mut app, show);
            common::save_pictures(&mut app, arguments.frames, Duration::from_secs_f32(FPS.recip()), &folder)
        }
        None => {
            let mut app = App::new();
            // A timeline may be in any folder.
            let files = AssetPlugin { unapproved_path_mode: UnapprovedPathMode::Allow, ..default() };
            app.add_plugins((DefaultPlugins.set(files), EguiPlugin::default()));
            scene(&mut app, show);
            let keys = keys.run_if(not(egui_wants_any_keyboard_input));
            let mouse = mouse.run_if(not(egui_wants_any_pointer_input));
            app.add_systems(Update, (keys.before(PlaybackSystems::Timelines), mouse.before(follow)))
                .add_systems(EguiPrimaryContextPass, panel);
            app.run();
            Ok(())
        }
    }
}

/// Adds the scene, with or without a window.
fn scene(app: &mut App, show: Show) {
    app.add_plugins(GaussianCapturePlugins)
        .insert_resource(show)
        .init_resource::<LastMarker>()
        .insert_resource(ClearColor(Color::srgb(0.06, 0.06, 0.08)))
        .add_systems(Startup, (setup, setup_ball))
        .add_systems(Update, ((fly, report).after(PlaybackSystems::Timelines), (arrange, follow).chain()));
}

fn setup(mut commands: Commands, assets: Res<AssetServer>, show: Res<Show>) {
    let timeline = TimelinePlayer(assets.load(show.0.clone()));
    // The tracks are spawned here to give them transforms; otherwise the player would spawn them.
    commands.spawn((timeline, children![TimelineTrack("left".into()), TimelineTrack("right".into())]));
    commands.spawn((
        DirectionalLight { illuminance: 4000.0, ..default() },
        Transform::from_xyz(2.0, 4.0, 3.0).looking_at(Vec3::ZERO, Vec3::Y),
    ));
    commands.spawn((
        Camera3d::default(),
        // Captures need no multisampling. With multisampling, opaque meshes such as the ball would hide captures per
        // sample.
        Msaa::Off,
        // Captures keep their trained colors.
        Tonemapping::None,
        Orbit { center: Vec3::ZERO, distance: 4.0, yaw: 0.3, pitch: 0.3 },
    ));
}

/// Spawns a ball with one of Bevy's animations.
fn setup_ball(
    mut commands: Commands,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
    mut clips: ResMut<Assets<AnimationClip>>,
    mut graphs: ResMut<Assets<AnimationGraph>>,
) -> Result {
    let target = AnimationTargetId::from_name(&Name::new("ball"));
    let stops = (0..=WAY.len()).map(|stop| (stop as f32 / WAY.len() as f32 * FLIGHT_SECONDS, WAY[stop % WAY.len()]));
    let mut clip = AnimationClip::default();
    let curve = AnimatableKeyframeCurve::new(stops)?;
    clip.add_curve_to_target(target, AnimatableCurve::new(animated_field!(Transform::translation), curve));
    let (graph, node) = AnimationGraph::from_clip(clips.add(clip));
    let mut player = AnimationPlayer::default();
    // The timeline's clock sets its time.
    player.play(node).pause();
    let ball = commands
        .spawn((
            Flight(node),
            Mesh3d(meshes.add(Sphere::new(0.12).mesh().uv(48, 24))),
            MeshMaterial3d(materials.add(StandardMaterial::from(Color::srgb(0.45, 0.25, 0.8)))),
            (target, player, AnimationGraphHandle(graphs.add(graph))),
        ))
        .id();
    commands.entity(ball).insert(AnimatedBy(ball));
    Ok(())
}

/// Sets the time of the ball's animation to the timeline's clock.
fn fly(clock: Single<&PlaybackClock, With<TimelinePlayer>>, ball: Single<(&mut AnimationPlayer, &Flight)>) {
    let (mut player, flight) = ball.into_inner();
    if let Some(animation) = player.animation_mut(flight.0) {
        animation.set_seek_time(clock.seconds.rem_euclid(FLIGHT_SECONDS.into()) as f32);
    }
}

fn report(mut markers: MessageReader<MarkerReached>, mut last: ResMut<LastMarker>) {
    for marker in markers.read() {
        info!("marker: {}", marker.name);
        last.0.clone_from(&marker.name);
    }
}

/// Places the captures side by side, upright, and points the camera at both, once the first capture is loaded.
fn arrange(
    captures: Res<Assets<GaussianCapture>>,
    mut tracks: Query<(&TimelineTrack, &GaussianCapture3d, &mut Transform)>,
    mut orbit: Single<&mut Orbit>,
    mut arranged: Local<bool>,
) {
    let Some(loaded) = tracks.iter().find_map(|(_, capture, _)| captures.get(&capture.0)).filter(|_| !*arranged) else {
        return;
    };
    *arranged = true;
    let alone = Orbit::around(loaded);
    let apart = alone.distance * 0.3;
    for (track, _, mut transform) in &mut tracks {
        transform.rotation = loaded.upright();
        transform.translation = Vec3::X * if track.0 == "left" { -apart } else { apart };
    }
    **orbit = Orbit { distance: alone.distance * 1.3, yaw: 0.3, ..alone };
}

fn keys(
    keys: Res<ButtonInput<KeyCode>>,
    timelines: Res<Assets<Timeline>>,
    player: Single<(&TimelinePlayer, &mut Playback)>,
) {
    let (handle, mut playback) = player.into_inner();
    if keys.just_pressed(KeyCode::Space) {
        playback.toggle();
    }
    if keys.just_pressed(KeyCode::KeyR) {
        playback.reverse();
    }
    if keys.just_pressed(KeyCode::Home) {
        playback.seek(0.0);
    }
    let steps = i32::from(keys.just_pressed(KeyCode::ArrowRight)) - i32::from(keys.just_pressed(KeyCode::ArrowLeft));
    if steps != 0
        && let Some(timeline) = timelines.get(&handle.0)
    {
        playback.step(steps, FPS, timeline.duration_seconds());
    }
}

fn panel(
    mut contexts: EguiContexts,
    assets: Res<AssetServer>,
    timelines: Res<Assets<Timeline>>,
    captures: Res<Assets<GaussianCapture>>,
    marker: Res<LastMarker>,
    player: Single<(&TimelinePlayer, &mut Playback)>,
) -> Result {
    let (handle, mut playback) = player.into_inner();
    let window = egui::Window::new("timeline").title_bar(false).resizable(false);
    window.anchor(egui::Align2::CENTER_BOTTOM, [0.0, -12.0]).show(contexts.ctx_mut()?, |ui| {
        let Some(timeline) = timelines.get(&handle.0) else {
            let failed = assets.load_state(&handle.0).is_failed();
            ui.label(if failed { "the timeline cannot be read; the log has the reason" } else { "loading ..." });
            return;
        };
        ui.horizontal(|ui| {
            if ui.button("to the start").clicked() {
                playback.seek(0.0);
            }
            if ui.button("back").clicked() {
                playback.step(-1, FPS, timeline.duration_seconds());
            }
            if ui.button(if playback.playing { "pause" } else { "play" }).clicked() {
                playback.toggle();
            }
            if ui.button("forward").clicked() {
                playback.step(1, FPS, timeline.duration_seconds());
            }
            if ui.button("reverse").clicked() {
                playback.reverse();
            }
            ui.label(format!("{:.2} s of {:.2} s", playback.time, timeline.duration_seconds()));
            ui.label(format!("last marker: {}", marker.0));
        });
        let chart = Chart { timeline, captures: &captures, animation: ("ball", &flight_key_frames(timeline)) };
        if let Some(sought) = chart.show(ui, playback.time) {
            playback.seek(sought);
        }
    });
    Ok(())
}

/// Returns the times of the ball's key-frames, in seconds of the timeline.
fn flight_key_frames(timeline: &Timeline) -> Vec<f32> {
    let spacing = FLIGHT_SECONDS / WAY.len() as f32;
    let count = (timeline.duration_seconds() / spacing) as u32;
    (0..=count.min(MOST_MARKS)).map(|index| index as f32 * spacing).collect()
}
