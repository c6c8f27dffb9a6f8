//! Plays a capture in chunk files while they arrive, as over a link: a capture of minutes in fixed memory.
//!
//! ```text
//! cargo run --release --features viewer --example stream -- INDEX [--link MBIT] [--latency MS] [--lose PERCENT] \
//!     [--outage S] [--halve] [--gpu MIB] [--host MIB] [--seconds S] [--whole CAPTURE] [--size WIDTHxHEIGHT] [--headless FOLDER] [--frames N]
//! ```
//!
//! * drag with the left button: orbit; wheel: nearer and farther
//! * space: play and pause; left and right: five seconds back and forward
//!
//! INDEX is the `index.gs4d` that `gs4d split long.gs4d -o chunks` writes into the folder of the files. The title of
//! the window has the share of the Gaussians that is there, the seconds that are buffered, and the memory on the GPU.
//!
//! * `--link MBIT`, `--latency MS`, `--lose PERCENT`: files come over a simulated link of so many megabits a second,
//!   with a delay from a request to its first byte, on which a part of the requests fail. It is no network: bytes come
//!   from the disk and are held back. Without these options they are not
//! * `--outage S`, `--halve`: after playing has been measured, the link stops for so many seconds, and has half its rate
//!   from then on; the next ten seconds are measured
//! * `--gpu MIB`, `--host MIB`: memory for the capture, by default 1024 on the GPU and 512 for files on their way
//!
//! With `--headless FOLDER`, or without a display, it measures in real time: how long the first picture takes, then S
//! (20) seconds of playing, then eight seeks. It writes N (8) pictures, a 30th of a second apart, to FOLDER (`out`).
//! With `--whole CAPTURE`, the capture that was cut, it also compares pictures and times at twelve moments. The last
//! line has all numbers.

mod common;
#[path = "stream/compare.rs"]
mod compare;
#[path = "common/controls.rs"]
mod controls;
#[path = "stream/figures.rs"]
mod figures;
#[path = "stream/link.rs"]
mod link;
#[path = "stream/options.rs"]
mod options;
#[path = "stream/report.rs"]
mod report;
#[path = "common/size.rs"]
mod size;
#[path = "stream/take.rs"]
mod take;
#[path = "stream/timer.rs"]
mod timer;
#[path = "stream/watch.rs"]
mod watch;

use bevy::core_pipeline::tonemapping::{DebandDither, Tonemapping};
use bevy::prelude::*;
use bevy::window::PrimaryWindow;
use bevy_gs4d::prelude::*;
use bevy_gs4d::stream::StreamBudget;
use bevy_gs4d::testing;
use common::{Orbit, asset_path, save_pictures};
use compare::{compare, views};
use controls::{follow, mouse};
use figures::{Figures, mebibytes, peak_memory};
use link::Link;
use options::Options;
use report::{report, warm_up};
use std::path::Path;
use std::time::{Duration, Instant};
use take::Take;
use watch::Watch;

/// Seconds that a key goes back or forward.
const STEP: f32 = 5.0;

fn main() -> Result {
    let mut options = Options::default();
    let arguments = controls::arguments("", |option, values| options.read(option, values))?;
    let take = Take::open(&arguments.file)?;
    println!("{take}\n{}", options.link);
    let (link, sample) = (Link::new(&take.index, options.link), take.sample()?);
    if let Some(folder) = arguments.headless {
        return measure(&options, &take, &link, sample, &folder, arguments.frames);
    }
    let mut app = App::new();
    app.add_plugins(DefaultPlugins.build().add_before::<AssetPlugin>(link.clone()));
    scene(&mut app, Orbit::around(&sample), options.budget);
    drop(sample);
    let capture = app.world().resource::<AssetServer>().load(link.index());
    app.world_mut().spawn((GaussianCapture3d(capture), Upright));
    app.add_systems(Update, (keys, title, mouse.before(follow))).run();
    Ok(())
}

/// Adds the plugins and the camera, with or without a window.
fn scene(app: &mut App, orbit: Orbit, budget: StreamBudget) {
    app.add_plugins(GaussianCapturePlugins)
        .insert_resource(ClearColor(Color::BLACK))
        .insert_resource(budget)
        .add_systems(Update, follow);
    // Pixels keep their trained colors.
    app.world_mut().spawn((Camera3d::default(), Msaa::Off, Tonemapping::None, DebandDither::Disabled, orbit));
}

fn keys(keys: Res<ButtonInput<KeyCode>>, mut playback: Single<&mut Playback>) {
    if keys.just_pressed(KeyCode::Space) {
        playback.toggle();
    }
    let steps = i32::from(keys.just_pressed(KeyCode::ArrowRight)) - i32::from(keys.just_pressed(KeyCode::ArrowLeft));
    if steps != 0 {
        let seconds = playback.time + STEP * steps as f32;
        playback.seek(seconds);
    }
}

fn title(capture: Single<(&CaptureStreamState, &Playback)>, mut window: Single<&mut Window, With<PrimaryWindow>>) {
    let (state, playback) = *capture;
    let title = format!(
        "{:.1} s: {:.0} % of the Gaussians, {:.1} s buffered, {:.0} MiB on the GPU",
        playback.time,
        100.0 * state.share,
        state.buffered_seconds,
        mebibytes(state.gpu_bytes)
    );
    if window.title != title {
        window.title = title;
    }
}

/// Measures without a window, and writes pictures.
///
/// # Errors
/// Files that cannot be loaded, errors of drawing, a folder that cannot be written to.
fn measure(options: &Options, take: &Take, link: &Link, sample: GaussianCapture, folder: &Path, frames: u32) -> Result {
    let mut app = testing::app_with(options.size, |plugins| plugins.add_before::<AssetPlugin>(link.clone()));
    scene(&mut app, Orbit::around(&sample), options.budget);
    warm_up(&mut app, sample)?;
    let mut figures = Figures::default();
    let player = report(&mut app, take, link, options.seconds, &mut figures)?;
    let streamed = match options.whole {
        Some(_) => views(&mut app, player, take.seconds)?,
        None => Vec::new(),
    };
    app.world_mut().entity_mut(player).insert(Playback::paused_at(0.0));
    Watch::new(&mut app, player).arrive(Instant::now())?;
    app.world_mut().entity_mut(player).insert(Playback::default());
    save_pictures(&mut app, frames, Duration::from_secs_f64(1.0 / 30.0), folder)?;
    if let Some(whole) = &options.whole {
        app.world_mut().despawn(player);
        let capture = app.world().resource::<AssetServer>().load(asset_path(whole));
        let player = app.world_mut().spawn((GaussianCapture3d(capture), Upright)).id();
        testing::settle(&mut app)?;
        compare(&streamed, &views(&mut app, player, take.seconds)?, &mut figures);
        let bytes = app.world().resource::<CaptureStatistics>().capture_bytes();
        let peak = peak_memory().map_or(0.0, mebibytes);
        println!("the whole capture: {:.1} MiB on the GPU; {peak:.0} MiB of memory at most", mebibytes(bytes));
        figures.add("whole_gpu_mib", format_args!("{:.1}", mebibytes(bytes)));
        figures.add("whole_peak_mib", format_args!("{peak:.1}"));
    }
    println!("result: {figures}");
    Ok(())
}
