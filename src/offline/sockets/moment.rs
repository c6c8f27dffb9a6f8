//! What is there at a time, by place.
//!
//! In: the Gaussians that are drawn at a time ([`Drawn`]), or what a shape can be pulled to ([`Feature`]). Out: a
//! [`Moment`] of either, in which those nearest to a point are found; features of which each cell has one.

use glam::{DMat3, DVec3, Vec3};
use rstar::RTree;
use rstar::primitives::GeomWithData;
use std::collections::HashMap;

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
    /// Its velocity, capture units per timestamp unit.
    pub velocity: DVec3,
    /// The standard deviation of its marginal, at most the time interval, timestamp units.
    pub duration: f64,
}

/// What a shape can be pulled to at a time: a point on a surface, or the mean of a Gaussian.
#[derive(Debug, Clone, Copy)]
pub(super) struct Feature {
    /// Capture space.
    pub place: DVec3,
    /// How sure it is, 0 to 1.
    pub weight: f64,
    /// 0 to 1.
    pub color: Vec3,
}

/// What has a place.
pub(super) trait Placed {
    /// Capture space.
    fn place(&self) -> DVec3;
}

impl Placed for Drawn {
    fn place(&self) -> DVec3 {
        self.mean
    }
}

impl Placed for Feature {
    fn place(&self) -> DVec3 {
        self.place
    }
}

/// What is there at a time, in which neighbors are found.
pub(super) struct Moment<T> {
    pub all: Vec<T>,
    tree: RTree<Place>,
}

/// Returns whether a place is in a box, both in capture space.
pub(super) fn is_inside(place: DVec3, [low, high]: [DVec3; 2]) -> bool {
    place.cmpge(low).all() && place.cmple(high).all()
}

/// Returns the feature that counts most in each cell of this side (capture units), in their order.
pub(super) fn thinned(mut points: Vec<Feature>, cell: f64) -> Vec<Feature> {
    // -0 and 0 are one cell.
    let at = |one: &Feature| ((one.place / cell).floor() + DVec3::ZERO).to_array().map(f64::to_bits);
    let mut best: HashMap<[u64; 3], f64> = HashMap::new();
    for one in &points {
        let weight = best.entry(at(one)).or_insert(one.weight);
        *weight = weight.max(one.weight);
    }
    // Of equal ones the first.
    points.retain(|one| best.get(&at(one)).is_some_and(|best| one.weight >= *best) && best.remove(&at(one)).is_some());
    points
}

/// A place, with the index of what is there.
type Place = GeomWithData<[f64; 3], usize>;

impl<T: Placed> Moment<T> {
    /// Returns the moment of these.
    pub(super) fn of(all: Vec<T>) -> Self {
        let places = all.iter().enumerate().map(|(index, one)| Place::new(one.place().to_array(), index));
        let tree = RTree::bulk_load(places.collect());
        Self { all, tree }
    }

    /// Returns the indices of those nearest to a point, the nearest first, with the squares of their distances.
    pub(super) fn nearest(&self, place: DVec3) -> impl Iterator<Item = (usize, f64)> {
        let found = self.tree.nearest_neighbor_iter_with_distance_2(&place.to_array());
        found.map(|(place, square)| (place.data, square))
    }
}
