//! A deformation graph: nodes on what is around a point, which moves as rigidly as it can.
//!
//! In: the means of Gaussians around a point, a spacing. Out: a [`Graph`] of those that can be reached from the point
//! without a gap; the places of its nodes at which the forces with which it keeps its shape balance pulls at points;
//! how much a [`Pose`] differs from rest.
//!
//! The energy of a pose is that of Sorkine and Alexa, "As-Rigid-As-Possible Surface Modeling" (2007), over the edges of
//! the graph: `sum of w |(x_m - x_n) - (R_n + R_m) / 2 (p_m - p_n)|²` for nodes n and m at rest at p, in the pose at x,
//! with the rotation R of each node. Points between nodes move with the nearest ones, as in Sumner and others,
//! "Embedded Deformation for Shape Manipulation" (2007).

use crate::gaussian::outer::outer;
use glam::{DMat3, DQuat, DVec3};
use rstar::RTree;
use rstar::primitives::GeomWithData;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Most nodes of a graph.
const MOST: usize = 1200;
/// Length of the longest edge, in spacings.
const LONGEST: f64 = 2.5;
/// Length of the edges whose weight is lower by the factor e, in spacings.
const TYPICAL: f64 = 1.5;
/// Largest distance from the point, and along edges from the node nearest to it, in spacings.
const REACH: f64 = 30.0;
/// Nodes with which a point moves.
const CARRIERS: usize = 8;
/// Steps in which the rotation of a node is found, from that of before.
const TURNS: usize = 4;
/// Most steps in which forces are balanced, and the part of the forces that may be left.
const BALANCES: usize = 30;
const LEFT: f64 = 1e-4;

/// Nodes at rest, and the edges between them.
pub(super) struct Graph {
    /// Their places at rest, capture space.
    pub rest: Vec<DVec3>,
    /// The edges of each node: the other node, and the weight.
    edges: Vec<Vec<(usize, f64)>>,
    /// The distance between nodes, capture units.
    pub spacing: f64,
    tree: RTree<GeomWithData<[f64; 3], usize>>,
}

/// Where the nodes of a graph are, and how they are turned.
#[derive(Debug, Clone)]
pub(super) struct Pose {
    /// Capture space.
    pub places: Vec<DVec3>,
    /// From rest.
    pub rotations: Vec<DQuat>,
}

/// A point at rest, and the nodes with which it moves: their weights have the sum 1.
#[derive(Debug, Clone)]
pub(super) struct Skinned {
    /// Capture space.
    pub rest: DVec3,
    pub carriers: Vec<(usize, f64)>,
}

/// What pulls at a point: a force, by how much it falls along each way of the point (symmetric, no eigenvalue is
/// negative), and how much it counts.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Pull {
    pub force: DVec3,
    pub stiffness: DMat3,
    pub weight: f64,
}

impl Graph {
    /// Returns the graph of the means that are reached from a point; `None` if there is none.
    pub(super) fn around(point: DVec3, means: &[DVec3], spacing: f64) -> Option<Self> {
        let mut sorted: Vec<DVec3> =
            means.iter().copied().filter(|mean| mean.distance(point) < REACH * spacing).collect();
        sorted.sort_by(|a, b| a.distance_squared(point).total_cmp(&b.distance_squared(point)));
        let mut tree = RTree::new();
        let mut nodes: Vec<DVec3> = Vec::new();
        for mean in sorted {
            let nearest = tree.nearest_neighbor(&mean.to_array());
            let is_free = nearest.is_none_or(|node: &GeomWithData<[f64; 3], usize>| {
                DVec3::from(*node.geom()).distance_squared(mean) >= spacing * spacing
            });
            if is_free {
                tree.insert(GeomWithData::new(mean.to_array(), nodes.len()));
                nodes.push(mean);
            }
        }
        let rest: Vec<DVec3> = reached(&nodes, &tree, spacing).into_iter().map(|node| nodes[node]).collect();
        let places = rest.iter().enumerate().map(|(index, place)| GeomWithData::new(place.to_array(), index));
        let tree = RTree::bulk_load(places.collect());
        let weighted = |(node, length): (usize, f64)| (node, (-(length / (TYPICAL * spacing)).powi(2)).exp());
        let edges = (0..rest.len()).map(|node| edges(&tree, node, rest[node], spacing).map(weighted).collect());
        let edges = edges.collect();
        (!rest.is_empty()).then_some(Self { rest, edges, spacing, tree })
    }

    /// Returns the pose at rest.
    pub(super) fn at_rest(&self) -> Pose {
        Pose { places: self.rest.clone(), rotations: vec![DQuat::IDENTITY; self.rest.len()] }
    }

    /// Returns the distance from a point to the nearest node at rest, capture units.
    pub(super) fn distance(&self, point: DVec3) -> f64 {
        let nearest = self.tree.nearest_neighbor(&point.to_array());
        nearest.map_or(f64::INFINITY, |node| DVec3::from(*node.geom()).distance(point))
    }

    /// Returns the nodes with which a point at rest moves.
    pub(super) fn skin(&self, rest: DVec3) -> Skinned {
        let nearest = self.tree.nearest_neighbor_iter_with_distance_2(&rest.to_array()).take(CARRIERS);
        // Points that are far from all nodes move with the nearest.
        let mut least = 0.0;
        let weighted = nearest.enumerate().map(|(order, (node, square))| {
            if order == 0 {
                least = square;
            }
            (node.data, ((least - square) / (self.spacing * self.spacing)).exp())
        });
        let mut carriers: Vec<(usize, f64)> = weighted.collect();
        let sum: f64 = carriers.iter().map(|(_, weight)| weight).sum();
        carriers.iter_mut().for_each(|(_, weight)| *weight /= sum);
        Skinned { rest, carriers }
    }

    /// Turns each node of a pose as its edges are turned.
    pub(super) fn turn(&self, pose: &mut Pose) {
        for (node, edges) in self.edges.iter().enumerate() {
            let mut covariance = DMat3::ZERO;
            for &(other, weight) in edges {
                let (from, to) = (self.rest[other] - self.rest[node], pose.places[other] - pose.places[node]);
                covariance += outer(to, from) * weight;
            }
            pose.rotations[node] = rotation(&covariance, pose.rotations[node]);
        }
    }

    /// Returns the places of nodes at which three forces balance: those of a pose to keep its shape, times `stiffness`;
    /// the pulls at points that move with the nodes; and those that hold nodes where they are `expected`, times `hold`.
    /// The rotations stay.
    pub(super) fn balanced(
        &self,
        pose: &Pose,
        pulls: &[(&Skinned, Pull)],
        stiffness: f64,
        expected: &[DVec3],
        hold: f64,
    ) -> Vec<DVec3> {
        let turned: Vec<DMat3> = pose.rotations.iter().map(|rotation| DMat3::from_quat(*rotation)).collect();
        let nodes = 0..self.rest.len();
        let force = |node: usize| {
            let own = self.edges[node].iter().map(|&(other, weight)| self.misfit(pose, &turned, node, other) * weight);
            own.sum::<DVec3>() * stiffness + (expected[node] - pose.places[node]) * hold
        };
        let mut forces: Vec<DVec3> = nodes.clone().map(force).collect();
        let weights: Vec<f64> = self
            .edges
            .iter()
            .map(|edges| stiffness * edges.iter().map(|(_, weight)| weight).sum::<f64>() + hold)
            .collect();
        let mut diagonal = weights.clone();
        for (point, pull) in pulls {
            let [x, y, z] = [pull.stiffness.x_axis.x, pull.stiffness.y_axis.y, pull.stiffness.z_axis.z];
            for &(node, weight) in &point.carriers {
                forces[node] += pull.force * weight;
                diagonal[node] += (x + y + z) / 3.0 * (weight * weight);
            }
        }
        let inverse: Vec<f64> = diagonal.iter().map(|weight| weight.recip()).collect();
        let times = |ways: &[DVec3]| -> Vec<DVec3> {
            let of = |node: usize| {
                let others = self.edges[node].iter().map(|&(other, weight)| ways[other] * weight);
                ways[node] * weights[node] - others.sum::<DVec3>() * stiffness
            };
            let mut answer: Vec<DVec3> = nodes.clone().map(of).collect();
            for (point, pull) in pulls {
                let way: DVec3 = point.carriers.iter().map(|&(node, weight)| ways[node] * weight).sum();
                let against = pull.stiffness * way;
                point.carriers.iter().for_each(|&(node, weight)| answer[node] += against * weight);
            }
            answer
        };
        let ways = conjugate_gradients(forces, &inverse, times);
        pose.places.iter().zip(ways).map(|(place, way)| place + way).collect()
    }

    /// Returns by how much an edge of a pose differs from that at rest, turned, capture units.
    fn misfit(&self, pose: &Pose, turned: &[DMat3], node: usize, other: usize) -> DVec3 {
        let from = self.rest[other] - self.rest[node];
        pose.places[other] - pose.places[node] - (turned[node] + turned[other]) * (0.5 * from)
    }

    /// Returns the root of the mean square by which edges at most `distance` (capture units) from a point at rest
    /// differ from those at rest, turned, capture units; `None` if there is none.
    pub(super) fn misfit_around(&self, pose: &Pose, point: DVec3, distance: f64) -> Option<f64> {
        let turned: Vec<DMat3> = pose.rotations.iter().map(|rotation| DMat3::from_quat(*rotation)).collect();
        let (mut sum, mut weights) = (0.0, 0.0);
        for (node, edges) in self.edges.iter().enumerate() {
            if self.rest[node].distance(point) <= distance {
                for &(other, weight) in edges {
                    sum += weight * self.misfit(pose, &turned, node, other).length_squared();
                    weights += weight;
                }
            }
        }
        (weights > 0.0).then(|| (sum / weights).sqrt())
    }
}

impl Skinned {
    /// Returns where the point is in a pose, capture space.
    pub(super) fn place(&self, graph: &Graph, pose: &Pose) -> DVec3 {
        let carried = self.carriers.iter().map(|&(node, weight)| {
            (pose.places[node] + pose.rotations[node] * (self.rest - graph.rest[node])) * weight
        });
        carried.sum()
    }

    /// Returns how the point is turned in a pose, from rest.
    pub(super) fn rotation(&self, pose: &Pose) -> DQuat {
        let first = self.carriers.first().map_or(DQuat::IDENTITY, |(node, _)| pose.rotations[*node]);
        let mut sum = DQuat::from_xyzw(0.0, 0.0, 0.0, 0.0);
        for &(node, weight) in &self.carriers {
            let rotation = pose.rotations[node];
            sum += rotation * (weight * rotation.dot(first).signum());
        }
        if sum.length_squared() > 0.0 { sum.normalize() } else { first }
    }
}

/// Returns the nodes that are reached from the first one along edges, the nearest first.
fn reached(nodes: &[DVec3], tree: &RTree<GeomWithData<[f64; 3], usize>>, spacing: f64) -> Vec<usize> {
    let mut ways = vec![f64::INFINITY; nodes.len()];
    let mut found = Vec::new();
    let mut next = BinaryHeap::new();
    if let Some(first) = ways.first_mut() {
        *first = 0.0;
        next.push(Reverse((0u64, 0usize)));
    }
    // Ways are not negative, so that their bits have the order of their values.
    while let Some(Reverse((way, node))) = next.pop() {
        let way = f64::from_bits(way);
        if way > ways[node] {
            continue;
        }
        found.push(node);
        if found.len() == MOST {
            break;
        }
        for (other, length) in edges(tree, node, nodes[node], spacing) {
            let longer = way + length;
            if longer < ways[other] && longer < REACH * spacing {
                ways[other] = longer;
                next.push(Reverse((longer.to_bits(), other)));
            }
        }
    }
    found
}

/// Returns the edges of a node at a place: the other nodes, with their distances.
fn edges(
    tree: &RTree<GeomWithData<[f64; 3], usize>>,
    node: usize,
    place: DVec3,
    spacing: f64,
) -> impl Iterator<Item = (usize, f64)> {
    let within = tree.locate_within_distance(place.to_array(), (LONGEST * spacing).powi(2));
    within
        .filter(move |other| other.data != node)
        .map(move |other| (other.data, DVec3::from(*other.geom()).distance(place)))
}

/// Returns the rotation of a matrix, found from one that is near it: Müller and others, "A Robust Method to Extract the
/// Rotational Part of Deformations" (2016).
fn rotation(matrix: &DMat3, mut near: DQuat) -> DQuat {
    let size: f64 = matrix.to_cols_array().iter().map(|value| value.abs()).sum();
    for _ in 0..TURNS {
        let turned = DMat3::from_quat(near);
        let pairs = || [(turned.x_axis, matrix.x_axis), (turned.y_axis, matrix.y_axis), (turned.z_axis, matrix.z_axis)];
        let across: DVec3 = pairs().into_iter().map(|(axis, to)| axis.cross(to)).sum();
        let along: f64 = pairs().into_iter().map(|(axis, to)| axis.dot(to)).sum();
        let turn = across / (along.abs() + 1e-9 * size + f64::MIN_POSITIVE);
        if turn == DVec3::ZERO {
            break;
        }
        near = (DQuat::from_scaled_axis(turn) * near).normalize();
    }
    near
}

/// Returns the ways for which `times` returns about these forces, by conjugate gradients with the inverse of the
/// diagonal as preconditioner.
fn conjugate_gradients(mut forces: Vec<DVec3>, inverse: &[f64], times: impl Fn(&[DVec3]) -> Vec<DVec3>) -> Vec<DVec3> {
    let dot = |a: &[DVec3], b: &[DVec3]| a.iter().zip(b).map(|(a, b)| a.dot(*b)).sum::<f64>();
    let conditioned = |forces: &[DVec3]| -> Vec<DVec3> { inverse.iter().zip(forces).map(|(i, f)| *f * *i).collect() };
    let mut ways = vec![DVec3::ZERO; forces.len()];
    let mut direction = conditioned(&forces);
    let mut rest = dot(&forces, &direction);
    let enough = rest * LEFT * LEFT;
    for _ in 0..BALANCES {
        if rest.is_nan() || rest <= enough {
            break;
        }
        let answer = times(&direction);
        let curvature = dot(&direction, &answer);
        if curvature.is_nan() || curvature <= 0.0 {
            break;
        }
        let length = rest / curvature;
        for (index, way) in ways.iter_mut().enumerate() {
            *way += direction[index] * length;
            forces[index] -= answer[index] * length;
        }
        let better = conditioned(&forces);
        let next = dot(&forces, &better);
        for (along, better) in direction.iter_mut().zip(better) {
            *along = better + *along * (next / rest);
        }
        rest = next;
    }
    ways
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the corners of cubes of side 1, from the origin on.
    fn block([x, y, z]: [u8; 3]) -> Vec<DVec3> {
        let all = (0..x).flat_map(|x| (0..y).flat_map(move |y| (0..z).map(move |z| [x, y, z])));
        all.map(|place| DVec3::from_array(place.map(f64::from))).collect()
    }

    fn graph(means: &[DVec3]) -> Graph {
        Graph::around(DVec3::ZERO, means, 1.0).expect("there are nodes")
    }

    #[test]
    fn nodes_are_apart_and_none_is_beyond_a_gap() {
        let near = block([4, 3, 2]);
        let twice = near.iter().map(|place| *place + 0.3 * DVec3::X);
        let beyond = near.iter().map(|place| *place + 6.0 * DVec3::X);
        let found = graph(&near.iter().copied().chain(twice).chain(beyond).collect::<Vec<_>>());
        let mut places = found.rest.clone();
        places.sort_by(|a, b| a.to_array().partial_cmp(&b.to_array()).expect("numbers"));
        assert_eq!(places, near, "each place once, and none beyond the gap");
        assert!(Graph::around(DVec3::ZERO, &[], 1.0).is_none(), "no means have no graph");
    }

    #[test]
    fn a_graph_turns_as_a_whole_when_some_points_are_pulled() {
        let graph = graph(&block([4, 3, 2]));
        let turn = DQuat::from_scaled_axis(DVec3::new(0.3, -0.2, 0.5));
        let moved = |place: DVec3| turn * place + DVec3::new(0.5, 1.0, -0.25);
        let pulled: Vec<Skinned> =
            [DVec3::ZERO, 3.0 * DVec3::X, 2.0 * DVec3::Y, DVec3::Z].map(|place| graph.skin(place)).into();
        let mut pose = graph.at_rest();
        let expected = pose.places.clone();
        for _ in 0..600 {
            graph.turn(&mut pose);
            let pull = |point| {
                let force = moved(Skinned::clone(point).rest) - point.place(&graph, &pose);
                Pull { force, stiffness: DMat3::IDENTITY, weight: 1.0 }
            };
            let pulls: Vec<(&Skinned, Pull)> = pulled.iter().map(|point| (point, pull(point))).collect();
            pose.places = graph.balanced(&pose, &pulls, 1.0, &expected, 0.0);
        }
        for (place, rest) in pose.places.iter().zip(&graph.rest) {
            assert!(place.abs_diff_eq(moved(*rest), 1e-3), "{rest} is at {place}");
        }
        let point = graph.skin(DVec3::new(1.5, 0.5, 0.5));
        assert!(point.place(&graph, &pose).abs_diff_eq(moved(point.rest), 1e-3), "points between nodes go with them");
        assert!(point.rotation(&pose).angle_between(turn) < 1e-3, "and turn with them");
        assert!(graph.misfit_around(&pose, DVec3::ZERO, 9.0).expect("there are edges") < 1e-3, "no edge differs");
        assert_eq!(graph.misfit_around(&graph.at_rest(), DVec3::ZERO, 9.0), Some(0.0), "at rest none does");
        assert_eq!(graph.misfit_around(&pose, 99.0 * DVec3::X, 9.0), None, "there are no edges far away");
    }

    #[test]
    fn rotations_of_stretched_matrices_are_found() {
        let turn = DQuat::from_scaled_axis(DVec3::new(0.2, 0.4, -0.3));
        let stretched = DMat3::from_quat(turn) * DMat3::from_diagonal(DVec3::new(3.0, 1.0, 0.5));
        let found = (0..10).fold(DQuat::IDENTITY, |near, _| rotation(&stretched, near));
        assert!(found.angle_between(turn) < 1e-6, "the rotation is {found}");
        assert_eq!(rotation(&DMat3::ZERO, turn), turn, "no edges keep the rotation");
    }
}
