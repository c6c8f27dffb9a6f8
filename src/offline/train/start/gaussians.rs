//! The Gaussians at the points that a training begins with.
//!
//! In: points with colors, times and velocities, [`Looks`]. Out: Gaussians in the trained form, and the squared
//! distances that their scales follow from.

use super::point::{Life, StartPoint};
use crate::gaussian::axes::moving;
use crate::gaussian::harmonics::evaluated;
use crate::gaussian::{Harmonics, Parameters};
use crate::offline::train::reference::neighbors::{NEIGHBORS, neighbors_of_first};
use crate::scene::Trained;
use glam::Vec3;
use std::collections::HashMap;

/// Opacity before the first step.
const OPACITY: f32 = 0.1;
/// Nearest points that give the scale.
const NEAREST: usize = 3;
/// Stretch of time whose points are compared where they are in its middle, in temporal scales.
const STRETCH: f32 = 0.5;
/// How long before and after that middle the points are from, in temporal scales.
const DRAWN: f32 = 2.0;
/// Value of the first spherical harmonic: a coefficient is `color − 0.5` divided by it.
const SH_C0: f32 = 0.282_094_79;

/// What the Gaussians before the first step have in common.
#[derive(Debug, Clone, Copy)]
pub(super) struct Looks {
    /// Least squared spatial scale, units of length squared.
    pub least: f32,
    /// Temporal scale, in the unit of timestamps.
    pub scale_t: f32,
    /// Temporal scale at points without a time, beside others with one.
    pub untimed_t: f32,
    /// Temporal scale of what stands.
    pub standing_t: f32,
    /// Spatial degree of color, 0 to 3.
    pub degree: u32,
    /// Degree of color in time, 0 to 2.
    pub degree_t: u32,
}

/// Returns for each place the mean squared distance to the nearest others, at least `least`.
pub(super) fn squares(places: &[[f32; 3]], least: f32) -> Vec<f32> {
    squares_of_first(places, places.len(), least)
}

/// Returns those of the first `count` places alone, among all.
fn squares_of_first(places: &[[f32; 3]], count: usize, least: f32) -> Vec<f32> {
    let near = neighbors_of_first(places, count);
    let square = |(index, own): (usize, &[u32])| {
        let square = |&other: &u32| Vec3::from(places[index]).distance_squared(Vec3::from(places[other as usize]));
        (own[1..=NEAREST].iter().map(square).sum::<f32>() / NEAREST as f32).max(least)
    };
    near.chunks_exact(NEIGHBORS).enumerate().map(square).collect()
}

/// Returns for each point the mean squared distance to the nearest others, at least `least`: among those with
/// velocities, to those that are drawn at about its time, where they have flown until then.
fn squares_of(points: &[StartPoint], looks: &Looks) -> Vec<f32> {
    if points.iter().any(|point| point.velocity != Vec3::ZERO) {
        squares_in_motion(points, looks)
    } else {
        squares_at_rest(points, looks.least)
    }
}

/// Returns the mean squared distances of points without velocities: to others of the same time, if there are many of
/// each time.
fn squares_at_rest(points: &[StartPoint], least: f32) -> Vec<f32> {
    let mut of_time: HashMap<Option<u32>, Vec<usize>> = HashMap::new();
    for (index, point) in points.iter().enumerate() {
        of_time.entry((point.life != Life::Whole).then(|| point.time.to_bits())).or_default().push(index);
    }
    let many = of_time.values().all(|of_time| of_time.len() > NEIGHBORS);
    let groups: Vec<Vec<usize>> =
        if many { of_time.into_values().collect() } else { vec![(0..points.len()).collect()] };
    let mut squared = vec![least; points.len()];
    for group in groups {
        let places: Vec<[f32; 3]> = group.iter().map(|&index| points[index].position.to_array()).collect();
        for (&index, square) in group.iter().zip(squares(&places, least)) {
            squared[index] = square;
        }
    }
    squared
}

/// Returns the mean squared distances of points of which some have velocities. Those without are compared among
/// themselves, the rest in stretches of time: with what is drawn in the middle of its stretch.
fn squares_in_motion(points: &[StartPoint], looks: &Looks) -> Vec<f32> {
    let stretch = STRETCH * looks.scale_t;
    let (resting, mut moving): (Vec<usize>, Vec<usize>) =
        (0..points.len()).partition(|&index| points[index].velocity == Vec3::ZERO);
    let mut squared = vec![looks.least; points.len()];
    let mut compare = |own: &[usize], others: [&[usize]; 2], at: f32| {
        let place = |&index: &usize| {
            let StartPoint { position, time, velocity, .. } = points[index];
            (position + velocity * (at - time)).to_array()
        };
        let places: Vec<[f32; 3]> = own.iter().chain(others.into_iter().flatten()).map(place).collect();
        let own_squares = squares_of_first(&places, own.len(), looks.least);
        own.iter().zip(own_squares).for_each(|(&index, square)| squared[index] = square);
    };
    compare(&resting, [&[]; 2], 0.0);
    moving.sort_by(|&a, &b| points[a].time.total_cmp(&points[b].time));
    let time = |index: usize| points[moving[index]].time;
    let mut begin = 0;
    while begin < moving.len() {
        let middle = time(begin) + stretch / 2.0;
        let until = |limit: f32| moving.partition_point(|&index| points[index].time < limit);
        // A stretch too short for single precision has the points of one time.
        let end = until((time(begin) + stretch).max(time(begin).next_up()));
        let drawn = DRAWN * looks.scale_t;
        let [first, last] = [until(middle - drawn).min(begin), until(middle + drawn).max(end)];
        compare(&moving[begin..end], [&moving[first..begin], &moving[end..last]], middle);
        begin = end;
    }
    squared
}

/// Returns Gaussians at these points.
pub(super) fn trained(points: &[StartPoint], looks: &Looks) -> Trained {
    let Looks { scale_t, untimed_t, standing_t, degree, degree_t, .. } = *looks;
    let temporal = |life: Life| match life {
        Life::Timed => scale_t,
        Life::Untimed => untimed_t,
        Life::Whole => standing_t,
    };
    let mean: Vec<[f32; 3]> = points.iter().map(|point| point.position.to_array()).collect();
    let count = points.len();
    let begun = squares_of(points, looks)
        .into_iter()
        .zip(points)
        .map(|(square, point)| moving(square, temporal(point.life), point.velocity));
    let begun: Vec<_> = begun.collect();
    let parameters = Parameters {
        mean_t: points.iter().map(|point| point.time).collect(),
        log_scale: begun.iter().map(|(scale, ..)| *scale).collect(),
        log_scale_t: begun.iter().map(|(_, scale_t, _)| *scale_t).collect(),
        rotation_l: begun.iter().map(|(.., [left, _])| *left).collect(),
        rotation_r: begun.iter().map(|(.., [_, right])| *right).collect(),
        opacity_logit: vec![(OPACITY / (1.0 - OPACITY)).ln(); count],
        mean,
    };
    let coefficients = evaluated(degree, degree_t);
    let mut values = vec![0.0; count * coefficients * 3];
    for (own, point) in values.chunks_exact_mut(coefficients * 3).zip(points) {
        own[..3].copy_from_slice(&((point.color - 0.5) / SH_C0).to_array());
    }
    Trained { parameters, harmonics: Harmonics { coefficients, degree, degree_t, values } }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gaussian::SliceSettings;

    const LOOKS: Looks = Looks { least: 1e-7, scale_t: 0.4, untimed_t: 0.6, standing_t: 3.0, degree: 3, degree_t: 2 };

    /// Returns points on a spiral, so that distances differ.
    fn points(count: usize) -> Vec<StartPoint> {
        let point = |index: usize| {
            let angle = index as f32 * 0.7;
            let position = Vec3::new(angle.cos(), angle.sin(), 0.1 * angle) * (1.0 + 0.01 * index as f32);
            StartPoint { position, time: 0.5, color: Vec3::splat(0.25), velocity: Vec3::ZERO, life: Life::Timed }
        };
        (0..count).map(point).collect()
    }

    #[test]
    fn gaussians_begin_as_in_the_original() {
        let points = points(700);
        let Trained { parameters, harmonics } = trained(&points, &LOOKS);
        assert!((parameters.log_scale_t[0].exp() - 0.4).abs() < 1e-6, "the temporal scale");
        assert!((1.0 / (1.0 + (-parameters.opacity_logit[0]).exp()) - 0.1).abs() < 1e-6, "opacity");
        let mut distances: Vec<f32> = points.iter().map(|p| p.position.distance_squared(points[7].position)).collect();
        distances.sort_by(f32::total_cmp);
        let expected = (distances[1..4].iter().sum::<f32>() / 3.0).sqrt();
        assert!((parameters.log_scale[7][1].exp() / expected - 1.0).abs() < 1e-5, "scale from the nearest points");
        assert_eq!((harmonics.coefficients, harmonics.is_consistent(700)), (48, true), "all degrees");
        let dc = harmonics.of(7)[0] * SH_C0 + 0.5;
        assert!((dc - 0.25).abs() < 1e-6 && harmonics.of(7)[3..].iter().all(|&value| value == 0.0), "gray: {dc}");
    }

    #[test]
    fn the_temporal_scale_is_that_of_the_kind_of_point() {
        let mut points = points(3);
        points.iter_mut().zip([Life::Timed, Life::Untimed, Life::Whole]).for_each(|(point, life)| point.life = life);
        let found: Vec<f32> = trained(&points, &LOOKS).parameters.log_scale_t.iter().map(|scale| scale.exp()).collect();
        for (found, expected) in found.iter().zip([0.4, 0.6, 3.0]) {
            assert!((found / expected - 1.0).abs() < 1e-5, "{found}, not {expected}");
        }
    }

    #[test]
    fn a_gaussian_begins_with_the_velocity_of_its_point() {
        let velocities = [Vec3::ZERO, Vec3::new(3.0, -2.0, 0.5), Vec3::new(0.0, 0.0, -20.0), Vec3::X * 1e-3];
        let mut points = points(velocities.len());
        points.iter_mut().zip(velocities).for_each(|(point, velocity)| point.velocity = velocity);
        let looks = Looks { scale_t: 0.1, ..LOOKS };
        let parameters = trained(&points, &looks).parameters;
        let sliced = parameters.slice(&SliceSettings::default()).expect("valid parameters");
        for (index, (gaussian, velocity)) in sliced.iter().zip(velocities).enumerate() {
            let found = Vec3::from(gaussian.velocity);
            assert!(found.distance(velocity) < 1e-3 * (1.0 + velocity.length()), "{index}: {found}, not {velocity}");
            assert!((gaussian.sigma_t / 0.1 - 1.0).abs() < 1e-3, "{index}: temporal scale {}", gaussian.sigma_t);
            let trace = gaussian.covariance[0] + gaussian.covariance[3] + gaussian.covariance[5];
            let expected = 3.0 * squares_of(&points, &looks)[index];
            assert!((trace / expected - 1.0).abs() < 0.01, "{index}: the shape does not depend on the velocity");
        }
    }

    #[test]
    fn distances_are_to_points_of_the_same_time() {
        let mut points = points(200);
        let alone = squares_of(&points[..100], &LOOKS);
        let (first, second) = points.split_at_mut(100);
        for (point, of_first) in second.iter_mut().zip(first) {
            *point = StartPoint { time: 0.75, position: of_first.position + Vec3::X * 1e-3, ..*of_first };
        }
        assert_eq!(squares_of(&points, &LOOKS)[..100], alone, "as without the points of another time");
    }

    /// Returns points of a thing that flies: two at each of 48 moments, on the other axis at each second moment.
    fn flying(from: Vec3, velocity: Vec3) -> Vec<StartPoint> {
        let point = |index: usize| {
            let moment = index / 2;
            let time = moment as f32 / 47.0;
            let axis = [Vec3::Y, Vec3::Z][moment % 2];
            let beside = if index.is_multiple_of(2) { axis } else { -axis } * 0.01;
            let position = from + velocity * time + beside;
            StartPoint { position, time, color: Vec3::splat(0.25), velocity, life: Life::Timed }
        };
        (0..96).map(point).collect()
    }

    #[test]
    fn distances_of_what_flies_are_to_its_own_points_of_other_times() {
        let looks = Looks { scale_t: 0.04, ..LOOKS };
        let largest = |points: &[StartPoint]| squares_of(points, &looks).into_iter().fold(0.0, f32::max).sqrt();
        let velocity = Vec3::new(3.0, -1.0, 0.0);
        let two = [flying(Vec3::ZERO, velocity), flying(Vec3::new(2.0, 0.0, 0.0), velocity)].concat();
        // Two points of each thing are seen at a moment, 0.02 apart; the next thing is two units away.
        let found = largest(&two);
        assert!(found < 0.02, "compared with points of the same thing: {found}");
        let unknown: Vec<StartPoint> = two.iter().map(|point| StartPoint { velocity: Vec3::ZERO, ..*point }).collect();
        let found = largest(&unknown);
        assert!(found > 0.04, "without velocities the next moment's points are as far as it flew: {found}");
        let found = squares_of(&two, &Looks { scale_t: 0.0, ..looks })[0].sqrt();
        assert!((found - 1.633).abs() < 0.01, "drawn for no time: the other thing's points of the moment: {found}");
    }

    #[test]
    fn what_rests_and_what_passed_long_before_do_not_count_for_what_flies() {
        let looks = Looks { scale_t: 0.04, ..LOOKS };
        let flying = flying(Vec3::ZERO, Vec3::X * 3.0);
        let alone = squares_of(&flying, &looks);
        let beside = |offset: f32, velocity: Vec3| {
            flying.iter().map(move |point| StartPoint {
                position: point.position + Vec3::Y * 1e-3,
                time: point.time + offset,
                velocity,
                ..*point
            })
        };
        let long_before: Vec<StartPoint> = flying.iter().copied().chain(beside(-1.5, Vec3::X * 3.0)).collect();
        assert_eq!(squares_of(&long_before, &looks)[..96], alone, "beside what passed 1.5 intervals before");
        let resting: Vec<StartPoint> = flying.iter().copied().chain(beside(0.0, Vec3::ZERO)).collect();
        assert_eq!(squares_of(&resting, &looks)[..96], alone, "beside what rests");
        let with_it: Vec<StartPoint> = flying.iter().copied().chain(beside(0.0, Vec3::X * 3.0)).collect();
        assert_ne!(squares_of(&with_it, &looks)[..96], alone, "beside what flies with it");
    }
}
