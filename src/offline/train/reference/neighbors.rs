//! The nearest neighbors of every Gaussian.
//!
//! In: means. Out: the indices of the nearest Gaussians of each. A k-d tree finds them: captures have a few Gaussians
//! far from all others, and a grid around these would have the rest in one cell.

use glam::Vec3;
use rayon::prelude::*;

/// Neighbors of each Gaussian, itself included.
pub const NEIGHBORS: usize = 20;
/// Points of a leaf of the tree, which are compared one by one.
const LEAF: usize = 16;

/// Returns the [`NEIGHBORS`] nearest points of each, one after the other: first itself, then by distance. If there are
/// fewer points, the point itself fills the rest.
pub fn neighbors(means: &[[f32; 3]]) -> Vec<u32> {
    neighbors_of_first(means, means.len())
}

/// Returns those of the first `count` points alone, among all.
pub fn neighbors_of_first(means: &[[f32; 3]], count: usize) -> Vec<u32> {
    let mut tree: Vec<u32> = (0..means.len() as u32).collect();
    arrange(means, &mut tree, 0);
    let mut found = vec![0; count * NEIGHBORS];
    found.par_chunks_exact_mut(NEIGHBORS).enumerate().for_each(|(index, own)| {
        let mut nearest = Nearest::new(means, index as u32);
        nearest.search(&tree, 0);
        own.iter_mut().zip(nearest.found).for_each(|(own, (_, other))| *own = other);
    });
    found
}

/// Orders points as a k-d tree: the middle point is a node; points before it have at most its coordinate along `axis`,
/// points after it at least that; both parts are trees along the next axis.
fn arrange(means: &[[f32; 3]], points: &mut [u32], axis: usize) {
    if points.len() <= LEAF {
        return;
    }
    let along = |point: &u32| means[*point as usize][axis];
    let middle = points.len() / 2;
    // Of equal coordinates the index decides, so that the tree is the same on every run.
    let (low, _, high) =
        points.select_nth_unstable_by(middle, |a, b| along(a).total_cmp(&along(b)).then_with(|| a.cmp(b)));
    rayon::join(|| arrange(means, low, (axis + 1) % 3), || arrange(means, high, (axis + 1) % 3));
}

/// The nearest points of one that have been found so far.
struct Nearest<'a> {
    means: &'a [[f32; 3]],
    own: u32,
    at: Vec3,
    /// Squared distance and index, ascending.
    found: [(f32, u32); NEIGHBORS],
}

impl<'a> Nearest<'a> {
    fn new(means: &'a [[f32; 3]], own: u32) -> Self {
        let mut found = [(f32::INFINITY, own); NEIGHBORS];
        found[0].0 = 0.0;
        Self { means, own, at: Vec3::from(means[own as usize]), found }
    }

    fn search(&mut self, tree: &[u32], axis: usize) {
        if tree.len() <= LEAF {
            tree.iter().for_each(|&point| self.offer(point));
            return;
        }
        let (low, rest) = tree.split_at(tree.len() / 2);
        let Some((&branch, high)) = rest.split_first() else { return };
        self.offer(branch);
        let beyond = self.at[axis] - self.means[branch as usize][axis];
        let (near, far) = if beyond < 0.0 { (low, high) } else { (high, low) };
        self.search(near, (axis + 1) % 3);
        if beyond * beyond < self.reach() {
            self.search(far, (axis + 1) % 3);
        }
    }

    /// Returns the squared distance of the farthest point found so far that counts.
    fn reach(&self) -> f32 {
        self.found[NEIGHBORS - 1].0
    }

    fn offer(&mut self, point: u32) {
        let distance = self.at.distance_squared(Vec3::from(self.means[point as usize]));
        if point != self.own && distance < self.reach() {
            let place = self.found.partition_point(|(nearer, _)| *nearer <= distance);
            self.found.copy_within(place..NEIGHBORS - 1, place + 1);
            self.found[place] = (distance, point);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::random::Random;

    /// Returns points close together, and two far away.
    fn points(count: usize) -> Vec<[f32; 3]> {
        let mut random = Random::new(5);
        let mut points: Vec<_> = (0..count).map(|_| [(); 3].map(|()| random.in_range(-1.0, 1.0))).collect();
        points.extend([[900.0, -70.0, 3.0], [901.0, -70.0, 3.0]]);
        points
    }

    #[test]
    fn neighbors_are_the_nearest_of_all() {
        let points = points(700);
        let found = neighbors(&points);
        assert_eq!(found.len(), points.len() * NEIGHBORS, "as many for each");
        for (index, own) in found.chunks_exact(NEIGHBORS).enumerate() {
            let distance = |other: u32| Vec3::from(points[index]).distance_squared(Vec3::from(points[other as usize]));
            let mut all: Vec<f32> = (0..points.len() as u32).map(distance).collect();
            all.sort_by(f32::total_cmp);
            let nearest: Vec<f32> = own.iter().map(|&other| distance(other)).collect();
            assert_eq!(own[0] as usize, index, "first itself");
            assert_eq!(nearest, all[..NEIGHBORS], "point {index}: no other is nearer");
        }
    }

    #[test]
    fn few_or_equal_points_have_neighbors() {
        let few = neighbors(&[[0.0; 3], [1.0, 0.0, 0.0]]);
        assert_eq!(few[..3], [0, 1, 0], "the point itself where there are no more");
        assert_eq!(few[NEIGHBORS..][..3], [1, 0, 1], "of the other as well");
        assert!(neighbors(&[]).is_empty(), "none of none");
        let equal = neighbors(&[[0.5; 3]; 1000]);
        let own = equal.chunks_exact(NEIGHBORS).enumerate().all(|(index, own)| own[0] as usize == index);
        assert!(own, "each counts itself, however many are in its place");
        neighbors(&[[f32::NAN; 3]; 100]).iter().for_each(|&index| assert!(index < 100, "{index} is a point"));
    }
}
