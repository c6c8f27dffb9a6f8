//! Native 4D Gaussians that move as a deformation does.
//!
//! In: Gaussians in canonical space, their paths through time, a number. Out: [`Trained`]: that many native Gaussians. Each path becomes straight pieces of
//! equal duration, more where it bends more, and each piece a Gaussian:
//!
//! ```text
//! Σ = | V + v vᵀ σ²  v σ² |    V: covariance at the middle of the piece, v: its velocity,
//!     | vᵀ σ²        σ²   |    σ: temporal scale, 0.6 durations
//! ```

use super::nodes::{Nodes, Pose};
use super::skin::Bond;
use crate::gaussian::harmonics::evaluated;
use crate::gaussian::{Harmonics, Parameters};
use crate::offline::detail::Axes;
use crate::offline::layout::TrainedRecord;
use crate::scene::Trained;
use glam::{DMat3, DMat4, DQuat, DVec3, DVec4, Vec3};
use rayon::prelude::*;

/// Steps between two moments at which paths are known.
const MOMENTS: usize = 256;
/// Most pieces of a path.
const PIECES: usize = 64;
/// Temporal scale, in durations of a piece, and of a path that is one piece.
const SCALE_T: f64 = 0.6;
const SCALE_T_WHOLE: f64 = 1.5;
/// Sum of the marginals of all pieces in the middle of one.
const OVERLAP: f64 = 1.5;
/// Opacity below which a Gaussian is left out.
const FADED: f32 = 0.005;
/// Most opaque Gaussian, and the least scale.
const MOST_OPAQUE: f64 = 0.99;
const LEAST_SCALE: f64 = 1e-5;

/// Number of Gaussians to begin with, and the degrees of their colors.
#[derive(Debug, Clone, Copy)]
pub(in crate::offline::train) struct Extent {
    pub gaussians: usize,
    pub degree: u32,
    pub degree_t: u32,
}

/// The Gaussians of a deformation, in canonical space, with colors of degree 3.
pub(super) struct Deforming<'a> {
    pub records: &'a [TrainedRecord],
    pub bonds: &'a [Bond],
    pub nodes: &'a Nodes,
    pub harmonics: &'a Harmonics,
    pub interval: [f32; 2],
}

impl Deforming<'_> {
    /// Returns native Gaussians in this number, with colors of these degrees. There are fewer if even with the most pieces there are not as many.
    pub(super) fn native(&self, extent: Extent) -> Trained {
        let Extent { gaussians: count, degree, degree_t } = extent;
        let [first, last] = self.interval;
        let time = |moment: usize| first + (last - first) * moment as f32 / MOMENTS as f32;
        let poses: Vec<Vec<Pose>> =
            (0..=MOMENTS).into_par_iter().map(|moment| self.nodes.poses(time(moment))).collect();
        let opacity = |record: &TrainedRecord| 1.0 / (1.0 + (-record.opacity_logit[0]).exp());
        let mut own: Vec<usize> = (0..self.records.len()).filter(|&at| opacity(&self.records[at]) > FADED).collect();
        own.truncate(count);
        let bends: Vec<f32> = own.par_iter().map(|&at| self.bend(at, &poses)).collect();
        let pieces = pieces(&bends, count);
        let native: Vec<Native> = own
            .par_iter()
            .zip(&pieces)
            .flat_map_iter(|(&at, &pieces)| (0..pieces).map(move |piece| (at, piece, pieces)))
            .map(|(at, piece, pieces)| self.piece(at, piece, pieces, &poses))
            .collect();
        let (own, coefficients) = (self.harmonics.coefficients * 3, evaluated(degree, degree_t));
        let mut values = vec![0.0; native.len() * coefficients * 3];
        for (to, native) in values.chunks_exact_mut(coefficients * 3).zip(&native) {
            // Those that do not depend on time are first.
            let shared = own.min(to.len());
            to[..shared].copy_from_slice(&self.harmonics.of(native.at)[..shared]);
        }
        let each = |of: fn(&Native) -> f32| native.iter().map(of).collect();
        let parameters = Parameters {
            mean: native.iter().map(|native| native.mean.to_array()).collect(),
            mean_t: each(|native| native.time),
            log_scale: native.iter().map(|native| native.log_scale.truncate().as_vec3().to_array()).collect(),
            log_scale_t: each(|native| native.log_scale.w as f32),
            rotation_l: native.iter().map(|native| native.left.as_vec4().to_array()).collect(),
            rotation_r: native.iter().map(|native| native.right.as_vec4().to_array()).collect(),
            opacity_logit: each(|native| native.opacity_logit),
        };
        Trained { parameters, harmonics: Harmonics { coefficients, degree, degree_t, values } }
    }

    /// Returns the largest second difference of a path.
    fn bend(&self, at: usize, poses: &[Vec<Pose>]) -> f32 {
        let mean = Vec3::from(self.records[at].mean);
        let path: Vec<Vec3> = poses.iter().map(|poses| self.bonds[at].motion(mean, poses).0).collect();
        path.windows(3).map(|three| (three[0] - 2.0 * three[1] + three[2]).length()).fold(0.0, f32::max)
    }

    /// Returns the Gaussian of a piece of a path.
    fn piece(&self, at: usize, piece: usize, pieces: usize, poses: &[Vec<Pose>]) -> Native {
        let (record, bond) = (&self.records[at], &self.bonds[at]);
        let moment = |along: f64| ((along / pieces as f64 * MOMENTS as f64).round() as usize).min(MOMENTS);
        let [begin, middle, end] = [0.0, 0.5, 1.0].map(|along| moment(piece as f64 + along));
        let span = f64::from(self.interval[1] - self.interval[0]);
        let mean = Vec3::from(record.mean);
        let at_moment = |moment: usize| bond.motion(mean, &poses[moment]);
        let (place, turn) = at_moment(middle);
        let lasts = span * (end - begin).max(1) as f64 / MOMENTS as f64;
        let velocity = (at_moment(end).0 - at_moment(begin).0).as_dvec3() / lasts;
        let scale_t = if pieces == 1 { SCALE_T_WHOLE * span } else { SCALE_T * span / pieces as f64 };
        let [w, x, y, z] = record.rotation_l;
        let own = DQuat::from_xyzw(x.into(), y.into(), z.into(), w.into());
        let rotation = if own.length() > 0.0 { turn.as_dquat() * own.normalize() } else { turn.as_dquat() };
        let scale = DVec3::from(record.log_scale.map(|scale| f64::from(scale).exp()));
        let factor = DMat3::from_quat(rotation) * DMat3::from_diagonal(scale);
        let coupled = velocity * scale_t * scale_t;
        let outer = DMat3::from_cols(coupled * velocity.x, coupled * velocity.y, coupled * velocity.z);
        let space = factor * factor.transpose() + outer;
        let covariance = DMat4::from_cols(
            space.x_axis.extend(coupled.x),
            space.y_axis.extend(coupled.y),
            space.z_axis.extend(coupled.z),
            coupled.extend(scale_t * scale_t),
        );
        let Axes { scale, left, right } = Axes::of(covariance, LEAST_SCALE);
        let opacity = 1.0 / (1.0 + (-f64::from(record.opacity_logit[0])).exp());
        // What all pieces that overlap cover together is what the path covers.
        let shared = if pieces == 1 { opacity } else { 1.0 - (1.0 - opacity).powf(1.0 / OVERLAP) };
        let shared = shared.min(MOST_OPAQUE);
        Native {
            at,
            mean: place,
            time: self.interval[0] + (span * middle as f64 / MOMENTS as f64) as f32,
            log_scale: scale.map(f64::ln),
            left,
            right,
            opacity_logit: (shared / (1.0 - shared)).ln() as f32,
        }
    }
}

/// A native Gaussian.
struct Native {
    /// Index of the Gaussian in canonical space.
    at: usize,
    mean: Vec3,
    time: f32,
    log_scale: DVec4,
    left: DVec4,
    right: DVec4,
    opacity_logit: f32,
}

/// Returns the number of pieces of each path, `count` in all unless each has the most: as many as keep all within the same distance from their curves,
/// which falls with the square of the number.
fn pieces(bends: &[f32], count: usize) -> Vec<usize> {
    let of = |bend: f32, factor: f64| ((f64::from(bend).sqrt() * factor) as usize).clamp(1, PIECES);
    let total = |factor: f64| bends.iter().map(|&bend| of(bend, factor)).sum::<usize>();
    let (mut low, mut high) = (0.0, 1e6);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if total(middle) <= count { low = middle } else { high = middle }
    }
    let mut pieces: Vec<usize> = bends.iter().map(|&bend| of(bend, low)).collect();
    let mut order: Vec<usize> = (0..bends.len()).collect();
    order.sort_by(|&a, &b| bends[b].total_cmp(&bends[a]).then_with(|| a.cmp(&b)));
    let mut left = count.saturating_sub(pieces.iter().sum());
    while left > 0 && pieces.iter().any(|&pieces| pieces < PIECES) {
        for &at in &order {
            if left > 0 && pieces[at] < PIECES {
                pieces[at] += 1;
                left -= 1;
            }
        }
    }
    pieces
}

#[cfg(test)]
mod tests {
    use super::super::skin::{bonds, spread};
    use super::*;
    use crate::gaussian::SliceSettings;
    use crate::scene::random::Random;

    fn records(random: &mut Random, count: usize) -> Vec<TrainedRecord> {
        let record = |_| TrainedRecord {
            mean: [(); 3].map(|()| random.in_range(-1.0, 1.0)),
            log_scale: [(); 3].map(|()| random.in_range(-4.0, -2.0)),
            rotation_l: [(); 4].map(|()| random.in_range(-1.0, 1.0)),
            opacity_logit: [1.0, 0.0, 0.0, 0.0],
            ..TrainedRecord::default()
        };
        (0..count).map(record).collect()
    }

    #[test]
    fn pieces_are_as_many_as_wanted_and_more_where_paths_bend() {
        let found = pieces(&[0.0, 0.01, 0.04, 0.0], 20);
        assert_eq!(found.iter().sum::<usize>(), 20, "as many as wanted: {found:?}");
        assert!(found[0] <= 2 && found[3] <= 2, "straight paths are one piece, or two: {found:?}");
        let ratio = found[2] as f64 / found[1] as f64;
        assert!((1.6..=2.4).contains(&ratio), "twice as many for a bend of four times: {found:?}");
        assert_eq!(pieces(&[0.0; 3], 1000), [PIECES; 3], "at most so many of a path");
        assert_eq!(pieces(&[], 5), [0; 0], "of nothing");
    }

    #[test]
    fn native_gaussians_are_where_the_deformation_has_them() {
        let mut random = Random::new(1);
        let records = records(&mut random, 30);
        let mut nodes = Nodes::new(spread(&records, 8), [1.0, 3.0], 4);
        for time in [1.0, 1.4, 2.0, 2.5, 3.0] {
            let gradient = |index: usize| super::super::nodes::PoseGradient {
                shift: Vec3::from([(); 3].map(|()| random.in_range(-1.0, 1.0))) + index as f32,
                raw: glam::Vec4::new(0.5, -0.2, 0.1, 0.0) * (index as f32 - 4.0),
            };
            let gradients: Vec<_> = (0..nodes.places().len()).map(gradient).collect();
            nodes.collect(time, &gradients);
            nodes.step(time, 0.2);
        }
        let harmonics =
            Harmonics { coefficients: 16, degree: 3, degree_t: 0, values: (0..30 * 48).map(|v| v as f32).collect() };
        let bonds = bonds(&records, nodes.places());
        let deforming =
            Deforming { records: &records, bonds: &bonds, nodes: &nodes, harmonics: &harmonics, interval: [1.0, 3.0] };
        let Trained { parameters, harmonics: native } =
            deforming.native(Extent { gaussians: 600, degree: 3, degree_t: 2 });
        assert_eq!(parameters.len(), 600, "as many as wanted");
        let sliced = parameters.slice(&SliceSettings::default()).expect("every Gaussian can be drawn");
        // Pieces of a path are one after the other, in the order of paths.
        let of = |index: usize| native.of(index)[0] as usize / 48;
        let mut moves = 0.0f32;
        for (index, gaussian) in sliced.iter().enumerate() {
            assert_eq!(native.of(index)[..48], harmonics.of(of(index))[..], "colors of its path");
            assert!(native.of(index)[48..].iter().all(|&value| value == 0.0), "which do not depend on time");
            let at = |time: f32| {
                let bond = &bonds[of(index)];
                bond.motion(Vec3::from(records[of(index)].mean), &nodes.poses(time)).0
            };
            let (before, after) = (gaussian.mean_t - 0.02, gaussian.mean_t + 0.02);
            let place = Vec3::from(gaussian.mean);
            let error = place.distance(at(gaussian.mean_t));
            assert!(error < 1e-4, "{index}: {error} from its path");
            let (wanted, found) = ((at(after) - at(before)) / (after - before), Vec3::from(gaussian.velocity));
            let difference = wanted.distance(found) / (1.0 + wanted.length());
            assert!(difference < 0.3, "{index}: velocity {found}, and {wanted} along its path");
            moves = moves.max(wanted.length());
        }
        assert!(moves > 0.3, "there is motion to compare: {moves}");
    }
}
