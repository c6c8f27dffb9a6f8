//! The points of what moves at one moment, in clusters.
//!
//! In: the surface of a visual hull with its silhouettes and pictures. Out: [`MomentPoints`]: colored points, of which
//! fewer can be chosen evenly. Small clusters keep their points, since a ball is as important as a man.

use super::cells;
use super::hull_colors::colors;
use super::moving_hull::{Hull, Silhouette};
use glam::Vec3;
use image::RgbImage;

/// Cubes of a cluster below which it is noise.
const FEWEST: usize = 8;
/// Points that every cluster keeps, if it has as many.
const KEPT: usize = 64;

/// A point of a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SurfacePoint {
    /// World space.
    pub position: Vec3,
    /// RGB, 0 to 1.
    pub color: Vec3,
    /// Index of the cluster.
    pub cluster: u32,
}

/// Points that touch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Cluster {
    /// Mean of its positions, world space.
    pub center: Vec3,
    /// Mean of its colors, RGB, 0 to 1.
    pub color: Vec3,
    /// Number of cubes at its surface; 0 if no picture shows it.
    pub cubes: usize,
}

/// What moves at a moment.
#[derive(Debug, Clone, Default)]
pub(crate) struct MomentPoints {
    /// In the unit of timestamps.
    pub time: f32,
    /// In Morton order.
    pub points: Vec<SurfacePoint>,
    /// The clusters of the points.
    pub clusters: Vec<Cluster>,
    /// Usual distance between points that are next to each other, world units.
    pub spacing: f32,
    /// Side of the cubes of the hull, world units.
    pub cube: f32,
}

impl MomentPoints {
    /// Returns at most so many points of a hull.
    pub(crate) fn of(hull: Hull, pictures: &[(Silhouette<'_>, RgbImage)], time: f32, most: usize) -> Self {
        let (numbers, count) = cells::clusters(&hull.cells);
        let mut cubes = vec![0; count];
        numbers.iter().for_each(|&number| cubes[number as usize] += 1);
        let is_noise = |number: u32| cubes[number as usize] < FEWEST;
        // Clusters that are no noise are numbered anew.
        let mut next = 0;
        let new: Vec<Option<u32>> = (0..count as u32)
            .map(|number| {
                (!is_noise(number)).then(|| {
                    next += 1;
                    next - 1
                })
            })
            .collect();
        let renumbered = |(&cell, &number): (&u64, &u32)| Some((cell, new[number as usize]?));
        let kept: Vec<(u64, u32)> = hull.cells.iter().zip(&numbers).filter_map(renumbered).collect();
        let numbers: Vec<u32> = kept.iter().map(|&(_, number)| number).collect();
        let hull = Hull { cells: kept.iter().map(|&(cell, _)| cell).collect(), ..hull };
        let chosen = choose(&numbers, next as usize, most);
        let colors = colors(&hull, pictures, &chosen);
        let point = |(&index, color): (&usize, Option<Vec3>)| {
            let position = hull.place(hull.cells[index]);
            Some(SurfacePoint { position, color: color?, cluster: numbers[index] })
        };
        let points: Vec<SurfacePoint> = chosen.iter().zip(colors).filter_map(point).collect();
        let clusters = clusters(&points, &numbers, next as usize);
        let spacing = hull.side * (numbers.len().max(1) as f32 / chosen.len().max(1) as f32).sqrt();
        Self { time, points, clusters, spacing, cube: hull.side }
    }

    /// Returns the indices of at most so many of the points, ascending.
    pub(crate) fn fewer(&self, most: usize) -> Vec<usize> {
        let numbers: Vec<u32> = self.points.iter().map(|point| point.cluster).collect();
        choose(&numbers, self.clusters.len(), most)
    }
}

/// Returns the clusters of these points. `numbers` are the clusters of all cubes.
fn clusters(points: &[SurfacePoint], numbers: &[u32], count: usize) -> Vec<Cluster> {
    let mut sums = vec![(Vec3::ZERO, Vec3::ZERO, 0.0f32, 0usize); count];
    for point in points {
        let sum = &mut sums[point.cluster as usize];
        *sum = (sum.0 + point.position, sum.1 + point.color, sum.2 + 1.0, 0);
    }
    numbers.iter().for_each(|&number| sums[number as usize].3 += 1);
    let cluster = |(position, color, points, cubes): (Vec3, Vec3, f32, usize)| {
        let share = points.max(1.0).recip();
        // A cluster that no picture shows matches no other.
        let cubes = if points > 0.0 { cubes } else { 0 };
        Cluster { center: position * share, color: color * share, cubes }
    };
    sums.into_iter().map(cluster).collect()
}

/// Returns the indices of at most `most` items, ascending, given the cluster of each. Items are chosen at equal
/// distances in their order; every cluster has at least [`KEPT`], or all that it has, if `most` allows.
fn choose(numbers: &[u32], clusters: usize, most: usize) -> Vec<usize> {
    if numbers.len() <= most {
        return (0..numbers.len()).collect();
    }
    let mut sizes = vec![0usize; clusters];
    numbers.iter().for_each(|&number| sizes[number as usize] += 1);
    let kept = KEPT.min(most / clusters.max(1));
    let sure: usize = sizes.iter().map(|&size| size.min(kept)).sum();
    let (rest, left) = (most - sure, (numbers.len() - sure).max(1));
    let wanted: Vec<usize> = sizes.iter().map(|&size| size.min(kept) + (size - size.min(kept)) * rest / left).collect();
    let mut seen = vec![0usize; clusters];
    let is_chosen = |index: &usize| {
        let number = numbers[*index] as usize;
        let (at, size, wanted) = (seen[number], sizes[number], wanted[number]);
        seen[number] += 1;
        at * wanted / size != (at + 1) * wanted / size
    };
    (0..numbers.len()).filter(is_chosen).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_choice_is_even_and_keeps_small_clusters() {
        // 40 of a small cluster in the middle of 10,000 of a large one.
        let numbers: Vec<u32> = (0..10_040).map(|index| u32::from((5000..5040).contains(&index))).collect();
        let chosen = choose(&numbers, 2, 1000);
        assert!((990..=1000).contains(&chosen.len()), "nearly as many as allowed: {}", chosen.len());
        let small = chosen.iter().filter(|&&index| numbers[index] == 1).count();
        assert_eq!(small, 40, "all of the small cluster");
        let early = chosen.iter().filter(|&&index| index < 2500).count();
        assert!((230..=250).contains(&early), "a quarter of the others from the first quarter: {early}");
        assert_eq!(choose(&numbers, 2, 20_000).len(), 10_040, "all, if all are allowed");
        assert!(choose(&numbers, 2, 0).is_empty(), "none, if none are allowed");
    }
}
