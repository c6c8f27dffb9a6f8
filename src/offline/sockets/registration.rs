//! Registration: what was around a point at the start is pulled to what is there at another time.
//!
//! In: the features of the start ([`Sources`]), a pose of the graph on which they are, those of a [`Moment`]. Out: the
//! [`Pull`] at each feature of the start.
//!
//! Each feature of the start is pulled to a mixture of the nearest ones at the time (soft correspondences, as in EM-ICP
//! of Granger and Pennec, 2002): more to those with its color, and not to those that are far. How it is pulled at the
//! start, when nothing has moved, is subtracted: what is at rest stays.
//!
//! With the weights `w` of the features at `q` and the scale `s` of distances, the energy of a feature of the start at
//! `x` is `-ln sum w exp(-|q - x|² / 2 s²)`. Times s², its slope is the way to the mean of the mixture, and its second
//! derivative `1 - C / s²` for the covariance C of the mixture. So a pull hardly resists motion along what looks alike:
//! with 1 in its place, as in EM, each round would go a small part of such a way.

use super::graph::{Graph, Pose, Pull, Skinned};
use super::moment::{Feature, Moment};
use crate::gaussian::outer::outer;
use glam::{DMat3, DVec3, Vec3};
use rayon::prelude::*;
use rstar::RTree;

/// Number of features to which one is pulled.
const CANDIDATES: usize = 24;
/// Distance within which features of the start are on the graph, and least distance between them, in spacings.
const BESIDE: f64 = 1.5;
const APART: f64 = 0.5;
/// The finest scale of distances, and the distance at which a pull has fallen to a quarter, in spacings.
const SCALE: f64 = 0.36;
const FAR: f64 = 1.5;
/// Distance of colors (red, green and blue from 0 to 1) at which a feature counts less by the root of e.
const ALIKE: f64 = 0.2;
/// The coarsest scale, as a factor of the finest. In between, each is the one before divided by the same number.
const COARSEST: f64 = 3.4;
/// Number of rounds, and of those after which the scale is the finest.
pub(super) const ROUNDS: usize = 12;
const FINE: usize = 6;
/// Number of rounds from one search for the nearest features to the next.
pub(super) const SEARCH: usize = 5;

/// The features at the start that are on the graph.
#[derive(Default)]
pub(super) struct Sources {
    all: Vec<Source>,
    /// The mean number of sources of a node.
    density: f64,
}

/// A feature at the start.
struct Source {
    skinned: Skinned,
    color: Vec3,
    weight: f64,
    /// Where it is pulled to at the start, at each scale, from its place, capture space.
    offsets: [DVec3; FINE + 1],
}

/// The features to which sources may be pulled.
#[derive(Default)]
pub(super) struct Candidates {
    all: Vec<Feature>,
    /// The indices of those of each source.
    of: Vec<Vec<usize>>,
}

impl Sources {
    /// Returns the features of the start that are on a graph.
    pub(super) fn on(graph: &Graph, start: &Moment<Feature>) -> Self {
        let mut beside: Vec<&Feature> =
            start.all.iter().filter(|one| graph.distance(one.place) < BESIDE * graph.spacing).collect();
        beside.sort_by(|a, b| b.weight.total_cmp(&a.weight));
        let mut tree: RTree<[f64; 3]> = RTree::new();
        let mut all = Vec::new();
        for one in beside {
            let place = one.place.to_array();
            let least = (APART * graph.spacing).powi(2);
            if tree.nearest_neighbor(&place).is_none_or(|near| DVec3::from(*near).distance_squared(one.place) >= least)
            {
                tree.insert(place);
                let skinned = graph.skin(one.place);
                let offsets = [DVec3::ZERO; FINE + 1];
                all.push(Source { skinned, color: one.color, weight: one.weight, offsets });
            }
        }
        let density = all.len() as f64 / graph.rest.len() as f64;
        let mut sources = Self { all, density };
        let rest = graph.at_rest();
        let candidates = sources.candidates(graph, &rest, start);
        for round in 0..=FINE {
            let found = sources.pulled_with_start(graph, &rest, &candidates, round);
            for (source, pull) in sources.all.iter_mut().zip(found) {
                // A source without a pull has no weight.
                source.offsets[round] = if pull.weight > 0.0 { pull.force / pull.weight } else { DVec3::ZERO };
            }
        }
        sources
    }

    /// Returns the features of a moment that are nearest to the sources in a pose.
    pub(super) fn candidates(&self, graph: &Graph, pose: &Pose, moment: &Moment<Feature>) -> Candidates {
        let nearest = |source: &Source| -> Vec<usize> {
            let place = source.skinned.place(graph, pose);
            moment.nearest(place).take(CANDIDATES).map(|(index, _)| index).collect()
        };
        let mut of: Vec<Vec<usize>> = self.all.par_iter().map(nearest).collect();
        // Only those that are candidates, in the order in which they are found.
        let mut order = vec![usize::MAX; moment.all.len()];
        let mut all = Vec::new();
        for index in of.iter_mut().flatten() {
            if order[*index] == usize::MAX {
                order[*index] = all.len();
                all.push(moment.all[*index]);
            }
            *index = order[*index];
        }
        Candidates { all, of }
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
            let force = pull.force - rotation * source.offsets[round.min(FINE)] * pull.weight;
            let part = self.density.recip();
            Pull { force: force * part, stiffness: pull.stiffness * part, weight: pull.weight * part }
        };
        let found = self.pulled_with_start(graph, pose, candidates, round);
        self.all.iter().zip(found).map(|(source, pull)| (&source.skinned, without_start(source, pull))).collect()
    }

    /// Returns how each source is pulled in a pose, with what pulls at the start.
    fn pulled_with_start(&self, graph: &Graph, pose: &Pose, candidates: &Candidates, round: usize) -> Vec<Pull> {
        let scale = SCALE * graph.spacing * COARSEST.powf(1.0 - round.min(FINE) as f64 / FINE as f64);
        let far = FAR * graph.spacing;
        let pulled = |(source, of): (&Source, &Vec<usize>)| {
            let place = source.skinned.place(graph, pose);
            let mut weights = [0.0; CANDIDATES];
            for (weight, &index) in weights.iter_mut().zip(of) {
                let Feature { place: other, weight: sure, color } = candidates.all[index];
                let distance = other.distance_squared(place) / (scale * scale);
                let difference = f64::from(color.distance_squared(source.color)) / (ALIKE * ALIKE);
                *weight = sure.ln() - 0.5 * (distance + difference);
            }
            let weights = &mut weights[..of.len()];
            let best = weights.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            weights.iter_mut().for_each(|weight| *weight = (*weight - best).exp());
            let sum: f64 = weights.iter().sum();
            let ways =
                || weights.iter().zip(of).map(|(part, &index)| (candidates.all[index].place - place, part / sum));
            let way = ways().map(|(way, part)| way * part).sum::<DVec3>();
            let weight = source.weight / (1.0 + way.length_squared() / (far * far)).powi(2);
            if of.is_empty() || !way.is_finite() {
                return Pull::default();
            }
            let mut covariance = DMat3::ZERO;
            for (other, part) in ways() {
                let aside = (other - way) / scale;
                covariance += outer(aside, aside) * part;
            }
            // Between two places that are far apart it would be negative.
            let most = covariance.to_cols_array().iter().map(|entry| entry * entry).sum::<f64>().sqrt().max(1.0);
            Pull { force: way * weight, stiffness: (DMat3::IDENTITY - covariance * most.recip()) * weight, weight }
        };
        self.all.par_iter().zip(&candidates.of).map(pulled).collect()
    }
}

/// Returns how strongly points around a place at rest are pulled.
pub(super) fn strength(pulls: &[(&Skinned, Pull)], place: DVec3, distance: f64) -> f64 {
    let around = pulls.iter().filter(|(point, _)| point.rest.distance(place) <= distance);
    around.map(|(_, pull)| pull.weight).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    const COLORS: [Vec3; 2] = [Vec3::X, Vec3::Z];

    /// Returns a square of features of side 5, each of the other color than those beside it, moved.
    fn square(way: DVec3) -> Moment<Feature> {
        let at = |x: usize, y: usize| DVec3::new(x as f64, y as f64, 0.0) + way;
        let feature = |x: usize, y: usize| Feature { place: at(x, y), weight: 1.0, color: COLORS[(x + y) % 2] };
        Moment::of((0..6).flat_map(|x| (0..6).map(move |y| feature(x, y))).collect())
    }

    fn graph(start: &Moment<Feature>) -> Graph {
        let places: Vec<DVec3> = start.all.iter().map(|one| one.place).collect();
        Graph::around(DVec3::ZERO, &places, 1.0).expect("there are nodes")
    }

    fn pulls<'a>(graph: &Graph, sources: &'a Sources, moment: &Moment<Feature>) -> Vec<(&'a Skinned, Pull)> {
        let rest = graph.at_rest();
        sources.pulls(graph, &rest, &sources.candidates(graph, &rest, moment), FINE)
    }

    #[test]
    fn what_stands_is_not_pulled_and_what_has_moved_is_pulled_after_it() {
        let start = square(DVec3::ZERO);
        let graph = graph(&start);
        let sources = Sources::on(&graph, &start);
        let found = pulls(&graph, &sources, &start);
        assert_eq!(found.len(), 36, "each feature is a source");
        assert!(found.iter().all(|(_, pull)| pull.force.length() < 1e-9), "nothing has moved");
        let held = strength(&found, DVec3::ZERO, 9.0);
        assert!(held > 30.0, "all are pulled to where they are: {held}");
        let way = DVec3::new(0.25, -0.1, 0.05);
        for (point, pull) in pulls(&graph, &sources, &square(way)) {
            let to = pull.force / pull.weight;
            assert!(to.abs_diff_eq(way, 0.02), "{} is pulled by {to}", point.rest);
        }
    }

    #[test]
    fn features_are_pulled_to_those_of_their_color_and_hardly_to_those_far_away() {
        let start = square(DVec3::ZERO);
        let graph = graph(&start);
        let sources = Sources::on(&graph, &start);
        // A side of a cell away, the nearest ones have the other color.
        let moved = pulls(&graph, &sources, &square(0.6 * DVec3::X));
        let inside = moved.iter().filter(|(point, _)| point.rest.x < 4.5);
        let least = inside.map(|(_, pull)| pull.force.x / pull.weight).fold(f64::INFINITY, f64::min);
        assert!(least > 0.5, "one is pulled by {least}: to the other color, 0.4 the other way");
        let far = pulls(&graph, &sources, &square(9.0 * DVec3::Z));
        let [then, now] = [&pulls(&graph, &sources, &start), &far].map(|pulls| strength(pulls, DVec3::ZERO, 9.0));
        assert!(now < 0.01 * then, "what is far away holds nothing: {now} of {then}");
        let nothing = pulls(&graph, &sources, &Moment::of(Vec::new()));
        assert!(strength(&nothing, DVec3::ZERO, 9.0) == 0.0, "nothing is there");
    }

    #[test]
    fn pulls_resist_motion_across_a_line_of_one_color_and_hardly_along_it() {
        let line = |color: &dyn Fn(usize) -> Vec3| {
            let feature = |x: usize| Feature { place: 0.2 * x as f64 * DVec3::X, weight: 1.0, color: color(x) };
            Moment::of((0..40).map(feature).collect())
        };
        let resist = |start: &Moment<Feature>| {
            let graph = graph(start);
            let sources = Sources::on(&graph, start);
            let found = pulls(&graph, &sources, start);
            let (_, pull) = found.iter().find(|(point, _)| point.rest.x > 3.9).expect("the middle of the line");
            [pull.stiffness * DVec3::X, pull.stiffness * DVec3::Y].map(|against| against.length() / pull.weight)
        };
        let [along, across] = resist(&line(&|_| Vec3::X));
        assert!(along < 0.1 && across > 0.99, "along the line {along}, across it {across}");
        let [along, across] = resist(&line(&|x| COLORS[usize::from(x >= 20)]));
        assert!(along > 0.2 && across > 0.99, "where the color changes {along}, across {across}");
    }
}
