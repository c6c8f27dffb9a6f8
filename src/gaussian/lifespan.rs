//! The lifespan of a Gaussian: its opacity envelope in time.
//!
//! In: a temporal mean and deviation, a time. Out: the marginal at that time; the limits below which a Gaussian is not
//! drawn.

/// A Gaussian is drawn only at times at which its marginal is above this value (strict, as in the original), unless its
/// scene has another one.
pub const MARGINAL_CUTOFF: f32 = 0.05;

/// The smallest cut-off: a splat with a lower marginal has an alpha below 1/255, which is never drawn.
pub const SMALLEST_CUTOFF: f32 = 1.0 / 255.0;

/// Returns the distance in time from the temporal mean at which the marginal falls to the cut-off, in temporal
/// deviations: sqrt(−2 ln cutoff), rounded up.
pub(crate) fn lifespan_reach(cutoff: f32) -> f64 {
    (-2.0 * f64::from(cutoff).ln()).sqrt() * 1.0001
}

/// The opacity envelope of a Gaussian in time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lifespan {
    /// Temporal mean μ_t, timestamp units.
    pub mean_t: f32,
    /// Temporal standard deviation σ_t, timestamp units; infinite if the Gaussian is present at every time.
    pub sigma_t: f32,
}

impl Lifespan {
    /// Returns the unnormalized marginal at `time`, in (0, 1]: the factor on the opacity.
    pub fn marginal(self, time: f32) -> f32 {
        let z = (time - self.mean_t) * self.sigma_t.recip();
        (-0.5 * z * z).exp()
    }
}
