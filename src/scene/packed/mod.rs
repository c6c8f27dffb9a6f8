//! The packed form: what [`crate::offline::quantize`] makes and the GPU reads as it is, without unpacking it in memory.
//!
//! In: quantized records of 32 bytes, ranges to read them with, and colours by codebook. Out: any one Gaussian or colour, decoded;
//! twin of `shaders/shared/packed.wgsl`.
//!
//! A record is 16 lanes of 16 bits, each a place between two ends:
//!
//! | lane | value | ends |
//! |---|---|---|
//! | 0-2 | mean, capture units | box of the block of 256 Gaussians |
//! | 3 | temporal mean, timestamp units | all Gaussians |
//! | 4-6 | displacement (velocity · σ_t, or less: see `ranges`), square root with sign, about 32768 | largest of the block |
//! | 7 | logarithm of σ_t; 65535: always there, at rest | all Gaussians |
//! | 8-10 | logarithm of the scale along the rotated axes | all Gaussians |
//! | 11-13 | the three smaller components of the rotation | ±1/√2 |
//! | 14 | opacity | 0 to 1 |
//! | 15 | which component of the rotation (w, x, y, z) is left out | |

pub mod encode;

use crate::gaussian::{Gaussian, Harmonics, harmonics};
use glam::{Mat3, Quat, Vec3, Vec4};
use std::f32::consts::FRAC_1_SQRT_2;

/// Gaussians that share a box.
pub const BLOCK: usize = 256;
/// Largest value of a lane.
pub const LANE_MAX: f32 = 65535.0;
/// Four-vectors of [`PackedScene::ranges`] before those of the blocks.
pub const SHARED_RANGES: usize = 3;
/// Four-vectors of each block.
pub const BLOCK_RANGES: usize = 2;
/// Most codebooks that colours add up from.
pub const MAX_STAGES: usize = 4;
/// Lane 7 of a Gaussian that is always there.
pub const ALWAYS: u16 = u16::MAX;

/// Packed Gaussians.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PackedScene {
    /// One record each, two lanes to a word, the first in the lower half.
    pub records: Vec<[u32; 8]>,
    /// Ends of the lanes. Shared: `[mean_t low, size, log σ_t low, size]`, `[log scale low, size, stretch of rotation, of
    /// opacity]`, `[base colour low, size, -, -]`. A lane of fewer bits never reaches 65535: sizes and stretches make up for it. Then for each block `[mean low xyz, displacement]`, `[mean size xyz, r]`.
    /// `r` is 1 over the time interval: velocity = displacement · max(1 / σ_t, r), since nothing is seen to move for longer.
    pub ranges: Vec<[f32; 4]>,
    /// Colours by codebook; without them the scene's harmonics are whole.
    pub colors: Option<CodedColors>,
}

/// Colours by codebook: a base colour each, and the rest as a sum of entries of up to four codebooks, one from each.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct CodedColors {
    /// Spatial degree evaluated.
    pub degree: u32,
    /// Time degree evaluated.
    pub degree_t: u32,
    /// One record each: the first coefficient (10 bits for each channel), then four codes of 16 bits.
    pub records: Vec<[u32; 3]>,
    /// Entries of each codebook.
    pub entries: Vec<u32>,
    /// All codebooks: `words_per_entry` words for each entry, four signed bytes to a word, RGB innermost, first coefficient 0.
    pub codebooks: Vec<u32>,
    /// What a byte of 127 stands for: `words_per_entry` four-vectors for each codebook.
    pub scales: Vec<[f32; 4]>,
}

impl PackedScene {
    /// Number of Gaussians.
    pub fn len(&self) -> usize {
        self.records.len()
    }

    /// Whether there is no Gaussian.
    pub fn is_empty(&self) -> bool {
        self.records.is_empty()
    }

    /// Bytes in memory, on the host and on the GPU alike.
    pub fn size(&self) -> usize {
        let colors = self.colors.as_ref().map_or(0, CodedColors::size);
        size_of_val(self.records.as_slice()) + size_of_val(self.ranges.as_slice()) + colors
    }

    /// How many ranges `count` Gaussians need.
    pub fn range_count(count: usize) -> usize {
        SHARED_RANGES + BLOCK_RANGES * count.div_ceil(BLOCK)
    }

    /// Whether the parts fit together and every code has an entry: then nothing here can panic.
    ///
    /// # Errors
    /// What does not fit, in words.
    pub fn check(&self) -> Result<(), &'static str> {
        if self.ranges.len() != Self::range_count(self.len()) {
            return Err("the ranges do not fit the number of Gaussians");
        }
        if !self.ranges.as_flattened().iter().all(|value| value.is_finite()) {
            return Err("a range that is not finite");
        }
        self.colors.as_ref().map_or(Ok(()), |colors| colors.check(self.len()))
    }

    fn lane(&self, index: usize, lane: usize) -> u16 {
        (self.records[index][lane / 2] >> (16 * (lane % 2))) as u16
    }

    /// Decodes one Gaussian; panics beyond the end, as a slice does.
    pub fn gaussian(&self, index: usize) -> Gaussian {
        let part = |lane| f32::from(self.lane(index, lane)) / LANE_MAX;
        let parts = |lane| Vec3::new(part(lane), part(lane + 1), part(lane + 2));
        let [t_low, t_size, sigma_low, sigma_size] = self.ranges[0];
        let [scale_low, scale_size, rotation_stretch, opacity_stretch] = self.ranges[1];
        let block = SHARED_RANGES + index / BLOCK * BLOCK_RANGES;
        let (low, size) = (Vec4::from(self.ranges[block]), Vec4::from(self.ranges[block + 1]));
        let mean = low.truncate() + parts(0) * size.truncate();
        let (sigma_t, velocity) = match self.lane(index, 7) {
            ALWAYS => (f32::INFINITY, Vec3::ZERO),
            _ => {
                let sigma_t = (sigma_low + part(7) * sigma_size).exp();
                let signed = Vec3::from([4, 5, 6].map(|lane| (f32::from(self.lane(index, lane)) - 32768.0) / 32767.0));
                (sigma_t, signed * signed.abs() * low.w * sigma_t.recip().max(size.w))
            }
        };
        let scale = (parts(8) * scale_size + scale_low).map(f32::exp);
        let three = (parts(11) * rotation_stretch * 2.0 - 1.0) * FRAC_1_SQRT_2;
        let rotation = Mat3::from_quat(with_largest(three, self.lane(index, 15)));
        let m = rotation * Mat3::from_diagonal(scale);
        let covariance = m * m.transpose();
        Gaussian {
            mean: mean.to_array(),
            mean_t: t_low + part(3) * t_size,
            velocity: velocity.to_array(),
            sigma_t,
            covariance: [
                covariance.x_axis.x,
                covariance.x_axis.y,
                covariance.x_axis.z,
                covariance.y_axis.y,
                covariance.y_axis.z,
                covariance.z_axis.z,
            ],
            opacity: (part(14) * opacity_stretch).clamp(0.0, 1.0),
            padding: 0.0,
        }
    }

    /// The first coefficient of a coded colour.
    fn base(&self, colors: &CodedColors, index: usize) -> Vec3 {
        let [low, size, ..] = self.ranges[2];
        let word = colors.records[index][0];
        Vec3::from([0, 10, 20].map(|shift| low + (word >> shift & 1023) as f32 / 1023.0 * size))
    }

    /// Colour of one Gaussian; see [`Harmonics::color`](crate::gaussian::Harmonics::color). Black without coded colours.
    pub fn color(&self, index: usize, direction: Vec3, tau: f32, time_span: f32) -> Vec3 {
        let Some(colors) = &self.colors else { return Vec3::ZERO };
        let basis = harmonics::basis(direction);
        let rest = colors.rest(index);
        let block = |first: usize, count: usize| {
            (0..count).fold(Vec3::ZERO, |sum, k| sum + basis[k] * Vec3::from_slice(&rest[(first + k) * 3..]))
        };
        let mut color = self.base(colors, index) * basis[0] + block(0, (colors.degree as usize + 1).pow(2));
        if colors.degree == 3 {
            for n in 1..=colors.degree_t as usize {
                color += harmonics::time_cosine(n, tau, time_span) * block(16 * n, 16);
            }
        }
        (color + 0.5).max(Vec3::ZERO)
    }
}

impl PackedScene {
    /// Every Gaussian, decoded, and the coefficients of coded colours.
    pub fn unpack(&self) -> (Vec<Gaussian>, Option<Harmonics>) {
        let gaussians = (0..self.len()).map(|index| self.gaussian(index)).collect();
        let harmonics = self.colors.as_ref().map(|colors| {
            let coefficients = colors.coefficients();
            let mut values = Vec::with_capacity(self.len() * coefficients * 3);
            for index in 0..self.len() {
                values.extend(self.base(colors, index).to_array());
                values.extend_from_slice(&colors.rest(index)[3..coefficients * 3]);
            }
            Harmonics { coefficients, degree: colors.degree, degree_t: colors.degree_t, values }
        });
        (gaussians, harmonics)
    }
}

impl CodedColors {
    /// Coefficients per Gaussian and channel: 1, 4, 9, 16, 32 or 48.
    pub fn coefficients(&self) -> usize {
        harmonics::evaluated(self.degree, self.degree_t)
    }

    /// Words of one entry of a codebook.
    pub fn words_per_entry(&self) -> usize {
        (self.coefficients() * 3).div_ceil(4)
    }

    /// Bytes in memory.
    pub fn size(&self) -> usize {
        size_of_val(self.records.as_slice())
            + size_of_val(self.codebooks.as_slice())
            + size_of_val(self.scales.as_slice())
    }

    /// The code of a Gaussian in one of the codebooks.
    pub fn code(&self, index: usize, stage: usize) -> u32 {
        self.records[index][1 + stage / 2] >> (16 * (stage % 2)) & 0xffff
    }

    /// All coefficients but the first (which is 0 here), RGB innermost, padded to whole words.
    pub fn rest(&self, index: usize) -> Vec<f32> {
        let words = self.words_per_entry();
        let mut rest = vec![0.0; words * 4];
        let mut first = 0;
        for (stage, &entries) in self.entries.iter().enumerate() {
            let entry = (first + self.code(index, stage) as usize) * words;
            let scales = &self.scales[stage * words..][..words];
            for ((four, &word), scale) in rest.chunks_exact_mut(4).zip(&self.codebooks[entry..]).zip(scales) {
                for ((value, byte), scale) in four.iter_mut().zip(word.to_le_bytes()).zip(scale) {
                    *value += f32::from(byte as i8) / 127.0 * scale;
                }
            }
            first += entries as usize;
        }
        rest
    }

    fn check(&self, count: usize) -> Result<(), &'static str> {
        if self.degree > 3 || self.degree_t > 2 {
            return Err("a degree of colour that does not exist");
        }
        let words = self.words_per_entry();
        let total: u64 = self.entries.iter().map(|&entries| u64::from(entries)).sum();
        if self.records.len() != count || self.entries.len() > MAX_STAGES {
            return Err("the colours do not fit the number of Gaussians");
        }
        if self.codebooks.len() as u64 != total * words as u64 || self.scales.len() != words * self.entries.len() {
            return Err("the codebooks do not have the size that their entries need");
        }
        if !self.scales.as_flattened().iter().all(|value| value.is_finite()) {
            return Err("a scale of a codebook that is not finite");
        }
        let fits = |stage: usize, &entries: &u32| (0..count).all(|index| self.code(index, stage) < entries);
        if self.entries.iter().enumerate().all(|(stage, entries)| fits(stage, entries)) {
            Ok(())
        } else {
            Err("a code beyond its codebook")
        }
    }
}

/// The unit quaternion whose largest component was left out; `three` are the others in the order w, x, y, z.
fn with_largest(three: Vec3, largest: u16) -> Quat {
    let rest = (1.0 - three.length_squared()).max(0.0).sqrt();
    let [a, b, c] = three.to_array();
    let [w, x, y, z] = match largest {
        0 => [rest, a, b, c],
        1 => [a, rest, b, c],
        2 => [a, b, rest, c],
        _ => [a, b, c, rest],
    };
    Quat::from_xyzw(x, y, z, w)
}
