//! The conditions that hold after every change.
//!
//! In: an app after an update, and its log. Out: the first violated condition, as a text.

use crate::support::warning_layer::Warnings;
use bevy::log::{BoxedLayer, DEFAULT_FILTER, LogPlugin};
use bevy::prelude::*;
use bevy_gs4d::GaussianCapturePlugins;
use bevy_gs4d::testing;
use image::RgbaImage;
use std::mem;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};

/// The first words of expected warnings: about cameras whose lens is [`Unusable`](crate::state::Lens::Unusable).
const EXPECTED: [&str; 1] = ["captures are not drawn for a camera whose projection is"];

/// The logged warnings and errors, including those of wgpu, since the last [`take_logged`].
static LOGGED: Mutex<Vec<String>> = Mutex::new(Vec::new());

/// Returns an app without a window, whose warnings and errors are recorded.
pub fn app(size: UVec2) -> App {
    // A process has one log: the log of the first app also records the messages of a second app.
    static HAS_LOG: AtomicBool = AtomicBool::new(false);
    let mut app = testing::app_with(size, |plugins| {
        if HAS_LOG.swap(true, Ordering::Relaxed) { plugins.disable::<LogPlugin>() } else { plugins.set(log()) }
    });
    app.add_plugins(GaussianCapturePlugins).insert_resource(ClearColor(Color::BLACK));
    app
}

fn log() -> LogPlugin {
    // As in `testing::app`: an abandoned read-back is not a fault.
    let filter = format!("{DEFAULT_FILTER},bevy_render::gpu_readback=error");
    LogPlugin { filter, custom_layer: |_| -> Option<BoxedLayer> { Some(Box::new(Warnings(record))) }, ..default() }
}

fn record(text: String) {
    LOGGED.lock().unwrap_or_else(PoisonError::into_inner).push(text);
}

/// Returns the warnings and errors since the last call.
pub fn take_logged() -> Vec<String> {
    mem::take(&mut *LOGGED.lock().unwrap_or_else(PoisonError::into_inner))
}

/// Checks that the app has not stopped and has logged no unexpected warning or error.
///
/// # Errors
/// The app wants to exit; the logged warnings and errors.
pub fn check_running(app: &App) -> Result<(), String> {
    let is_expected = |message: &String| EXPECTED.iter().any(|start| message.starts_with(start));
    let logged: Vec<String> = take_logged().into_iter().filter(|message| !is_expected(message)).collect();
    if !logged.is_empty() {
        return Err(format!("logged: {}", logged.join("; ")));
    }
    app.should_exit().map_or(Ok(()), |_| Err("the app wants to exit".to_owned()))
}

/// Returns the largest difference between two pictures in any channel, in 255ths.
pub fn difference(a: &[u8], b: &[u8]) -> u8 {
    a.iter().zip(b).map(|(a, b)| a.abs_diff(*b)).max().unwrap_or_default()
}

/// Checks that two pictures are bitwise equal. Every pass has a fixed order: splats of equal depth are blended in the
/// order of their captures, which the new app receives as an option.
///
/// # Errors
/// The size of the difference.
pub fn check_same(seen: &RgbaImage, fresh: &RgbaImage) -> Result<(), String> {
    if seen.dimensions() != fresh.dimensions() {
        return Err(format!("has {:?} pixels, expected {:?}", seen.dimensions(), fresh.dimensions()));
    }
    if seen == fresh {
        return Ok(());
    }
    let square = |(a, b): (&u8, &u8)| (f64::from(*a) - f64::from(*b)).powi(2);
    let mean = seen.iter().zip(fresh.iter()).map(square).sum::<f64>() / seen.len() as f64;
    let decibels = 10.0 * (255.0 * 255.0 / mean).log10();
    Err(format!("differs by up to {} of 255 from that of a new app, PSNR {decibels:.1} dB", difference(seen, fresh)))
}

/// Returns whether any pixel of a picture, given as RGBA bytes, differs from the black background.
pub fn shows_something(picture: &[u8]) -> bool {
    picture.chunks_exact(4).any(|pixel| pixel[..3] != [0; 3])
}
