//! Gaussians in the units of the format: seconds from the beginning of the file, capture units.
//!
//! In: [`Columns`] and how they are played. Out: a [`Row`] for each Gaussian, whose window is its active interval.

use crate::codec::export::clip::Clip;
use crate::codec::export::error::ExportError;
use crate::codec::import::columns::{Columns, SH_C0};
use crate::scene::FilterKind;

/// Largest magnitude of the logarithm of a scale: single precision holds the scale.
const LARGEST_LOG_SCALE: f64 = 80.0;

/// A Gaussian.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Row {
    /// Its mean at `mean_t`.
    pub mean: [f64; 3],
    /// Logarithms of its scales.
    pub log_scale: [f64; 3],
    /// Its rotation: x, y, z, w.
    pub rotation: [f64; 4],
    /// Its color of degree 0, which may be outside 0 to 1.
    pub color: [f64; 3],
    /// Its opacity, 0 to 1.
    pub opacity: f64,
    /// Its velocity, units per second.
    pub velocity: [f64; 3],
    /// Its temporal mean, seconds.
    pub mean_t: f64,
    /// Its temporal standard deviation, seconds; infinite if it never fades.
    pub sigma_t: f64,
    /// Begin and end of its existence, seconds.
    pub window: [f64; 2],
}

impl Row {
    /// Returns whether it never fades.
    pub(super) fn never_fades(&self) -> bool {
        self.sigma_t.is_infinite()
    }

    /// Returns its center at a time.
    pub(super) fn center(&self, time: f64) -> [f64; 3] {
        [0, 1, 2].map(|axis| self.mean[axis] + self.velocity[axis] * (time - self.mean_t))
    }

    /// Returns the first and the last time at which it is visible, within `reach` standard deviations of its temporal
    /// mean, in a clip of this duration in seconds; `None` if it never is.
    pub(super) fn visible(&self, duration: f64, reach: f64) -> Option<[f64; 2]> {
        let half = if self.never_fades() { f64::INFINITY } else { reach * self.sigma_t };
        let first = (self.mean_t - half).max(self.window[0]).max(0.0);
        let last = (self.mean_t + half).min(self.window[1]).min(duration);
        (first <= last).then_some([first, last])
    }

    fn is_finite(&self) -> bool {
        let vectors = [self.mean, self.log_scale, self.color, self.velocity];
        vectors.as_flattened().iter().chain(&self.rotation).all(|value| value.is_finite())
            && self.opacity.is_finite()
            && self.mean_t.is_finite()
            && !self.sigma_t.is_nan()
    }
}

/// Returns the Gaussians.
///
/// # Errors
/// A Gaussian whose active segments are not contiguous, or with a number that is not finite.
pub(super) fn rows(columns: &Columns, clip: &Clip, duration: f64) -> Result<Vec<Row>, ExportError> {
    let [first, last] = clip.time_interval.map(f64::from);
    let seconds = duration / (last - first);
    let windows = windows(columns, duration)?;
    let row = |index: usize| {
        let motion = columns.motion.get(index);
        let [w, x, y, z] = columns.rotation[index].map(f64::from);
        let colors = columns.harmonics.of(index);
        Row {
            mean: columns.mean[index].map(f64::from),
            log_scale: columns.log_scale[index]
                .map(|scale| f64::from(scale).clamp(-LARGEST_LOG_SCALE, LARGEST_LOG_SCALE)),
            rotation: glam::DVec4::new(x, y, z, w).normalize_or(glam::DVec4::W).to_array(),
            color: [0, 1, 2].map(|channel| 0.5 + f64::from(SH_C0) * f64::from(colors[channel])),
            opacity: 1.0 / (1.0 + (-f64::from(columns.opacity_logit[index])).exp()),
            velocity: motion.map_or([0.0; 3], |motion| motion.velocity.map(|value| f64::from(value) / seconds)),
            mean_t: motion.map_or(0.0, |motion| (f64::from(motion.mean_t) - first) * seconds),
            sigma_t: motion.map_or(f64::INFINITY, |motion| f64::from(motion.sigma_t) * seconds),
            window: windows.get(index).copied().unwrap_or([0.0, f64::INFINITY]),
        }
    };
    let rows: Vec<Row> = (0..columns.len()).map(row).collect();
    match rows.iter().position(|row| !row.is_finite()) {
        Some(index) => Err(ExportError::Unsupported(format!("Gaussian {index} has a number that is not finite"))),
        None => Ok(rows),
    }
}

/// Returns begin and end of the existence of each Gaussian, in seconds; an empty list if all exist always.
fn windows(columns: &Columns, duration: f64) -> Result<Vec<[f64; 2]>, ExportError> {
    // A support filter repeats the lifespans.
    let Some(filter) = columns.filter.as_ref().filter(|filter| filter.kind != FilterKind::Support) else {
        return Ok(Vec::new());
    };
    let intervals = filter.to_intervals().ok_or_else(|| {
        ExportError::Unsupported(
            "its temporal filter has Gaussians that are active in separate segments of time; export a sequence (--sequence)"
                .to_owned(),
        )
    })?;
    let time = |segment: u32| duration * f64::from(segment) / f64::from(filter.segments);
    let window = |&word: &u32| {
        let (first, last) = (word & 0xffff, word >> 16);
        match (first <= last, last + 1 >= filter.segments) {
            (false, _) => [0.0, 0.0],
            // The end of the duration belongs to the last segment.
            (true, true) => [time(first), f64::INFINITY],
            (true, false) => [time(first), time(last + 1)],
        }
    };
    Ok(intervals.iter().map(window).collect())
}
