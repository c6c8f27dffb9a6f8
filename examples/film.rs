//! Films an island of Bevy's own meshes as a dataset for training: cloth in the wind, petals, a fire, and three kinds
//! of light that cast shadows.
//!
//! ```text
//! cargo run --release --features viewer --example film -- [FOLDER] [--rig RIG] [--cameras N] [--times N] \
//!     [--shutter SHUTTER] [--size SIZE] [--test-at FRACTION] [--take SECONDS --from SECONDS --until SECONDS]
//! examples/film/island.sh [FOLDER]
//! examples/film/take.sh [FOLDER]
//! ```
//!
//! The first script films, trains, bakes and evaluates, and keeps the petals, which have few pixels; the second makes a
//! capture of a minute, in chunk files.
//!
//! `points.json` in the folder has the tracks of ten points of the scene, with which `gs4d socket --points` compares
//! sockets.
//!
//! Defaults: the folder `dataset`, 32 cameras on a hemisphere, each with its own offset of the shutter, 96 times over
//! four seconds, pictures of 800x800. Every eighth camera is for the test, another eighth for validation. `--shutter
//! together` lets all film at the same moments, as `gs4d footage` needs it. `--rig grid` is a rig as of the dataset
//! N3V: 21 cameras in three rows before the scene, which film at the same moments, the one in the middle for the test.
//! `--test-at` films the cameras of the test alone, all at once, so far between each time and the next: 0 at the
//! moments of the first camera, 0.5 halfway between them. `--take` is the length of a longer take, in which the sun
//! moves and petals fall along other ways in each loop; `--from` and `--until` film a segment of it.

#[path = "film/island.rs"]
mod island;

use bevy::ecs::world::EntityWorldMut;
use bevy::prelude::*;
use bevy_gs4d::renderer::silence_wayland;
use bevy_gs4d::testing::{self, Film, Filmed, HoldOut, Rig};
use std::io::Write;

/// The header of this file is the text of `--help`.
const SOURCE: &str = include_str!("film.rs");
/// Columns and rows of the grid.
const GRID: UVec2 = UVec2::new(7, 3);

fn main() -> Result {
    // On a server without a session nothing is printed about that.
    silence_wayland();
    let (mut folder, [mut cameras, mut times], mut size) = (None, [32, 96], UVec2::splat(800));
    let (mut is_grid, mut is_together, mut test_at) = (false, false, None);
    let (mut take, mut from, mut until) = (None, 0.0, None);
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        match argument.as_str() {
            "--help" | "-h" => {
                let header = SOURCE.lines().map_while(|line| line.strip_prefix("//!"));
                header.for_each(|line| println!("{}", line.strip_prefix(' ').unwrap_or(line)));
                return Ok(());
            }
            "--rig" | "--cameras" | "--times" | "--shutter" | "--size" | "--test-at" | "--take" | "--from"
            | "--until" => {}
            option if option.starts_with('-') => {
                let options = "--rig, --cameras, --times, --shutter, --size, --test-at, --take, --from and --until";
                return Err(format!("{option}: the options are {options}").into());
            }
            _ if folder.is_some() => return Err(format!("{argument}: more than one folder; name one").into()),
            _ => {
                folder = Some(argument);
                continue;
            }
        };
        let text = arguments.next().ok_or_else(|| format!("{argument} needs a value"))?;
        let number = |text: &str| text.parse::<u32>().map_err(|_| format!("{argument} {text}: not a number"));
        let seconds = |text: &str| {
            let seconds = text.parse().ok().filter(|seconds| (0.0..=3600.0).contains(seconds));
            seconds.ok_or_else(|| format!("{argument} {text}: not a number of seconds, 0 to 3600"))
        };
        match argument.as_str() {
            "--rig" if !["hemisphere", "grid"].contains(&text.as_str()) => {
                return Err(format!("--rig {text}: the rigs are hemisphere and grid").into());
            }
            "--rig" => is_grid = text == "grid",
            "--shutter" if !["staggered", "together"].contains(&text.as_str()) => {
                return Err(format!("--shutter {text}: the shutters are staggered and together").into());
            }
            "--shutter" => is_together = text == "together",
            "--cameras" => cameras = number(&text)?,
            "--times" => times = number(&text)?,
            "--take" => take = Some(seconds(&text)?),
            "--from" => from = seconds(&text)?,
            "--until" => until = Some(seconds(&text)?),
            "--test-at" => {
                let fraction = text.parse().ok().filter(|fraction| (0.0..1.0).contains(fraction));
                test_at = Some(fraction.ok_or_else(|| format!("--test-at {text}: not a number from 0 to 1"))?);
            }
            _ => {
                let (width, height) = text.split_once('x').unwrap_or((&text, &text));
                size = UVec2::new(number(width)?, number(height)?);
            }
        }
    }
    let folder = folder.unwrap_or_else(|| "dataset".into());
    let length: f32 = take.unwrap_or(island::SECONDS);
    let loops = length / island::SECONDS;
    if loops < 1.0 || loops.fract() != 0.0 {
        return Err(format!("--take {length}: a take has a whole number of loops of {} s", island::SECONDS).into());
    }
    let between = [from, until.unwrap_or(length)];
    if !(from < between[1] && between[1] <= length) {
        return Err(format!("{from} to {} s: a segment is within the {length} s of the take", between[1]).into());
    }

    let mut app = testing::app(UVec2::splat(64));
    app.insert_resource(island::Take { seconds: length }).add_systems(Startup, island::spawn);
    let film = film(is_grid, cameras as usize, times, between, test_at);
    let film = Film { size, stagger: film.stagger && !is_together, ..film };
    let filmed = testing::film(&mut app, &film, folder.as_ref(), island::place, |done, all| {
        print!("\r{done} of {all} pictures");
        // A line that is not shown is no reason to stop.
        std::io::stdout().flush().ok();
    });
    let Filmed { train, validation, test } = filmed.map_err(|error| error.to_string())?;
    println!("\n{folder}: {train} pictures for training, {validation} for validation, {test} for the test");
    Ok(())
}

/// Returns the film of the island from a time to another. A grid has its own number of cameras.
fn film(is_grid: bool, cameras: usize, times: u32, [from, until]: [f32; 2], test_at: Option<f32>) -> Film {
    // Every how many cameras one is for the test.
    let (mut rig, test_cameras) = if is_grid {
        (Rig::grid(island::CENTER, island::DISTANCE, 0.3, Vec2::new(2.6, 1.0), GRID), 11)
    } else {
        (Rig::hemisphere(island::CENTER, island::DISTANCE, cameras), 8)
    };
    let moment = |time: f32| from + (until - from) * time / times.saturating_sub(1).max(1) as f32;
    let mut moments: Vec<f32> = (0..times).map(|time| moment(time as f32)).collect();
    let mut hold_out = HoldOut { test_cameras, ..HoldOut::default() };
    if let Some(fraction) = test_at {
        rig = Rig::fixed(rig.poses().iter().skip(test_cameras - 1).step_by(test_cameras).copied().collect());
        // The first and the last time stay, so that 0 and 1 in the camera file are the same moments.
        let inside = (1..times).map(|time| moment((time - 1) as f32 + fraction));
        moments = inside.chain([from, until]).collect();
        hold_out = HoldOut::NOTHING;
    }
    Film {
        stagger: test_at.is_none() && !is_grid,
        hold_out,
        prepare_camera: |camera: &mut EntityWorldMut<'_>| {
            camera.insert(AmbientLight { color: Color::srgb(0.75, 0.85, 1.0), brightness: 1200.0, ..default() });
        },
        ..Film::new(rig, moments)
    }
}
