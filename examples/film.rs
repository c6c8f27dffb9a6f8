//! Films a scene of meshes as a dataset for training: a ball circles a block under a sun.
//!
//! ```text
//! cargo run --release --features viewer --example film -- [FOLDER] [--cameras N] [--times N] [--size PIXELS]
//! gs4d train --data FOLDER
//! ```
//!
//! Defaults: the folder `dataset`, 40 cameras on a hemisphere, 12 times over two seconds, square pictures of 400 pixels.

use bevy::prelude::*;
use bevy_gs4d::testing::{self, Film, HoldOut, Rig};
use std::f32::consts::TAU;
use std::io::Write;

const SECONDS: f32 = 2.0;

#[derive(Component)]
struct Ball;

fn main() -> Result {
    let (mut folder, [mut cameras, mut times, mut size]) = (None, [40, 12, 400]);
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        let number = match argument.as_str() {
            "--cameras" => &mut cameras,
            "--times" => &mut times,
            "--size" => &mut size,
            option if option.starts_with('-') => {
                return Err(format!("{option}: the options are --cameras, --times and --size").into());
            }
            _ if folder.is_some() => return Err(format!("{argument}: more than one folder; name one").into()),
            _ => {
                folder = Some(argument);
                continue;
            }
        };
        let text = arguments.next().ok_or_else(|| format!("{argument} needs a number"))?;
        *number = text.parse::<u32>().map_err(|_| format!("{argument} {text}: not a number"))?;
    }
    let folder = folder.unwrap_or_else(|| "dataset".into());

    let mut app = testing::app(UVec2::splat(64));
    app.add_systems(Startup, setup);
    let rig = Rig::hemisphere(Vec3::Y * 0.3, 5.0, cameras as usize);
    let moments = (0..times).map(|time| SECONDS * time as f32 / times.saturating_sub(1).max(1) as f32);
    let mut film = Film::new(rig, moments.collect());
    film.size = UVec2::splat(size);
    // Every fourth time is for the test as well.
    film.hold_out = HoldOut { test_times: 4, ..HoldOut::default() };
    let filmed = testing::film(&mut app, &film, folder.as_ref(), place_ball, |done, all| {
        print!("\r{done} of {all} pictures");
        // A line that is not shown is no reason to stop.
        std::io::stdout().flush().ok();
    })?;
    let testing::Filmed { train, validation, test } = filmed;
    println!("\n{folder}: {train} pictures for training, {validation} for validation, {test} for the test");
    Ok(())
}

fn setup(mut commands: Commands, mut meshes: ResMut<Assets<Mesh>>, mut materials: ResMut<Assets<StandardMaterial>>) {
    let sun = DirectionalLight { shadow_maps_enabled: true, illuminance: 6000.0, ..default() };
    commands.spawn((sun, Transform::from_xyz(2.0, 4.0, 1.0).looking_at(Vec3::ZERO, Vec3::Y)));
    commands.spawn((
        Mesh3d(meshes.add(Cuboid::new(1.0, 0.8, 1.0))),
        MeshMaterial3d(materials.add(Color::srgb(0.2, 0.45, 0.8))),
    ));
    commands.spawn((
        Ball,
        Mesh3d(meshes.add(Sphere::new(0.3))),
        MeshMaterial3d(materials.add(Color::srgb(0.85, 0.3, 0.15))),
        Transform::default(),
    ));
}

/// Moves the ball to its place at a time in seconds.
fn place_ball(world: &mut World, seconds: f32) {
    let (sin, cos) = (TAU * seconds / SECONDS).sin_cos();
    let mut balls = world.query_filtered::<&mut Transform, With<Ball>>();
    for mut ball in balls.iter_mut(world) {
        ball.translation = Vec3::new(1.1 * cos, 0.5, 1.1 * sin);
    }
}
