//! Walks around a capture as in virtual reality: both eyes side by side, a body that walks and teleports, and a
//! vignette that closes while the body moves, against motion sickness.
//!
//! ```text
//! cargo run --release --features viewer --example walkthrough -- \
//!     [CAPTURE] [--path FILE] [--two-targets] [--headless FOLDER] [--frames N]
//! ```
//!
//! * drag with the left button: look around; W, A, S, D: walk; Q and E: turn by 30 degrees in one step
//! * hold T or the right button: aim at the floor; release: teleport there
//! * V: vignette on and off; I: next distance between the eyes (64, 70, 0 and 58 mm)
//! * P: follow the recorded path, or stop; R: start recording a path; R again: write it to `recorded.path.ron`
//!
//! `--path FILE` follows the path in a file from the start; without it, P follows the path in
//! `assets/walkthrough.path.ron`. With `--two-targets` each eye draws into its own target, and the window shows only
//! the left eye.
//!
//! With `--headless FOLDER`, or without a display, it follows the recorded path and writes N (8) pictures, a 30th of a
//! second apart, to FOLDER (`out`) instead: both eyes in one picture, or with `--two-targets` two pictures for each
//! time.
//!
//! Built with the feature `openxr`, it draws for a headset, which has not been tested: the headset tracks the head, and
//! keys and mouse move the body. Without a headset it prints a message and shows the window.

#[path = "common/arguments.rs"]
mod arguments;
#[path = "walkthrough/body.rs"]
mod body;
#[path = "walkthrough/comfort.rs"]
mod comfort;
#[path = "walkthrough/headset.rs"]
mod headset;
#[path = "walkthrough/path.rs"]
mod path;
#[path = "walkthrough/teleport.rs"]
mod teleport;

use arguments::{Arguments, asset_path, parse, save_pictures, value};
use bevy::asset::UnapprovedPathMode;
use bevy::camera::RenderTarget;
use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::prelude::*;
use bevy_gs4d::asset::GaussianCapture;
use bevy_gs4d::scene::Bounds;
use bevy_gs4d::stereo::{EyeTargets, StereoRig, spawn_stereo};
use bevy_gs4d::testing::{self, Offscreen};
use bevy_gs4d::{GaussianCapture3d, GaussianCapturePlugins};
use body::{Body, EYE_HEIGHT, Head, Moves, START};
use comfort::{Comfort, ComfortPlugin, EyeView};
use path::{HeadPath, PathPlayer, Recorder};
use std::f32::consts::FRAC_PI_2;
use std::path::{Path, PathBuf};
use std::time::Duration;
use teleport::Teleport;

/// Size of the picture of one eye without a window, in pixels.
const EYE: UVec2 = UVec2::new(480, 480);
/// Half of the diagonal to which a capture is scaled, in meters.
const CAPTURE_RADIUS: f32 = 1.5;
/// Time between pictures.
const STEP: Duration = Duration::from_nanos(1_000_000_000 / 30);
/// Distances between the eyes that the key I cycles through, in meters.
const DISTANCES: [f32; 4] = [0.064, 0.070, 0.0, 0.058];

#[derive(Resource)]
struct Capture(PathBuf);

/// The targets of the eyes.
#[derive(Resource)]
struct Targets(EyeTargets);

fn main() -> Result {
    let (mut way, mut two_targets) = (None, false);
    let defaults = Arguments { file: "toybox.gs4d".into(), headless: None, frames: 8 };
    let arguments = parse(defaults, |option, values| {
        match option {
            "--path" => way = Some(PathBuf::from(value(option, "a file", values)?)),
            "--two-targets" => two_targets = true,
            _ => return Ok(false),
        }
        Ok(true)
    })?;
    let path = HeadPath::load(way.as_deref())?;
    let capture = Capture(asset_path(&arguments.file));
    match arguments.headless {
        Some(folder) => {
            let size = if two_targets { EYE } else { EYE * UVec2::new(2, 1) };
            let mut app = testing::app(size);
            scene(&mut app, capture, path, true);
            let right = stand(&mut app, two_targets);
            match right {
                Some(right) => save_pairs(&mut app, &right, arguments.frames, &folder),
                None => save_pictures(&mut app, arguments.frames, STEP, &folder),
            }
        }
        None => {
            let mut app = App::new();
            // A capture may be in any folder.
            let files = AssetPlugin { unapproved_path_mode: UnapprovedPathMode::Allow, ..default() };
            let worn = headset::add_plugins(&mut app, DefaultPlugins.set(files));
            scene(&mut app, capture, path, way.is_some());
            if !worn {
                stand(&mut app, two_targets);
            }
            interact(&mut app);
            app.run();
            Ok(())
        }
    }
}

/// Adds the scene, with or without a window, and the path. `playing`: whether the path is followed from the start.
fn scene(app: &mut App, capture: Capture, path: HeadPath, playing: bool) {
    app.add_plugins((GaussianCapturePlugins, ComfortPlugin))
        .insert_resource(capture)
        .insert_resource(path)
        .insert_resource(PathPlayer { playing, seconds: 0.0 })
        .init_resource::<Teleport>()
        .insert_resource(ClearColor(Color::srgb(0.06, 0.06, 0.08)))
        .add_systems(Startup, (setup, teleport::setup))
        .add_systems(Update, (arrange, path::follow.in_set(Moves)));
}

/// Adds a body with a stereo rig. Returns the target of the right eye if it has a separate one.
fn stand(app: &mut App, two_targets: bool) -> Option<Offscreen> {
    let right = two_targets.then(|| Offscreen::new(&mut app.world_mut().resource_mut::<Assets<Image>>(), EYE));
    let window = RenderTarget::default();
    let targets = match &right {
        Some(right) => EyeTargets::Separate([window, right.target()]),
        None => EyeTargets::SideBySide(window),
    };
    app.insert_resource(Targets(targets)).add_systems(Startup, spawn_body);
    right
}

/// Adds the systems for keys and mouse.
fn interact(app: &mut App) {
    app.init_resource::<Recorder>()
        .add_plugins(teleport::plugin)
        .add_systems(Update, (body::look_around, body::walk, body::snap_turn).in_set(Moves).run_if(path::walking))
        .add_systems(Update, (switches, path::start, path::record).after(Moves));
}

fn setup(
    mut commands: Commands,
    assets: Res<AssetServer>,
    capture: Res<Capture>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    commands.spawn(GaussianCapture3d(assets.load(capture.0.clone())));
    commands.spawn((
        Mesh3d(meshes.add(Circle::new(teleport::FLOOR_RADIUS))),
        MeshMaterial3d(materials.add(StandardMaterial::from(Color::srgb(0.2, 0.2, 0.24)))),
        Transform::from_rotation(Quat::from_rotation_x(-FRAC_PI_2)),
    ));
    commands.spawn((
        DirectionalLight { illuminance: 3000.0, ..default() },
        Transform::from_xyz(2.0, 4.0, 3.0).looking_at(Vec3::ZERO, Vec3::Y),
    ));
}

fn spawn_body(mut commands: Commands, targets: Res<Targets>) {
    let stereo = spawn_stereo(&mut commands, StereoRig::default(), targets.0.clone());
    let lens = PerspectiveProjection { fov: FRAC_PI_2, near: 0.05, ..default() };
    for (index, eye) in stereo.eyes.into_iter().enumerate() {
        commands.entity(eye).insert((EyeView(index), eye_settings(), Projection::Perspective(lens.clone())));
    }
    commands.entity(stereo.head).insert((Head, Transform::from_xyz(0.0, EYE_HEIGHT, 0.0)));
    commands.spawn((Body::default(), START, Visibility::default())).add_child(stereo.head);
}

/// Returns the camera settings of every eye, of the stereo rig or of a headset.
fn eye_settings() -> impl Bundle {
    // Captures need no multisampling, and keep their trained colors.
    (Msaa::Off, Tonemapping::None)
}

/// Places a newly loaded capture on the floor, at a size to walk around.
fn arrange(
    captures: Res<Assets<GaussianCapture>>,
    capture: Single<(&GaussianCapture3d, &mut Transform)>,
    mut arranged: Local<bool>,
) {
    let (handle, mut transform) = capture.into_inner();
    let Some(loaded) = captures.get(&handle.0).filter(|_| !*arranged) else { return };
    *arranged = true;
    let Some(core) = Bounds::core(loaded.scene().iter()) else { return };
    let (turn, scale) = (loaded.upright(), CAPTURE_RADIUS / core.radius().max(1e-9));
    let [low, high] = [core.min, core.max].map(|corner| turn * corner * scale);
    let center = (low + high) / 2.0;
    let place = -Vec3::new(center.x, low.y.min(high.y), center.z);
    *transform = Transform { translation: place, rotation: turn, scale: Vec3::splat(scale) };
}

/// Handles the keys V and I.
fn switches(keys: Res<ButtonInput<KeyCode>>, mut comfort: ResMut<Comfort>, rig: Option<Single<&mut StereoRig>>) {
    if keys.just_pressed(KeyCode::KeyV) {
        comfort.vignette = !comfort.vignette;
    }
    if let Some(mut rig) = rig.filter(|_| keys.just_pressed(KeyCode::KeyI)) {
        let known = DISTANCES.iter().position(|distance| *distance == rig.ipd).unwrap_or(0);
        rig.ipd = DISTANCES[(known + 1) % DISTANCES.len()];
        info!("{} mm between the eyes", rig.ipd * 1e3);
    }
}

/// Renders a pair of pictures for each time, as [`save_pictures`] renders one picture.
fn save_pairs(app: &mut App, right: &Offscreen, count: u32, folder: &Path) -> Result {
    for index in 0..count {
        let step = if index == 0 { Duration::ZERO } else { STEP };
        let pair = [("left", testing::picture(app, step)?), ("right", testing::read(app, right)?)];
        for (eye, picture) in pair {
            testing::save(&picture, &folder.join(format!("{index:04}-{eye}.png")))?;
        }
    }
    println!("{count} pairs of pictures in {}", folder.display());
    Ok(())
}
