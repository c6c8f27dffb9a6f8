//! Scores: the importance of each Gaussian for the training views.
//!
//! In: a `ScoreEngine`, the `Traits` of the Gaussians, the views. Out: [`Scores`], every [`Variant`] from a single
//! pass over the views, summed in double precision.

pub(crate) mod engine;
pub(crate) mod file;
pub(crate) mod gpu;
pub(crate) mod reference;
mod scoring;
pub(crate) mod traits;
mod variant;

pub(in crate::offline) use engine::INTERRUPTED;
pub use engine::ScoreError;
pub(crate) use engine::{CpuEngine, ScoreEngine};
pub(crate) use file::read_weights;
pub use file::{read_scores, write_scores};
pub(crate) use gpu::GpuEngine;
pub(crate) use reference::{ViewScore, Want};
pub use scoring::ScoringSettings;
pub use traits::ScoreSettings;
pub(crate) use traits::Traits;
pub use variant::{UnknownVariant, Variant};

use super::Progress;
use crate::view::View;
use rayon::prelude::*;

/// Every score of every Gaussian.
///
/// With `c` the contribution `α T` to a pixel, `C_t` its sum over the pixels of all views at time `t`, p the marginal
/// and v its variance:
///
/// ```text
/// change(t)  = 1 / (½ tanh |p''(t)| + ½)      p'' = ((t − μ_t)²/v² − 1/v) p        in (1, 2]: 2 where opacity does not change
/// γ          = (V / V_ref)^volume_power       V: product of the activated scales
///
/// spatial    = Σ_t C_t                        norm2      = sqrt Σ_t C_t²                    peak      = max_t C_t
/// full       = Σ_t change γ C_t               full-norm2 = sqrt Σ_t (change γ C_t)²         full-peak = max_t change γ C_t
/// temporal   = Σ_views change γ               first-derivative: full with p' = −(t − μ_t)/v p in place of p''
/// sigma      = Σ_t v γ C_t
/// energy     = sqrt Σ_views Σ_pixels c²       removal    = sqrt Σ_views Σ_pixels |c (color − behind)|²
/// energy-removal = sqrt(energy · removal)
/// ```
#[derive(Debug, Clone)]
pub struct Scores {
    sums: Vec<Sums>,
    has_volume: bool,
}

impl Scores {
    /// Scores every view once, views of one time together. Advances the caller's task once for each view.
    ///
    /// # Errors
    /// No views, views that show nothing of the scene, a failure of the engine.
    pub fn accumulate(
        engine: &mut dyn ScoreEngine,
        traits: &Traits,
        views: &[View],
        settings: &ScoreSettings,
        progress: &mut dyn Progress,
    ) -> Result<Self, ScoreError> {
        if views.is_empty() {
            return Err(ScoreError::NoViews);
        }
        let factors = traits.volume_factors(settings);
        let weights = |index: usize| factors.as_ref().map_or(1.0, |factors| factors[index]);
        let mut sums = vec![Sums::default(); traits.moments.len()];
        let mut views = views.to_vec();
        views.sort_by(|a, b| a.time.total_cmp(&b.time));
        for moment in views.chunk_by(|a, b| a.time == b.time) {
            let mut contribution = vec![0.0; sums.len()];
            for view in moment {
                if progress.is_interrupted() {
                    return Err(ScoreError::Interrupted);
                }
                let score = engine.score(view, Want::Removal)?;
                add(&mut contribution, &score.contribution);
                for ((sum, &energy), &removal) in sums.iter_mut().zip(&score.energy).zip(&score.removal) {
                    sum.energy += f64::from(energy);
                    sum.removal += f64::from(removal);
                }
                progress.advance();
            }
            let (time, count) = (f64::from(moment[0].time), moment.len() as f64);
            sums.par_iter_mut().enumerate().for_each(|(index, sum)| {
                sum.add_moment(time, count, traits.moments[index], weights(index), contribution[index]);
            });
        }
        if sums.iter().all(|sum| sum.spatial == 0.0) {
            return Err(ScoreError::NothingContributes);
        }
        Ok(Self { sums, has_volume: factors.is_some() })
    }

    /// Returns one score of each Gaussian, in the order of the scene.
    ///
    /// # Errors
    /// [`ScoreError::NoVolume`] for a score that needs the volume, unless the scene was in the trained form.
    pub fn of(&self, variant: Variant) -> Result<Vec<f32>, ScoreError> {
        if variant.needs_volume() && !self.has_volume {
            return Err(ScoreError::NoVolume { variant });
        }
        Ok(self.sums.iter().map(|sum| sum.value(variant) as f32).collect())
    }

    /// Returns whether the volume of the Gaussians, which some variants need, is known.
    pub fn has_volume(&self) -> bool {
        self.has_volume
    }

    /// Returns the number of Gaussians that contribute to at least one view.
    pub fn contributing(&self) -> usize {
        self.sums.iter().filter(|sum| sum.spatial > 0.0).count()
    }
}

fn add(sums: &mut [f64], values: &[f32]) {
    for (sum, &value) in sums.iter_mut().zip(values) {
        *sum += f64::from(value);
    }
}

/// The sums of one Gaussian.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    spatial: f64,
    temporal: f64,
    full: f64,
    first_derivative: f64,
    sigma: f64,
    squares: f64,
    peak: f64,
    full_squares: f64,
    full_peak: f64,
    energy: f64,
    removal: f64,
}

impl Sums {
    /// Adds the views of one time: their number, and the sum of the contributions of the Gaussian to these views.
    fn add_moment(&mut self, time: f64, views: f64, [mean, variance]: [f64; 2], volume: f64, contribution: f64) {
        let distance = time - mean;
        let marginal = (-0.5 * distance * distance / variance).exp();
        let first = -distance / variance * marginal;
        let second = (distance / variance * (distance / variance) - variance.recip()) * marginal;
        let steadiness = |derivative: f64| (0.5 * derivative.abs().tanh() + 0.5).recip();
        let weight = steadiness(second) * volume;
        let full = weight * contribution;
        self.spatial += contribution;
        self.temporal += views * weight;
        self.full += full;
        self.first_derivative += steadiness(first) * volume * contribution;
        self.sigma += variance * volume * contribution;
        self.squares += contribution * contribution;
        self.peak = self.peak.max(contribution);
        self.full_squares += full * full;
        self.full_peak = self.full_peak.max(full);
    }

    fn value(&self, variant: Variant) -> f64 {
        match variant {
            Variant::Spatial => self.spatial,
            Variant::Temporal => self.temporal,
            Variant::Full => self.full,
            Variant::FirstDerivative => self.first_derivative,
            Variant::Sigma => self.sigma,
            Variant::Norm2 => self.squares.sqrt(),
            Variant::Peak => self.peak,
            Variant::FullNorm2 => self.full_squares.sqrt(),
            Variant::FullPeak => self.full_peak,
            Variant::Energy => self.energy.sqrt(),
            Variant::Removal => self.removal.sqrt(),
            Variant::EnergyRemoval => (self.energy.sqrt() * self.removal.sqrt()).sqrt(),
        }
    }
}
