//! A capture among meshes: fog, glass in front of and behind the capture, and a sun for which the capture casts and
//! receives shadows.
//!
//! ```text
//! cargo run --release --features viewer --example scene -- [CAPTURE] [--headless FOLDER] [--frames N]
//! ```
//!
//! There are no keys. With `--headless FOLDER`, or without a display, it writes N (8) pictures, a 30th of a second
//! apart, to FOLDER (`out`) instead.

#[path = "common/arguments.rs"]
mod arguments;
#[path = "common/show.rs"]
mod show;

use bevy::light::CascadeShadowConfigBuilder;
use bevy::prelude::*;
use bevy_gs4d::pbr::{CastsShadows, ReceivesShadows, ShadowResolution};
use bevy_gs4d::prelude::*;
use std::path::PathBuf;

/// The color of fog and background.
const HAZE: Color = Color::srgb(0.62, 0.7, 0.78);
/// Height of the floor.
const FLOOR: f32 = -0.85;

/// The asset path of the capture on the command line.
#[derive(Resource)]
struct Capture(PathBuf);

fn spawn_capture(mut commands: Commands, assets: Res<AssetServer>, capture: Res<Capture>) {
    commands.spawn((
        GaussianCapture3d(assets.load(capture.0.clone())),
        Upright,
        CastsShadows { resolution: ShadowResolution::Full, ..default() },
        ReceivesShadows::default(),
    ));
}

fn spawn_scene(
    mut commands: Commands,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    // A camera needs no component for captures.
    commands.spawn((
        Camera3d::default(),
        Transform::from_xyz(-2.6, 1.7, 3.2).looking_at(Vec3::Y * 0.05, Vec3::Y),
        DistanceFog { color: HAZE, falloff: FogFalloff::Linear { start: 3.0, end: 14.0 }, ..default() },
        AmbientLight { brightness: 300.0, ..default() },
    ));
    let cascades = CascadeShadowConfigBuilder { num_cascades: 1, maximum_distance: 12.0, ..default() }.build();
    let sun = DirectionalLight { shadow_maps_enabled: true, illuminance: 9000.0, ..default() };
    commands.spawn((sun, cascades, Transform::from_xyz(4.0, 5.0, 1.5).looking_at(Vec3::ZERO, Vec3::Y)));

    let floor = StandardMaterial { base_color: Color::srgb(0.75, 0.72, 0.68), perceptual_roughness: 1.0, ..default() };
    commands.spawn((
        Mesh3d(meshes.add(Plane3d::default().mesh().size(40.0, 40.0))),
        MeshMaterial3d(materials.add(floor)),
        Transform::from_xyz(0.0, FLOOR, 0.0),
    ));
    commands.spawn((
        Mesh3d(meshes.add(Sphere::new(0.45))),
        MeshMaterial3d(materials.add(Color::srgb(0.8, 0.2, 0.15))),
        Transform::from_xyz(1.9, FLOOR + 0.45, 0.2),
    ));
    let pane = meshes.add(Cuboid::new(1.0, 1.4, 0.03));
    let (blue, green) = (Color::srgba(0.1, 0.35, 0.9, 0.4), Color::srgba(0.1, 0.7, 0.3, 0.5));
    for (place, base_color) in [(Vec3::new(-1.0, 0.2, 1.5), blue), (Vec3::new(0.9, 0.0, -1.4), green)] {
        let glass = StandardMaterial { base_color, alpha_mode: AlphaMode::Blend, ..default() };
        commands.spawn((
            Mesh3d(pane.clone()),
            MeshMaterial3d(materials.add(glass)),
            Transform::from_translation(place).with_rotation(Quat::from_rotation_y(-0.5)),
        ));
    }
}

fn main() -> Result {
    show::run(UVec2::new(800, 450), |app, capture| {
        app.insert_resource(Capture(capture)).insert_resource(ClearColor(HAZE));
        app.add_plugins(GaussianCapturePlugins).add_systems(Startup, (spawn_capture, spawn_scene));
    })
}
