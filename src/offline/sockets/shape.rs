//! The shape around a point, as it moves.
//!
//! In: a capture, a point at a time. Out: the [`Shape`] around it, which is moved from time to time: it stays as rigid
//! as it can ([`Graph`]) and is pulled ([`Sources`]) to surfaces and means; where the point is on it, and how sure that
//! is.

use super::cloud::Cloud;
use super::graph::{Graph, Pose, Skinned};
use super::means::{Moving, means};
use super::moment::{Drawn, Feature, Moment, thinned};
use super::registration::{Candidates, ROUNDS, SEARCH, Sources, strength};
use super::surface::surface;
use glam::{DQuat, DVec3};
use rstar::RTree;
use std::sync::Arc;

/// Smallest and largest distance between nodes, as parts of the size of the capture.
const SPACING: [f64; 2] = [0.0085, 0.1];
/// In between it is the median, over so many Gaussians around the point, of the distance to their fourth neighbor.
const SAMPLE: usize = 64;
const NEIGHBOR: usize = 4;
/// Smallest opacity at the start of a Gaussian that is part of the shape.
pub(super) const SOLID: f64 = 0.1;
/// How strongly the shape is kept, against a pull of 1 at each node.
const STIFFNESS: f64 = 0.7;
/// The part of the way of the step before that is expected again.
const INERTIA: f64 = 0.5;
/// How strongly nodes stay where they are expected: it decides for nodes that nothing else pulls.
const HOLD: f64 = 0.01;
/// Lengths of the trial step that finds the velocities of nodes at the start, as parts of the time interval of the
/// capture, the longest first: the first one over which no node moves too far is used.
const TRIALS: [f64; 3] = [1.0 / 64.0, 1.0 / 256.0, 1.0 / 1024.0];
/// Distance around the nodes within which features are found, and from the point, in spacings.
const MARGIN: f64 = 5.0;
const AROUND: f64 = 40.0;
/// Longest way of a node around the point in one step from where it was expected, and the distance within which nodes
/// are around it, in spacings.
const LONGEST_WAY: f64 = 1.5;
const VICINITY: f64 = 5.0;
/// Size of the pixels of the views of surfaces, which is the side of the cells of which each has one mean, too, in
/// spacings.
const PIXEL: f64 = 0.4;
/// Least part of the pulls around the point at the start that must still be there.
const LEAST_PULL: f64 = 0.1;
/// Error of a point for each unit of misfit of the edges around it: of 12 points of the streamers and lanterns of the
/// film of the island, the root of the mean square over 49 times (docs/benchmarks.md, "Sockets").
const ERROR_OF_MISFIT: f64 = 7.4;

/// What is around a point.
#[derive(Clone)]
pub(super) struct Shape<'a> {
    cloud: &'a Cloud,
    graph: Arc<Graph>,
    sources: Arc<Sources>,
    point: Skinned,
    /// Distance within which nodes and sources are around the point at rest, capture units.
    vicinity: f64,
    pose: Pose,
    /// How strongly sources around the point are pulled, and must be.
    pull: f64,
    least: f64,
    /// The velocity of each node in the step before, capture units per timestamp unit; `None` before the first one.
    velocities: Option<Vec<DVec3>>,
    /// Timestamp units.
    time: f64,
}

impl<'a> Shape<'a> {
    /// Returns the shape around a point (capture space) at a time (timestamp units); `None` if too little that is solid
    /// is drawn there, or the capture has no size.
    pub(super) fn around(cloud: &'a Cloud, point: DVec3, time: f64) -> Option<Self> {
        let start = Moment::of(cloud.drawn(time, None));
        let [least, most] = SPACING.map(|part| part * cloud.size);
        let spacing = spacing(&start, point)?.clamp(least, most);
        if spacing <= 0.0 {
            return None;
        }
        let solid: Vec<DVec3> = start.all.iter().filter(|one| one.opacity > SOLID).map(|one| one.mean).collect();
        let graph = Graph::around(point, &solid, spacing)?;
        let vicinity = graph.distance(point) + VICINITY * spacing;
        let pose = graph.at_rest();
        graph.misfit_around(&pose, point, vicinity)?;
        let start = Self {
            cloud,
            sources: Arc::default(),
            point: graph.skin(point),
            graph: Arc::new(graph),
            vicinity,
            pose,
            pull: 0.0,
            least: 0.0,
            velocities: None,
            time,
        };
        let start = start.with_sources()?;
        // Which means move as the nodes is known after a step only. It ends within the time interval.
        let trial = |part: f64| {
            let length = part * cloud.span();
            let end = if time + length <= cloud.interval[1] { time + length } else { time - length };
            let mut next = start.clone();
            (length > 0.0 && next.advance(end, false)).then_some(next.velocities)
        };
        match TRIALS.into_iter().find_map(trial) {
            Some(velocities) => Self { velocities, ..start }.with_sources(),
            None => Some(start),
        }
    }

    /// Returns the shape, at rest, with what is on it at its time as sources; `None` where its places are no numbers.
    fn with_sources(self) -> Option<Self> {
        let Self { cloud, graph, pose, vicinity, .. } = &self;
        let point = self.point.rest;
        let start = features(cloud, self.time, pose, self.velocities.as_deref(), point, graph.spacing)?;
        let sources = Sources::on(graph, &start);
        let held = sources.pulls(graph, pose, &sources.candidates(graph, pose, &start), ROUNDS);
        let pull = strength(&held, point, *vicinity);
        Some(Self { sources: Arc::new(sources), pull, least: LEAST_PULL * pull, ..self })
    }

    /// Moves the shape to a time. Returns whether it has moved: it does not if nodes around the point would be far from
    /// where they are expected, unless that is `forced`; and never to places that are no numbers.
    pub(super) fn advance(&mut self, time: f64, forced: bool) -> bool {
        let Self { cloud, graph, sources, .. } = &*self;
        let duration = time - self.time;
        let mut expected = self.pose.places.clone();
        for (place, velocity) in expected.iter_mut().zip(self.velocities.iter().flatten()) {
            *place += velocity * (INERTIA * duration);
        }
        let mut pose = Pose { places: expected.clone(), ..self.pose.clone() };
        let point = self.point.place(graph, &pose);
        let Some(moment) = features(cloud, time, &pose, self.velocities.as_deref(), point, graph.spacing) else {
            return false;
        };
        let mut candidates = Candidates::default();
        let mut pull = 0.0;
        for round in 0..ROUNDS {
            if !pose.places.iter().all(|place| place.is_finite()) {
                return false;
            }
            graph.turn(&mut pose);
            if round.is_multiple_of(SEARCH) {
                candidates = sources.candidates(graph, &pose, &moment);
            }
            let pulls = sources.pulls(graph, &pose, &candidates, round);
            pull = strength(&pulls, self.point.rest, self.vicinity);
            pose.places = graph.balanced(&pose, &pulls, STIFFNESS, &expected, HOLD);
        }
        graph.turn(&mut pose);
        let longest = LONGEST_WAY * graph.spacing;
        let is_off = |node: usize| {
            let is_near = graph.rest[node].distance(self.point.rest) <= self.vicinity;
            is_near && pose.places[node].distance(expected[node]) > longest
        };
        let is_number = pose.places.iter().all(|place| place.is_finite());
        if !is_number || !forced && (0..graph.rest.len()).any(is_off) {
            return false;
        }
        let moved = pose.places.iter().zip(&self.pose.places);
        self.velocities = Some(moved.map(|(after, before)| (after - before) / duration).collect());
        (self.pose, self.pull, self.time) = (pose, pull, time);
        true
    }

    /// Returns whether what is around the point is still pulled to something.
    pub(super) fn is_held(&self) -> bool {
        self.pull >= self.least
    }

    /// Returns where the point is, capture space.
    pub(super) fn place(&self) -> DVec3 {
        self.point.place(&self.graph, &self.pose)
    }

    /// Returns how the point is turned, from the start.
    pub(super) fn rotation(&self) -> DQuat {
        self.point.rotation(&self.pose)
    }

    /// Returns an estimate of the error of the place, capture units: what bends and stretches is followed less surely.
    pub(super) fn error(&self) -> f64 {
        let Self { graph, pose, point, vicinity, .. } = self;
        ERROR_OF_MISFIT * graph.misfit_around(pose, point.rest, *vicinity).unwrap_or(0.0)
    }
}

/// Returns the median over the Gaussians around a point of the distance to one of their neighbors, capture units;
/// `None` without Gaussians.
fn spacing(start: &Moment<Drawn>, point: DVec3) -> Option<f64> {
    let neighbor = |index: usize| {
        let (_, square) = start.nearest(start.all[index].mean).take(NEIGHBOR + 1).last()?;
        Some(square.sqrt())
    };
    let mut distances: Vec<f64> = start.nearest(point).take(SAMPLE).filter_map(|(index, _)| neighbor(index)).collect();
    distances.sort_by(f64::total_cmp);
    distances.get(distances.len() / 2).copied()
}

/// Returns what a pose can be pulled to at a time, around a point in capture space: surfaces, and means of Gaussians
/// that move as its nodes, if their velocities are known; `None` where the places are no numbers.
fn features(
    cloud: &Cloud,
    time: f64,
    pose: &Pose,
    velocities: Option<&[DVec3]>,
    point: DVec3,
    spacing: f64,
) -> Option<Moment<Feature>> {
    if !pose.places.iter().all(|place| place.is_finite()) {
        return None;
    }
    let [margin, around] = [MARGIN, AROUND].map(|distance| DVec3::splat(distance * spacing));
    // A node that has gone astray does not widen the box.
    let low = pose.places.iter().copied().fold(DVec3::INFINITY, DVec3::min).max(point - around) - margin;
    let high = pose.places.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max).min(point + around) + margin;
    // Gaussians beside the box, which are seen in it, are drawn as far as a margin from it.
    let drawn = cloud.drawn(time, Some([low - margin, high + margin]));
    let mut found = surface(&drawn, [low, high], PIXEL * spacing)?;
    let known = pose.places.iter().zip(velocities.into_iter().flatten());
    let nodes = RTree::bulk_load(known.map(|(place, velocity)| Moving::new(place.to_array(), *velocity)).collect());
    found.extend(thinned(means(&drawn, [low, high], &nodes, spacing), PIXEL * spacing));
    Some(Moment::of(found))
}
