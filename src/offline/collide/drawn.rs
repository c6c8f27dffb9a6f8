//! The Gaussians that are drawn at some time of a capture.
//!
//! In: a capture, with its temporal filter. Out: its Gaussians with the times between which each may be drawn
//! ([`Drawn`]); the box that holds most of their opacity.

use crate::gaussian::alpha::ALPHA_MIN;
use crate::gaussian::{Gaussian, InvalidGaussian};
use crate::scene::GaussianScene;
use crate::scene::edit::apply::life;
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// The part of the opacity that the box holds along each axis.
const HELD: f64 = 0.99;

/// A Gaussian, and when it is drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Drawn {
    pub gaussian: Gaussian,
    /// The first and the last time at which it may be drawn, timestamp units.
    pub life: [f64; 2],
}

/// Returns the Gaussians that are drawn at some time of the capture.
///
/// # Errors
/// The first Gaussian of a scene in the trained form that cannot be drawn.
pub(super) fn drawn(scene: &GaussianScene) -> Result<Vec<Drawn>, InvalidGaussian> {
    let gaussians: &[Gaussian] = &scene.gaussians()?;
    let one = |(index, gaussian): (usize, &Gaussian)| {
        let is_visible = gaussian.opacity >= ALPHA_MIN && gaussian.check().is_ok();
        let life = life(index, gaussian, &scene.trained_with, scene.filter.as_ref());
        (is_visible && life[0] <= life[1]).then_some(Drawn { gaussian: *gaussian, life })
    };
    Ok(gaussians.par_iter().enumerate().filter_map(one).collect())
}

/// Returns the corners of the box whose sides are the shortest that hold 99 % of the means along each axis, capture
/// space. A mean counts at the beginning, in the middle and at the end of its life, as much as its Gaussian is opaque
/// and as long as it lives of `span`, the length of the time interval; if that is 0, as much as it is opaque. `None` if
/// nothing counts.
pub(super) fn middle(drawn: &[Drawn], span: f64) -> Option<[DVec3; 2]> {
    let samples = |drawn: &Drawn| {
        let Drawn { gaussian, life: [first, last] } = *drawn;
        let duration = if span > 0.0 { (last - first) / span } else { 1.0 };
        let weight = f64::from(gaussian.opacity) * duration;
        [0.0, 0.5, 1.0].map(|part| (gaussian.mean_at((first + part * (last - first)) as f32), weight))
    };
    let all = drawn.par_iter().flat_map_iter(samples);
    let all: Vec<(Vec3, f64)> = all.filter(|(mean, weight)| mean.is_finite() && *weight > 0.0).collect();
    let (mut low, mut high) = (DVec3::ZERO, DVec3::ZERO);
    for axis in 0..3 {
        let places = all.iter().map(|(mean, weight)| (f64::from(mean[axis]), *weight)).collect();
        [low[axis], high[axis]] = shortest(places)?;
    }
    Some([low, high])
}

/// Returns the shortest interval that holds 99 % of the weight of these places; `None` if there are none. Weights are
/// positive.
fn shortest(mut places: Vec<(f64, f64)>) -> Option<[f64; 2]> {
    places.par_sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    let least = HELD * places.iter().map(|(_, weight)| weight).sum::<f64>();
    let mut from = places.iter().peekable();
    let mut held = 0.0;
    let mut best: Option<[f64; 2]> = None;
    for &(last, weight) in &places {
        held += weight;
        while let Some(&(_, first)) = from.next_if(|(place, weight)| *place < last && held - weight >= least) {
            held -= first;
        }
        let first = from.peek().map_or(last, |(place, _)| *place);
        if held >= least && best.is_none_or(|[low, high]| last - first < high - low) {
            best = Some([first, last]);
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gaussian::Harmonics;
    use crate::scene::RuntimeScene;

    fn gaussian(mean: Vec3, velocity: Vec3, sigma_t: f32) -> Gaussian {
        let covariance = [1e-3, 0.0, 0.0, 1e-3, 0.0, 1e-3];
        let (mean, velocity) = (mean.to_array(), velocity.to_array());
        Gaussian { mean, mean_t: 0.5, velocity, sigma_t, covariance, opacity: 0.5, padding: 0.0 }
    }

    fn drawn_of(gaussians: Vec<Gaussian>) -> Vec<Drawn> {
        let values = vec![0.0; 3 * gaussians.len()];
        let harmonics = Harmonics { coefficients: 1, values, ..Harmonics::default() };
        drawn(&RuntimeScene::sliced(gaussians, harmonics).into()).expect("all can be drawn")
    }

    #[test]
    fn gaussians_that_are_never_drawn_are_left_out() {
        let good = gaussian(Vec3::ZERO, Vec3::ZERO, f32::INFINITY);
        let late = Gaussian { mean_t: 9.0, sigma_t: 0.1, ..good };
        let faint = Gaussian { opacity: 1e-3, ..good };
        let broken = Gaussian { mean: [f32::NAN; 3], ..good };
        let found = drawn_of(vec![late, good, faint, broken]);
        assert_eq!(found, [Drawn { gaussian: good, life: [0.0, 1.0] }], "one of four is drawn");
    }

    #[test]
    fn the_box_holds_the_way_of_what_moves_and_not_what_strays() {
        let mut gaussians: Vec<Gaussian> =
            (0..200).map(|i| gaussian(Vec3::Y * (i as f32 / 199.0), Vec3::X * 4.0, f32::INFINITY)).collect();
        gaussians.push(gaussian(Vec3::splat(50.0), Vec3::ZERO, f32::INFINITY));
        let [low, high] = middle(&drawn_of(gaussians), 1.0).expect("they are drawn");
        assert!(low.abs_diff_eq(DVec3::new(-2.0, 0.0, 0.0), 0.02), "the smallest corner is {low}");
        assert!(high.abs_diff_eq(DVec3::new(2.0, 1.0, 0.0), 0.02), "the largest corner is {high}");
        assert_eq!(middle(&[], 1.0), None, "nothing has no box");
    }

    #[test]
    fn the_interval_is_the_shortest_of_all_that_hold_enough() {
        let even = |from: f64| (0..100).map(move |i| (from + f64::from(i), 1.0));
        assert_eq!(shortest(even(0.0).collect()), Some([0.0, 98.0]), "one of a hundred is left out");
        let outlier = even(0.0).chain([(1e6, 0.9)]).collect();
        assert_eq!(shortest(outlier), Some([0.0, 99.0]), "what lies apart is left out first");
        assert_eq!(shortest(vec![(3.0, 2.0); 5]), Some([3.0, 3.0]), "one place has no length");
        assert_eq!(shortest(Vec::new()), None, "no places have no interval");
    }
}
