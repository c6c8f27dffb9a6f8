//! Scores: the importance of each Gaussian for the training views.
//!
//! In: a `ScoreEngine`, the `Traits` of the Gaussians, the views. Out: [`Scores`], every [`Variant`] from a single
//! pass over the views, summed in double precision.

pub(crate) mod engine;
mod error;
pub(crate) mod file;
pub(crate) mod gpu;
pub(crate) mod parts;
pub(crate) mod reference;
mod scorer;
mod scoring;
mod sums;
mod total;
pub(crate) mod traits;
mod variant;

pub(crate) use engine::ScoreEngine;
pub use error::ScoreError;
pub(crate) use file::read_weights;
pub use file::{read_scores, write_scores};
pub(crate) use gpu::GpuEngine;
pub(crate) use reference::{ViewScore, Want};
pub(crate) use scorer::scorer;
pub use scoring::ScoringSettings;
pub use traits::ScoreSettings;
pub(crate) use traits::Traits;
pub use variant::{UnknownVariant, Variant};

use crate::offline::store::StoreError;
use crate::offline::store::shard::Shard;
use crate::offline::store::stored::Stored;
use crate::offline::work::{Progress, proceed};
use crate::view::View;
use rayon::prelude::*;
use sums::{BYTES, Sums};

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
    views: usize,
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
        Self::of_shard(engine, traits, views, settings, Shard::WHOLE, progress)?.whole()
    }

    /// Scores the views of a shard: some of the times with all their views. The scores of all shards are
    /// [merged](Self::merge).
    ///
    /// # Errors
    /// No views at all, a failure of the engine.
    pub(crate) fn of_shard(
        engine: &mut dyn ScoreEngine,
        traits: &Traits,
        views: &[View],
        settings: &ScoreSettings,
        shard: Shard,
        progress: &mut dyn Progress,
    ) -> Result<Self, ScoreError> {
        if views.is_empty() {
            return Err(ScoreError::NoViews);
        }
        let factors = traits.volume_factors(settings);
        let weights = |index: usize| factors.as_ref().map_or(1.0, |factors| factors[index]);
        let mut sums = vec![Sums::default(); traits.moments.len()];
        let groups = by_time(views, shard);
        for group in &groups {
            let mut contribution = vec![0.0; sums.len()];
            for view in group {
                proceed(progress)?;
                let score = engine.score(view, Want::Removal)?;
                add(&mut contribution, &score.contribution);
                sums.par_iter_mut().zip(&score.energy).zip(&score.removal).for_each(|((sum, &energy), &removal)| {
                    sum.add_view(energy.into(), removal.into());
                });
                progress.advance();
            }
            let (time, count) = (f64::from(group[0].time), group.len() as f64);
            sums.par_iter_mut().enumerate().for_each(|(index, sum)| {
                sum.add_time(time, count, traits.moments[index], weights(index), contribution[index]);
            });
        }
        Ok(Self { sums, has_volume: factors.is_some(), views: groups.iter().map(Vec::len).sum() })
    }

    /// Adds the scores of another shard with the same inputs.
    pub(crate) fn merge(&mut self, other: &Self) {
        self.sums.par_iter_mut().zip(&other.sums).for_each(|(sum, other)| sum.merge(other));
        self.views += other.views;
    }

    /// Checks the scores of all shards, and returns them.
    ///
    /// # Errors
    /// Views that show nothing of the scene.
    pub(crate) fn whole(self) -> Result<Self, ScoreError> {
        match self.contributing() {
            0 => Err(ScoreError::NothingContributes),
            _ => Ok(self),
        }
    }

    /// Returns the number of views that a shard scores.
    pub(super) fn count(views: &[View], shard: Shard) -> usize {
        by_time(views, shard).iter().map(Vec::len).sum()
    }

    /// Returns the number of views that were scored.
    pub(crate) fn views(&self) -> usize {
        self.views
    }

    /// Returns the number of bytes of [`encode`](Stored::encode).
    fn bytes(&self) -> usize {
        HEAD + self.len() * BYTES
    }

    /// Returns the number of Gaussians.
    pub(crate) fn len(&self) -> usize {
        self.sums.len()
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
        self.sums.iter().filter(|sum| sum.spatial.value() > 0.0).count()
    }
}

/// Returns the views of a shard in groups of one time each. Times ascend.
fn by_time(views: &[View], shard: Shard) -> Vec<Vec<View>> {
    let mut views = views.to_vec();
    views.sort_by(|a, b| a.time.total_cmp(&b.time));
    let groups: Vec<Vec<View>> = views.chunk_by(|a, b| a.time == b.time).map(<[View]>::to_vec).collect();
    let counts: Vec<usize> = groups.iter().map(Vec::len).collect();
    shard.share(&counts).into_iter().filter_map(|index| groups.get(index).cloned()).collect()
}

fn add(sums: &mut [f64], values: &[f32]) {
    for (sum, &value) in sums.iter_mut().zip(values) {
        *sum += f64::from(value);
    }
}

/// Whether the volume is known (a byte) and the number of views, then the sums of each Gaussian.
impl Stored for Scores {
    fn encode(&self) -> Result<Vec<u8>, StoreError> {
        let mut bytes = Vec::with_capacity(self.bytes());
        bytes.push(u8::from(self.has_volume));
        bytes.extend((self.views as u64).to_le_bytes());
        self.sums.iter().for_each(|sums| bytes.extend(sums.to_bytes()));
        Ok(bytes)
    }

    fn decode(bytes: &[u8]) -> Option<Self> {
        let (&has_volume, rest) = bytes.split_first()?;
        let (views, rest) = rest.split_first_chunk()?;
        let (sums, []) = rest.as_chunks::<BYTES>() else { return None };
        let sums = sums.iter().map(Sums::of_bytes).collect();
        Some(Self { sums, has_volume: has_volume != 0, views: usize::try_from(u64::from_le_bytes(*views)).ok()? })
    }
}

/// Bytes before the sums.
const HEAD: usize = 1 + size_of::<u64>();
