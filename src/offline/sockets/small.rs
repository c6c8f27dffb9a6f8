//! A small thing around a point, as it moves.
//!
//! In: a capture, a point at a time. Out: [`Small`], if the point is on a few Gaussians and nothing around these moves
//! as they do: a petal, a spark, a ball in the air. Their center is moved from time to time, and the point with it.
//!
//! At each time the center is expected where its velocity has brought it, and then is the mean of the Gaussians around
//! it (mean shift), weighted by opacity, by distance, and by how alike their velocities are to that of the thing: what
//! it passes does not count, nor do Gaussians that are larger. It is lost where few of its Gaussians are left.

use super::cloud::Cloud;
use super::moment::Drawn;
use glam::DVec3;

/// The distance from the center at which the weight of a Gaussian is lower by the root of e, as a part of the size of
/// the capture.
const REACH: f64 = 0.006;
/// Distance up to which Gaussians are looked at, in reaches.
const FARTHEST: f64 = 5.0;
/// The time, as a part of the time interval of the capture, in which a Gaussian moves away from the thing by one reach if
/// the difference of their velocities lowers its weight by the root of e.
const ALIKE: f64 = 1.0 / 32.0;
/// The root of the trace of the covariance up to which a Gaussian has its whole weight, in reaches, and the excess over
/// that, as a part of it, at which the weight is lower by the root of e.
const LARGEST: f64 = 1.3;
const LARGER: f64 = 0.3;
/// The distances from the center, in reaches, within which the Gaussians of the thing are, and between which there are
/// none that move as they do; the most that may be there, as a part of the opacities of the thing.
const INSIDE: f64 = 2.0;
const AROUND: f64 = 3.5;
const MOST_AROUND: f64 = 0.1;
/// Largest distance of the center from the point, in reaches, and smallest sum of weights at the start.
const NEAREST: f64 = 0.7;
const FEWEST: f64 = 0.3;
/// Smallest part of the sum of weights at the start that must still be there.
const LEAST: f64 = 0.2;
/// Longest way of the center in one step from where it was expected, in reaches.
const LONGEST_WAY: f64 = 0.5;
/// Number of rounds in which a center settles after the first, which finds its velocity.
const ROUNDS: usize = 6;

/// A small thing.
#[derive(Clone)]
pub(super) struct Small<'a> {
    cloud: &'a Cloud,
    center: Center,
    /// From the center to the point, capture units.
    offset: DVec3,
    /// Smallest sum of weights with which it is there.
    least: f64,
    /// Timestamp units.
    time: f64,
}

/// The center of Gaussians.
#[derive(Debug, Clone, Copy)]
struct Center {
    /// Capture space.
    place: DVec3,
    /// Capture units per timestamp unit.
    velocity: DVec3,
    /// The sum of the weights.
    weight: f64,
    /// The root of the mean square of the distances of the Gaussians from it, capture units.
    spread: f64,
}

impl<'a> Small<'a> {
    /// Returns the small thing that a point (capture space) is on at a time (timestamp units); `None` if it is on
    /// nothing, or on a part of something larger.
    pub(super) fn around(cloud: &'a Cloud, point: DVec3, time: f64) -> Option<Self> {
        let reach = REACH * cloud.size;
        let near = drawn_around(cloud, point, time);
        let center = settled(cloud, &near, point, None)?;
        let (mut inside, mut beside) = (0.0, 0.0);
        for one in &near {
            let counts = one.opacity * alike(cloud, one.velocity - center.velocity) * fitting(cloud, one);
            match one.mean.distance(center.place) / reach {
                far if far < INSIDE => inside += counts,
                far if far < AROUND => beside += counts,
                _ => {}
            }
        }
        let is_small = center.weight >= FEWEST
            && center.place.distance(point) <= NEAREST * reach
            && beside <= MOST_AROUND * inside;
        is_small.then(|| Self::of(cloud, center, point, time))
    }

    /// Returns what a point is on at another time, at which it has been followed to there; `None` if that is nothing.
    pub(super) fn again(&self, point: DVec3, time: f64) -> Option<Self> {
        let near = drawn_around(self.cloud, point, time);
        let center = settled(self.cloud, &near, point - self.offset, Some(self.center.velocity))?;
        Some(Self::of(self.cloud, center, point, time))
    }

    fn of(cloud: &'a Cloud, center: Center, point: DVec3, time: f64) -> Self {
        Self { cloud, center, offset: point - center.place, least: LEAST * center.weight, time }
    }

    /// Moves the thing to a time. Returns whether it has moved: it does not if nothing is around where it is expected, or
    /// its center would be far from there.
    pub(super) fn advance(&mut self, time: f64) -> bool {
        let Self { cloud, center: Center { place, velocity, .. }, .. } = *self;
        let expected = place + velocity * (time - self.time);
        let near = drawn_around(cloud, expected, time);
        let settled = settled(cloud, &near, expected, Some(velocity));
        let is_near = |center: &Center| center.place.distance(expected) <= LONGEST_WAY * REACH * cloud.size;
        let Some(center) = settled.filter(is_near) else { return false };
        (self.center, self.time) = (center, time);
        true
    }

    /// Returns whether enough of it is still there.
    pub(super) fn is_held(&self) -> bool {
        self.center.weight >= self.least
    }

    /// Returns where the point is, capture space.
    pub(super) fn place(&self) -> DVec3 {
        self.center.place + self.offset
    }

    /// Returns an estimate of the error of the place, capture units: the center is somewhere among the Gaussians.
    pub(super) fn error(&self) -> f64 {
        self.center.spread
    }
}

/// Returns the Gaussians that are drawn at a time around a place.
fn drawn_around(cloud: &Cloud, place: DVec3, time: f64) -> Vec<Drawn> {
    let half = DVec3::splat(FARTHEST * REACH * cloud.size);
    if place.is_finite() { cloud.drawn(time, Some([place - half, place + half])) } else { Vec::new() }
}

/// Returns the center into which a place settles, of Gaussians that move as this velocity, or as most of those around
/// the place do; `None` where there are none.
fn settled(cloud: &Cloud, near: &[Drawn], place: DVec3, velocity: Option<DVec3>) -> Option<Center> {
    let reach = REACH * cloud.size;
    let (mut place, mut velocity) = (place, velocity);
    let mut found = None;
    for _ in 0..=ROUNDS {
        let weight = |one: &Drawn| {
            let far = one.mean.distance_squared(place) / (reach * reach);
            let moves = velocity.map_or(1.0, |velocity| alike(cloud, one.velocity - velocity));
            one.opacity * (-0.5 * far).exp() * moves * fitting(cloud, one)
        };
        let (mut sum, mut places, mut velocities, mut squares) = (0.0, DVec3::ZERO, DVec3::ZERO, 0.0);
        for one in near {
            let weight = weight(one);
            let off = one.mean - place;
            sum += weight;
            places += weight * off;
            velocities += weight * one.velocity;
            squares += weight * off.length_squared();
        }
        if sum.is_nan() || sum < f64::MIN_POSITIVE.sqrt() {
            return None;
        }
        let off = places / sum;
        let spread = (squares / sum - off.length_squared()).max(0.0).sqrt();
        let center = Center { place: place + off, velocity: velocities / sum, weight: sum, spread };
        (place, velocity, found) = (center.place, Some(center.velocity), Some(center));
    }
    found
}

/// Returns how alike a velocity is to that of the thing, 0 to 1, given their difference.
fn alike(cloud: &Cloud, difference: DVec3) -> f64 {
    let away = difference * (ALIKE * cloud.span() / (REACH * cloud.size));
    (-0.5 * away.length_squared()).exp()
}

/// Returns how much a Gaussian counts by its size, 0 to 1: larger ones are no parts of a small thing.
fn fitting(cloud: &Cloud, one: &Drawn) -> f64 {
    let size = (one.covariance.x_axis.x + one.covariance.y_axis.y + one.covariance.z_axis.z).max(0.0).sqrt();
    let larger = (size / (LARGEST * REACH * cloud.size) - 1.0).max(0.0) / LARGER;
    (-0.5 * larger * larger).exp()
}

#[cfg(test)]
mod tests {
    use super::super::fixture::{gaussian, scene};
    use super::*;
    use crate::gaussian::Gaussian;
    use glam::Vec3;

    /// A reach in the captures of these tests.
    const SIDE: f32 = 0.01;

    /// Returns where a thing that flies on a curve is.
    fn way(time: f32) -> Vec3 {
        Vec3::new(0.8 * time - 0.4, 0.3 * (5.0 * time).sin(), 0.9 * time * time)
    }

    /// Returns a thing of short-lived Gaussians that fly beside each other until `end`, over a lawn, past a post.
    fn petal(end: f32) -> Vec<Gaussian> {
        let small = [2e-5, 0.0, 0.0, 2e-5, 0.0, 2e-5];
        let flown = (0..80).map(|index| (index as f32, index as f32 / 80.0)).filter(|(_, time)| *time < end);
        let flown = flown.map(|(index, time)| {
            let velocity = (way(time + 1e-3) - way(time - 1e-3)) / 2e-3;
            let beside = 0.4 * SIDE * Vec3::new((2.4 * index).cos(), (2.4 * index).sin(), 0.0);
            Gaussian { covariance: small, ..gaussian(way(time) + beside, time, velocity, 0.03) }
        });
        let at_rest = |place: Vec3| Gaussian { covariance: small, ..gaussian(place, 0.5, Vec3::ZERO, f32::INFINITY) };
        let lawn = (0..900).map(|index| Vec3::new((index % 30) as f32 - 14.5, (index / 30) as f32 - 14.5, -4.0) * 0.05);
        let post = (0..40).map(|index| way(0.5) + Vec3::new(0.0, 0.03, 0.02 * (index as f32 - 20.0)));
        flown.chain(lawn.chain(post).map(at_rest)).collect()
    }

    fn cloud(gaussians: Vec<Gaussian>) -> Cloud {
        let cloud = Cloud::of(&scene(gaussians)).expect("they can be drawn");
        assert!((REACH * cloud.size / f64::from(SIDE) - 1.0).abs() < 0.4, "the size is {}", cloud.size);
        cloud
    }

    #[test]
    fn a_petal_is_followed_past_what_rests() {
        let cloud = cloud(petal(2.0));
        let point = way(0.2).as_dvec3() + DVec3::Z * 0.003;
        let mut petal = Small::around(&cloud, point, 0.2).expect("a petal");
        for step in 1..=38 {
            let time = 0.2 + 0.02 * f64::from(step);
            assert!(petal.advance(time) && petal.is_held(), "lost at {time}");
            let off = petal.place().distance(way(time as f32).as_dvec3() + DVec3::Z * 0.003);
            assert!(off < 0.5 * f64::from(SIDE), "at {time} it is {off} off");
            assert!(petal.error() < f64::from(SIDE), "at {time} the estimate is {}", petal.error());
        }
        let back = petal.again(petal.place(), 0.96).expect("it is there");
        assert!(back.place().distance(petal.place()) < 1e-12, "the way back begins where it was");
    }

    #[test]
    fn a_petal_that_ends_is_lost() {
        let cloud = cloud(petal(0.5));
        let mut petal = Small::around(&cloud, way(0.3).as_dvec3(), 0.3).expect("a petal");
        let lost =
            (1..35).map(|step| 0.3 + 0.02 * f64::from(step)).find(|&time| !petal.advance(time) || !petal.is_held());
        assert!(lost.is_some_and(|time| (0.5..0.64).contains(&time)), "its Gaussians end at 0.5: {lost:?}");
    }

    #[test]
    fn parts_of_larger_things_are_not_small() {
        let cloud = cloud(petal(2.0));
        let post = way(0.5).as_dvec3() + DVec3::new(0.0, 0.03, 0.0);
        assert!(Small::around(&cloud, post, 0.5).is_none(), "a point of the post");
        let aside = way(0.2).as_dvec3() + DVec3::Y * 2.0 * f64::from(SIDE);
        assert!(Small::around(&cloud, aside, 0.2).is_none(), "a point beside the petal");
        assert!(Small::around(&cloud, DVec3::NAN, 0.2).is_none(), "no place");
        assert!(Small::around(&cloud, DVec3::splat(9.0), 0.2).is_none(), "nothing is there");
    }
}
