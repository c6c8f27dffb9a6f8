//! The means of Gaussians, of those that move as what is around them.
//!
//! In: the Gaussians that are drawn at a time; where the nodes of a graph are expected, and their velocities. Out: the
//! means, as [`Feature`]s.
//!
//! Where something moves fast, a capture often has Gaussians that stand: for a moment, as those that come next take
//! their place, or for long inside of what passes. A mean counts less by how far its Gaussian drifts from the nearest
//! node over its life.

use super::moment::{Drawn, Feature, is_inside};
use glam::DVec3;
use rayon::prelude::*;
use rstar::RTree;
use rstar::primitives::GeomWithData;

/// How much a mean counts against a point of a surface.
const SHARE: f64 = 0.7;
/// Least agreement of a mean that counts.
const LEAST: f64 = 0.05;
/// Drift at which a mean counts less by the root of e, in spacings.
const DRIFT: f64 = 0.36;

/// Where a node is expected (capture space), and its velocity (capture units per timestamp unit).
pub(super) type Moving = GeomWithData<[f64; 3], DVec3>;

/// Returns the means in a box (capture space) of those of these Gaussians that agree with the nodes; of all without
/// nodes. `spacing` is the distance between nodes, capture units.
pub(super) fn means(drawn: &[Drawn], bounds: [DVec3; 2], nodes: &RTree<Moving>, spacing: f64) -> Vec<Feature> {
    let agreement = |one: &Drawn| {
        let velocity = nodes.nearest_neighbor(&one.mean.to_array()).map_or(one.velocity, |node| node.data);
        let drift = one.velocity.distance(velocity) * one.duration / (DRIFT * spacing);
        (-0.5 * drift * drift).exp()
    };
    let feature = |one: &Drawn| {
        let agreement = if is_inside(one.mean, bounds) { agreement(one) } else { 0.0 };
        let weight = SHARE * one.opacity * agreement;
        (agreement >= LEAST).then_some(Feature { place: one.mean, weight, color: one.color })
    };
    drawn.par_iter().filter_map(feature).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DMat3, Vec3};

    #[test]
    fn means_count_that_drift_little_from_what_is_around_them() {
        let gaussian = |mean: DVec3, velocity: DVec3, duration: f64| Drawn {
            mean,
            opacity: 0.8,
            covariance: DMat3::IDENTITY,
            color: Vec3::ONE,
            velocity,
            duration,
        };
        let drawn = [
            gaussian(DVec3::ZERO, DVec3::X, 0.5),
            gaussian(DVec3::ZERO, DVec3::ZERO, 0.5),
            gaussian(DVec3::ZERO, DVec3::ZERO, 1e-3),
            gaussian(9.0 * DVec3::Y, DVec3::ZERO, 0.5),
            gaussian(99.0 * DVec3::Y, DVec3::ZERO, 0.5),
        ];
        let bounds = [DVec3::splat(-10.0), DVec3::splat(10.0)];
        let nodes =
            RTree::bulk_load(vec![Moving::new([0.1, 0.0, 0.0], DVec3::X), Moving::new([0.0, 9.0, 0.0], DVec3::ZERO)]);
        let weights = |nodes| means(&drawn, bounds, nodes, 0.1).iter().map(|one| one.weight).collect::<Vec<_>>();
        let found = weights(&nodes);
        assert_eq!(found.len(), 3, "one stands for long where a node passes, and one is outside of the box: {found:?}");
        assert_eq!((found[0], found[2]), (SHARE * 0.8, SHARE * 0.8), "they move as the nodes beside them");
        assert!(found[1] > 0.55, "it stands for a moment: {}", found[1]);
        assert_eq!(weights(&RTree::new()), [SHARE * 0.8; 4], "without nodes nothing is known");
    }
}
