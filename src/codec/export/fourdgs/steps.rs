//! The precision of a `.4dgs` file.
//!
//! In: Gaussians. Out: [`Steps`] so fine that no picture shows them. The profiles of the crate are for small files:
//! they round means to a share of the median scale, so that large opaque splats change their order.
//!
//! Numbers are stored as multiples of a step with 32 bits. A step is wider only where 32 bits do not reach.

use super::rows::Row;
use fourdgs::quantization::{Steps, life_class, support_k};

/// Number of steps of means across the middle of the capture, the range of 98 % of them along each axis.
const ACROSS: f64 = (1 << 25) as f64;
/// Number of steps of time in the duration.
const MOMENTS: f64 = (1 << 24) as f64;
/// The step of logarithms of scales and of deviations: half of it is two millionths of the scale.
const LOGARITHM: f64 = 1.0 / (1 << 18) as f64;
/// The step of three components of a rotation.
const ROTATION: f64 = 1.0 / (1 << 20) as f64;
/// The step of colors and opacities. 1 is a multiple of it.
const COLOR: f64 = 1.0 / (1 << 16) as f64;
/// Largest multiple of a step. The difference of two is stored, too.
pub(super) const REACH: f64 = (1 << 29) as f64;
/// Number of steps of time in the shortest lifespan that is stored: for shorter ones the format divides the step.
const SHORTEST: f64 = 32.0;

/// The clip that a file holds.
#[derive(Debug, Clone, Copy)]
pub(super) struct Times {
    /// Its duration, seconds.
    pub duration: f64,
    /// The marginal below which a Gaussian is not drawn.
    pub cutoff: f64,
}

impl Times {
    /// Returns the distance from its temporal mean, in standard deviations, up to which a Gaussian is drawn.
    pub(super) fn reach(self) -> f64 {
        support_k(self.cutoff)
    }
}

/// Returns the steps for these Gaussians.
pub(super) fn steps(rows: &[Row], times: Times) -> Steps {
    let latest = rows.iter().fold(0.0_f64, |most, row| most.max(row.mean_t.abs()));
    let mut steps = Steps {
        pos: place_step(rows),
        scale_log: LOGARITHM,
        rot: ROTATION,
        rgb: COLOR,
        alpha: COLOR,
        motion: 1.0,
        time: (times.duration / MOMENTS).max(latest / REACH),
        sigma_log: LOGARITHM,
        sh: 1,
    };
    steps.motion = velocity_step(rows, &steps, times);
    steps
}

/// Returns the lifespan of a Gaussian, as a deviation that can be stored.
pub(super) fn sigma(row: &Row, steps: &Steps) -> f64 {
    row.sigma_t.max(SHORTEST * steps.time)
}

/// Returns the multiple of the step that stores the lifespan of a Gaussian.
pub(super) fn sigma_multiple(row: &Row, steps: &Steps) -> i64 {
    if row.never_fades() { 0 } else { (sigma(row, steps).ln() / steps.sigma_log).round() as i64 }
}

/// Returns the class by which the format divides the step of the velocity of a Gaussian.
pub(super) fn velocity_class(row: &Row, steps: &Steps, times: Times) -> f64 {
    let [opens, closes] = row.window;
    life_class(sigma_multiple(row, steps), steps.sigma_log, row.never_fades(), closes - opens, times.reach())
}

/// Returns the step of means, which a few outliers do not widen.
fn place_step(rows: &[Row]) -> f64 {
    let (mut middle, mut whole) = (0.0_f64, 0.0_f64);
    for axis in 0..3 {
        let mut values: Vec<f64> = rows.iter().map(|row| row.mean[axis]).collect();
        values.sort_unstable_by(f64::total_cmp);
        let at =
            |percent: usize| values.get(values.len() * percent / 100).or(values.last()).copied().unwrap_or_default();
        middle = middle.max(at(99) - at(1));
        whole = whole.max(at(100) - at(0));
    }
    // Means are counted from the smallest: no multiple is negative.
    let step = (middle / ACROSS).max(whole / (2.0 * REACH));
    if step > 0.0 { step } else { 1.0 / ACROSS }
}

/// Returns the undivided step of velocities, whose rounding moves no visible center by more than half a step of means.
fn velocity_step(rows: &[Row], steps: &Steps, times: Times) -> f64 {
    let (mut step, mut smallest) = (f64::INFINITY, 0.0_f64);
    for row in rows {
        let speed = row.velocity.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
        if speed == 0.0 {
            continue;
        }
        let divided = velocity_class(row, steps, times).exp2();
        smallest = smallest.max(speed * divided / REACH);
        let [first, last] = row.visible(times.duration, times.reach()).unwrap_or([row.mean_t; 2]);
        let farthest = (first - row.mean_t).abs().max((last - row.mean_t).abs());
        if farthest > 0.0 {
            step = step.min(steps.pos * divided / farthest);
        }
    }
    if step.is_finite() { step.max(smallest) } else { steps.pos.max(smallest) }
}
