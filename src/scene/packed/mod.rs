//! The packed form: what [`encode`] makes and the GPU reads as it is, without unpacking it in memory.
//!
//! In: quantized records of 32 bytes, ranges to read them with, and colors, whole or by codebook. Out: any one Gaussian or color,
//! decoded, as `shaders/shared/packed.wgsl` decodes it.
//!
//! | file | what it says |
//! |---|---|
//! | `lanes.rs` | which value lies where in a record, and between which ends: the encoder and the decoder go by it |
//! | `encode.rs` | from Gaussians to records and ranges |
//! | `decode.rs` | from records and ranges to Gaussians and colors |
//! | `shape.rs` | a covariance as scales and a rotation, and back |
//! | `colors.rs` | colors by codebook, and back |

mod colors;
mod decode;
pub mod encode;
mod lanes;
mod shape;

pub use colors::CodedColors;
pub use lanes::{BLOCK, BLOCK_RANGES, COLOR_WORDS, MAX_STAGES, RECORD_WORDS, SHARED_RANGES};

use crate::gaussian::Harmonics;

/// Packed Gaussians and their color.
#[derive(Debug, Clone, PartialEq)]
pub struct PackedScene {
    /// One record each: sixteen lanes, two to a word, the first in the lower half.
    pub records: Vec<[u32; RECORD_WORDS]>,
    /// Ends of the lanes: [`SHARED_RANGES`] four-vectors for all Gaussians, then [`BLOCK_RANGES`] for each [`BLOCK`] of them.
    pub ranges: Vec<[f32; 4]>,
    /// Their color.
    pub colors: PackedColors,
}

/// The color of packed Gaussians.
#[derive(Debug, Clone, PartialEq)]
pub enum PackedColors {
    /// Every coefficient, in single precision.
    Whole(Harmonics),
    /// By codebook.
    Coded(CodedColors),
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
        let colors = match &self.colors {
            PackedColors::Whole(harmonics) => size_of_val(harmonics.values.as_slice()),
            PackedColors::Coded(colors) => colors.size(),
        };
        size_of_val(self.records.as_slice()) + size_of_val(self.ranges.as_slice()) + colors
    }

    /// How many ranges `count` Gaussians need.
    pub fn range_count(count: usize) -> usize {
        SHARED_RANGES + BLOCK_RANGES * count.div_ceil(BLOCK)
    }

    /// Whether the records, ranges and coded colors fit together and every code has an entry: then decoding them cannot panic.
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
        match &self.colors {
            PackedColors::Whole(_) => Ok(()),
            PackedColors::Coded(colors) => colors.check(self.len()),
        }
    }
}
