//! Activity of Gaussians over time: the data of the three plots in the paper's Figure 2.
//!
//! In: runtime Gaussians before and after a bake. Out: the distribution of their temporal variances, the fraction that
//! is active at each time, and the overlap of each active set with the first set.

use crate::gaussian::Gaussian;
use crate::scene::TemporalFilter;
use serde::Serialize;

/// Number of bins of the histogram.
const BINS: usize = 40;

/// Fractions of the Gaussians by temporal variance Σ_t, in bins of equal width on a logarithmic scale.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct VarianceHistogram {
    /// Borders of the bins, timestamp units squared; one more than the number of bins.
    pub borders: Vec<f64>,
    /// Fraction of the Gaussians in each bin before.
    pub before: Vec<f64>,
    /// Fraction of the Gaussians in each bin after.
    pub after: Vec<f64>,
}

impl VarianceHistogram {
    /// Computes the histogram. Gaussians that are always active have an infinite variance and are in no bin.
    pub fn of(before: &[Gaussian], after: &[Gaussian]) -> Self {
        let variance = |g: &Gaussian| f64::from(g.sigma_t).powi(2).log10();
        let all = before.iter().chain(after).map(variance).filter(|v| v.is_finite());
        let [low, high] = all.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], v| [low.min(v), high.max(v)]);
        let (low, high) = if low < high {
            (low, high)
        } else if low.is_finite() {
            (low - 0.5, low + 0.5)
        } else {
            (-4.0, 1.0)
        };
        let width = (high - low) / BINS as f64;
        let fractions = |gaussians: &[Gaussian]| {
            let mut bins = vec![0.0; BINS];
            for value in gaussians.iter().map(variance).filter(|v| v.is_finite()) {
                let bin = (((value - low) / width) as usize).min(BINS - 1);
                bins[bin] += 1.0 / gaussians.len() as f64;
            }
            bins
        };
        Self {
            borders: (0..=BINS).map(|i| 10f64.powf(low + width * i as f64)).collect(),
            before: fractions(before),
            after: fractions(after),
        }
    }
}

/// The active Gaussians over time: their fraction, and the overlap of the active sets.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Activity {
    /// Fraction of the Gaussians whose marginal exceeds the cut-off, at each time.
    pub share: Vec<f64>,
    /// Intersection over union of the active set with that at the first time.
    pub overlap: Vec<f64>,
}

impl Activity {
    /// Computes fraction and overlap at each of `times`. A Gaussian is active while its marginal is above `cutoff`.
    pub fn of(gaussians: &[Gaussian], cutoff: f32, times: &[f32]) -> Self {
        let active = |time: f32| gaussians.iter().map(move |g| g.marginal(time) > cutoff);
        let first: Vec<bool> = times.first().map(|&time| active(time).collect()).unwrap_or_default();
        let (mut share, mut overlap) = (Vec::new(), Vec::new());
        for &time in times {
            let (mut count, mut both, mut either) = (0usize, 0usize, 0usize);
            for (now, then) in active(time).zip(&first) {
                count += usize::from(now);
                both += usize::from(now && *then);
                either += usize::from(now || *then);
            }
            share.push(count as f64 / gaussians.len().max(1) as f64);
            overlap.push(if either == 0 { 1.0 } else { both as f64 / either as f64 });
        }
        Self { share, overlap }
    }
}

/// Returns the fraction of the Gaussians that a filter leaves active, at each time.
///
/// # Panics
/// If the filter has no segments.
pub(crate) fn filter_shares(filter: &TemporalFilter, interval: [f32; 2], times: &[f32]) -> Vec<f64> {
    let fraction = |segment: u32| {
        let active = (0..filter.count).filter(|&index| filter.is_active(segment, index)).count();
        active as f64 / filter.count.max(1) as f64
    };
    let fractions: Vec<f64> = (0..filter.segments).map(fraction).collect();
    times.iter().map(|&time| fractions[filter.segment_of(time, interval) as usize]).collect()
}

/// Returns `count` evenly spaced times, both ends of the interval included.
pub(crate) fn even_times(interval: [f32; 2], count: usize) -> Vec<f32> {
    let step = (interval[1] - interval[0]) / (count.max(2) - 1) as f32;
    (0..count).map(|i| interval[0] + step * i as f32).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn gaussian(mean_t: f32, sigma_t: f32) -> Gaussian {
        Gaussian { mean_t, sigma_t, opacity: 0.5, ..bytemuck::Zeroable::zeroed() }
    }

    #[test]
    fn fractions_of_the_histogram_leave_out_gaussians_of_infinite_variance() {
        let before = [gaussian(0.0, 0.1), gaussian(0.0, 0.01), gaussian(0.0, 1.0), gaussian(0.0, f32::INFINITY)];
        let histogram = VarianceHistogram::of(&before, &before[..1]);
        assert_eq!(histogram.borders.len(), BINS + 1, "one border more than bins");
        assert!(
            (histogram.before.iter().sum::<f64>() - 0.75).abs() < 1e-12,
            "three of four Gaussians have a finite variance"
        );
        assert!((histogram.after.iter().sum::<f64>() - 1.0).abs() < 1e-12, "the only Gaussian is in a bin");
        assert!(
            (histogram.borders[0] - 1e-4).abs() < 1e-7,
            "the first border is the smallest variance: {}",
            histogram.borders[0]
        );
    }

    #[test]
    fn a_variance_that_all_gaussians_have_is_within_its_bin() {
        let histogram = VarianceHistogram::of(&[gaussian(0.0, 100.0)], &[]);
        let full = histogram.before.iter().position(|&share| share > 0.0).expect("the Gaussian is in a bin");
        let [from, to] = [histogram.borders[full], histogram.borders[full + 1]];
        assert!(from <= 1.001e4 && to >= 0.999e4, "100² is in the bin from {from} to {to}");
    }

    #[test]
    fn overlap_starts_at_one_and_ends_with_the_first_set() {
        let gaussians = [gaussian(0.0, 0.1), gaussian(1.0, 0.1), gaussian(0.5, 10.0)];
        let activity = Activity::of(&gaussians, 0.05, &even_times([0.0, 1.0], 3));
        assert_eq!(activity.overlap, [1.0, 0.5, 1.0 / 3.0], "only the Gaussian of long lifespan is active throughout");
        assert!(
            (activity.share[1] - 1.0 / 3.0).abs() < 1e-12,
            "one of three is active in the middle: {:?}",
            activity.share
        );
        assert!(
            (activity.share[0] - 2.0 / 3.0).abs() < 1e-12,
            "two of three are active at the start: {:?}",
            activity.share
        );
    }
}
