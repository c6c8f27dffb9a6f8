//! Properties of Gaussians that scores need besides the contributions.
//!
//! In: a scene, and [`ScoreSettings`]. Out: temporal mean, variance and the factor by volume of each Gaussian.

use crate::gaussian::{InvalidGaussian, Model, Parameters};
use crate::scene::{GaussianScene, SceneForm};

/// Parameters that the paper leaves open.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default)]
pub struct ScoreSettings {
    /// Power of the volume in `γ = (V / V_ref)^power`; 0 leaves the volume out. Default: 0.1.
    pub volume_power: f64,
    /// Rank of `V_ref` among all volumes in descending order, as a fraction of their number, 0 to 1. Default: 0.9.
    pub volume_rank: f64,
}

impl Default for ScoreSettings {
    fn default() -> Self {
        Self { volume_power: 0.1, volume_rank: 0.9 }
    }
}

/// Upper limit of the variance, timestamp units squared.
const LONGEST: f64 = 1e24;

/// Properties of the Gaussians on which scores depend besides the contributions.
#[derive(Debug, Clone, PartialEq)]
pub struct Traits {
    /// Temporal mean (timestamp units) and variance (timestamp units squared) of each Gaussian.
    pub(super) moments: Vec<[f64; 2]>,
    /// Logarithm of the product of the activated scales; `None` unless the scene is in the trained form.
    log_volume: Option<Vec<f64>>,
}

impl Traits {
    /// Reads the properties from a scene of any form.
    ///
    /// # Errors
    /// The first Gaussian that cannot be drawn.
    pub fn of(scene: &GaussianScene) -> Result<Self, InvalidGaussian> {
        // A Gaussian of constant opacity has an infinite variance, which is limited so that sums are finite. If all
        // Gaussians have it, the limit has no effect.
        let moments = scene
            .gaussians()?
            .iter()
            .map(|gaussian| [f64::from(gaussian.mean_t), f64::from(gaussian.sigma_t).powi(2).min(LONGEST)])
            .collect();
        let log_volume = match &scene.form {
            SceneForm::Trained(trained) => Some(log_volumes(&trained.parameters)),
            SceneForm::Ready(_) => None,
        };
        Ok(Self { moments, log_volume })
    }

    /// Returns γ of each Gaussian; `None` if the volume is unknown.
    pub(super) fn volume_factors(&self, settings: &ScoreSettings) -> Option<Vec<f64>> {
        let volumes = self.log_volume.as_ref()?;
        let mut sorted = volumes.clone();
        sorted.sort_unstable_by(|a, b| b.total_cmp(a));
        let rank = (settings.volume_rank * sorted.len() as f64) as usize;
        let reference = sorted.get(rank.min(sorted.len().saturating_sub(1))).copied().unwrap_or_default();
        Some(volumes.iter().map(|volume| (settings.volume_power * (volume - reference)).exp()).collect())
    }
}

fn log_volumes(parameters: &Parameters) -> Vec<f64> {
    let space = parameters.log_scale.iter().map(|scale| scale.iter().map(|&s| f64::from(s)).sum::<f64>());
    if parameters.model() == Model::Static3d {
        return space.collect();
    }
    space.zip(&parameters.log_scale_t).map(|(space, &time)| space + f64::from(time)).collect()
}
