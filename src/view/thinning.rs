//! Thinning: a capture drawn with its most important Gaussians alone, which fill the gaps of the others.
//!
//! In: the least importance that is drawn, and the share of Gaussians above it. Out: a [`Thinning`]: the weight of a
//! Gaussian of some importance, and how much larger and more opaque the remaining Gaussians are drawn.

/// The factor on the covariances of the Gaussians that remain is their share to this power, at most [`MOST_GROWTH`];
/// their areas grow by the same factor.
const GROWTH: f32 = -0.2;
/// The largest factor, that of a thirtieth of the Gaussians.
const MOST_GROWTH: f32 = 2.0;
/// Their transmittance is raised to the share to this power, at most to [`MOST_BOOST`].
const BOOST: f32 = -0.7;
/// The largest power of their transmittance: each covers as much as two copies of it.
const MOST_BOOST: f32 = 2.0;

/// The Gaussians of a capture that are drawn, by their importance ([`Gaussian::importance`]), and how they are changed
/// to fill the gaps of those that are not. It is continuous: a small change of [`least`](Self::least) changes the
/// picture a little.
///
/// Default: all Gaussians, unchanged.
///
/// [`Gaussian::importance`]: crate::gaussian::Gaussian::importance
///
/// # Examples
///
/// ```
/// use bevy_gs4d::view::Thinning;
///
/// let half = Thinning::new(0.02, 0.5);
/// assert_eq!(half.weight(0.01), 0.0, "less important than the least");
/// assert_eq!(half.weight(0.03), 1.0, "more important");
/// assert!(half.growth > 1.0 && half.boost > 1.0, "the others fill the gaps");
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Thinning {
    /// Gaussians of at most this importance are not drawn, those of up to 1.25 times as much are fainter; capture
    /// units. 0: all Gaussians are drawn, unchanged.
    pub least: f32,
    /// Factor on the covariances of the Gaussians that are drawn, from 1 to 2.
    pub growth: f32,
    /// Power of their transmittance `1 − opacity`, from 1 to 2.
    pub boost: f32,
}

impl Default for Thinning {
    fn default() -> Self {
        Self { least: 0.0, growth: 1.0, boost: 1.0 }
    }
}

impl Thinning {
    /// Gaussians fade in from the least importance to this multiple of it, so that none appears at once.
    pub const FULL: f32 = 1.25;

    /// Returns the thinning to the Gaussians above an importance, which are this share of all, above 0 and at most 1.
    pub fn new(least: f32, share: f32) -> Self {
        let share = share.clamp(f32::MIN_POSITIVE, 1.0);
        Self { least, growth: share.powf(GROWTH).min(MOST_GROWTH), boost: share.powf(BOOST).min(MOST_BOOST) }
    }

    /// Returns whether all Gaussians are drawn, unchanged.
    pub fn is_none(&self) -> bool {
        self.least <= 0.0
    }

    /// Returns the factor on the opacity of a Gaussian of this importance, from 0 to 1.
    pub fn weight(&self, importance: f32) -> f32 {
        if self.is_none() { 1.0 } else { ((importance / self.least - 1.0) / (Self::FULL - 1.0)).clamp(0.0, 1.0) }
    }

    /// Returns the opacity at which a splat of this opacity is drawn.
    pub fn boosted(&self, opacity: f32) -> f32 {
        if self.is_none() || opacity >= 1.0 { opacity } else { 1.0 - (1.0 - opacity).powf(self.boost) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_a_least_importance_nothing_changes() {
        for thinning in [Thinning::default(), Thinning::new(0.0, 0.3)] {
            assert!(thinning.is_none(), "all Gaussians: {thinning:?}");
            assert_eq!((thinning.weight(0.0), thinning.boosted(0.3)), (1.0, 0.3), "unchanged: {thinning:?}");
        }
    }

    #[test]
    fn gaussians_fade_in_above_the_least_importance() {
        let thinning = Thinning::new(0.4, 0.5);
        let found = [0.0, 0.4, 0.45, 0.5, 9.0, f32::INFINITY].map(|importance| thinning.weight(importance));
        assert_eq!(found[..2], [0.0; 2], "not drawn up to the least importance");
        assert!((found[2] - 0.5).abs() < 1e-5, "half as opaque in the middle: {}", found[2]);
        assert!(found[3..].iter().all(|weight| (weight - 1.0).abs() < 1e-5), "whole from 1.25 times it on: {found:?}");
    }

    #[test]
    fn fewer_gaussians_are_larger_and_more_opaque() {
        let found = [1.0, 0.6, 0.4, 0.25, 0.1, 0.0].map(|share| Thinning::new(1.0, share));
        assert_eq!((found[0].growth, found[0].boost), (1.0, 1.0), "all Gaussians fill no gaps");
        for pair in found.windows(2) {
            assert!(pair[1].growth > pair[0].growth && pair[1].boost >= pair[0].boost, "a smaller share: {pair:?}");
        }
        assert!(found.iter().all(|thinning| thinning.growth <= 2.0 && thinning.boost <= 2.0), "bounds: {found:?}");
        let two = Thinning { least: 1.0, growth: 1.0, boost: 2.0 };
        assert!((two.boosted(0.5) - 0.75).abs() < 1e-6, "two copies of half the opacity");
        assert_eq!([0.0, 1.0, 1.5].map(|opacity| two.boosted(opacity)), [0.0, 1.0, 1.5], "nothing and everything stay");
    }
}
