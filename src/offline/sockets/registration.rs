//! Registration: what was around a point at the start is pulled to what is drawn at another time.
//!
//! In: the Gaussians at the start ([`Sources`]), a pose of the graph on which they are, the Gaussians of a [`Moment`].
//! Out: the [`Pull`] at each Gaussian of the start.
//!
//! Each Gaussian of the start is pulled to a mixture of the nearest ones at the time (soft correspondences, as in
//! EM-ICP of Granger and Pennec, 2002): more to those with its color, less along the directions in which they are long,
//! and not to those that are far. How it is pulled at the start, when nothing has moved, is subtracted: what is at rest
//! stays.

use super::graph::{Graph, Pose, Pull, Skinned};
use super::moment::{Drawn, Moment};
use glam::{DMat3, DVec3, Vec3};
use rayon::prelude::*;
use rstar::RTree;

/// Number of Gaussians to which one is pulled.
const CANDIDATES: usize = 24;
/// Distance within which Gaussians of the start are on the graph, and least distance between them, in spacings.
const BESIDE: f64 = 1.5;
const APART: f64 = 0.5;
/// The finest scale of distances, and the distance at which a pull has fallen to a quarter, in spacings.
const SCALE: f64 = 0.3;
const FAR: f64 = 1.5;
/// Distance of colors (red, green and blue from 0 to 1) at which a Gaussian counts less by the root of e.
const ALIKE: f64 = 0.2;
/// The coarsest scale, as a factor of the finest. In between, each is the one before divided by the same number.
const COARSEST: f64 = 4.0;
/// Number of rounds, and of those after which the scale is the finest.
pub(super) const ROUNDS: usize = 12;
const FINE: usize = 6;
/// Number of rounds from one search for the nearest Gaussians to the next.
pub(super) const SEARCH: usize = 5;

/// The Gaussians at the start that are on the graph.
pub(super) struct Sources {
    all: Vec<Source>,
    /// The mean number of sources of a node.
    density: f64,
}

/// A Gaussian at the start.
struct Source {
    skinned: Skinned,
    color: Vec3,
    opacity: f64,
    /// How strongly it is pulled at the start.
    pull: f64,
    /// Where it is pulled to at the start, at each scale, from its mean, capture space.
    offsets: [DVec3; FINE + 1],
}

/// The Gaussians to which sources may be pulled.
#[derive(Default)]
pub(super) struct Candidates {
    all: Vec<Drawn>,
    /// The indices of those of each source.
    of: Vec<Vec<usize>>,
}

impl Sources {
    /// Returns the Gaussians of the start that are on a graph.
    pub(super) fn on(graph: &Graph, start: &Moment) -> Self {
        let mut beside: Vec<&Drawn> =
            start.drawn.iter().filter(|one| graph.distance(one.mean) < BESIDE * graph.spacing).collect();
        beside.sort_by(|a, b| b.opacity.total_cmp(&a.opacity));
        let mut tree: RTree<[f64; 3]> = RTree::new();
        let mut all = Vec::new();
        for one in beside {
            let place = one.mean.to_array();
            let least = (APART * graph.spacing).powi(2);
            if tree.nearest_neighbor(&place).is_none_or(|near| DVec3::from(*near).distance_squared(one.mean) >= least) {
                tree.insert(place);
                let skinned = graph.skin(one.mean);
                let offsets = [DVec3::ZERO; FINE + 1];
                all.push(Source { skinned, color: one.color, opacity: one.opacity, pull: 0.0, offsets });
            }
        }
        let density = all.len() as f64 / graph.rest.len() as f64;
        let mut sources = Self { all, density };
        let rest = graph.at_rest();
        let candidates = sources.candidates(graph, &rest, start);
        for round in 0..=FINE {
            let found = sources.pulled_with_start(graph, &rest, &candidates, round);
            for (source, pull) in sources.all.iter_mut().zip(found) {
                // A source without a pull has no stiffness.
                let stiffness = pull.stiffness + DMat3::IDENTITY * 1e-6;
                source.offsets[round] = stiffness.inverse() * pull.force;
                source.pull = trace(&pull.stiffness);
            }
        }
        sources
    }

    /// Returns the Gaussians of a moment that are nearest to the sources in a pose.
    pub(super) fn candidates(&self, graph: &Graph, pose: &Pose, moment: &Moment) -> Candidates {
        let nearest = |source: &Source| -> Vec<usize> {
            let place = source.skinned.place(graph, pose);
            moment.nearest(place).take(CANDIDATES).map(|(index, _)| index).collect()
        };
        let mut of: Vec<Vec<usize>> = self.all.par_iter().map(nearest).collect();
        // Only those that are candidates, in the order in which they are found.
        let mut order = vec![usize::MAX; moment.drawn.len()];
        let mut all = Vec::new();
        for index in of.iter_mut().flatten() {
            if order[*index] == usize::MAX {
                order[*index] = all.len();
                all.push(moment.drawn[*index]);
            }
            *index = order[*index];
        }
        Candidates { all, of }
    }

    /// Returns how strongly sources around a point at rest are pulled at the start.
    pub(super) fn pull_around(&self, point: DVec3, distance: f64) -> f64 {
        let around = self.all.iter().filter(|source| source.skinned.rest.distance(point) <= distance);
        around.map(|source| source.pull).sum::<f64>() / self.density
    }

    /// Returns the sources, and how they are pulled in a pose of a graph.
    pub(super) fn pulls(
        &self,
        graph: &Graph,
        pose: &Pose,
        candidates: &Candidates,
        round: usize,
    ) -> Vec<(&Skinned, Pull)> {
        let without_start = |source: &Source, pull: Pull| {
            let rotation = source.skinned.rotation(pose);
            let force = pull.force - pull.stiffness * (rotation * source.offsets[round.min(FINE)]);
            Pull { force: force / self.density, stiffness: pull.stiffness * self.density.recip() }
        };
        let found = self.pulled_with_start(graph, pose, candidates, round);
        self.all.iter().zip(found).map(|(source, pull)| (&source.skinned, without_start(source, pull))).collect()
    }

    /// Returns how each source is pulled in a pose, with what pulls at the start.
    fn pulled_with_start(&self, graph: &Graph, pose: &Pose, candidates: &Candidates, round: usize) -> Vec<Pull> {
        let scale = SCALE * graph.spacing * COARSEST.powf(1.0 - round.min(FINE) as f64 / FINE as f64);
        let wider = DMat3::from_diagonal(DVec3::splat(scale * scale));
        // Without unit: 1 across a thin Gaussian.
        let precision = |one: &Drawn| {
            let covariance = one.covariance + wider;
            let precision = covariance.inverse() * (scale * scale);
            // One that is no covariance counts as a point.
            if is_positive(&covariance) && precision.is_finite() { precision } else { DMat3::IDENTITY }
        };
        let precisions: Vec<DMat3> = candidates.all.par_iter().map(precision).collect();
        let far = FAR * graph.spacing;
        let pulled = |(source, of): (&Source, &Vec<usize>)| {
            let place = source.skinned.place(graph, pose);
            let mut weights = [0.0; CANDIDATES];
            for (weight, &index) in weights.iter_mut().zip(of) {
                let Drawn { mean, opacity, color, .. } = candidates.all[index];
                let way = mean - place;
                let distance = way.dot(precisions[index] * way) / (scale * scale);
                let difference = f64::from(color.distance_squared(source.color)) / (ALIKE * ALIKE);
                *weight = opacity.ln() - 0.5 * (distance + difference);
            }
            let weights = &mut weights[..of.len()];
            let best = weights.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            weights.iter_mut().for_each(|weight| *weight = (*weight - best).exp());
            let sum: f64 = weights.iter().sum();
            let mut pull = Pull::default();
            let mut middle = DVec3::ZERO;
            for (&weight, &index) in weights.iter().zip(of) {
                let (way, part) = (candidates.all[index].mean - place, weight / sum);
                middle += way * part;
                pull.force += precisions[index] * way * part;
                pull.stiffness += precisions[index] * part;
            }
            let near = source.opacity / (1.0 + middle.length_squared() / (far * far)).powi(2);
            let pull = Pull { force: pull.force * near, stiffness: pull.stiffness * near };
            if pull.force.is_finite() && pull.stiffness.is_finite() { pull } else { Pull::default() }
        };
        self.all.par_iter().zip(&candidates.of).map(pulled).collect()
    }
}

/// Returns how strongly points around a place at rest are pulled.
pub(super) fn strength(pulls: &[(&Skinned, Pull)], place: DVec3, distance: f64) -> f64 {
    let around = pulls.iter().filter(|(point, _)| point.rest.distance(place) <= distance);
    around.map(|(_, pull)| trace(&pull.stiffness)).sum()
}

/// Returns the sum of the diagonal of a matrix.
fn trace(matrix: &DMat3) -> f64 {
    matrix.x_axis.x + matrix.y_axis.y + matrix.z_axis.z
}

/// Returns whether a symmetric matrix is positive definite.
fn is_positive(matrix: &DMat3) -> bool {
    let minor = matrix.x_axis.x * matrix.y_axis.y - matrix.x_axis.y * matrix.y_axis.x;
    matrix.x_axis.x > 0.0 && minor > 0.0 && matrix.determinant() > 0.0
}
