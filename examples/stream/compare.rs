//! A streamed capture beside the capture that was cut.
//!
//! In: the [`View`]s of each at the same moments, paused. Out: whether their pictures are the same, and how long their
//! frames take.

use crate::figures::{Figures, median};
use crate::watch::Watch;
use bevy::prelude::*;
use bevy_gs4d::prelude::*;
use bevy_gs4d::testing::{self, RgbaImage};
use std::time::{Duration, Instant};

/// Number of moments.
const MOMENTS: u16 = 12;
/// Frames that are measured at each moment.
const FRAMES: usize = 30;
/// Frames before them: GPU times arrive some frames late.
const BEFORE: usize = 8;

/// A capture at a moment.
pub struct View {
    /// `None` for a streamed capture of which not all was there in time.
    picture: Option<RgbaImage>,
    /// GPU times of frames, milliseconds.
    gpu: Vec<f64>,
    /// Durations of updates, milliseconds.
    updates: Vec<f64>,
}

/// Draws a capture of `duration` seconds at evenly spaced moments, as fast as possible.
///
/// # Errors
/// Errors of drawing, the end of the app.
pub fn views(app: &mut App, player: Entity, duration: f32) -> Result<Vec<View>> {
    let statistics = app.world().resource::<CaptureStatistics>().clone();
    statistics.measure(true);
    let mut views = Vec::new();
    for moment in 0..MOMENTS {
        let seconds = duration * (f32::from(moment) + 0.5) / f32::from(MOMENTS);
        app.world_mut().entity_mut(player).insert(Playback::paused_at(seconds));
        let is_streamed = app.world().get::<CaptureStreamState>(player).is_some();
        let is_whole = !is_streamed || Watch::new(app, player).arrive(Instant::now())?.whole.is_finite();
        let picture = testing::picture(app, Duration::ZERO)?;
        let mut view = View { picture: is_whole.then_some(picture), gpu: Vec::new(), updates: Vec::new() };
        for frame in 0..BEFORE + FRAMES {
            let began = Instant::now();
            app.update();
            let seconds = began.elapsed().as_secs_f64();
            if app.should_exit().is_some() {
                return Err("the app ended: the log has the reason".into());
            }
            if frame >= BEFORE {
                view.gpu.push(1e3 * f64::from(statistics.gpu_seconds()));
                view.updates.push(1e3 * seconds);
            }
        }
        views.push(view);
    }
    statistics.measure(false);
    Ok(views)
}

/// Compares a streamed capture with the whole one, and reports the differences.
pub fn compare(streamed: &[View], whole: &[View], figures: &mut Figures) {
    let pairs = streamed.iter().zip(whole).filter_map(|(a, b)| a.picture.as_ref().zip(b.picture.as_ref()));
    let ratios: Vec<f64> = pairs.map(|(a, b)| psnr(a, b)).collect();
    let (compared, moments) = (ratios.len(), streamed.len());
    let identical = ratios.iter().filter(|ratio| ratio.is_infinite()).count();
    let least = ratios.iter().copied().fold(f64::INFINITY, f64::min);
    let note = if least.is_finite() { format!("; least PSNR {least:.1} dB") } else { String::new() };
    println!("identical pictures: {identical} of {moments}{note}");
    if compared < moments {
        println!("not whole in time, and so not compared: {} of {moments}", moments - compared);
    }
    let usual = |views: &[View], times: fn(&View) -> &Vec<f64>| {
        median(&views.iter().flat_map(|view| times(view).iter().copied()).collect::<Vec<_>>())
    };
    let gpu = [streamed, whole].map(|views| usual(views, |view| &view.gpu));
    let updates = [streamed, whole].map(|views| usual(views, |view| &view.updates));
    println!("frame of the stream {:.3} ms, of the whole capture {:.3} ms (GPU)", gpu[0], gpu[1]);
    println!("frame of the stream {:.3} ms, of the whole capture {:.3} ms (update)", updates[0], updates[1]);
    figures.add("identical", identical);
    figures.add("compared", compared);
    figures.add("least_psnr_db", format_args!("{least:.2}"));
    figures.add("stream_gpu_ms", format_args!("{:.4}", gpu[0]));
    figures.add("whole_gpu_ms", format_args!("{:.4}", gpu[1]));
    figures.add("stream_update_ms", format_args!("{:.4}", updates[0]));
    figures.add("whole_update_ms", format_args!("{:.4}", updates[1]));
}

/// Returns the PSNR between the colors of two pictures of one size, dB; infinite for the same colors.
fn psnr(a: &RgbaImage, b: &RgbaImage) -> f64 {
    let square = |(a, b): (&u8, &u8)| (f64::from(*a) - f64::from(*b)).powi(2);
    let pairs = a.pixels().zip(b.pixels()).flat_map(|(a, b)| a.0[..3].iter().zip(&b.0[..3]));
    let mean = pairs.map(square).sum::<f64>() / (3.0 * f64::from(a.width()) * f64::from(a.height()));
    10.0 * (255.0f64.powi(2) / mean).log10()
}
