//! The Gaussians that are drawn at a time, by place.
//!
//! In: the Gaussians, each with its mean and its opacity at the time. Out: a [`Moment`], in which those nearest to a
//! point are found.

use glam::{DMat3, DVec3, Vec3};
use rstar::RTree;
use rstar::primitives::GeomWithData;

/// A Gaussian at a time.
#[derive(Debug, Clone, Copy)]
pub(super) struct Drawn {
    /// Its mean at the time, capture space.
    pub mean: DVec3,
    /// Its opacity at the time, 0 to 1.
    pub opacity: f64,
    /// Its covariance, squared capture units.
    pub covariance: DMat3,
    /// Its color, independent of direction and time, 0 to 1.
    pub color: Vec3,
}

/// The Gaussians that are drawn at a time.
pub(super) struct Moment {
    pub drawn: Vec<Drawn>,
    tree: RTree<Place>,
}

/// A mean, with the index of its Gaussian.
type Place = GeomWithData<[f64; 3], usize>;

impl Moment {
    pub(super) fn of(drawn: Vec<Drawn>) -> Self {
        let places = drawn.iter().enumerate().map(|(index, one)| Place::new(one.mean.to_array(), index));
        let tree = RTree::bulk_load(places.collect());
        Self { drawn, tree }
    }

    /// Returns the indices of the Gaussians whose means are nearest to a point, the nearest first, with the squares of
    /// their distances.
    pub(super) fn nearest(&self, place: DVec3) -> impl Iterator<Item = (usize, f64)> {
        let found = self.tree.nearest_neighbor_iter_with_distance_2(&place.to_array());
        found.map(|(place, square)| (place.data, square))
    }
}
