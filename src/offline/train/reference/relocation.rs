//! Relocation of Gaussians that have faded; CPU reference of `shaders/offline/relocate.wgsl`.
//!
//! In: raw parameters, the seed of random numbers. Out: the parameters with every faded Gaussian at the place of a live
//! one, drawn by opacity, and the moves, by which colors are copied. As in 3DGS-MCMC, this takes the place of removing
//! and cloning: the number of Gaussians stays, and the picture hardly changes. Of `N` Gaussians in one place each gets
//! the opacity and the scales
//!
//! ```text
//! o' = 1 − (1 − o)^(1/N)          s' = s o / Σ_{i=1..N} Σ_{k=0..i−1} binom(i−1, k) (−1)^k o'^(k+1) / √(k+1)
//! ```
//!
//! so that alpha in the center, and its integral along any line through the center, stay as they were. The temporal
//! scale gets the same factor as the others: then the integral over time stays too, and so does the velocity, which is
//! a ratio of covariances.

use crate::offline::engine::layout::TrainedRecord;
use crate::scene::random::Random;

/// Opacity up to which a Gaussian has faded, that of 3DGS-MCMC and of the original's pruning.
pub const FADED: f64 = 0.005;
/// Most Gaussians in one place after a relocation.
const MOST_COPIES: u32 = 51;
/// Largest opacity of a relocated Gaussian.
const MOST_OPAQUE: f64 = 1.0 - 1e-6;

/// Moves every Gaussian that has faded to a live one. Returns the moves: where to, where from. Nothing moves if no
/// Gaussian is live, nor to a Gaussian that has been drawn 50 times, up to which the sums above are accurate in double
/// precision.
pub fn relocate(records: &mut [TrainedRecord], seed: u64) -> Vec<[u32; 2]> {
    let mut random = Random::new(seed);
    let opacity = |record: &TrainedRecord| 1.0 / (1.0 + (-f64::from(record.opacity_logit[0])).exp());
    let is_live = |record: &TrainedRecord| opacity(record) > FADED;
    let (live, faded): (Vec<u32>, Vec<u32>) =
        (0..records.len() as u32).partition(|&index| is_live(&records[index as usize]));
    // Sums of opacities up to each live Gaussian: by opacity the Gaussians are drawn (3DGS-MCMC), since the images need
    // opaque ones most.
    let mut sums = Vec::with_capacity(live.len());
    let mut total = 0.0;
    for &index in &live {
        total += opacity(&records[index as usize]);
        sums.push(total);
    }
    let Some(last) = live.len().checked_sub(1) else { return Vec::new() };
    let mut copies = vec![1u32; live.len()];
    let mut moves = Vec::with_capacity(faded.len());
    for to in faded {
        let drawn = f64::from(random.unit()) * total;
        let place = sums.partition_point(|&sum| sum <= drawn).min(last);
        if copies[place] < MOST_COPIES {
            copies[place] += 1;
            moves.push([to, live[place]]);
        }
    }
    for (&index, &copies) in live.iter().zip(&copies).filter(|(_, copies)| **copies > 1) {
        let record = &mut records[index as usize];
        let (shared, factor) = shared_by(opacity(record), copies);
        let shared = shared.clamp(FADED, MOST_OPAQUE);
        let smaller = factor.ln() as f32;
        record.opacity_logit[0] = (shared / (1.0 - shared)).ln() as f32;
        record.log_scale = record.log_scale.map(|scale| scale + smaller);
        record.log_scale_t += smaller;
    }
    for &[to, from] in &moves {
        records[to as usize] = records[from as usize];
    }
    moves
}

/// Returns the opacity that each of so many Gaussians in one place has instead of one with this opacity, and the factor
/// on its scales.
fn shared_by(opacity: f64, copies: u32) -> (f64, f64) {
    let shared = 1.0 - (1.0 - opacity).powf(1.0 / f64::from(copies));
    let mut integral = 0.0;
    for i in 1..=copies {
        // binom(i − 1, k) (−1)^k o'^(k + 1), from one k to the next.
        let mut product = shared;
        for k in 0..i {
            integral += product / f64::from(k + 1).sqrt();
            product *= -shared * f64::from(i - 1 - k) / f64::from(k + 1);
        }
    }
    (shared, opacity / integral)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the integral of alpha along a line through the center, in units of scale, of so many Gaussians of this
    /// opacity and scale.
    fn integral(opacity: f64, scale: f64, copies: u32) -> f64 {
        const STEP: f64 = 1e-3;
        let alpha = |x: f64| 1.0 - (1.0 - opacity * (-0.5 * (x / scale).powi(2)).exp()).powf(f64::from(copies));
        (-10_000..=10_000).map(|i| STEP * alpha(f64::from(i) * STEP)).sum()
    }

    #[test]
    fn the_center_and_the_integral_of_alpha_stay() {
        for opacity in [0.006, 0.1, 0.5, 0.9, 0.999] {
            for copies in [1, 2, 3, 10, 51] {
                let (shared, factor) = shared_by(opacity, copies);
                let center = 1.0 - (1.0 - shared).powf(f64::from(copies));
                assert!((center - opacity).abs() < 1e-12, "{copies} of {opacity}: alpha in the center is {center}");
                let (before, after) = (integral(opacity, 1.0, 1), integral(shared, factor, copies));
                let error = (after / before - 1.0).abs();
                assert!(error < 1e-9, "{copies} of {opacity}: the integral changes by a share of {error:e}");
                assert!(factor <= 1.0 + 1e-12, "{copies} of {opacity}: scales do not grow: {factor}");
            }
        }
    }

    fn record(opacity: f32, at: f32) -> TrainedRecord {
        let logit = (opacity / (1.0 - opacity)).ln();
        TrainedRecord { mean: [at; 3], opacity_logit: [logit, 0.0, 0.0, 0.0], ..TrainedRecord::default() }
    }

    #[test]
    fn faded_gaussians_move_to_live_ones_by_opacity() {
        let mut records: Vec<_> = (0..3000).map(|index| record(0.004, -(index as f32))).collect();
        records.extend((1..=400).map(|index| record(if index <= 200 { 0.1 } else { 0.3 }, index as f32)));
        let before = records.clone();
        let moves = relocate(&mut records, 1);
        assert_eq!(moves.len(), 3000, "every faded Gaussian moves");
        let to_opaque = moves.iter().filter(|[_, from]| before[*from as usize].mean[0] > 200.5).count();
        assert!((2150..2350).contains(&to_opaque), "three of four move to the more opaque half: {to_opaque}");
        for &[to, from] in &moves {
            assert_eq!(records[to as usize], records[from as usize], "both have the same parameters");
            assert_eq!(records[to as usize].mean, before[from as usize].mean, "in the place of the live one");
        }
        let copies = 1 + moves.iter().filter(|[_, from]| *from == 3000).count();
        let (shared, factor) = shared_by(0.1, copies as u32);
        let shared = shared.max(FADED);
        let found = (records[3000].opacity_logit[0], records[3000].log_scale_t);
        assert!((f64::from(found.0) - (shared / (1.0 - shared)).ln()).abs() < 1e-5, "opacity of {copies}: {found:?}");
        assert!((f64::from(found.1) - factor.ln()).abs() < 1e-6, "temporal scale of {copies}: {found:?}");
    }

    #[test]
    fn nothing_moves_without_a_need_or_a_place() {
        let mut live = vec![record(0.5, 1.0); 9];
        let mut faded = vec![record(0.001, 1.0); 9];
        assert_eq!(relocate(&mut live, 1), [[0; 2]; 0], "all live");
        assert_eq!(relocate(&mut faded, 1), [[0; 2]; 0], "all faded");
        assert_eq!(relocate(&mut [], 1), [[0; 2]; 0], "none");
        assert!(live == [record(0.5, 1.0); 9] && faded == [record(0.001, 1.0); 9], "unchanged");
        let mut one = vec![record(0.001, 0.0); 200];
        one.push(record(0.9, 2.0));
        let moves = relocate(&mut one, 1);
        assert_eq!(moves.len(), 50, "at most 51 Gaussians are in one place");
    }
}
