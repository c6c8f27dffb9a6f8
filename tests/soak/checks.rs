//! What must hold whatever an app is told to do.
//!
//! In: an app that has been updated, and everything that it logs. Out: the first thing that does not hold, as a text.

use bevy::log::tracing::field::{Field, Visit};
use bevy::log::tracing::{Event, Level, Subscriber};
use bevy::log::tracing_subscriber::Layer;
use bevy::log::tracing_subscriber::layer::Context;
use bevy::log::{BoxedLayer, DEFAULT_FILTER, LogPlugin};
use bevy::prelude::*;
use bevy::render::RenderApp;
use bevy::render::render_resource::{CachedPipelineState, PipelineCache};
use bevy_gs4d::GaussianCapturePlugin;
use bevy_gs4d::testing;
use image::RgbaImage;
use std::fmt::{Debug, Write};
use std::mem;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};

/// Beginnings of the warnings that must come: of cameras whose lens is [`Unusable`](crate::state::Lens::Unusable).
const EXPECTED: [&str; 1] = ["captures are not drawn for a camera whose projection is"];

/// What has been logged and not been looked at yet: warnings and errors, those of wgpu among them.
static LOGGED: Mutex<Vec<String>> = Mutex::new(Vec::new());

/// Returns an app without a window, whose warnings and errors are noted.
pub fn app(size: UVec2) -> App {
    // A process has one log; what it notes of a second app comes through that of the first.
    static HAS_LOG: AtomicBool = AtomicBool::new(false);
    let mut app = testing::app_with(size, |plugins| {
        if HAS_LOG.swap(true, Ordering::Relaxed) { plugins.disable::<LogPlugin>() } else { plugins.set(log()) }
    });
    app.add_plugins(GaussianCapturePlugin).insert_resource(ClearColor(Color::BLACK));
    app
}

fn log() -> LogPlugin {
    // As in `testing::app`: a read-back that is abandoned is no fault.
    let filter = format!("{DEFAULT_FILTER},bevy_render::gpu_readback=error");
    LogPlugin { filter, custom_layer: |_| -> Option<BoxedLayer> { Some(Box::new(Warnings)) }, ..default() }
}

/// Notes warnings and errors.
struct Warnings;

impl<S: Subscriber> Layer<S> for Warnings {
    fn on_event(&self, event: &Event<'_>, _: Context<'_, S>) {
        // What is more severe is less.
        if *event.metadata().level() <= Level::WARN {
            let mut message = Message(String::new());
            event.record(&mut message);
            LOGGED.lock().unwrap_or_else(PoisonError::into_inner).push(message.0);
        }
    }
}

struct Message(String);

impl Visit for Message {
    fn record_debug(&mut self, field: &Field, value: &dyn Debug) {
        if field.name() == "message" {
            // A text takes everything.
            let _ = write!(self.0, "{value:?}");
        }
    }
}

/// Returns the warnings and errors since the last call.
pub fn take_logged() -> Vec<String> {
    mem::take(&mut *LOGGED.lock().unwrap_or_else(PoisonError::into_inner))
}

/// Checks that the app goes on, and has not logged anything unexpected.
///
/// # Errors
/// It has stopped; the warning or error.
pub fn check_running(app: &App) -> Result<(), String> {
    let is_expected = |said: &String| EXPECTED.iter().any(|start| said.starts_with(start));
    let logged: Vec<String> = take_logged().into_iter().filter(|said| !is_expected(said)).collect();
    if !logged.is_empty() {
        return Err(format!("logged: {}", logged.join("; ")));
    }
    app.should_exit().map_or(Ok(()), |_| Err("the app wants to exit".to_owned()))
}

/// Checks that every pipeline could be compiled.
///
/// # Errors
/// The first that could not.
pub fn check_pipelines(app: &App) -> Result<(), String> {
    for pipeline in app.sub_app(RenderApp).world().resource::<PipelineCache>().pipelines() {
        if let CachedPipelineState::Err(failure) = &pipeline.state {
            return Err(format!("a pipeline failed: {failure}"));
        }
    }
    Ok(())
}

/// Returns the largest difference of two pictures in any channel, in 255ths.
pub fn difference(a: &[u8], b: &[u8]) -> u8 {
    a.iter().zip(b).map(|(a, b)| a.abs_diff(*b)).max().unwrap_or_default()
}

/// Checks that two pictures are the same, bit for bit. Every pass has a fixed order: splats of one depth are blended in the order of their
/// captures, and that is given to the new app.
///
/// # Errors
/// How far they are apart.
pub fn check_same(seen: &RgbaImage, fresh: &RgbaImage) -> Result<(), String> {
    if seen.dimensions() != fresh.dimensions() {
        return Err(format!("is {:?} pixels large, not {:?}", seen.dimensions(), fresh.dimensions()));
    }
    if seen == fresh {
        return Ok(());
    }
    let square = |(a, b): (&u8, &u8)| (f64::from(*a) - f64::from(*b)).powi(2);
    let mean = seen.iter().zip(fresh.iter()).map(square).sum::<f64>() / seen.len() as f64;
    let decibels = 10.0 * (255.0 * 255.0 / mean).log10();
    Err(format!("is up to {} of 255 from that of a new app, {decibels:.1} dB", difference(seen, fresh)))
}

/// Returns whether there is anything but the black background in a picture: bytes of RGBA.
pub fn shows_something(picture: &[u8]) -> bool {
    picture.chunks_exact(4).any(|pixel| pixel[..3] != [0; 3])
}
