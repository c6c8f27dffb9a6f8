//! Two captures and a flying ball, cut together by a timeline: the captures come, fade, turn round and go as
//! `assets/demo.timeline.ron` says, and the ball's own animation keeps to the same playhead. Change the file and start again to
//! direct them otherwise.
//!
//! ```text
//! cargo run --release --features viewer --example timeline -- [TIMELINE] [--headless FOLDER] [--frames N]
//! ```
//!
//! * drag in the panel below: scrub; its bars are clips, the short marks in them key-frames, the flags markers
//! * space: play and pause; left and right: a 30th of a second back and on; R: turn round
//! * drag elsewhere with the left button: go round; wheel: nearer and farther
//!
//! With `--headless FOLDER`, or where there is no display, it writes N (8) pictures, a quarter of a second apart, to FOLDER (`out`)
//! instead.

mod common;
#[path = "common/controls.rs"]
mod controls;

use bevy::animation::{AnimatedBy, AnimationTargetId, animated_field};
use bevy::asset::UnapprovedPathMode;
use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::prelude::*;
use bevy_egui::input::{egui_wants_any_keyboard_input, egui_wants_any_pointer_input};
use bevy_egui::{EguiContexts, EguiPlugin, EguiPrimaryContextPass, egui};
use bevy_gs4d::playback::{Clip, PlaybackSystems};
use bevy_gs4d::prelude::*;
use common::{Orbit, offscreen};
use controls::{follow, mouse};
use std::path::PathBuf;
use std::time::Duration;

/// The timeline to play.
#[derive(Resource)]
struct Show(PathBuf);

/// What the panel says of markers.
#[derive(Resource, Default)]
struct LastMarker(String);

/// The ball and the node of its animation.
#[derive(Component)]
struct Flight(AnimationNodeIndex);

/// Seconds after which the ball is where it began.
const FLIGHT_SECONDS: f32 = 4.0;

fn main() -> Result {
    let arguments = controls::arguments("demo.timeline.ron")?;
    let show = Show(common::asset_path(&arguments.file));
    match arguments.headless {
        Some(folder) => {
            let mut app = offscreen::app(UVec2::new(960, 540));
            scene(&mut app, show);
            common::save_pictures(&mut app, arguments.frames, Duration::from_millis(250), &folder)
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

/// What is shown with and without a window.
fn scene(app: &mut App, show: Show) {
    app.add_plugins(GaussianCapturePlugin)
        .insert_resource(show)
        .init_resource::<LastMarker>()
        .insert_resource(ClearColor(Color::srgb(0.06, 0.06, 0.08)))
        .add_systems(Startup, (setup, setup_ball))
        .add_systems(Update, ((fly, report).after(PlaybackSystems::Timelines), (arrange, follow).chain()));
}

fn setup(
    mut commands: Commands,
    assets: Res<AssetServer>,
    show: Res<Show>,
    offscreen: Option<Res<offscreen::Offscreen>>,
) {
    let timeline = TimelinePlayer(assets.load(show.0.clone()));
    // The tracks are spawned here so that they can be placed; without them the player would spawn its own.
    commands.spawn((timeline, children![TimelineTrack("left".into()), TimelineTrack("right".into())]));
    commands.spawn((
        DirectionalLight { illuminance: 4000.0, ..default() },
        Transform::from_xyz(2.0, 4.0, 3.0).looking_at(Vec3::ZERO, Vec3::Y),
    ));
    let mut camera = commands.spawn((
        Camera3d::default(),
        // Meshes hide what is behind them only without multisampling.
        Msaa::Off,
        // Colours of the captures as trained.
        Tonemapping::None,
        Orbit { center: Vec3::ZERO, distance: 4.0, yaw: 0.3, pitch: 0.3 },
    ));
    if let Some(offscreen) = offscreen {
        camera.insert(offscreen.target());
    }
}

/// A ball whose way is one of Bevy's animations.
fn setup_ball(
    mut commands: Commands,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
    mut clips: ResMut<Assets<AnimationClip>>,
    mut graphs: ResMut<Assets<AnimationGraph>>,
) -> Result {
    let target = AnimationTargetId::from_name(&Name::new("ball"));
    let way =
        [Vec3::new(-1.5, 0.9, 0.6), Vec3::new(0.0, 0.4, -0.8), Vec3::new(1.5, 0.9, 0.6), Vec3::new(0.0, 1.2, 1.0)];
    let stops = (0..=way.len()).map(|stop| (stop as f32 / way.len() as f32 * FLIGHT_SECONDS, way[stop % way.len()]));
    let mut clip = AnimationClip::default();
    let curve = AnimatableKeyframeCurve::new(stops)?;
    clip.add_curve_to_target(target, AnimatableCurve::new(animated_field!(Transform::translation), curve));
    let (graph, node) = AnimationGraph::from_clip(clips.add(clip));
    let mut player = AnimationPlayer::default();
    // The timeline moves it.
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

/// Keeps the ball to the timeline's clock.
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

/// Puts the captures side by side, upright, and looks at both, as soon as one has been loaded.
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
    let steps = i32::from(keys.just_pressed(KeyCode::ArrowRight)) - i32::from(keys.just_pressed(KeyCode::ArrowLeft));
    if steps != 0
        && let Some(timeline) = timelines.get(&handle.0)
    {
        playback.step(steps, 30.0, timeline.duration_seconds());
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
            ui.label(if failed { "not a timeline that can be read; the log says why" } else { "loading ..." });
            return;
        };
        ui.horizontal(|ui| {
            if ui.button(if playback.playing { "pause" } else { "play" }).clicked() {
                playback.toggle();
            }
            if ui.button("turn round").clicked() {
                playback.reverse();
            }
            ui.label(format!("{:.2} s of {:.2} s", playback.time, timeline.duration_seconds()));
            ui.label(format!("last marker: {}", marker.0));
        });
        if let Some(sought) = chart(ui, timeline, &captures, playback.time) {
            playback.seek(sought);
        }
    });
    Ok(())
}

const LABELS: f32 = 56.0;
const ROW: f32 = 26.0;

/// Draws the timeline, and returns the moment that is pointed at while a button is down.
fn chart(ui: &mut egui::Ui, timeline: &Timeline, captures: &Assets<GaussianCapture>, time: f32) -> Option<f32> {
    let rows = timeline.tracks().len() as f32;
    let size = egui::vec2(720.0, ROW * (rows + 1.0));
    let (response, painter) = ui.allocate_painter(size, egui::Sense::click_and_drag());
    let bounds = response.rect;
    let (left, duration) = (bounds.left() + LABELS, timeline.duration_seconds().max(f32::MIN_POSITIVE));
    let width = bounds.width() - LABELS - 4.0;
    let x = |seconds: f32| left + width * seconds / duration;
    let (font, ink) = (egui::FontId::proportional(12.0), ui.visuals().text_color());
    for (row, track) in timeline.tracks().iter().enumerate() {
        let top = bounds.top() + ROW * (row as f32 + 1.0);
        let middle = egui::pos2(bounds.left(), top + ROW / 2.0);
        painter.text(middle, egui::Align2::LEFT_CENTER, &track.name, font.clone(), ink);
        for clip in &track.clips {
            let bar = egui::Rect::from_x_y_ranges(x(clip.start)..=x(clip.end()), top + 2.0..=top + ROW - 2.0);
            let color = if clip.speed < 0.0 { egui::Color32::DARK_RED } else { egui::Color32::DARK_BLUE };
            painter.rect_filled(bar, 3.0, color);
            for moment in key_frames(clip, captures) {
                painter.vline(x(moment), bar.center().y..=bar.bottom(), (1.0, egui::Color32::LIGHT_YELLOW));
            }
        }
    }
    for marker in timeline.markers() {
        painter.vline(x(marker.time), bounds.y_range(), (1.0, egui::Color32::GREEN));
        let flag = egui::pos2(x(marker.time) + 3.0, bounds.top());
        painter.text(flag, egui::Align2::LEFT_TOP, &marker.name, font.clone(), egui::Color32::GREEN);
    }
    painter.vline(x(time), bounds.y_range(), (2.0, egui::Color32::WHITE));
    let pointer = response.interact_pointer_pos()?;
    Some(((pointer.x - left) / width * duration).clamp(0.0, duration))
}

/// When a clip shows key-frames of its capture, in seconds of the timeline.
fn key_frames(clip: &Clip, captures: &Assets<GaussianCapture>) -> Vec<f32> {
    let [first, last] = clip.range;
    let Some(key_frames) = captures.get(&clip.capture).and_then(|capture| capture.key_frames()) else {
        return Vec::new();
    };
    let begin = if clip.speed < 0.0 { last } else { first };
    let shown = key_frames.times().filter(|time| (first..=last).contains(time));
    shown.map(|time| clip.start + (time - begin) / clip.speed).collect()
}
