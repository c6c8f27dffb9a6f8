//! Nodes that move through time, and the rigid motion of each at a moment.
//!
//! In: places in canonical space, an interval of time. Out: [`Nodes`]: a [`Pose`] of each node at any time, gradients of poses collected into those of the
//! curves, and steps of Adam. A node's displacement and rotation are uniform cubic B-splines of time: a change of one control point is felt over four
//! spans of the curve, so that views of neighboring times share it.

use crate::offline::fine_tune::adam::Step;
use glam::{Quat, Vec3, Vec4};

/// Values of each control point: displacement and quaternion offset.
const VALUES: usize = 7;
/// Control points that a moment depends on.
const ORDER: usize = 4;

/// The rigid motion of a node at a moment, from canonical space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Pose {
    /// Place in canonical space.
    pub place: Vec3,
    /// Displacement of that place.
    pub shift: Vec3,
    /// Rotation about that place, as a quaternion of any length: x, y, z, w.
    pub raw: Vec4,
    /// The same of length 1.
    pub rotation: Quat,
}

/// The gradient of a loss with respect to a pose.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct PoseGradient {
    pub shift: Vec3,
    pub raw: Vec4,
}

impl PoseGradient {
    pub(super) fn add(&mut self, other: &Self) {
        self.shift += other.shift;
        self.raw += other.raw;
    }
}

impl Pose {
    /// Returns where a point of canonical space is at the moment, if it moves with the node.
    pub(super) fn apply(&self, point: Vec3) -> Vec3 {
        self.rotation * (point - self.place) + self.place + self.shift
    }

    /// Returns the gradient with respect to the pose, for a point whose place at the moment has the gradient `upstream`.
    pub(super) fn backward(&self, point: Vec3, upstream: Vec3) -> PoseGradient {
        let v = point - self.place;
        let (w, u) = (self.rotation.w, Vec3::new(self.rotation.x, self.rotation.y, self.rotation.z));
        // R v = v + 2 w u×v + 2 (u (u·v) − v (u·u)) for a quaternion of length 1.
        let of_w = 2.0 * upstream.dot(u.cross(v));
        let of_u =
            2.0 * w * v.cross(upstream) + 2.0 * (upstream * u.dot(v) + v * upstream.dot(u) - 2.0 * u * upstream.dot(v));
        let of_unit = of_u.extend(of_w);
        let unit = Vec4::from(self.rotation);
        let raw = (of_unit - unit * unit.dot(of_unit)) / self.raw.length().max(1e-6);
        PoseGradient { shift: upstream, raw }
    }
}

/// Nodes and their curves.
#[derive(Debug, Clone)]
pub(super) struct Nodes {
    places: Vec<Vec3>,
    interval: [f32; 2],
    /// Control points of each curve.
    controls: usize,
    /// Control points of each node, one node after the other.
    values: Vec<[f32; VALUES]>,
    gradients: Vec<[f32; VALUES]>,
    moments: Vec<[[f32; VALUES]; 2]>,
    /// Steps that each control point has made.
    steps: Vec<usize>,
    /// Control points that views have shown so far.
    reached: Option<[usize; 2]>,
}

impl Nodes {
    /// Returns nodes at these places that do not move, with curves of so many spans over the interval.
    pub(super) fn new(places: Vec<Vec3>, interval: [f32; 2], spans: usize) -> Self {
        let controls = spans.max(1) + ORDER - 1;
        let count = places.len() * controls;
        Self {
            places,
            interval,
            controls,
            values: vec![[0.0; VALUES]; count],
            gradients: vec![[0.0; VALUES]; count],
            moments: vec![[[0.0; VALUES]; 2]; count],
            steps: vec![0; controls],
            reached: None,
        }
    }

    pub(super) fn places(&self) -> &[Vec3] {
        &self.places
    }

    /// Returns the first control point that a time depends on, and the weight of each.
    fn weights(&self, time: f32) -> (usize, [f32; ORDER]) {
        let [first, last] = self.interval;
        let spans = self.controls + 1 - ORDER;
        let along = ((time - first) / (last - first).max(f32::MIN_POSITIVE)).clamp(0.0, 1.0) * spans as f32;
        let span = (along as usize).min(spans - 1);
        let x = along - span as f32;
        let (square, cube) = (x * x, x * x * x);
        let weights =
            [(1.0 - x).powi(3), 3.0 * cube - 6.0 * square + 4.0, -3.0 * cube + 3.0 * square + 3.0 * x + 1.0, cube];
        (span, weights.map(|weight| weight / 6.0))
    }

    /// Lets curves go on as they end where views have not been shown before, as far as this time needs it.
    pub(super) fn reach(&mut self, time: f32) {
        let (first, _) = self.weights(time);
        let last = first + ORDER - 1;
        let [low, high] = self.reached.unwrap_or([first, last]);
        let controls = self.controls;
        for own in self.values.chunks_exact_mut(controls) {
            for control in high + 1..=last {
                own[control] = own[control - 1];
            }
            for control in (first..low).rev() {
                own[control] = own[control + 1];
            }
        }
        self.reached = Some([low.min(first), high.max(last)]);
    }

    /// Returns the poses of all nodes at a time.
    pub(super) fn poses(&self, time: f32) -> Vec<Pose> {
        let (first, weights) = self.weights(time);
        let pose = |(place, own): (&Vec3, &[[f32; VALUES]])| {
            let mut sum = [0.0; VALUES];
            for (weight, control) in weights.iter().zip(&own[first..]) {
                sum.iter_mut().zip(control).for_each(|(sum, value)| *sum += weight * value);
            }
            let [x, y, z, qx, qy, qz, qw] = sum;
            let raw = Vec4::new(qx, qy, qz, 1.0 + qw);
            let unit = raw.try_normalize().unwrap_or(Vec4::W);
            Pose { place: *place, shift: Vec3::new(x, y, z), raw, rotation: Quat::from_vec4(unit) }
        };
        self.places.iter().zip(self.values.chunks_exact(self.controls)).map(pose).collect()
    }

    /// Adds the gradients of the poses at a time to those of the curves.
    pub(super) fn collect(&mut self, time: f32, gradients: &[PoseGradient]) {
        let (first, weights) = self.weights(time);
        for (own, PoseGradient { shift, raw }) in self.gradients.chunks_exact_mut(self.controls).zip(gradients) {
            let of_pose = [shift.x, shift.y, shift.z, raw.x, raw.y, raw.z, raw.w];
            for (weight, control) in weights.iter().zip(&mut own[first..]) {
                control.iter_mut().zip(of_pose).for_each(|(sum, value)| *sum += weight * value);
            }
        }
    }

    /// Makes a step of Adam with the control points that a time depends on. All gradients become 0.
    pub(super) fn step(&mut self, time: f32, rate: f32) {
        let (first, _) = self.weights(time);
        for control in first..first + ORDER {
            self.steps[control] += 1;
            let step = Step::new(self.steps[control]);
            for at in (control..self.values.len()).step_by(self.controls) {
                let [m, v] = &mut self.moments[at];
                for (value, &gradient) in self.gradients[at].iter().enumerate() {
                    let moments = [&mut m[value], &mut v[value]];
                    self.values[at][value] += rate * step.change(moments, gradient);
                }
            }
        }
        self.gradients.fill([0.0; VALUES]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::random::Random;

    fn vector(random: &mut Random) -> Vec3 {
        Vec3::from([(); 3].map(|()| random.in_range(-1.0, 1.0)))
    }

    /// Returns three nodes whose control points are random, over times from 2 to 4.
    fn nodes(random: &mut Random) -> Nodes {
        let places = (0..3).map(|_| vector(random)).collect();
        let mut nodes = Nodes::new(places, [2.0, 4.0], 5);
        nodes.values.iter_mut().flatten().for_each(|value| *value = random.in_range(-0.5, 0.5));
        nodes
    }

    #[test]
    fn curves_are_smooth_and_constant_curves_are_still() {
        let mut random = Random::new(1);
        let nodes = nodes(&mut random);
        for time in [2.0, 2.4, 2.41, 3.0, 3.999, 4.0] {
            let (first, weights) = nodes.weights(time);
            assert!(first + ORDER <= nodes.controls, "{time}: control points that are there");
            assert!((weights.iter().sum::<f32>() - 1.0).abs() < 1e-6, "{time}: weights add up to 1");
            let (before, after) = (nodes.poses(time - 1e-3), nodes.poses(time + 1e-3));
            let far = |(a, b): (&Pose, &Pose)| (a.shift - b.shift).length() + (a.raw - b.raw).length();
            let farthest = before.iter().zip(&after).map(far).fold(0.0, f32::max);
            assert!(farthest < 0.02, "{time}: no jump, also from span to span: {farthest}");
        }
        let still = Nodes::new(vec![Vec3::X], [2.0, 4.0], 5);
        assert_eq!(still.poses(3.3)[0].apply(Vec3::Y), Vec3::Y, "nothing moves at first");
    }

    #[test]
    fn a_curve_goes_on_as_it_ends_until_a_view_shows_more() {
        let mut random = Random::new(2);
        let mut nodes = nodes(&mut random);
        nodes.reach(3.0);
        let (first, _) = nodes.weights(3.0);
        let before = nodes.values.clone();
        nodes.reach(3.9);
        let of = |values: &[[f32; VALUES]], control: usize| values[nodes.controls + control];
        for control in 0..nodes.controls {
            let wanted = of(&before, control.min(first + ORDER - 1));
            assert_eq!(of(&nodes.values, control), wanted, "control point {control} of the second node");
        }
        let reached = nodes.values.clone();
        nodes.reach(3.5);
        assert_eq!(nodes.values, reached, "what has been shown stays");
    }

    #[test]
    fn gradients_of_poses_and_curves_match_differences() {
        let mut random = Random::new(3);
        let mut nodes = nodes(&mut random);
        let (point, upstream, time) = (vector(&mut random), vector(&mut random), 2.7);
        let loss = |nodes: &Nodes| -> f64 {
            nodes.poses(time).iter().map(|pose| f64::from(upstream.dot(pose.apply(point)))).sum()
        };
        let of_poses: Vec<_> = nodes.poses(time).iter().map(|pose| pose.backward(point, upstream)).collect();
        nodes.collect(time, &of_poses);
        let found = nodes.gradients.clone();
        const STEP: f32 = 1e-2;
        for (at, found) in found.iter().enumerate() {
            for (value, &found) in found.iter().enumerate() {
                let mut at_offset = |offset: f32| {
                    let kept = nodes.values[at][value];
                    nodes.values[at][value] += offset;
                    let loss = loss(&nodes);
                    nodes.values[at][value] = kept;
                    loss
                };
                let difference = (at_offset(STEP) - at_offset(-STEP)) / f64::from(2.0 * STEP);
                let error = (difference - f64::from(found)).abs();
                assert!(error < 2e-3, "control point {at}, value {value}: {found} for {difference}");
            }
        }
    }

    #[test]
    fn steps_change_only_what_their_time_depends_on() {
        let mut random = Random::new(4);
        let mut nodes = nodes(&mut random);
        let before = nodes.values.clone();
        let one = PoseGradient { shift: Vec3::X, raw: Vec4::ZERO };
        nodes.collect(2.1, &[one; 3]);
        nodes.step(2.1, 0.01);
        for (at, (own, before)) in nodes.values.iter().zip(&before).enumerate() {
            let moved = if at % nodes.controls < ORDER { 0.01 } else { 0.0 };
            assert!((before[0] - own[0] - moved).abs() < 1e-5, "control point {at} moves by {moved}");
            assert_eq!(own[1..], before[1..], "control point {at}: values without a gradient stay");
        }
        assert!(nodes.gradients.iter().flatten().all(|&gradient| gradient == 0.0), "gradients are used up");
    }
}
