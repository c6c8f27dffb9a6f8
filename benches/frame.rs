//! CPU time of a frame: the spans of the crate's own systems in a headless Bevy app.
//!
//! ```text
//! cargo bench --features viewer,cli --bench frame -- [CAPTURE] [FRAMES]
//! ```
//!
//! In: a capture (default: the bundled capture) that plays in front of one camera, a number of frames (default: 600).
//! Out: a line for each span: entries per frame, median and 95th percentile in microseconds; then the sum over a frame.
//! Bevy's own systems and the GPU are not included.

use bevy::log::tracing::span::Id;
use bevy::log::tracing::subscriber::Interest;
use bevy::log::tracing::{Metadata, Subscriber};
use bevy::log::tracing_subscriber::Layer;
use bevy::log::tracing_subscriber::layer::Context;
use bevy::log::tracing_subscriber::registry::LookupSpan;
use bevy::log::{BoxedLayer, Level, LogPlugin};
use bevy::prelude::*;
use bevy_gs4d::prelude::*;
use bevy_gs4d::testing;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Number of entries and total time of each span of the crate since the last reset.
static SPENT: Mutex<BTreeMap<&'static str, (u32, Duration)>> = Mutex::new(BTreeMap::new());

/// A layer that measures spans by name.
struct Stopwatch;

struct Entered(Instant);

fn is_ours(metadata: &Metadata<'_>) -> bool {
    metadata.is_span() && metadata.name().starts_with("gs4d/")
}

impl<S: Subscriber + for<'a> LookupSpan<'a>> Layer<S> for Stopwatch {
    fn register_callsite(&self, _: &'static Metadata<'static>) -> Interest {
        Interest::always()
    }

    fn on_enter(&self, id: &Id, context: Context<'_, S>) {
        if let Some(span) = context.span(id).filter(|span| is_ours(span.metadata())) {
            span.extensions_mut().replace(Entered(Instant::now()));
        }
    }

    fn on_exit(&self, id: &Id, context: Context<'_, S>) {
        let now = Instant::now();
        let Some(span) = context.span(id).filter(|span| is_ours(span.metadata())) else { return };
        if let Some(Entered(start)) = span.extensions_mut().remove() {
            let mut spent = SPENT.lock().unwrap_or_else(PoisonError::into_inner);
            let (count, sum) = spent.entry(span.metadata().name()).or_default();
            *count += 1;
            *sum += now - start;
        }
    }
}

fn stopwatch(_: &mut App) -> Option<BoxedLayer> {
    Some(Box::new(Stopwatch))
}

fn main() -> Result {
    // Cargo passes additional options.
    let mut arguments = std::env::args().skip(1).filter(|argument| !argument.starts_with("--"));
    let bundled = || format!("{}/assets/toybox.gs4d", env!("CARGO_MANIFEST_DIR"));
    let capture = PathBuf::from(arguments.next().unwrap_or_else(bundled));
    let frames: usize = arguments.next().map_or(Ok(600), |count| count.parse())?;

    let log =
        LogPlugin { level: Level::DEBUG, filter: "warn,bevy_gs4d=debug".into(), custom_layer: stopwatch, ..default() };
    let mut app = testing::app_with(UVec2::new(64, 64), |plugins| plugins.set(log));
    app.add_plugins(GaussianCapturePlugins);
    let handle = app.world().resource::<AssetServer>().load(capture.clone());
    app.world_mut().spawn(GaussianCapture3d(handle));
    app.world_mut().spawn((Camera3d::default(), Msaa::Off, Transform::from_xyz(0.0, 0.5, 4.0)));
    testing::settle(&mut app)?;
    app.insert_resource(bevy::time::TimeUpdateStrategy::ManualDuration(Duration::from_secs_f64(1.0 / 60.0)));

    let mut spans: BTreeMap<&str, Vec<(u32, Duration)>> = BTreeMap::new();
    let mut sums = Vec::new();
    for _ in 0..frames {
        SPENT.lock().unwrap_or_else(PoisonError::into_inner).clear();
        app.update();
        let spent = SPENT.lock().unwrap_or_else(PoisonError::into_inner);
        sums.push(spent.values().map(|(_, time)| *time).sum());
        for (name, time) in spent.iter() {
            spans.entry(name).or_default().push(*time);
        }
    }
    println!("{} over {frames} frames, microseconds", capture.display());
    println!("{:<18} {:>8} {:>9} {:>9}", "span", "a frame", "median", "95 %");
    for (name, times) in spans {
        let entered: u32 = times.iter().map(|(count, _)| count).sum();
        let [median, late] = quantiles(times.into_iter().map(|(_, time)| time).collect());
        println!("{name:<18} {:>8.2} {median:>9.1} {late:>9.1}", f64::from(entered) / frames as f64);
    }
    let [median, late] = quantiles(sums);
    println!("{:<18} {:>8} {median:>9.1} {late:>9.1}", "all", "");
    Ok(())
}

/// Returns the median and the 95th percentile in microseconds.
fn quantiles(mut times: Vec<Duration>) -> [f64; 2] {
    times.sort();
    [times.len() / 2, times.len() * 95 / 100].map(|at| times.get(at).copied().unwrap_or_default().as_secs_f64() * 1e6)
}
