//! Start points at points that were measured.
//!
//! In: points of a file, the number of start points, [`Measured`]. Out: so many of the points: some of them if there are
//! more, and further ones beside them if there are fewer. Where some points have times and others have none, as those
//! that `footage` makes of what moves and of what stands, each kind gets its share.

use super::gaussians::squares;
use super::point::{Life, StartPoint};
use crate::offline::dataset::point_cloud::CloudPoint;
use crate::scene::random::Random;
use glam::Vec3;

/// Color of points without one, that of the original.
pub(super) const GRAY: f32 = 127.0 / 255.0;
/// Most start points for each point with a time, if there are others.
const BESIDE: usize = 4;
/// Share of the interval by which random times are outside, at each end.
const OUTSIDE: f32 = 0.1;

/// How measured points are used.
#[derive(Debug, Clone, Copy)]
pub(super) struct Measured {
    /// First and last time of the capture.
    pub interval: [f32; 2],
    /// Least squared distance of points beside each other.
    pub least: f32,
    /// Whether start points have the velocities of their points.
    pub velocities: bool,
    /// Whether points without times, beside others with one, stand during the whole interval.
    pub standing: bool,
    /// Share of the start points that points with times get, if there are others.
    pub timed_share: f64,
}

impl Measured {
    /// Returns so many start points.
    pub(super) fn points(&self, cloud: &[CloudPoint], count: usize, random: &mut Random) -> Vec<StartPoint> {
        let (timed, others): (Vec<CloudPoint>, Vec<CloudPoint>) = cloud.iter().partition(|point| point.time.is_some());
        // A single kind keeps the order of the file.
        if timed.is_empty() || others.is_empty() {
            return self.some(cloud, Life::Timed, count, random);
        }
        let untimed = if self.standing { Life::Whole } else { Life::Untimed };
        let of_timed = ((self.timed_share * count as f64) as usize).min(BESIDE * timed.len());
        let mut points = self.some(&timed, Life::Timed, of_timed, random);
        points.extend(self.some(&others, untimed, count - of_timed, random));
        points
    }

    /// Returns so many start points at points of one kind.
    fn some(&self, own: &[CloudPoint], life: Life, count: usize, random: &mut Random) -> Vec<StartPoint> {
        if own.len() > count {
            // The first of a random order (Fisher and Yates).
            let mut order: Vec<usize> = (0..own.len()).collect();
            for index in 0..count {
                let other = index + ((random.unit() * (own.len() - index) as f32) as usize).min(own.len() - index - 1);
                order.swap(index, other);
            }
            return order[..count].iter().map(|&index| self.at(&own[index], Vec3::ZERO, life, random)).collect();
        }
        let places: Vec<[f32; 3]> = own.iter().map(|point| point.position.to_array()).collect();
        let distances: Vec<f32> = squares(&places, self.least).into_iter().map(f32::sqrt).collect();
        let further = |index: usize| {
            let beside = if index < own.len() { Vec3::ZERO } else { distances[index % own.len()] * in_cube(random) };
            self.at(&own[index % own.len()], beside, life, random)
        };
        (0..count).map(further).collect()
    }

    /// Returns the start point beside a point.
    fn at(&self, point: &CloudPoint, beside: Vec3, life: Life, random: &mut Random) -> StartPoint {
        let CloudPoint { position, color, time, velocity } = *point;
        let middle = (self.interval[0] + self.interval[1]) / 2.0;
        let untimed = |random: &mut Random| if life == Life::Whole { middle } else { any_time(self.interval, random) };
        StartPoint {
            position: position + beside,
            time: time.unwrap_or_else(|| untimed(random)),
            color: color.unwrap_or(Vec3::splat(GRAY)),
            velocity: if self.velocities { velocity } else { Vec3::ZERO },
            life,
        }
    }
}

/// Returns a random place in the cube from −1 to 1.
pub(super) fn in_cube(random: &mut Random) -> Vec3 {
    Vec3::from([(); 3].map(|()| random.in_range(-1.0, 1.0)))
}

/// Returns a random time of the interval, or a little outside: Gaussians outside serve its first and last moments (the
/// original's margin).
pub(super) fn any_time(interval: [f32; 2], random: &mut Random) -> f32 {
    interval[0] + (interval[1] - interval[0]) * random.in_range(-OUTSIDE, 1.0 + OUTSIDE)
}

#[cfg(test)]
mod tests {
    use super::*;

    const MEASURED: Measured =
        Measured { interval: [0.0, 1.0], least: 1e-7, velocities: false, standing: false, timed_share: 0.55 };

    /// Returns so many points with times and so many without.
    fn cloud(timed: usize, others: usize) -> Vec<CloudPoint> {
        let point = |index: usize| CloudPoint {
            position: Vec3::X * index as f32,
            color: None,
            time: (index < timed).then_some(0.25),
            velocity: Vec3::Y,
        };
        (0..timed + others).map(point).collect()
    }

    #[test]
    fn points_with_and_without_times_get_their_shares() {
        let measured = Measured { timed_share: 0.7, ..MEASURED };
        let shares = |timed, others| {
            let points = measured.points(&cloud(timed, others), 1000, &mut Random::new(0));
            let moving = points.iter().filter(|point| point.time == 0.25).count();
            (points.len(), moving)
        };
        assert_eq!(shares(5000, 300), (1000, 700), "however many there are");
        assert_eq!(shares(10, 300), (1000, 40), "few of them get few");
        assert_eq!(shares(5000, 0), (1000, 1000), "all, if there are no others");
    }

    #[test]
    fn standing_points_and_velocities_are_used_on_request() {
        let asked = Measured { velocities: true, standing: true, ..MEASURED };
        let points = asked.points(&cloud(50, 50), 100, &mut Random::new(0));
        let stands = |point: &&StartPoint| point.life == Life::Whole;
        assert!(points.iter().filter(stands).all(|point| point.time == 0.5), "in the middle");
        assert_eq!(points.iter().filter(stands).count(), 45, "the points without a time");
        assert!(points.iter().all(|point| point.velocity == Vec3::Y), "their velocities");
        let plain = MEASURED.points(&cloud(50, 50), 100, &mut Random::new(0));
        let is_plain = |point: &StartPoint| point.life != Life::Whole && point.velocity == Vec3::ZERO;
        assert!(plain.iter().all(is_plain), "only on request");
        assert_eq!(plain.iter().filter(|point| point.life == Life::Untimed).count(), 45, "the same points");
    }
}
