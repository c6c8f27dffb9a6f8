//! A window with a capture that plays: everything that is needed, and nothing else.
use bevy::prelude::*;
use bevy_gs4d::render::{GaussianCapture3d, GaussianCapturePlugin};
use std::f32::consts::FRAC_PI_2;

fn main() {
    App::new().add_plugins((DefaultPlugins, GaussianCapturePlugin)).add_systems(Startup, setup).run();
}

fn setup(mut commands: Commands, assets: Res<AssetServer>) {
    commands.spawn((
        GaussianCapture3d(assets.load("toybox.gs4d")),
        // The capture has +z up, Bevy +y.
        Transform::from_rotation(Quat::from_rotation_x(-FRAC_PI_2)),
    ));
    commands.spawn((
        Camera3d::default(),
        // Meshes hide what is behind them only without multisampling.
        Msaa::Off,
        Transform::from_xyz(2.5, 1.5, 3.0).looking_at(Vec3::ZERO, Vec3::Y),
    ));
}
