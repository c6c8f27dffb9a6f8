//! The rigidity of nodes: as rigid as possible.
//!
//! In: nodes and their poses at a moment. Out: [`Rigidity`]: the term of the loss and its gradients. Each node asks its neighbors to be where its own
//! rigid motion would have them:
//!
//! ```text
//! Σᵢ Σⱼ |(xⱼ − xᵢ) − Rᵢ (pⱼ − pᵢ)|²,  xᵢ = pᵢ + tᵢ
//! ```

use super::nodes::{Pose, PoseGradient};
use glam::Vec3;

/// Neighbors of each node.
const NEAREST: usize = 8;

/// The neighbors of all nodes.
#[derive(Debug, Clone)]
pub(super) struct Rigidity {
    neighbors: Vec<Vec<u32>>,
}

impl Rigidity {
    pub(super) fn new(places: &[Vec3]) -> Self {
        let nearest = |own: &Vec3| {
            let mut others: Vec<(f32, u32)> =
                places.iter().enumerate().map(|(index, place)| (place.distance_squared(*own), index as u32)).collect();
            others.sort_by(|a, b| a.0.total_cmp(&b.0));
            others.into_iter().skip(1).take(NEAREST).map(|(_, index)| index).collect()
        };
        Self { neighbors: places.iter().map(nearest).collect() }
    }

    /// Adds the gradients of the term times `weight`.
    pub(super) fn add(&self, poses: &[Pose], weight: f32, gradients: &mut [PoseGradient]) {
        for (index, near) in self.neighbors.iter().enumerate() {
            let own = &poses[index];
            for &other in near {
                let (other, at) = (&poses[other as usize], other as usize);
                // Where the other is, and where the motion of this node has it.
                let error = other.place + other.shift - own.apply(other.place);
                let upstream = 2.0 * weight * error;
                gradients[at].shift += upstream;
                gradients[index].add(&own.backward(other.place, -upstream));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::nodes::Nodes;
    use super::*;
    use crate::scene::random::Random;
    use glam::{Quat, Vec4};

    fn vector(random: &mut Random) -> Vec3 {
        Vec3::from([(); 3].map(|()| random.in_range(-1.0, 1.0)))
    }

    /// Returns the term itself.
    fn term(rigidity: &Rigidity, poses: &[Pose]) -> f64 {
        let of = |(own, near): (&Pose, &Vec<u32>)| {
            let square = |&other: &u32| {
                let other = &poses[other as usize];
                let apart = (other.place + other.shift) - (own.place + own.shift);
                f64::from((apart - own.rotation * (other.place - own.place)).length_squared())
            };
            near.iter().map(square).sum::<f64>()
        };
        poses.iter().zip(&rigidity.neighbors).map(of).sum()
    }

    #[test]
    fn gradients_match_differences_of_the_term() {
        let mut random = Random::new(1);
        let places: Vec<Vec3> = (0..12).map(|_| vector(&mut random)).collect();
        let rigidity = Rigidity::new(&places);
        let mut poses = Nodes::new(places, [0.0, 1.0], 1).poses(0.0);
        for pose in &mut poses {
            pose.shift = 0.3 * vector(&mut random);
            pose.raw = (0.4 * vector(&mut random)).extend(1.3);
        }
        let turned = |mut poses: Vec<Pose>| {
            poses.iter_mut().for_each(|pose| pose.rotation = Quat::from_vec4(pose.raw.normalize()));
            poses
        };
        let poses = turned(poses);
        let mut gradients = vec![PoseGradient::default(); poses.len()];
        rigidity.add(&poses, 0.5, &mut gradients);
        const STEP: f32 = 1e-2;
        for (node, gradient) in gradients.iter().enumerate() {
            for value in 0..7 {
                let at = |offset: f32| {
                    let mut poses = poses.clone();
                    match value {
                        0..3 => poses[node].shift[value] += offset,
                        _ => poses[node].raw[value - 3] += offset,
                    }
                    0.5 * term(&rigidity, &turned(poses))
                };
                let difference = (at(STEP) - at(-STEP)) / f64::from(2.0 * STEP);
                let found = if value < 3 { gradient.shift[value] } else { gradient.raw[value - 3] };
                let error = (difference - f64::from(found)).abs();
                assert!(
                    error < 2e-3 * (1.0 + difference.abs()),
                    "node {node}, value {value}: {found} for {difference}"
                );
            }
        }
    }

    #[test]
    fn a_common_rigid_motion_costs_nothing() {
        let mut random = Random::new(2);
        let places: Vec<Vec3> = (0..20).map(|_| vector(&mut random)).collect();
        let rigidity = Rigidity::new(&places);
        let turn = Quat::from_rotation_z(1.1);
        let mut poses = Nodes::new(places, [0.0, 1.0], 1).poses(0.0);
        for pose in &mut poses {
            (pose.raw, pose.rotation) = (Vec4::from(turn), turn);
            pose.shift = turn * pose.place - pose.place;
        }
        let mut gradients = vec![PoseGradient::default(); poses.len()];
        rigidity.add(&poses, 1.0, &mut gradients);
        let largest = gradients.iter().map(|own| own.shift.length() + own.raw.length()).fold(0.0, f32::max);
        assert!(largest < 1e-5, "the gradient is {largest}");
    }
}
