//! Films an island of Bevy's own meshes as a dataset for training: cloth in the wind, petals, a fire, and three kinds of light that cast shadows.
//!
//! ```text
//! cargo run --release --features viewer --example film -- [FOLDER] [--cameras N] [--times N] [--size PIXELS] [--between]
//! examples/film/island.sh [FOLDER]
//! ```
//!
//! The script films, trains, bakes and evaluates.
//!
//! Defaults: the folder `dataset`, 32 cameras on a hemisphere, each with its own offset of the shutter, 96 times over four seconds, square
//! pictures of 800 pixels. Every eighth camera is for the test, another eighth for validation. `--between` films the cameras of the test alone,
//! halfway between the times, as pictures that nothing was trained on.

#[path = "film/island.rs"]
mod island;

use bevy::ecs::world::EntityWorldMut;
use bevy::prelude::*;
use bevy_gs4d::testing::{self, Film, Filmed, HoldOut, Rig};
use std::io::Write;

/// The header of this file is the text of `--help`.
const SOURCE: &str = include_str!("film.rs");
/// Every how many cameras one is for the test.
const TEST_CAMERAS: usize = 8;

fn main() -> Result {
    let (mut folder, [mut cameras, mut times, mut size], mut between) = (None, [32, 96, 800], false);
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        let number = match argument.as_str() {
            "--help" | "-h" => {
                let header = SOURCE.lines().map_while(|line| line.strip_prefix("//!"));
                header.for_each(|line| println!("{}", line.strip_prefix(' ').unwrap_or(line)));
                return Ok(());
            }
            "--between" => {
                between = true;
                continue;
            }
            "--cameras" => &mut cameras,
            "--times" => &mut times,
            "--size" => &mut size,
            option if option.starts_with('-') => {
                return Err(format!("{option}: the options are --cameras, --times, --size and --between").into());
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
    app.add_systems(Startup, island::spawn);
    let film = film(cameras as usize, times, size, between);
    let filmed = testing::film(&mut app, &film, folder.as_ref(), island::place, |done, all| {
        print!("\r{done} of {all} pictures");
        // A line that is not shown is no reason to stop.
        std::io::stdout().flush().ok();
    });
    let Filmed { train, validation, test } = filmed.map_err(|error| error.to_string())?;
    println!("\n{folder}: {train} pictures for training, {validation} for validation, {test} for the test");
    Ok(())
}

/// Returns the film of the island.
fn film(cameras: usize, times: u32, size: u32, between: bool) -> Film {
    let mut rig = Rig::hemisphere(island::CENTER, island::DISTANCE, cameras);
    let moment = |time: f32| island::SECONDS * time / times.saturating_sub(1).max(1) as f32;
    let mut moments: Vec<f32> = (0..times).map(|time| moment(time as f32)).collect();
    let mut hold_out = HoldOut { test_cameras: TEST_CAMERAS, ..HoldOut::default() };
    if between {
        rig = Rig::fixed(rig.poses().iter().skip(TEST_CAMERAS - 1).step_by(TEST_CAMERAS).copied().collect());
        // The first and the last time stay, so that 0 and 1 in the camera file are the same moments.
        moments = (1..times).map(|time| moment(time as f32 - 0.5)).chain([0.0, island::SECONDS]).collect();
        hold_out = HoldOut::NOTHING;
    }
    Film {
        size: UVec2::splat(size),
        stagger: !between,
        hold_out,
        prepare_camera: |camera: &mut EntityWorldMut<'_>| {
            camera.insert(AmbientLight { color: Color::srgb(0.75, 0.85, 1.0), brightness: 1200.0, ..default() });
        },
        ..Film::new(rig, moments)
    }
}
