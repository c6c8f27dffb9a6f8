//! The options of compression, and the qualities that select them.
//!
//! In: a [`Quality`]. Out: its [`CompressSettings`]. `CONTRIBUTING.md` lists the files that a further option changes.

use crate::offline::segments::Cut;
use crate::scene::{Bits, Packing};
use serde::{Deserialize, Serialize};

/// Number of Gaussians for each entry of a codebook.
const GAUSSIANS_OF_ENTRY: usize = 64;
/// The number of entries of a codebook is a multiple of this.
const STEP_OF_ENTRIES: usize = 64;

/// How much may be lost; [`promise`](Self::promise) returns the limit in dB. Default: [`Balanced`](Self::Balanced).
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Quality {
    /// The smallest packages without obvious differences.
    Small,
    /// At most 24 bytes per Gaussian and 1 MB of codebooks: about 50 dB against the original's pictures.
    #[default]
    Balanced,
    /// Color rounded but not coded, geometry with more bits: about 60 dB.
    VisuallyLossless,
    /// The runtime form, in single precision.
    Lossless,
}

impl Quality {
    /// Every quality with its name.
    pub const NAMES: [(&'static str, Self); 4] = [
        ("small", Self::Small),
        ("balanced", Self::Balanced),
        ("visually-lossless", Self::VisuallyLossless),
        ("lossless", Self::Lossless),
    ];
}

/// The order in which quantized Gaussians are stored. Default: [`Spatial`](Self::Spatial).
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PackedOrder {
    /// Neighbors in space follow each other.
    #[default]
    Spatial,
    /// In layers, the most important Gaussians first ([`Packing::progressive`]).
    Progressive,
    /// That of chunk files, which have layers: the capture can be cut into them without a change of its values.
    Chunks(Cut),
}

/// Every option of compression.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CompressSettings {
    /// Bits of geometry; `None` keeps single precision (and the order of the Gaussians).
    pub geometry: Option<Bits>,
    /// Number of entries of each codebook of color, at most four; without any, every coefficient is kept.
    pub codebooks: Vec<usize>,
    /// Without codebooks, coefficients are rounded to multiples of this, so that they compress; 0 keeps them as they
    /// are. A step above 0 must be a normal number: multiples of a subnormal one are not accurate.
    pub color_step: f32,
    /// The order of quantized Gaussians.
    pub order: PackedOrder,
    /// Weight of each Gaussian's color, not negative, in the order of the scene; `None` weighs by opacity.
    #[serde(skip)]
    pub weights: Option<Vec<f32>>,
}

impl CompressSettings {
    /// Returns the settings of a quality for codebooks that are trained with the Gaussians: their numbers of entries
    /// follow the number of Gaussians.
    pub fn suiting(quality: Quality, gaussians: usize) -> Self {
        let mut settings = Self::from(quality);
        let entries = (gaussians / GAUSSIANS_OF_ENTRY).next_multiple_of(STEP_OF_ENTRIES).max(STEP_OF_ENTRIES);
        settings.codebooks.iter_mut().for_each(|own| *own = (*own).min(entries));
        settings
    }
}

impl From<Quality> for CompressSettings {
    fn from(quality: Quality) -> Self {
        let (geometry, codebooks) = match quality {
            Quality::Small => (
                Some(Bits {
                    mean: 10,
                    mean_t: 10,
                    velocity: 7,
                    sigma_t: 7,
                    scale: 7,
                    rotation: 7,
                    opacity: 7,
                    base: 7,
                    escape: 0.02,
                }),
                vec![1024; 3],
            ),
            Quality::Balanced => (
                Some(Bits {
                    mean: 11,
                    mean_t: 11,
                    velocity: 8,
                    sigma_t: 8,
                    scale: 8,
                    rotation: 8,
                    opacity: 7,
                    base: 8,
                    escape: 0.02,
                }),
                vec![2048, 2048, 2048, 1024],
            ),
            Quality::VisuallyLossless => (Some(Bits::default()), Vec::new()),
            Quality::Lossless => (None, Vec::new()),
        };
        let color_step = if quality == Quality::VisuallyLossless { Packing::default().color_step } else { 0.0 };
        Self { geometry, codebooks, color_step, order: PackedOrder::Spatial, weights: None }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_entries_of_codebooks_follow_the_number_of_gaussians() {
        let entries = |count| CompressSettings::suiting(Quality::Balanced, count).codebooks;
        assert_eq!(entries(10), [64; 4], "the fewest");
        assert_eq!(entries(18_000), [320; 4], "281 entries, rounded up to a multiple of 64");
        assert_eq!(entries(30_000), [512; 4], "468 entries, rounded up");
        assert_eq!(entries(1_000_000), [2048, 2048, 2048, 1024], "at most those of the quality");
    }
}
