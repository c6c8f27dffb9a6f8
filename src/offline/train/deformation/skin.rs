//! How Gaussians follow nodes: linear blend skinning.
//!
//! In: means in canonical space, [`Nodes`](super::nodes::Nodes). Out: [`Skin`]: the nearest nodes of each Gaussian with weights; the raw parameters of
//! Gaussians at a moment, and the gradients with respect to the canonical ones and to the poses.
//!
//! ```text
//! μ' = Σ wₖ (Rₖ (μ − pₖ) + pₖ + tₖ)      q' = normalize(Σ wₖ qₖ) q
//! ```

use super::nodes::{Pose, PoseGradient};
use crate::offline::layout::TrainedRecord;
use glam::{Quat, Vec3, Vec4};
use rayon::prelude::*;

/// Nodes that a Gaussian follows.
const FOLLOWED: usize = 4;
/// Gaussians whose gradients are summed one after the other.
const CHUNK: usize = 1024;

/// The nodes of one Gaussian.
#[derive(Debug, Clone, Copy)]
pub(super) struct Bond {
    nodes: [u32; FOLLOWED],
    weights: [f32; FOLLOWED],
}

impl Bond {
    /// Returns the bond of a mean with the nearest of these places. `reach` is the deviation by which weights fall with distance.
    pub(super) fn new(mean: Vec3, places: &[Vec3], reach: f32) -> Self {
        let mut nearest = [(f32::INFINITY, 0u32); FOLLOWED];
        for (index, place) in places.iter().enumerate() {
            let own = (place.distance_squared(mean), index as u32);
            if own.0 < nearest[FOLLOWED - 1].0 {
                nearest[FOLLOWED - 1] = own;
                let mut at = FOLLOWED - 1;
                while at > 0 && nearest[at].0 < nearest[at - 1].0 {
                    nearest.swap(at, at - 1);
                    at -= 1;
                }
            }
        }
        let least = nearest[0].0;
        let weights = nearest.map(|(square, _)| match square.is_finite() {
            true => (-(square - least) / (2.0 * reach * reach)).exp(),
            false => 0.0,
        });
        let sum: f32 = weights.iter().sum();
        Self { nodes: nearest.map(|(_, node)| node), weights: weights.map(|weight| weight / sum) }
    }

    fn each(&self) -> impl Iterator<Item = (usize, f32)> {
        self.nodes.into_iter().map(|node| node as usize).zip(self.weights)
    }

    /// Returns the mean at the moment of the poses, and the rotation from canonical space.
    pub(super) fn motion(&self, mean: Vec3, poses: &[Pose]) -> (Vec3, Quat) {
        let (mut moved, mut turned) = (Vec3::ZERO, Vec4::ZERO);
        for (node, weight) in self.each() {
            moved += weight * poses[node].apply(mean);
            turned += weight * Vec4::from(poses[node].rotation);
        }
        (moved, Quat::from_vec4(turned.try_normalize().unwrap_or(Vec4::W)))
    }
}

/// Returns the bonds of all Gaussians with nodes at these places.
pub(super) fn bonds(records: &[TrainedRecord], places: &[Vec3]) -> Vec<Bond> {
    let reach = spacing(places);
    records.par_iter().map(|record| Bond::new(Vec3::from(record.mean), places, reach)).collect()
}

/// Returns the mean distance of a place to the nearest other.
fn spacing(places: &[Vec3]) -> f32 {
    let nearest = |(own, place): (usize, &Vec3)| {
        let others = places.iter().enumerate().filter(|(other, _)| *other != own);
        others.map(|(_, other)| other.distance_squared(*place)).fold(f32::INFINITY, f32::min).sqrt()
    };
    let distances: Vec<f32> =
        places.par_iter().enumerate().map(nearest).filter(|distance| distance.is_finite()).collect();
    (distances.iter().sum::<f32>() / distances.len().max(1) as f32).max(f32::MIN_POSITIVE.sqrt())
}

/// Returns so many of the means, or all: the first, then each time the one farthest from those before.
pub(super) fn spread(records: &[TrainedRecord], count: usize) -> Vec<Vec3> {
    let means: Vec<Vec3> = records.iter().map(|record| Vec3::from(record.mean)).collect();
    let mut distances = vec![f32::INFINITY; means.len()];
    let mut found: Vec<Vec3> = means.first().copied().into_iter().collect();
    while let Some(&last) = found.last().filter(|_| found.len() < count.min(means.len())) {
        let nearer = |(distance, mean): (&mut f32, &Vec3)| *distance = distance.min(mean.distance_squared(last));
        distances.par_iter_mut().zip(&means).for_each(nearer);
        let farthest = (0..means.len()).max_by(|&a, &b| distances[a].total_cmp(&distances[b]));
        found.extend(farthest.map(|farthest| means[farthest]));
    }
    found
}

/// Returns the raw parameters at the moment of the poses.
pub(super) fn deformed(records: &[TrainedRecord], bonds: &[Bond], poses: &[Pose]) -> Vec<TrainedRecord> {
    let deform = |(record, bond): (&TrainedRecord, &Bond)| {
        let (mean, turn) = bond.motion(Vec3::from(record.mean), poses);
        let [w, x, y, z] = record.rotation_l;
        let [x, y, z, w] = (turn * Quat::from_xyzw(x, y, z, w)).to_array();
        TrainedRecord { mean: mean.to_array(), rotation_l: [w, x, y, z], ..*record }
    };
    records.par_iter().zip(bonds).map(deform).collect()
}

/// Turns gradients with respect to the raw parameters at the moment of the poses into those with respect to the canonical ones; returns those with
/// respect to the poses. The poses are held fixed where rotations depend on them.
pub(super) fn backward(
    records: &[TrainedRecord],
    bonds: &[Bond],
    poses: &[Pose],
    gradients: &mut [TrainedRecord],
) -> Vec<PoseGradient> {
    let chunk = |((records, bonds), gradients): ((&[TrainedRecord], &[Bond]), &mut [TrainedRecord])| {
        let mut sums = vec![PoseGradient::default(); poses.len()];
        for ((record, bond), gradient) in records.iter().zip(bonds).zip(gradients) {
            let (mean, upstream) = (Vec3::from(record.mean), Vec3::from(gradient.mean));
            // `step` leaves such gradients out; those of nodes are sums of many.
            if !upstream.is_finite() {
                continue;
            }
            let mut of_mean = Vec3::ZERO;
            for (node, weight) in bond.each() {
                sums[node].add(&poses[node].backward(mean, weight * upstream));
                of_mean += weight * (poses[node].rotation.inverse() * upstream);
            }
            let (_, turn) = bond.motion(mean, poses);
            let [w, x, y, z] = gradient.rotation_l;
            // A product with a quaternion of length 1 is a rotation of the four values; its inverse is that with the conjugate.
            let [x, y, z, w] = (turn.conjugate() * Quat::from_xyzw(x, y, z, w)).to_array();
            gradient.mean = of_mean.to_array();
            gradient.rotation_l = [w, x, y, z];
        }
        sums
    };
    let chunks = records.par_chunks(CHUNK).zip(bonds.par_chunks(CHUNK)).zip(gradients.par_chunks_mut(CHUNK));
    let sums: Vec<Vec<PoseGradient>> = chunks.map(chunk).collect();
    let mut total = vec![PoseGradient::default(); poses.len()];
    for sums in sums {
        total.iter_mut().zip(&sums).for_each(|(total, sum)| total.add(sum));
    }
    total
}

#[cfg(test)]
mod tests {
    use super::super::nodes::Nodes;
    use super::*;
    use crate::scene::random::Random;

    fn vector(random: &mut Random) -> Vec3 {
        Vec3::from([(); 3].map(|()| random.in_range(-1.0, 1.0)))
    }

    fn record(random: &mut Random) -> TrainedRecord {
        let rotation_l = [(); 4].map(|()| random.in_range(-1.0, 1.0));
        TrainedRecord { mean: vector(random).to_array(), rotation_l, ..TrainedRecord::default() }
    }

    #[test]
    fn gaussians_follow_a_common_rigid_motion_exactly() {
        let mut random = Random::new(1);
        let records: Vec<_> = (0..40).map(|_| record(&mut random)).collect();
        let places = spread(&records, 6);
        let bonds = bonds(&records, &places);
        let (turn, shift) = (Quat::from_rotation_y(0.7), Vec3::new(0.1, -0.4, 2.0));
        let mut poses = Nodes::new(places, [0.0, 1.0], 1).poses(0.0);
        for pose in &mut poses {
            pose.shift = turn * pose.place + shift - pose.place;
            (pose.raw, pose.rotation) = (Vec4::from(turn), turn);
        }
        for (moved, record) in deformed(&records, &bonds, &poses).iter().zip(&records) {
            let wanted = turn * Vec3::from(record.mean) + shift;
            assert!(wanted.distance(Vec3::from(moved.mean)) < 1e-5, "{moved:?} is not at {wanted}");
            let quaternion = |[w, x, y, z]: [f32; 4]| Vec4::new(x, y, z, w);
            let wanted = Vec4::from(turn * Quat::from_vec4(quaternion(record.rotation_l)));
            assert!(wanted.distance(quaternion(moved.rotation_l)) < 1e-5, "{moved:?} is not turned to {wanted}");
        }
    }

    #[test]
    fn gradients_of_means_and_rotations_match_differences() {
        let mut random = Random::new(2);
        let records: Vec<_> = (0..9).map(|_| record(&mut random)).collect();
        let places = spread(&records, 5);
        let bonds = bonds(&records, &places);
        let mut poses = Nodes::new(places, [0.0, 1.0], 1).poses(0.0);
        for pose in &mut poses {
            pose.shift = 0.3 * vector(&mut random);
            pose.raw = (0.4 * vector(&mut random)).extend(1.0);
            pose.rotation = Quat::from_vec4(pose.raw.normalize());
        }
        let upstream: Vec<_> = (0..9).map(|_| record(&mut random)).collect();
        let loss = |records: &[TrainedRecord], poses: &[Pose]| -> f64 {
            let moved = deformed(records, &bonds, poses);
            let values = |record: &TrainedRecord| [&record.mean[..], &record.rotation_l].concat();
            let product = |(a, b)| values(a).into_iter().zip(values(b)).map(|(a, b)| f64::from(a * b)).sum::<f64>();
            moved.iter().zip(&upstream).map(product).sum()
        };
        let mut gradients = upstream.clone();
        let of_poses = backward(&records, &bonds, &poses, &mut gradients);
        const STEP: f32 = 1e-2;
        let check = |name: &str, found: f32, loss: &dyn Fn(f32) -> f64| {
            let difference = (loss(STEP) - loss(-STEP)) / f64::from(2.0 * STEP);
            assert!((difference - f64::from(found)).abs() < 2e-3, "{name}: {found} for {difference}");
        };
        for at in 0..records.len() {
            for value in 0..4 {
                let changed = |offset: f32| {
                    let mut records = records.clone();
                    if value < 3 {
                        records[at].mean[value] += offset;
                    }
                    records
                };
                let turned = |offset: f32| {
                    let mut records = records.clone();
                    records[at].rotation_l[value] += offset;
                    records
                };
                if value < 3 {
                    check("mean", gradients[at].mean[value], &|offset| loss(&changed(offset), &poses));
                }
                check("rotation", gradients[at].rotation_l[value], &|offset| loss(&turned(offset), &poses));
            }
        }
        for node in 0..poses.len() {
            for axis in 0..3 {
                let shifted = |offset: f32| {
                    let mut poses = poses.clone();
                    poses[node].shift[axis] += offset;
                    poses
                };
                check("shift", of_poses[node].shift[axis], &|offset| loss(&records, &shifted(offset)));
            }
        }
    }

    #[test]
    fn nodes_are_spread_and_bonds_are_with_the_nearest() {
        let records: Vec<_> =
            (0..100).map(|at| TrainedRecord { mean: [at as f32, 0.0, 0.0], ..TrainedRecord::default() }).collect();
        let places = spread(&records, 5);
        let mut along: Vec<f32> = places.iter().map(|place| place.x).collect();
        along.sort_by(f32::total_cmp);
        assert!(along.windows(2).all(|pair| pair[1] - pair[0] >= 24.0), "a quarter apart: {along:?}");
        let bond = Bond::new(Vec3::X * 26.0, &places, spacing(&places));
        let nearest = places[bond.nodes[0] as usize].x;
        assert!((nearest - 26.0).abs() <= 13.0, "the nearest is at {nearest}");
        assert!(bond.weights.windows(2).all(|pair| pair[0] >= pair[1]), "and has the largest weight: {bond:?}");
        assert!((bond.weights.iter().sum::<f32>() - 1.0).abs() < 1e-6, "weights add up to 1: {bond:?}");
        let alone = Bond::new(Vec3::ZERO, &places[..1], spacing(&places[..1]));
        assert_eq!(alone.weights, [1.0, 0.0, 0.0, 0.0], "one node has all");
    }
}
