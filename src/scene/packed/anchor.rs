//! Temporal means near the time interval, for the packed form, which has one range for all temporal means.
//!
//! In: Gaussians with their color, the time interval and the period of colors. Out: the same Gaussians at the same
//! positions at all times. Gaussians whose temporal mean was far from the interval have nearly the same opacity as
//! before; Gaussians that are never drawn are still never drawn.
//!
//! In the interval, such a Gaussian shows a flank of its marginal. A marginal with a nearer mean, of the same value and
//! slope in the middle of the interval, differs in curvature alone. The temporal mean moves by whole periods of colors
//! that change with time, and stays where it is if a period is too long; otherwise by whole intervals. Colors are
//! evaluated in the direction of the mean, which moves too: they change where the mean moves by much of the distance to
//! the camera.

use crate::gaussian::Gaussian;
use crate::scene::provenance::TrainedWith;
use crate::scene::sliced::Sliced;
use rayon::prelude::*;

/// Temporal means up to this distance from the middle of the time interval are not moved, lengths of the interval.
const FAR: f64 = 4.0;
/// Least distance of moved temporal means, lengths of the interval.
const NEAR: f64 = 0.5;
/// Largest relative change of a marginal by its curvature, within the limits of the distance.
const CHANGE: f64 = 0.002;
/// Largest temporal deviation, lengths of the interval: the packed form has one range for all, and longer deviations
/// look nearly the same.
const LONG: f64 = 1000.0;

/// Moves temporal means that are far from the interval close to it.
pub(crate) fn move_near(sliced: &mut Sliced, trained_with: &TrainedWith) {
    let [start, end] = trained_with.time_interval.map(f64::from);
    let (middle, span) = (0.5 * (start + end), end - start);
    let period = if sliced.harmonics.degree_t > 0 { f64::from(trained_with.period_of_colors()) } else { span };
    // The interval of a still has no length.
    if span > 0.0 && period > 0.0 {
        let cutoff = trained_with.marginal_cutoff;
        sliced.gaussians.par_iter_mut().for_each(|gaussian| move_one(gaussian, middle, span, period, cutoff));
    }
}

/// Moves one temporal mean by whole periods. `cutoff` is the marginal at and below which a Gaussian is not drawn.
fn move_one(gaussian: &mut Gaussian, middle: f64, span: f64, period: f64, cutoff: f32) {
    let away = f64::from(gaussian.mean_t) - middle;
    let distance = away.abs();
    if distance <= FAR * span {
        return;
    }
    let sigma_t = f64::from(gaussian.sigma_t);
    // At the ends of the interval, the logarithm of the marginal differs by slope × span² / (8 near). A near mean
    // multiplies rounding errors of the velocity by a short time.
    let slope = distance / (sigma_t * sigma_t);
    let nearest = (slope * span * span / (8.0 * CHANGE)).clamp(NEAR * span, (FAR - 1.0) * span);
    let largest_marginal = (-0.5 * ((distance - 0.5 * span) / sigma_t).powi(2)).exp();
    // One that is never drawn has no color.
    let step = if largest_marginal <= f64::from(cutoff) { span } else { period };
    // A whole number of steps, except for distances so large that a step is less than their rounding.
    let near = (distance - ((distance - nearest) / step).floor() * step).clamp(nearest, nearest + step);
    gaussian.mean_t = (middle + near.copysign(away)) as f32;
    if largest_marginal <= f64::from(cutoff) {
        gaussian.opacity = 0.0;
        gaussian.sigma_t = sigma_t.min(LONG * span) as f32;
        return;
    }
    if sigma_t.is_finite() {
        let sigma_near = (sigma_t * (near / distance).sqrt()).min(LONG * span);
        gaussian.sigma_t = sigma_near as f32;
        // The ratio of the two marginals in the middle of the interval.
        let ratio = (0.5 * (near / sigma_near).powi(2) - 0.5 * (distance / sigma_t).powi(2)).exp();
        gaussian.opacity = (gaussian.opacity * ratio as f32).min(1.0);
    }
    let moved = (near - distance) * away.signum();
    for (mean, velocity) in gaussian.mean.iter_mut().zip(gaussian.velocity) {
        *mean = (f64::from(*mean) + f64::from(velocity) * moved) as f32;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gaussian::Harmonics;

    fn gaussian(mean_t: f32, sigma_t: f32) -> Gaussian {
        Gaussian {
            mean: [1.0, 2.0, 3.0],
            mean_t,
            velocity: [0.1, -0.2, 0.0],
            sigma_t,
            covariance: [0.01, 0.0, 0.0, 0.01, 0.0, 0.01],
            opacity: 0.9,
            padding: 0.0,
        }
    }

    fn moved_one(gaussian: Gaussian, interval: [f32; 2]) -> Gaussian {
        let mut one = Sliced { gaussians: vec![gaussian], harmonics: Harmonics::default() };
        move_near(&mut one, &TrainedWith { time_interval: interval, ..TrainedWith::default() });
        one.gaussians[0]
    }

    fn moved(mean_t: f32, sigma_t: f32, interval: [f32; 2]) -> Gaussian {
        moved_one(gaussian(mean_t, sigma_t), interval)
    }

    #[test]
    fn temporal_means_near_the_interval_are_not_moved() {
        for (mean_t, interval) in [(-3.4, [0.0, 1.0]), (0.5, [0.0, 1.0]), (25.0, [0.0, 6.0]), (900.0, [5.0, 5.0])] {
            assert_eq!(moved(mean_t, 2.0, interval), gaussian(mean_t, 2.0), "a temporal mean of {mean_t} is not moved");
        }
    }

    #[test]
    fn moved_gaussians_keep_positions_and_nearly_keep_opacities() {
        for (mean_t, sigma_t, error) in [(150.0, 179.0, 2e-3), (-40.0, 30.0, 2e-3), (5.0, 3.0, 5e-3), (5e4, 1e5, 1e-4)]
        {
            let (before, after) = (gaussian(mean_t, sigma_t), moved(mean_t, sigma_t, [0.0, 1.0]));
            assert!((after.mean_t - 0.5).abs() <= 4.0, "{mean_t} is moved to {}", after.mean_t);
            let intervals = before.mean_t - after.mean_t;
            assert!((intervals - intervals.round()).abs() < 0.01, "time harmonics repeat: {intervals}");
            for time in [0.0, 0.3, 0.5, 1.0] {
                let distance = before.mean_at(time).distance(after.mean_at(time));
                assert!(distance < 1e-6 * mean_t.abs().max(1.0), "{mean_t} at {time}: {distance}");
                let alpha = |gaussian: &Gaussian| gaussian.opacity * gaussian.marginal(time);
                let (before, after) = (alpha(&before), alpha(&after));
                assert!((before - after).abs() <= error, "{mean_t} at {time}: {before} is {after}");
            }
        }
    }

    #[test]
    fn gaussians_that_are_never_drawn_become_transparent() {
        for mean_t in [-3e38, -7.0, 1e6] {
            let after = moved(mean_t, 1.0, [0.0, 1.0]);
            assert_eq!(after.opacity, 0.0, "{mean_t} is never drawn");
            assert!(after.check().is_ok(), "{mean_t} is still valid: {after:?}");
        }
    }

    #[test]
    fn deviations_stay_close_to_a_very_short_interval() {
        // A Gaussian that is drawn all the time, and one that is never drawn.
        for (mean_t, sigma_t, opacity) in [(0.1, 0.2, 0.794), (7.0, 1.0, 0.0)] {
            let after = moved(mean_t, sigma_t, [0.0, 1e-30]);
            assert!(after.sigma_t <= 1.1e-27 && after.check().is_ok(), "the deviation is limited: {after:?}");
            let shown = after.opacity * after.marginal(5e-31);
            assert!((shown - opacity).abs() < 1e-3, "{mean_t}: alpha {shown} is {opacity}");
        }
    }

    #[test]
    fn gaussians_of_constant_opacity_keep_it() {
        let before = Gaussian { velocity: [0.0; 3], ..gaussian(1e6, f32::INFINITY) };
        let after = moved_one(before, [0.0, 1.0]);
        assert_eq!(after, Gaussian { mean_t: after.mean_t, ..before }, "only the temporal mean is moved");
        assert!(after.mean_t <= 4.5, "it is near the interval: {}", after.mean_t);
    }

    #[test]
    fn temporal_means_move_by_whole_periods_of_colors_that_change_with_time() {
        for period in [0.3, 1.7, 60.0] {
            let harmonics = Harmonics { coefficients: 32, degree: 3, degree_t: 1, values: vec![0.5; 192] };
            let mut sliced = Sliced { gaussians: vec![gaussian(40.0, 50.0), gaussian(90.0, 1.0)], harmonics };
            let trained_with =
                TrainedWith { time_interval: [0.0, 1.0], color_period: Some(period), ..TrainedWith::default() };
            move_near(&mut sliced, &trained_with);
            let [drawn, never] = [0, 1].map(|index| sliced.gaussians[index]);
            let periods = (40.0 - drawn.mean_t) / period;
            assert!((periods - periods.round()).abs() < 1e-3, "{periods} periods of {period}");
            assert!(drawn.mean_t <= 4.5 || period > 40.0, "it is near the interval: {}", drawn.mean_t);
            assert!(never.mean_t <= 4.5 && never.opacity == 0.0, "one that is never drawn moves anyway: {never:?}");
        }
    }
}
