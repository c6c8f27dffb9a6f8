//! Props on sockets: a hat on each socket of a capture, and on points that are followed when it starts.
//!
//! ```text
//! cargo run --release --features viewer,cli --example sockets -- [CAPTURE] [--place X,Y,Z,T]... [--headless FOLDER]
//!     [--frames N]
//! ```
//!
//! The hats on sockets that the package has, as `gs4d socket` places them, are yellow. Each `--place` adds a violet one
//! on what is at the point X,Y,Z of the capture at the time T, a timestamp. Without a capture, the lanterns of the
//! bundled island have hats, and a stone at the fire. A hat vanishes while its socket is lost, and a violet one when
//! the file is loaded again.
//!
//! There are no keys. With `--headless FOLDER`, or without a display, it writes N (8) pictures, half a second apart, to
//! FOLDER (`out`) instead.

mod common;

use bevy::asset::UnapprovedPathMode;
use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::prelude::*;
use bevy::tasks::futures::check_ready;
use bevy::tasks::{AsyncComputeTaskPool, Task};
use bevy_gs4d::offline::sockets::{Placement, follow};
use bevy_gs4d::offline::work::NoProgress;
use bevy_gs4d::playback::SocketState;
use bevy_gs4d::prelude::*;
use bevy_gs4d::scene::{GaussianScene, RuntimeScene, Socket};
use bevy_gs4d::testing;
use common::{Orbit, arguments};
use std::path::PathBuf;
use std::time::Duration;

/// Points of the bundled island with their time: the tops of two lanterns, and a stone at the fire.
const ISLAND: [[f32; 4]; 3] = [[0.056, 0.545, -0.018, 0.5], [0.33, 0.546, -0.015, 0.5], [0.546, 0.085, 0.568, 0.5]];
/// Height of a hat, as a part of the distance of the camera.
const HEIGHT: f32 = 0.045;
/// Samples of the track of a point a second.
const RATE: f32 = 60.0;

/// What is shown, and the points that get a socket.
#[derive(Resource)]
struct Show {
    capture: PathBuf,
    points: Vec<[f32; 4]>,
    /// The capture with its new sockets, while they are followed: for seconds, in which the app goes on.
    following: Option<Task<std::result::Result<RuntimeScene, String>>>,
    /// Whether the hats are on; an error is why not.
    outcome: Option<std::result::Result<(), String>>,
}

fn main() -> Result {
    let defaults = arguments::Arguments { file: String::new(), headless: None, frames: 8 };
    let mut points = Vec::new();
    let arguments = arguments::parse(defaults, |option, rest| {
        if option == "--place" {
            points.push(point(&arguments::value(option, "X,Y,Z,T", rest)?)?);
        }
        Ok(option == "--place")
    })?;
    let mut capture = arguments.file.as_str();
    if capture.is_empty() {
        capture = "island.gs4d";
        points.extend(ISLAND);
    }
    let show = Show { capture: common::asset_path(capture), points, following: None, outcome: None };
    if let Some(folder) = arguments.headless {
        let mut app = testing::app(UVec2::new(960, 540));
        scene(&mut app, show);
        wait_for_hats(&mut app)?;
        return common::save_pictures(&mut app, arguments.frames, Duration::from_millis(500), &folder);
    }
    let mut app = App::new();
    // A capture may be in any folder.
    let files = AssetPlugin { unapproved_path_mode: UnapprovedPathMode::Allow, ..default() };
    app.add_plugins(DefaultPlugins.set(files));
    scene(&mut app, show);
    app.run();
    Ok(())
}

/// Returns a point and its time.
///
/// # Errors
/// A text that is not four numbers.
fn point(text: &str) -> Result<[f32; 4]> {
    let numbers: Option<Vec<f32>> = text.split(',').map(|number| number.trim().parse().ok()).collect();
    let point = numbers.and_then(|numbers| numbers.try_into().ok());
    Ok(point.ok_or_else(|| format!("--place {text}: not three coordinates and a timestamp, X,Y,Z,T"))?)
}

/// Adds the scene, with or without a window.
fn scene(app: &mut App, show: Show) {
    app.add_plugins(GaussianCapturePlugins)
        .insert_resource(show)
        .insert_resource(ClearColor(Color::srgb(0.06, 0.06, 0.08)))
        .add_systems(Startup, setup)
        .add_systems(Update, (put_on_hats, hide_lost));
}

/// Runs the app until the hats are on.
///
/// # Errors
/// A capture that cannot be loaded, a point that cannot be followed, a capture without sockets.
fn wait_for_hats(app: &mut App) -> Result {
    loop {
        testing::step(app, Duration::ZERO)?;
        if let Some(outcome) = &app.world().resource::<Show>().outcome {
            return Ok(outcome.clone()?);
        }
    }
}

fn setup(mut commands: Commands, assets: Res<AssetServer>, show: Res<Show>) {
    commands.spawn((GaussianCapture3d(assets.load(show.capture.clone())), Upright));
    commands.spawn((Camera3d::default(), Msaa::Off, Tonemapping::None));
    commands.spawn((
        DirectionalLight { illuminance: 4000.0, ..default() },
        Transform::from_xyz(2.0, 4.0, 3.0).looking_at(Vec3::ZERO, Vec3::Y),
    ));
}

/// Gives a capture that has been loaded its new sockets, and a hat for each, and points the camera at it.
fn put_on_hats(
    mut commands: Commands,
    mut show: ResMut<Show>,
    mut captures: ResMut<Assets<GaussianCapture>>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
    stage: Single<(Entity, &GaussianCapture3d)>,
    camera: Single<(&mut Transform, &mut Projection), With<Camera3d>>,
) {
    let Some(loaded) = captures.get(&stage.1.0).filter(|_| show.outcome.is_none()) else { return };
    let orbit = Orbit::around(loaded);
    let (mut place, mut lens) = camera.into_inner();
    orbit.place(&mut place, &mut lens);
    let mut following = show.following.take().unwrap_or_else(|| {
        let (scene, points) = (loaded.scene().clone(), show.points.clone());
        AsyncComputeTaskPool::get().spawn(async move { with_sockets(&scene, &points) })
    });
    let scene = match check_ready(&mut following) {
        None => {
            show.following = Some(following);
            return;
        }
        Some(Ok(scene)) => scene,
        Some(Err(fault)) => {
            let fault = format!("{}: {fault}", show.capture.display());
            error!("{fault}");
            show.outcome = Some(Err(fault));
            return;
        }
    };
    let height = HEIGHT * orbit.distance;
    let cone = meshes.add(Cone { radius: 0.4 * height, height });
    let [yellow, violet] = [(0.95, 0.75, 0.1), (0.45, 0.05, 0.85)].map(|(r, g, b)| materials.add(Color::srgb(r, g, b)));
    // Sockets are in the space of the capture, which may have another axis up.
    let turn = loaded.upright().inverse();
    let own = loaded.scene().sockets.len();
    for (index, socket) in scene.sockets.iter().enumerate() {
        let color = if index < own { yellow.clone() } else { violet.clone() };
        let pose = Transform::from_translation(turn * (0.5 * height * Vec3::Y)).with_rotation(turn);
        let hat = (Mesh3d(cone.clone()), MeshMaterial3d(color), pose);
        commands.entity(stage.0).with_child((CaptureSocket::new(&socket.name), children![hat]));
    }
    if let Some(mut asset) = captures.get_mut(&stage.1.0) {
        *asset = GaussianCapture::new(scene);
    }
    show.outcome = Some(Ok(()));
}

/// Returns a capture with a socket for each of these points as well. Games have them in the package.
///
/// # Errors
/// A capture in chunk files, a point that cannot be followed, a capture without sockets: as a sentence.
fn with_sockets(loaded: &RuntimeScene, points: &[[f32; 4]]) -> std::result::Result<RuntimeScene, String> {
    if loaded.chunks.is_some() {
        return Err("is in chunk files: name the capture that gs4d split has cut".into());
    }
    let mut scene = loaded.clone();
    let whole = GaussianScene::from(loaded.clone());
    let samples = ((RATE * loaded.playback.duration_seconds).ceil() as usize).clamp(1, Socket::MOST_SAMPLES - 2) + 1;
    for &[x, y, z, time] in points {
        let placement = Placement { name: format!("{x},{y},{z} at {time}"), position: [x, y, z], time, samples };
        let followed = follow(&whole, &placement, &mut NoProgress);
        let followed = followed.map_err(|error| format!("the point {x},{y},{z} at {time}: {error}"))?;
        scene.sockets.push(followed.socket);
    }
    if scene.sockets.is_empty() {
        return Err("has no sockets: place one with gs4d socket, or a point with --place X,Y,Z,T".into());
    }
    Ok(scene)
}

/// Hides what is on a socket that is lost.
fn hide_lost(mut sockets: Query<(&SocketState, &mut Visibility), Changed<SocketState>>) {
    for (state, mut visibility) in &mut sockets {
        let is_tracked = matches!(state, SocketState::Tracked { .. });
        *visibility = if is_tracked { Visibility::Inherited } else { Visibility::Hidden };
    }
}
