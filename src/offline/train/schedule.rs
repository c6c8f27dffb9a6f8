//! The schedule of training: which views, over which background, at which rates, with which random numbers.
//!
//! In: a seed, the number of views and the number of a step. Out: the views of its batch, the background of each, the
//! rates of the optimizer ([`Step`]). Everything follows from the number of the step alone, so that a resumed run goes
//! on as if it had not stopped.

use crate::scene::random::Random;

/// Learning rates of Adam, by kind of parameter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rates {
    /// Of the mean, in units of `spatial_lr_scale`.
    pub mean: f64,
    /// Of the temporal mean, in units of `spatial_lr_scale`, whose lengths are relative to the unit of a small scene.
    pub mean_t: f64,
    /// Of the logarithms of all scales.
    pub scale: f64,
    /// Of both rotations.
    pub rotation: f64,
    /// Of the logit of opacity.
    pub opacity: f64,
    /// Of the first color coefficient.
    pub color: f64,
    /// Of the other color coefficients.
    pub harmonics: f64,
    /// Of the environment map; 0 keeps it as it is.
    pub environment: f64,
    /// Of the exposures of cameras, if they are trained.
    pub exposure: f64,
}

impl Rates {
    /// The rates with which the original ends its training.
    pub const ORIGINAL: Self = Self {
        mean: 1.6e-6,
        mean_t: 1.6e-4,
        scale: 5e-3,
        rotation: 1e-3,
        opacity: 0.05,
        color: 2.5e-3,
        harmonics: 1.25e-4,
        environment: 2.5e-3,
        exposure: 1e-3,
    };

    /// The rates of fine-tuning after pruning: means move as fast as when the original begins its training, since the
    /// Gaussians that are left must spread to the places of those that were removed.
    pub const OURS: Self = Self { mean: 1.6e-4, ..Self::ORIGINAL };

    /// Returns the rates of the first four four-vectors of each Gaussian's raw parameters and of the fifth, as `adam`
    /// reads them. `unit` is the unit of length, capture units.
    pub(crate) fn of_parameters(&self, spatial_lr_scale: f64, unit: f64, factor: f64) -> [[f32; 4]; 5] {
        let rate = |rate: f64| (rate * factor) as f32;
        let mean = rate(self.mean * spatial_lr_scale);
        [
            [mean, mean, mean, rate(self.mean_t * spatial_lr_scale / unit)],
            [rate(self.scale); 4],
            [rate(self.rotation); 4],
            [rate(self.rotation); 4],
            [rate(self.opacity), 0.0, 0.0, 0.0],
        ]
    }

    /// Returns the rates of the color coefficients, in the same form.
    pub(crate) fn of_harmonics(&self, factor: f64) -> [[f32; 4]; 5] {
        let (first, other) = ((self.color * factor) as f32, (self.harmonics * factor) as f32);
        let mut rates = [[other; 4]; 5];
        rates[0][..3].fill(first);
        rates
    }
}

/// One step, as its schedule says.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Step {
    /// Number of the step in its run, from 0.
    pub index: usize,
    /// Number of the step since the moments of the optimizer were 0, from 1.
    pub count: usize,
    /// Rates of the optimizer.
    pub rates: Rates,
    /// Factor on all rates.
    pub factor: f64,
    /// Number of values of the color of each Gaussian that are trained, from the first; `None`: all.
    pub color_values: Option<u32>,
    /// Whether the step is one of training from pictures alone, in which Gaussians are hidden, moved and replaced.
    pub grows: bool,
}

impl Step {
    /// Returns step number `count`, from 1, of fine-tuning with these rates, times a factor.
    pub fn new(rates: Rates, factor: f64, count: usize) -> Self {
        Self { index: count.saturating_sub(1), count, rates, factor, color_values: None, grows: false }
    }
}

/// What is behind the images where they are not covered.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Behind {
    /// A random color for each view, if images have transparent pixels or masks; else as [`Fixed`](Self::Fixed). With a
    /// fixed color, fog of that color costs nothing.
    #[default]
    Random,
    /// The background that the capture was trained with.
    Fixed,
}

/// The views of each step.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Schedule {
    pub seed: u64,
    pub views: usize,
    pub batch: usize,
}

impl Schedule {
    /// Returns the views of a step, from 0: every view once, in random order, then all again. Views that do not fill a
    /// batch are left out.
    pub(crate) fn batch(&self, step: usize) -> Vec<usize> {
        let batch = self.batch.min(self.views).max(1);
        let per_epoch = (self.views / batch).max(1);
        let order = shuffled(self.views, self.seed, (step / per_epoch) as u64);
        order[step % per_epoch * batch..][..batch].to_vec()
    }

    /// Returns a random color for a view of a step.
    pub(crate) fn background(&self, step: usize, place: usize) -> [f32; 3] {
        let mut random = Random::new(mixed(self.seed, (step * self.batch + place) as u64));
        [random.unit(), random.unit(), random.unit()]
    }
}

/// Returns the seed of the noise of a step.
pub fn noise_seed(seed: u64, step: usize) -> u32 {
    (mixed(seed.wrapping_add(2), step as u64) >> 32) as u32
}

/// Returns the seed of the dropout of a step.
pub fn dropout_seed(seed: u64, step: usize) -> u32 {
    (mixed(seed.wrapping_add(4), step as u64) >> 32) as u32
}

/// Returns the seed of the relocation or densification after this number of steps.
pub fn relocation_seed(seed: u64, steps: usize) -> u64 {
    mixed(seed.wrapping_add(3), steps as u64)
}

/// Returns the factor on all rates at a step: it falls from 1 to `last` along half a cosine.
pub(crate) fn decay(step: usize, steps: usize, last: f64) -> f64 {
    let done = step as f64 / steps.max(1) as f64;
    last + (1.0 - last) * 0.5 * (1.0 + (std::f64::consts::PI * done).cos())
}

/// Returns 0 to `count`, shuffled.
fn shuffled(count: usize, seed: u64, epoch: u64) -> Vec<usize> {
    let mut random = Random::new(mixed(seed.wrapping_add(1), epoch));
    let mut order: Vec<usize> = (0..count).collect();
    for last in (1..count).rev() {
        order.swap(last, random.below(last + 1));
    }
    order
}

/// Returns a seed for one of many sequences.
fn mixed(seed: u64, number: u64) -> u64 {
    (seed ^ number.wrapping_mul(0xD129_0D3A_2B5C_6F1D)).wrapping_mul(0x9E37_79B9_7F4A_7C15)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_view_comes_once_in_each_round() {
        let schedule = Schedule { seed: 3, views: 11, batch: 2 };
        let round = |first: usize| {
            let mut seen: Vec<usize> = (first..first + 5).flat_map(|step| schedule.batch(step)).collect();
            seen.sort_unstable();
            seen.dedup();
            seen
        };
        assert_eq!((round(0).len(), round(5).len()), (10, 10), "ten of eleven, without repetition");
        assert_ne!(schedule.batch(0), schedule.batch(5), "in another order");
        assert_eq!(schedule.batch(7), schedule.batch(7), "the same whenever it is asked for");
        let whole = Schedule { batch: 50, ..schedule };
        assert_eq!(whole.batch(1).len(), 11, "a batch is at most all views");
    }

    #[test]
    fn rates_fall_to_their_last() {
        assert_eq!(decay(0, 100, 0.1), 1.0, "whole at first");
        assert!((decay(50, 100, 0.1) - 0.55).abs() < 1e-12, "halfway");
        assert!((decay(100, 100, 0.1) - 0.1).abs() < 1e-12, "the last");
        assert_eq!(decay(70, 100, 1.0), 1.0, "or constant");
    }
}
