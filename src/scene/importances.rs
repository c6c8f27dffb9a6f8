//! How important the Gaussians of a capture are, as a distribution.
//!
//! In: a [`RuntimeScene`]. Out: [`Importances`], a sorted sample of the
//! [importance](crate::gaussian::Gaussian::importance) of its Gaussians, which tells the share of them above an
//! importance, and the least importance with which a share of them is drawn.

use super::RuntimeScene;
use crate::view::Thinning;

/// Most Gaussians in the sample: a share is then exact to a hundredth.
const SAMPLE: usize = 4096;

/// The [importances](crate::gaussian::Gaussian::importance) of a capture's Gaussians, capture units: a sample of at most
/// 4,096, in descending order; empty for an empty capture.
///
/// # Examples
///
/// The most important quarter of a capture, for a device that is too slow for all of it:
///
/// ```
/// use bevy_gs4d::scene::{Importances, synth::{SynthSettings, synthesize}};
///
/// let scene = synthesize(&SynthSettings { count: 1000, ..SynthSettings::default() }).into_runtime()?;
/// let importances = Importances::of(&scene);
/// let thinning = importances.thinning(importances.least_of(0.25));
/// assert_eq!(thinning.weight(0.0), 0.0, "the least important Gaussians are not drawn");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Importances(Vec<f32>);

impl Importances {
    /// Returns the importances of Gaussians at even steps through a capture. At most 4,096 are decoded.
    pub fn of(scene: &RuntimeScene) -> Self {
        let count = scene.len().min(SAMPLE);
        let of_sample = |step: usize| scene.gaussian((step as u64 * scene.len() as u64 / count as u64) as usize);
        let mut sample: Vec<f32> = (0..count).map(|step| of_sample(step).importance()).collect();
        sample.sort_unstable_by(|a, b| b.total_cmp(a));
        Self(sample)
    }

    /// Returns the importances of the Gaussians of several captures together, each with its number of Gaussians.
    pub fn of_all<'a>(captures: impl Iterator<Item = (usize, &'a Self)> + Clone) -> Self {
        let all: usize = captures.clone().map(|(count, _)| count).sum();
        let mut sample = Vec::with_capacity(all.min(SAMPLE));
        for (count, Self(own)) in captures {
            // At least one of each, and as many as there are.
            let share = (count as u64 * SAMPLE as u64).div_ceil(all.max(1) as u64) as usize;
            let share = share.min(own.len());
            sample.extend((0..share).map(|step| own[(2 * step + 1) * own.len() / (2 * share)]));
        }
        sample.sort_unstable_by(|a, b| b.total_cmp(a));
        Self(sample)
    }

    /// Returns the share of the Gaussians that are more important than `least`, from 0 to 1.
    pub fn share_above(&self, least: f32) -> f32 {
        let Self(sample) = self;
        let above = sample.partition_point(|importance| *importance > least);
        // Linear between two of the sample, so that a small change of `least` is a small change of the share.
        let between = match (above.checked_sub(1).and_then(|index| sample.get(index)), sample.get(above)) {
            (Some(more), Some(less)) if more > less => (more - least) / (more - less),
            _ => 0.0,
        };
        (above as f32 + between.clamp(0.0, 1.0)) / (sample.len().max(1) as f32)
    }

    /// Returns the thinning to the Gaussians that are more important than `least`; all, unchanged, if it is 0 or less.
    pub fn thinning(&self, least: f32) -> Thinning {
        if least > 0.0 { Thinning::new(least, self.share_above(least)) } else { Thinning::default() }
    }

    /// Returns the [least importance](Thinning::least) with which about this share of the Gaussians, and at least one of
    /// the sample, is drawn whole; 0 if it is all of them. A share that is not a number counts as 0.
    pub fn least_of(&self, share: f32) -> f32 {
        let Self(sample) = self;
        let count = (share * sample.len() as f32).ceil().max(1.0) as usize;
        if count >= sample.len() { 0.0 } else { sample[count - 1] / Thinning::FULL }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Packing;
    use crate::scene::synth::{SynthSettings, synthesize};

    fn scene(count: usize) -> RuntimeScene {
        synthesize(&SynthSettings { count, ..SynthSettings::default() }).into_runtime().expect("it can be drawn")
    }

    #[test]
    fn the_share_above_an_importance_is_that_of_all_gaussians() {
        let scene = scene(9000);
        let importances = Importances::of(&scene);
        let all: Vec<f32> = scene.iter().map(|gaussian| gaussian.importance()).collect();
        for share in [0.05, 0.3, 0.5, 0.9] {
            let least = importances.least_of(share);
            let thinning = importances.thinning(least);
            let whole = all.iter().filter(|importance| thinning.weight(**importance) > 0.999).count();
            let whole = whole as f32 / all.len() as f32;
            assert!((whole - share).abs() < 0.02, "{whole} of all Gaussians are drawn whole, {share} of the sample");
            let found = importances.share_above(least * Thinning::FULL);
            assert!((found - share).abs() < 1e-3, "there and back: {found}, expected {share}");
        }
        assert_eq!((importances.least_of(1.0), importances.share_above(f32::INFINITY)), (0.0, 0.0), "all, and none");
        assert_eq!(importances.share_above(-1.0), 1.0, "all are more important than nothing");
    }

    #[test]
    fn the_share_changes_little_when_the_importance_does() {
        let importances = Importances::of(&scene(500));
        let (mut least, mut before) = (2.0 * importances.least_of(0.0), 0.0);
        while least > 1e-6 {
            let share = importances.share_above(least);
            assert!(share >= before && share - before < 0.02, "{before} to {share} at {least}");
            (least, before) = (least * 0.998, share);
        }
    }

    #[test]
    fn packed_and_empty_captures_have_importances() {
        let sliced = scene(700);
        let packed = sliced.clone().pack(&Packing::default()).expect("it can be packed");
        let [a, b] = [&sliced, &packed].map(|scene| Importances::of(scene).least_of(0.5));
        assert!((a / b - 1.0).abs() < 0.05, "{a} and {b} are the medians");
        let none = Importances::default();
        assert_eq!((none.least_of(0.5), none.share_above(0.0)), (0.0, 0.0), "an empty capture");
    }

    #[test]
    fn importances_of_several_captures_are_those_of_all_gaussians() {
        let all = scene(9000);
        let gaussians: Vec<_> = all.iter().collect();
        let of = |range: std::ops::Range<usize>| {
            let own = gaussians[range].to_vec();
            (own.len(), Importances::of(&RuntimeScene::sliced(own, Default::default())))
        };
        let parts = [of(0..200), of(200..6000), of(6000..9000), (0, Importances::default())];
        let together = Importances::of_all(parts.iter().map(|(count, importances)| (*count, importances)));
        assert!((SAMPLE..SAMPLE + 4).contains(&together.0.len()), "a sample of {}", together.0.len());
        let alone = Importances::of(&all);
        for share in [0.05, 0.3, 0.5, 0.9] {
            let found = together.share_above(alone.least_of(share) * Thinning::FULL);
            assert!((found - share).abs() < 0.02, "{found} of the Gaussians, expected {share}");
        }
        assert_eq!(Importances::of_all(std::iter::empty()), Importances::default(), "of none");
    }

    #[test]
    fn few_and_equal_gaussians_are_drawn_at_the_smallest_share() {
        for sample in [vec![3.0], vec![5.0, 4.0, 3.0, 2.0, 1.0], vec![0.7; 100]] {
            let importances = Importances(sample.clone());
            for share in [0.0, 1.0 / 16.0, f32::NAN] {
                let least = importances.least_of(share);
                let thinning = importances.thinning(least);
                let most = thinning.weight(sample[0]);
                assert!(most > 0.999, "the most important of {sample:?} has the weight {most} at a share of {share}");
            }
        }
    }
}
