//! Quantisation of geometry: from runtime Gaussians to the records and ranges of the packed form.
//!
//! In: Gaussians in the order in which they will be stored, and how many bits each attribute gets. Out: what
//! [`PackedScene`](crate::scene::PackedScene) decodes. An attribute of fewer than 16 bits leaves the low bits of its lanes zero, which
//! costs nothing on disk; the largest splats keep all 16, since the picture shows their errors first.

use super::{ALWAYS, BLOCK, LANE_MAX};
use crate::gaussian::Gaussian;
use crate::scene::Bounds;
use glam::{DMat3, DQuat, DVec3};
use serde::{Deserialize, Serialize};
use std::f64::consts::FRAC_1_SQRT_2;

/// The smallest scale that is told from none, as a part of the radius of the middle of the scene. Trained captures have scales a
/// thousand times smaller yet, which no picture shows and which would waste half the range; this floor costs nothing up to 100 dB.
const FLATTEST: f32 = 1.0 / 16_384.0;

/// Bits of each attribute, and who gets more.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Bits {
    /// Mean, per axis, within the box of its block; 1 to 16.
    pub mean: u32,
    /// Temporal mean; 1 to 16.
    pub mean_t: u32,
    /// Displacement within one σ_t or the time interval, whichever is shorter, per axis; 2 to 16.
    pub velocity: u32,
    /// Logarithm of σ_t; 1 to 15.
    pub sigma_t: u32,
    /// Logarithm of the scale, per axis; 1 to 16.
    pub scale: u32,
    /// Each of three components of the rotation; 1 to 16.
    pub rotation: u32,
    /// Opacity; 1 to 16.
    pub opacity: u32,
    /// Base colour, per channel, where colours are coded; 1 to 10.
    pub base: u32,
    /// Share of the Gaussians, those with the largest splats, that keep 16 bits for scale, rotation and mean.
    pub escape: f32,
}

/// A lane of so many bits: places `k · step` with `k` from 0 to `levels`.
#[derive(Clone, Copy)]
struct Lane {
    levels: f64,
    step: f64,
}

impl Lane {
    fn new(bits: u32) -> Self {
        let bits = bits.clamp(1, 16);
        Self { levels: f64::from((1u32 << bits) - 1), step: f64::from(1u32 << (16 - bits)) }
    }

    /// The value at the upper end.
    fn top(self) -> f64 {
        self.levels * self.step
    }

    /// What a range must grow by, since lanes are read as parts of 65535.
    fn stretch(self) -> f64 {
        f64::from(LANE_MAX) / self.top()
    }

    /// A place between 0 and 1; with all bits if `fine`.
    fn encode(self, place: f64, fine: bool) -> u16 {
        let place = place.clamp(0.0, 1.0);
        if fine { (place * self.top()).round() as u16 } else { ((place * self.levels).round() * self.step) as u16 }
    }
}

/// The ends of some values.
#[derive(Clone, Copy)]
struct Span {
    low: f64,
    size: f64,
}

impl Span {
    fn of(values: impl Iterator<Item = f64>) -> Self {
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
        // Ends are stored in single precision: what they enclose must not fall outside.
        if low > high { Self { low: 0.0, size: 0.0 } } else { Self { low: f64::from(low as f32), size: high - low } }
    }

    fn place(self, value: f64) -> f64 {
        if self.size > 0.0 { (value - self.low) / self.size } else { 0.0 }
    }
}

/// A covariance taken apart.
struct Shape {
    log_scale: DVec3,
    rotation: DQuat,
}

/// Records and ranges of these Gaussians, in their order. `base` are the ends of the base colours, which share a range; `reach` is the
/// longest time over which motion matters, the length of the time interval.
pub fn quantize(gaussians: &[Gaussian], bits: &Bits, base: [f32; 2], reach: f32) -> (Vec<[u32; 8]>, Vec<[f32; 4]>) {
    let radius = Bounds::core(gaussians.iter().copied()).map_or(0.0, Bounds::radius);
    let flattest = f64::from(radius * FLATTEST);
    let shapes: Vec<Shape> = gaussians.iter().map(|gaussian| Shape::of(gaussian, flattest)).collect();
    let finite = |gaussian: &&Gaussian| gaussian.sigma_t.is_finite();
    let time = Span::of(gaussians.iter().map(|g| f64::from(g.mean_t)));
    let sigma = Span::of(gaussians.iter().filter(finite).map(|g| f64::from(g.sigma_t).ln()));
    let scale = Span::of(shapes.iter().flat_map(|shape| shape.log_scale.to_array()));
    let lanes = Lanes::new(bits);
    let mut ranges = vec![
        [time.low, time.size * lanes.mean_t.stretch(), sigma.low, sigma.size * lanes.sigma_t.stretch()]
            .map(|v| v as f32),
        [scale.low, scale.size * lanes.scale.stretch(), lanes.rotation.stretch(), lanes.opacity.stretch()]
            .map(|v| v as f32),
        [base[0], base[1] - base[0], 0.0, 0.0],
    ];
    let fine = largest(gaussians, &shapes, bits.escape);
    let [_, _, sigma_low, sigma_size] = ranges[0].map(f64::from);
    let deviation = |gaussian: &Gaussian| lanes.sigma_t.encode(sigma.place(f64::from(gaussian.sigma_t).ln()), false);
    // Within one σ_t as it will be decoded, so that its error does not change the velocity.
    let displacement = |gaussian: &Gaussian| {
        let sigma_t = (sigma_low + f64::from(deviation(gaussian)) / f64::from(LANE_MAX) * sigma_size).exp();
        gaussian.velocity.map(|velocity| f64::from(velocity) * sigma_t.min(f64::from(reach)))
    };
    let mut records = Vec::with_capacity(gaussians.len());
    for (block, chunk) in gaussians.chunks(BLOCK).enumerate() {
        let mean = [0, 1, 2].map(|axis| Span::of(chunk.iter().map(|g| f64::from(g.mean[axis]))));
        let most = chunk.iter().filter(finite).flat_map(displacement).fold(0.0f64, |most, d| most.max(d.abs()));
        let stretch = lanes.mean.stretch();
        let [low, size] = [mean.map(|span| span.low as f32), mean.map(|span| (span.size * stretch) as f32)];
        let velocity = (most * (32767.0 / lanes.velocity_top()).powi(2)) as f32;
        ranges.push([low[0], low[1], low[2], velocity]);
        ranges.push([size[0], size[1], size[2], reach.max(f32::MIN_POSITIVE).recip()]);
        for (index, gaussian) in (block * BLOCK..).zip(chunk) {
            let shape = &shapes[index];
            let mut record = [0u16; 16];
            for axis in 0..3 {
                record[axis] = lanes.mean.encode(mean[axis].place(f64::from(gaussian.mean[axis])), fine[index]);
                record[8 + axis] = lanes.scale.encode(scale.place(shape.log_scale[axis]), fine[index]);
            }
            record[3] = lanes.mean_t.encode(time.place(f64::from(gaussian.mean_t)), false);
            record[7] = ALWAYS;
            if gaussian.sigma_t.is_finite() {
                record[7] = deviation(gaussian);
                for (lane, along) in record[4..7].iter_mut().zip(displacement(gaussian)) {
                    *lane = lanes.encode_velocity(if most > 0.0 { along / most } else { 0.0 });
                }
            }
            let (three, left_out) = smallest_three(shape.rotation);
            for (lane, component) in record[11..14].iter_mut().zip(three) {
                *lane = lanes.rotation.encode((component / FRAC_1_SQRT_2 + 1.0) * 0.5, fine[index]);
            }
            record[14] = lanes.opacity.encode(f64::from(gaussian.opacity), false);
            record[15] = left_out;
            records
                .push(std::array::from_fn(|word| u32::from(record[2 * word]) | u32::from(record[2 * word + 1]) << 16));
        }
    }
    (records, ranges)
}

/// Lanes of all attributes.
struct Lanes {
    mean: Lane,
    mean_t: Lane,
    velocity_bits: u32,
    sigma_t: Lane,
    scale: Lane,
    rotation: Lane,
    opacity: Lane,
}

impl Lanes {
    fn new(bits: &Bits) -> Self {
        Self {
            mean: Lane::new(bits.mean),
            mean_t: Lane::new(bits.mean_t),
            velocity_bits: bits.velocity.clamp(2, 16),
            // The top value of 16 bits means something else.
            sigma_t: Lane::new(bits.sigma_t.min(15)),
            scale: Lane::new(bits.scale),
            rotation: Lane::new(bits.rotation),
            opacity: Lane::new(bits.opacity),
        }
    }

    /// The largest step away from the middle.
    fn velocity_top(&self) -> f64 {
        let levels = (1u32 << (self.velocity_bits - 1)) - 1;
        f64::from(levels << (16 - self.velocity_bits))
    }

    /// A part of the largest displacement, −1 to 1, as its signed square root: small ones are the most.
    fn encode_velocity(&self, part: f64) -> u16 {
        let step = f64::from(1u32 << (16 - self.velocity_bits));
        let root = part.abs().sqrt().min(1.0).copysign(part);
        (32768.0 + (root * self.velocity_top() / step).round() * step) as u16
    }
}

/// The Gaussians whose splats are largest and most opaque.
fn largest(gaussians: &[Gaussian], shapes: &[Shape], share: f32) -> Vec<bool> {
    let count = ((gaussians.len() as f32 * share.clamp(0.0, 1.0)).round() as usize).min(gaussians.len());
    let size =
        |index: &usize| shapes[*index].log_scale.max_element() + f64::from(gaussians[*index].opacity).max(1e-6).ln();
    let mut order: Vec<usize> = (0..gaussians.len()).collect();
    order.sort_by(|a, b| size(b).total_cmp(&size(a)).then(a.cmp(b)));
    let mut fine = vec![false; gaussians.len()];
    order[..count].iter().for_each(|&index| fine[index] = true);
    fine
}

impl Shape {
    /// Scales, none below the `flattest`, and rotation of the conditional covariance.
    fn of(gaussian: &Gaussian, flattest: f64) -> Self {
        let [xx, xy, xz, yy, yz, zz] = gaussian.covariance.map(f64::from);
        let covariance = DMat3::from_cols_array(&[xx, xy, xz, xy, yy, yz, xz, yz, zz]);
        let (values, mut vectors) = eigen(covariance);
        if vectors.determinant() < 0.0 {
            vectors.z_axis = -vectors.z_axis;
        }
        // Rounding can leave a flat Gaussian a variance below zero.
        let floor = (flattest * flattest).max(values.max_element() * 1e-12).max(1e-30);
        Self {
            log_scale: values.max(DVec3::splat(floor)).map(|v| 0.5 * v.ln()),
            rotation: DQuat::from_mat3(&vectors).normalize(),
        }
    }
}

/// Eigenvalues and eigenvectors (columns) of a symmetric matrix, by Jacobi's rotations.
fn eigen(mut a: DMat3) -> (DVec3, DMat3) {
    let mut vectors = DMat3::IDENTITY;
    // Convergence is quadratic: a dozen sweeps are more than enough.
    for _ in 0..12 {
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            let off = a.col(q)[p];
            if off.abs() <= 1e-300 {
                continue;
            }
            let theta = (a.col(q)[q] - a.col(p)[p]) / (2.0 * off);
            let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
            let t = if theta == 0.0 { 1.0 } else { t };
            let cos = (t * t + 1.0).sqrt().recip();
            let sin = t * cos;
            let mut turn = DMat3::IDENTITY;
            turn.col_mut(p)[p] = cos;
            turn.col_mut(q)[q] = cos;
            turn.col_mut(q)[p] = sin;
            turn.col_mut(p)[q] = -sin;
            a = turn.transpose() * a * turn;
            vectors *= turn;
        }
    }
    (DVec3::new(a.x_axis.x, a.y_axis.y, a.z_axis.z), vectors)
}

/// The three smaller components in the order w, x, y, z, with the sign that makes the largest positive, and which that is.
fn smallest_three(q: DQuat) -> ([f64; 3], u16) {
    let all = [q.w, q.x, q.y, q.z];
    let largest = (0..4).fold(0, |best, i| if all[i].abs() > all[best].abs() { i } else { best });
    let sign = if all[largest] < 0.0 { -1.0 } else { 1.0 };
    let mut others = (0..4).filter(|&i| i != largest).map(|i| all[i] * sign);
    (std::array::from_fn(|_| others.next().unwrap_or_default()), largest as u16)
}
