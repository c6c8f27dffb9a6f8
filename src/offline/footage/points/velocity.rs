//! The velocities of points, from the moments before and after.
//!
//! In: the points of up to three moments. Out: the velocity of each point of the middle one, world units per unit of
//! time. Clusters begin with the motion of a cluster of similar size and color. Then every point looks for points of
//! its color where its velocity leads, and its velocity becomes the median of those around it, repeatedly: the nearest
//! points alone would understate motion along a surface.

use super::neighbors::Neighbors;
use super::surface_points::{Cluster, MomentPoints};
use glam::Vec3;
use rayon::prelude::*;

/// Rounds of search and median.
const ROUNDS: usize = 8;
/// Points whose mean is the place that a point moves to.
const MATCHES: usize = 3;
/// Points around a point whose median is its velocity.
const AROUND: usize = 32;
/// Farthest match from where the velocity leads, and farthest neighbor, in distances between points.
const REACH: f32 = 8.0;
/// World units that weigh as a color difference of 1, in distances between points.
const COLOR: f32 = 20.0;
/// Cubes of a cluster below which it moves as a whole.
const WHOLE: usize = 200;
/// Farthest motion of a cluster between two moments, in square roots of its cubes: about four diameters of a ball.
const FARTHEST: f32 = 2.5;
/// Largest ratio of the sizes of a cluster at two moments, and largest difference of its colors.
const RATIO: f32 = 2.0;
const DIFFERENCE: f32 = 0.25;

/// Returns the velocity of each point of `now`; 0 where nothing around a point has a match.
pub(crate) fn velocities(before: Option<&MomentPoints>, now: &MomentPoints, after: Option<&MomentPoints>) -> Vec<Vec3> {
    let sides: Vec<Side<'_>> =
        [before, after].into_iter().flatten().filter_map(|other| Side::new(other, now)).collect();
    let whole: Vec<Option<Vec3>> = now.clusters.iter().map(|cluster| motion(&sides, cluster, now.cube)).collect();
    let start = now.points.iter().map(|point| whole[point.cluster as usize].unwrap_or_default());
    let mut velocities: Vec<Vec3> = start.collect();
    let around = around(now);
    for _ in 0..ROUNDS {
        let found: Vec<Vec3> = velocities
            .par_iter()
            .zip(&now.points)
            .map(|(&velocity, point)| {
                let cluster = point.cluster as usize;
                if now.clusters[cluster].cubes < WHOLE && whole[cluster].is_some() {
                    return velocity;
                }
                let matches = sides.iter().filter_map(|side| side.velocity(point.position, point.color, velocity));
                mean(matches).unwrap_or(velocity)
            })
            .collect();
        velocities = around.par_iter().map(|around| median(around, &found)).collect();
    }
    velocities
}

/// Returns the points of the same cluster around each point, itself among them.
fn around(moment: &MomentPoints) -> Vec<Vec<usize>> {
    let places: Vec<Vec3> = moment.points.iter().map(|point| point.position).collect();
    let neighbors = Neighbors::new(places, reach(moment));
    let cluster = |index: usize| moment.points[index].cluster;
    let of = |index: usize| {
        let place = moment.points[index].position;
        let mut nearest = neighbors.best(place, AROUND, |_, distance| distance);
        nearest.retain(|&other| cluster(other) == cluster(index));
        nearest
    };
    (0..moment.points.len()).into_par_iter().map(of).collect()
}

/// Returns the distance up to which points of a moment count as near, world units.
fn reach(moment: &MomentPoints) -> f32 {
    (REACH * moment.spacing).max(f32::MIN_POSITIVE)
}

/// A moment before or after.
struct Side<'a> {
    moment: &'a MomentPoints,
    neighbors: Neighbors,
    /// Time from the middle moment, in the unit of timestamps.
    step: f32,
}

impl<'a> Side<'a> {
    /// Returns the side that a moment is on; `None` if it has no points or is not at another time.
    fn new(moment: &'a MomentPoints, middle: &MomentPoints) -> Option<Self> {
        let step = moment.time - middle.time;
        let places: Vec<Vec3> = moment.points.iter().map(|point| point.position).collect();
        let is_usable = step.is_finite() && step != 0.0 && !places.is_empty();
        is_usable.then(|| Self { moment, neighbors: Neighbors::new(places, reach(moment)), step })
    }

    /// Returns the velocity of a point, given one that leads near its match; `None` without a match.
    fn velocity(&self, position: Vec3, color: Vec3, velocity: Vec3) -> Option<Vec3> {
        let weight = (COLOR * self.moment.spacing).powi(2);
        let points = &self.moment.points;
        let cost = |index: usize, distance: f32| distance + weight * points[index].color.distance_squared(color);
        let matches = self.neighbors.best(position + velocity * self.step, MATCHES, cost);
        let place = mean(matches.into_iter().map(|index| points[index].position))?;
        Some((place - position) / self.step)
    }

    /// Returns the velocity of a cluster, whose cubes have this side; `None` without a similar one nearby.
    fn motion(&self, cluster: &Cluster, cube: f32) -> Option<Vec3> {
        let reach = FARTHEST * (cluster.cubes as f32).sqrt() * cube;
        let cost = |other: &Cluster| {
            let ratio = (other.cubes as f32 / cluster.cubes.max(1) as f32).ln().abs();
            let difference = other.color.distance(cluster.color);
            let distance = other.center.distance(cluster.center) / reach;
            let is_similar = ratio <= RATIO.ln() && difference <= DIFFERENCE && distance <= 1.0;
            is_similar.then_some(distance + ratio + 2.0 * difference)
        };
        let costs = self.moment.clusters.iter().filter_map(|other| Some((cost(other)?, other)));
        let (_, nearest) = costs.min_by(|a, b| a.0.total_cmp(&b.0))?;
        Some((nearest.center - cluster.center) / self.step)
    }
}

/// Returns the velocity of a cluster, the mean of both sides; `None` if neither has a similar one.
fn motion(sides: &[Side<'_>], cluster: &Cluster, cube: f32) -> Option<Vec3> {
    mean(sides.iter().filter_map(|side| side.motion(cluster, cube)))
}

/// Returns the mean; `None` of none.
fn mean(values: impl Iterator<Item = Vec3>) -> Option<Vec3> {
    let (sum, count) = values.fold((Vec3::ZERO, 0.0f32), |(sum, count), value| (sum + value, count + 1.0));
    (count > 0.0).then(|| sum / count)
}

/// Returns the median of each coordinate of the values with these indices; 0 of none.
fn median(indices: &[usize], values: &[Vec3]) -> Vec3 {
    let coordinate = |axis: usize| {
        let mut values: Vec<f32> = indices.iter().map(|&index| values[index][axis]).collect();
        let middle = values.len() / 2;
        if values.is_empty() { 0.0 } else { *values.select_nth_unstable_by(middle, f32::total_cmp).1 }
    };
    Vec3::new(coordinate(0), coordinate(1), coordinate(2))
}

#[cfg(test)]
mod tests {
    use super::super::surface_points::SurfacePoint;
    use super::*;

    /// Returns a sphere with a pattern of colors, moved by an offset.
    fn sphere(center: Vec3, radius: f32, count: usize, cluster: u32) -> Vec<SurfacePoint> {
        let point = |index: usize| {
            let z = 1.0 - (2 * index + 1) as f32 / count as f32;
            let angle = index as f32 * 2.399_963;
            let across = (1.0 - z * z).sqrt();
            let offset = Vec3::new(across * angle.cos(), across * angle.sin(), z);
            let waves = [offset.x, offset.y, offset.z].map(|side| 0.5 + 0.4 * (3.0 * side).sin());
            let color = Vec3::from(waves);
            SurfacePoint { position: center + radius * offset, color, cluster }
        };
        (0..count).map(point).collect()
    }

    fn moment(time: f32, large: Vec3, small: Vec3) -> MomentPoints {
        let points = [sphere(large, 1.0, 3000, 0), sphere(small, 0.05, 60, 1)].concat();
        let cluster = |center: Vec3, cubes: usize| Cluster { center, color: Vec3::splat(0.5), cubes };
        let clusters = vec![cluster(large, 5000), cluster(small, 100)];
        MomentPoints { time, points, clusters, spacing: 0.065, cube: 0.02 }
    }

    #[test]
    fn a_large_thing_and_a_small_fast_one_have_their_own_velocities() {
        let at = |step: f32| moment(0.1 * step, Vec3::X * 0.1 * step, Vec3::new(0.0, 2.0, 0.12 * step));
        let (before, now, after) = (at(-1.0), at(0.0), at(1.0));
        for (before, after) in [(Some(&before), Some(&after)), (None, Some(&after)), (Some(&before), None)] {
            let found = velocities(before, &now, after);
            let error = |cluster: u32, expected: Vec3| {
                let own = now.points.iter().zip(&found).filter(|(point, _)| point.cluster == cluster);
                let errors: Vec<f32> = own.map(|(_, velocity)| velocity.distance(expected)).collect();
                errors.iter().sum::<f32>() / errors.len() as f32
            };
            let (large, small) = (error(0, Vec3::X), error(1, Vec3::Z * 1.2));
            assert!(large < 0.2, "one unit a unit of time: mean error {large}");
            assert!(small < 1e-3, "the motion of the whole: mean error {small}");
        }
        assert!(velocities(None, &now, None).iter().all(|velocity| *velocity == Vec3::ZERO), "at rest without others");
    }
}
