//! Encoding: from sliced Gaussians to the records and ranges of the packed form.
//!
//! In: Gaussians in the order in which they will be stored, the number of bits of each attribute, and colors that are
//! packed already. Out: a [`PackedScene`]. An attribute of fewer than 16 bits leaves the low bits of its lanes zero,
//! which costs nothing on disk; the largest splats keep all 16, since their errors are the most visible.
//!
//! A range that a few values stretch has more bits, so that the other values keep their precision.

use super::additional_bits::additional_bits;
use super::lanes::{self, ALWAYS, AT_REST, BLOCK, BlockRanges, FARTHEST, LANE_MAX, SharedRanges};
use super::scene::{PackedColors, PackedScene};
use super::shape::{Shape, smallest_three};
use super::strays::{loses_precision, squared_size};
use crate::gaussian::Gaussian;
use crate::scene::Bounds;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::f64::consts::FRAC_1_SQRT_2;

/// Smallest scale that is stored, as a fraction of the radius of [`Bounds::core`]; smaller scales are raised to it.
/// Trained captures have scales a thousand times smaller, which are not visible and would waste half the range. This
/// floor has no visible effect up to 100 dB.
const FLATTEST: f32 = 1.0 / 16_384.0;
/// Two fractions of the median size of the Gaussians. In scenes of objects far apart the radius of the core is large:
/// if the smallest scale would be above the first fraction, it is the second.
const OF_USUAL: [f64; 2] = [1.0 / 16.0, 1.0 / 64.0];
/// Usual sizes of the ranges of the logarithms of scales and of σ_t. A larger range has more bits. Trained captures
/// have 8 to 11.
const LOG_SCALES: f64 = 14.0;
const LOG_SIGMAS: f64 = 20.0;
/// A block has 16 bits if its largest displacement is more than this multiple of the ninth decile of its displacements
/// above 0. The multiple is at most 40 in blocks of trained captures.
const FASTEST: f64 = 256.0;

/// Number of bits of each attribute. Default: no visible difference.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Bits {
    /// Mean, per axis, within the box of its block; 1 to 16. A block whose steps would be coarse for its Gaussians
    /// has 16.
    pub mean: u32,
    /// Temporal mean, within two lengths of the time interval; 1 to 16. A larger range has more, up to 16.
    pub mean_t: u32,
    /// Displacement within one σ_t or the time interval, whichever is shorter, per axis; 2 to 16. A block in which a
    /// few displacements are far larger than the others has 16.
    pub velocity: u32,
    /// Logarithm of σ_t; 1 to 15. A range of more than a factor of 10⁸ has more, up to 15.
    pub sigma_t: u32,
    /// Logarithm of the scale, per axis; 1 to 16. A range of more than a factor of 10⁶ has more, up to 16.
    pub scale: u32,
    /// Each of three components of the rotation; 1 to 16.
    pub rotation: u32,
    /// Opacity; 1 to 16.
    pub opacity: u32,
    /// Base color, per channel, where colors are coded; 1 to 10. A large range has more, up to 10.
    pub base: u32,
    /// Fraction of the Gaussians, those with the largest splats, that keep 16 bits for scale, rotation and mean; 0
    /// to 1.
    pub escape: f32,
}

impl Default for Bits {
    fn default() -> Self {
        Self {
            mean: 14,
            mean_t: 14,
            velocity: 12,
            sigma_t: 10,
            scale: 11,
            rotation: 11,
            opacity: 10,
            base: 10,
            escape: 0.03,
        }
    }
}

impl PackedScene {
    /// Packs Gaussians, keeping their order, as one layer. `base` is the range (low, high) of coded DC coefficients, as
    /// [`CodedColors::of_base`](super::CodedColors::of_base) returns it; `reach` is the longest time over which motion
    /// matters, the length of the time interval in timestamp units.
    pub fn encode(gaussians: &[Gaussian], bits: &Bits, colors: PackedColors, base: [f32; 2], reach: f32) -> Self {
        let flattest = flattest(gaussians);
        let shapes: Vec<Shape> = gaussians.par_iter().map(|gaussian| Shape::of(gaussian, flattest)).collect();
        let finite = |gaussian: &&Gaussian| gaussian.sigma_t.is_finite();
        let time = Span::of(gaussians.iter().map(|g| f64::from(g.mean_t)));
        let sigma = Span::of(gaussians.iter().filter(finite).map(|g| f64::from(g.sigma_t).ln()));
        let scale = Span::of(shapes.iter().flat_map(|shape| shape.log_scale.to_array()));
        let quantizers = Quantizers::new(&Bits {
            mean_t: bits.mean_t.saturating_add(additional_bits(time.size, 2.0 * f64::from(reach))),
            sigma_t: bits.sigma_t.saturating_add(additional_bits(sigma.size, LOG_SIGMAS)),
            scale: bits.scale.saturating_add(additional_bits(scale.size, LOG_SCALES)),
            ..*bits
        });
        let shared = SharedRanges {
            mean_t: time.range(quantizers.mean_t),
            log_sigma_t: sigma.range(quantizers.sigma_t),
            log_scale: scale.range(quantizers.scale),
            rotation_stretch: quantizers.rotation.stretch() as f32,
            opacity_stretch: quantizers.opacity.stretch() as f32,
            base: [base[0], base[1] - base[0]],
        };
        let mut ranges = shared.write().to_vec();
        let fine = largest(gaussians, &shapes, bits.escape);
        let [sigma_low, sigma_size] = shared.log_sigma_t.map(f64::from);
        let deviation =
            |gaussian: &Gaussian| quantizers.sigma_t.encode(sigma.place(f64::from(gaussian.sigma_t).ln()), false);
        // Within one σ_t as it will be decoded, so that the error of σ_t does not change the velocity.
        let displacement = |gaussian: &Gaussian| {
            let sigma_t = (sigma_low + f64::from(deviation(gaussian)) / f64::from(LANE_MAX) * sigma_size).exp();
            gaussian.velocity.map(|velocity| f64::from(velocity) * sigma_t.min(f64::from(reach)))
        };
        let encode_block = |(block, chunk): (usize, &[Gaussian])| {
            let mean = [0, 1, 2].map(|axis| Span::of(chunk.iter().map(|g| f64::from(g.mean[axis]))));
            let farthest =
                |gaussian: &Gaussian| displacement(gaussian).into_iter().fold(0.0f64, |most, d| most.max(d.abs()));
            let farthest: Vec<f64> = chunk.iter().filter(finite).map(farthest).collect();
            let most = farthest.iter().copied().fold(0.0, f64::max);
            let of_mean = if loses_precision(chunk.iter()) { Quantizer::new(16) } else { quantizers.mean };
            let of_velocity = if is_stretched(farthest) { SignedQuantizer::new(16) } else { quantizers.velocity };
            let ends = mean.map(|span| span.range(of_mean));
            let block_ranges = BlockRanges {
                mean_low: ends.map(|[low, _]| low),
                mean_size: ends.map(|[_, size]| size),
                displacement: (most * (f64::from(FARTHEST) / of_velocity.top()).powi(2)) as f32,
                rate: reach.max(f32::MIN_POSITIVE).recip(),
            };
            let encode = |(index, gaussian): (usize, &Gaussian)| {
                let shape = &shapes[index];
                let mut record = [0; lanes::LANES];
                for axis in 0..3 {
                    record[lanes::MEAN + axis] =
                        of_mean.encode(mean[axis].place(f64::from(gaussian.mean[axis])), fine[index]);
                    record[lanes::SCALE + axis] =
                        quantizers.scale.encode(scale.place(shape.log_scale[axis]), fine[index]);
                }
                record[lanes::MEAN_T] = quantizers.mean_t.encode(time.place(f64::from(gaussian.mean_t)), false);
                record[lanes::SIGMA_T] = ALWAYS;
                if gaussian.sigma_t.is_finite() {
                    record[lanes::SIGMA_T] = deviation(gaussian);
                    for (lane, along) in record[lanes::DISPLACEMENT..].iter_mut().zip(displacement(gaussian)) {
                        *lane = of_velocity.encode(if most > 0.0 { along / most } else { 0.0 });
                    }
                }
                let (three, left_out) = smallest_three(shape.rotation);
                for (lane, component) in record[lanes::ROTATION..].iter_mut().zip(three) {
                    *lane = quantizers.rotation.encode((component / FRAC_1_SQRT_2 + 1.0) * 0.5, fine[index]);
                }
                record[lanes::OPACITY] = quantizers.opacity.encode(f64::from(gaussian.opacity), false);
                record[lanes::LEFT_OUT] = left_out;
                lanes::pack(record)
            };
            (block_ranges.write(), (block * BLOCK..).zip(chunk).map(encode).collect::<Vec<_>>())
        };
        let blocks: Vec<_> = gaussians.par_chunks(BLOCK).enumerate().map(encode_block).collect();
        let mut records = Vec::with_capacity(gaussians.len());
        for (block_ranges, own) in blocks {
            ranges.extend(block_ranges);
            records.extend(own);
        }
        Self { records, ranges, colors, layers: Vec::new(), runs: None }
    }
}

/// Quantizes to the lane values `k · step` with `k` from 0 to `levels`.
#[derive(Clone, Copy)]
struct Quantizer {
    levels: f64,
    step: f64,
}

impl Quantizer {
    fn new(bits: u32) -> Self {
        let bits = bits.clamp(1, 16);
        Self { levels: f64::from((1u32 << bits) - 1), step: f64::from(1u32 << (16 - bits)) }
    }

    /// Returns the largest lane value.
    fn top(self) -> f64 {
        self.levels * self.step
    }

    /// Returns the factor by which a range must grow, since lanes are decoded as fractions of 65535.
    fn stretch(self) -> f64 {
        f64::from(LANE_MAX) / self.top()
    }

    /// Returns the lane value of a position in a range, 0 to 1; with all bits if `fine`.
    fn encode(self, place: f64, fine: bool) -> u16 {
        let place = place.clamp(0.0, 1.0);
        if fine { (place * self.top()).round() as u16 } else { ((place * self.levels).round() * self.step) as u16 }
    }
}

/// The range of some values.
#[derive(Clone, Copy)]
struct Span {
    low: f64,
    size: f64,
}

impl Span {
    fn of(values: impl Iterator<Item = f64>) -> Self {
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
        // The low end is rounded to single precision, as it is stored.
        if low > high { Self { low: 0.0, size: 0.0 } } else { Self { low: f64::from(low as f32), size: high - low } }
    }

    fn place(self, value: f64) -> f64 {
        if self.size > 0.0 { (value - self.low) / self.size } else { 0.0 }
    }

    /// Returns low end and size as they are stored for a lane of this quantizer.
    fn range(self, quantizer: Quantizer) -> [f32; 2] {
        [self.low as f32, (self.size * quantizer.stretch()) as f32]
    }
}

/// Quantizes fractions of the largest displacement, −1 to 1, by their signed square root, since most displacements are
/// small.
#[derive(Clone, Copy)]
struct SignedQuantizer {
    bits: u32,
}

impl SignedQuantizer {
    fn new(bits: u32) -> Self {
        Self { bits: bits.clamp(2, 16) }
    }

    /// Returns the largest difference from the middle of a lane.
    fn top(self) -> f64 {
        let levels = (1u32 << (self.bits - 1)) - 1;
        f64::from(levels << (16 - self.bits))
    }

    /// Returns the lane value of a fraction.
    fn encode(self, part: f64) -> u16 {
        let step = f64::from(1u32 << (16 - self.bits));
        let root = part.abs().sqrt().min(1.0).copysign(part);
        (f64::from(AT_REST) + (root * self.top() / step).round() * step) as u16
    }
}

/// Quantizers of all attributes.
struct Quantizers {
    mean: Quantizer,
    mean_t: Quantizer,
    velocity: SignedQuantizer,
    sigma_t: Quantizer,
    scale: Quantizer,
    rotation: Quantizer,
    opacity: Quantizer,
}

impl Quantizers {
    fn new(bits: &Bits) -> Self {
        Self {
            mean: Quantizer::new(bits.mean),
            mean_t: Quantizer::new(bits.mean_t),
            velocity: SignedQuantizer::new(bits.velocity),
            // With 16 bits the largest value would be `ALWAYS`.
            sigma_t: Quantizer::new(bits.sigma_t.min(15)),
            scale: Quantizer::new(bits.scale),
            rotation: Quantizer::new(bits.rotation),
            opacity: Quantizer::new(bits.opacity),
        }
    }
}

/// Returns the smallest scale that is stored, capture units.
fn flattest(gaussians: &[Gaussian]) -> f64 {
    let radius = Bounds::core(gaussians.iter().copied()).map_or(0.0, Bounds::radius);
    let flattest = f64::from(radius * FLATTEST);
    let mut sizes: Vec<f64> = gaussians.iter().map(|gaussian| squared_size(gaussian).sqrt()).collect();
    let middle = sizes.len() / 2;
    let usual = if sizes.is_empty() { 0.0 } else { *sizes.select_nth_unstable_by(middle, f64::total_cmp).1 };
    let [most, instead] = OF_USUAL.map(|part| part * usual);
    if usual > 0.0 && flattest > most { instead } else { flattest }
}

/// Returns whether a few displacements of a block are so large that the others would lose precision.
fn is_stretched(mut displacements: Vec<f64>) -> bool {
    displacements.retain(|&displacement| displacement > 0.0);
    let Some(last) = displacements.len().checked_sub(1) else { return false };
    let most = displacements.iter().copied().fold(0.0, f64::max);
    most > FASTEST * *displacements.select_nth_unstable_by(last * 9 / 10, f64::total_cmp).1
}

/// Returns for each Gaussian whether it is in the fraction with the largest and most opaque splats.
fn largest(gaussians: &[Gaussian], shapes: &[Shape], fraction: f32) -> Vec<bool> {
    let count = ((gaussians.len() as f32 * fraction.clamp(0.0, 1.0)).round() as usize).min(gaussians.len());
    let size = |(gaussian, shape): (&Gaussian, &Shape)| {
        shape.log_scale.max_element() + f64::from(gaussian.opacity).max(1e-6).ln()
    };
    let mut order: Vec<(f64, usize)> = gaussians.iter().zip(shapes).map(size).zip(0..).collect();
    order.par_sort_unstable_by(|(a, i), (b, j)| b.total_cmp(a).then(i.cmp(j)));
    let mut fine = vec![false; gaussians.len()];
    order[..count].iter().for_each(|&(_, index)| fine[index] = true);
    fine
}
