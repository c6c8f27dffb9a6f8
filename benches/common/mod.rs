//! Common code of the benchmarks that measure whole apps: the command line, apps that run like games, and the rounds of
//! measurements.
//!
//! In: `[CAPTURE] [--size WIDTHxHEIGHT] [--frames N] [--rounds N]` and the options of one benchmark; apps. Out:
//! [`Arguments`], and the [`Times`] of each app's frame.

use bevy::app::PluginGroupBuilder;
use bevy::log::LogPlugin;
use bevy::prelude::*;
use bevy::render::pipelined_rendering::PipelinedRenderingPlugin;
use bevy::render::renderer::RenderDevice;
use bevy::time::TimeUpdateStrategy;
use bevy_gs4d::testing;
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// Warm-up time: an idle GPU has a low clock rate at first.
const WARM_UP: Duration = Duration::from_millis(600);
/// Number of frames before each measurement: after frames of another app, the caches are cold.
const FIRST_FRAMES: u32 = 10;

/// The arguments of a benchmark, or its defaults.
pub struct Arguments {
    pub capture: PathBuf,
    pub size: UVec2,
    /// Number of frames of each measurement.
    pub frames: u32,
    pub rounds: usize,
}

/// Milliseconds of an app's frame, one for each round.
pub struct Times(Vec<f64>);

/// Parses the command line; `size`, `frames` and `rounds` are defaults. `more` is called with each option that is not
/// common to all benchmarks and with a function that returns the option's value; it returns whether this benchmark has
/// the option.
///
/// # Errors
/// An unknown option, an option without a value or with an invalid value.
pub fn parse(
    size: UVec2,
    frames: u32,
    rounds: usize,
    mut more: impl FnMut(&str, &mut dyn FnMut() -> Result<String, String>) -> Result<bool>,
) -> Result<Arguments> {
    let capture = concat!(env!("CARGO_MANIFEST_DIR"), "/assets/toybox.gs4d").into();
    let mut parsed = Arguments { capture, size, frames, rounds };
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        let mut value = || arguments.next().ok_or_else(|| format!("{argument} needs a value"));
        match argument.as_str() {
            "--size" => parsed.size = numbers(&value()?, 'x').map(UVec2::from).ok_or("--size: not like 640x480")?,
            "--frames" => parsed.frames = value()?.parse().map_err(|_| "--frames: not a number")?,
            "--rounds" => parsed.rounds = value()?.parse().map_err(|_| "--rounds: not a number")?,
            // Cargo passes this option.
            "--bench" => {}
            option if option.starts_with('-') => {
                if !more(option, &mut value)? {
                    return Err(format!("{option}: no such option").into());
                }
            }
            file => parsed.capture = file.into(),
        }
    }
    Ok(parsed)
}

/// Parses exactly `N` numbers between separators.
pub fn numbers<T: std::str::FromStr, const N: usize>(text: &str, separator: char) -> Option<[T; N]> {
    let parts: Vec<T> = text.split(separator).map(|part| part.parse().ok()).collect::<Option<_>>()?;
    parts.try_into().ok()
}

/// Returns an app without a window, with pipelined rendering. Bevy has one logger for all apps: `logged` is whether it
/// is already installed.
pub fn app(size: UVec2, logged: bool, adjust: impl FnOnce(PluginGroupBuilder) -> PluginGroupBuilder) -> App {
    testing::app_with(size, |plugins| {
        let plugins = adjust(plugins).enable::<PipelinedRenderingPlugin>();
        if logged { plugins.disable::<LogPlugin>() } else { plugins }
    })
}

/// Waits until all assets are loaded. Afterwards each update advances time by a 60th of a second, independent of its
/// wall-clock time.
///
/// # Errors
/// The errors of [`testing::settle`].
pub fn start(app: &mut App) -> Result {
    testing::settle(app)?;
    app.insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_secs_f64(1.0 / 60.0)));
    Ok(())
}

/// Measures the frames of all apps, which take turns in each round.
///
/// # Errors
/// An app stops, or the GPU is lost.
pub fn measure(apps: &mut [App], arguments: &Arguments) -> Result<Vec<Times>> {
    let mut measured: Vec<Vec<f64>> = vec![Vec::new(); apps.len()];
    for app in apps.iter_mut() {
        warm_up(app)?;
    }
    for _ in 0..arguments.rounds {
        for (app, times) in apps.iter_mut().zip(&mut measured) {
            run(app, FIRST_FRAMES)?;
            let took = run(app, arguments.frames)?;
            times.push(took.as_secs_f64() * 1e3 / f64::from(arguments.frames));
        }
    }
    Ok(measured.into_iter().map(Times).collect())
}

impl Times {
    /// Returns the median of the rounds.
    pub fn median(&self) -> f64 {
        let [_, median, _] = quartiles(self.0.clone());
        median
    }

    /// Returns the shortest and the longest round, as text.
    pub fn spread(&self) -> String {
        let [low, high] = [f64::min, f64::max].map(|best| self.0.iter().copied().reduce(best).unwrap_or(f64::NAN));
        format!("{low:.3} - {high:.3}")
    }

    /// Returns the additional frame time compared with another app that took turns with this app: the median of the
    /// rounds' differences, and the range of the middle half of the differences, as text. A temporary slowdown of the
    /// machine affects both apps of a round.
    pub fn more_than(&self, other: &Self) -> (f64, String) {
        let [low, median, high] = quartiles(self.0.iter().zip(&other.0).map(|(own, other)| own - other).collect());
        (median, format!("{low:.3} - {high:.3}"))
    }
}

/// Returns the quartiles; NaN without values.
fn quartiles(mut values: Vec<f64>) -> [f64; 3] {
    values.sort_by(f64::total_cmp);
    [1, 2, 3].map(|quarter| values.get(values.len() * quarter / 4).copied().unwrap_or(f64::NAN))
}

/// Runs the app until the GPU has reached its full clock rate.
///
/// # Errors
/// The errors of [`measure`].
pub fn warm_up(app: &mut App) -> Result {
    let began = Instant::now();
    while began.elapsed() < WARM_UP {
        run(app, 10)?;
    }
    Ok(())
}

/// Runs the app for a number of frames, and returns the time until the GPU has finished them.
///
/// # Errors
/// The errors of [`measure`].
pub fn run(app: &mut App, frames: u32) -> Result<Duration> {
    let device = app.world().resource::<RenderDevice>().clone();
    let began = Instant::now();
    for _ in 0..frames {
        app.update();
        if app.should_exit().is_some() {
            return Err("the app stopped".into());
        }
    }
    device.wgpu_device().poll(wgpu::PollType::wait_indefinitely())?;
    Ok(began.elapsed())
}
