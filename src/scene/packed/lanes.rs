//! The lanes of packed records: which value lies where, and between which ends.
//!
//! In: places, codes, and the ends that places lie between. Out: the words of records and ranges; and back. The encoder and the decoder
//! both go by this table; `shaders/shared/packed.wgsl` repeats it.
//!
//! A record of geometry is 16 lanes of 16 bits, each a place between two ends:
//!
//! | lane | value | ends |
//! |---|---|---|
//! | 0-2 | mean, capture units | box of the block of 256 Gaussians |
//! | 3 | temporal mean, timestamp units | all Gaussians |
//! | 4-6 | displacement (velocity · σ_t, or less: see `BlockRanges::rate`), square root with sign, about 32768 | largest of the block |
//! | 7 | logarithm of σ_t; 65535: always there, at rest | all Gaussians |
//! | 8-10 | logarithm of the scale along the rotated axes | all Gaussians |
//! | 11-13 | the three smaller components of the rotation | ±1/√2 |
//! | 14 | opacity | 0 to 1 |
//! | 15 | which component of the rotation (w, x, y, z) is left out | |
//!
//! A record of coded color is a word of three places of 10 bits, the first coefficient, and two words of four codes of 16 bits.

/// Gaussians that share a box.
pub const BLOCK: usize = 256;
/// Four-vectors of [`PackedScene::ranges`](super::PackedScene::ranges) before those of the blocks.
pub const SHARED_RANGES: usize = 3;
/// Four-vectors of each block.
pub const BLOCK_RANGES: usize = 2;
/// Words of a record of geometry.
pub const RECORD_WORDS: usize = 8;
/// Words of a record of coded color.
pub const COLOR_WORDS: usize = 3;
/// Most codebooks that colors add up from.
pub const MAX_STAGES: usize = 4;

/// Lanes of a record of geometry.
pub(super) const LANES: usize = 2 * RECORD_WORDS;
/// Largest value of a lane.
pub(super) const LANE_MAX: f32 = 65535.0;
/// Largest value of a place of the first coefficient of a coded color.
pub(super) const BASE_MAX: f32 = 1023.0;

/// First lane of the mean.
pub(super) const MEAN: usize = 0;
/// Lane of the temporal mean.
pub(super) const MEAN_T: usize = 3;
/// First lane of the displacement.
pub(super) const DISPLACEMENT: usize = 4;
/// Lane of the logarithm of σ_t.
pub(super) const SIGMA_T: usize = 7;
/// First lane of the logarithm of the scale.
pub(super) const SCALE: usize = 8;
/// First lane of the rotation.
pub(super) const ROTATION: usize = 11;
/// Lane of the opacity.
pub(super) const OPACITY: usize = 14;
/// Lane of which component of the rotation is left out.
pub(super) const LEFT_OUT: usize = 15;

/// Lane [`SIGMA_T`] of a Gaussian that is always there.
pub(super) const ALWAYS: u16 = u16::MAX;
/// The place of no displacement.
pub(super) const AT_REST: f32 = 32768.0;
/// From there to the place of the largest one.
pub(super) const FARTHEST: f32 = 32767.0;

/// Ends of the lanes that all Gaussians share. A lane of fewer bits never reaches 65535: sizes and stretches make up for it.
#[derive(Debug, Clone, Copy)]
pub(super) struct SharedRanges {
    /// Low end and size of the temporal mean, timestamp units.
    pub mean_t: [f32; 2],
    /// Low end and size of the logarithm of σ_t.
    pub log_sigma_t: [f32; 2],
    /// Low end and size of the logarithm of the scale.
    pub log_scale: [f32; 2],
    /// Factor on the places of the rotation.
    pub rotation_stretch: f32,
    /// Factor on the place of the opacity.
    pub opacity_stretch: f32,
    /// Low end and size of the first coefficient of coded colors.
    pub base: [f32; 2],
}

/// Ends of the lanes of one block.
#[derive(Debug, Clone, Copy)]
pub(super) struct BlockRanges {
    /// Low corner of the box of the means, capture units.
    pub mean_low: [f32; 3],
    /// Its size.
    pub mean_size: [f32; 3],
    /// Largest displacement, capture units.
    pub displacement: f32,
    /// 1 over the time interval: velocity = displacement · max(1 / σ_t, rate), since nothing is seen to move for longer.
    pub rate: f32,
}

impl SharedRanges {
    /// Those of a scene; panics if `ranges` is too short.
    pub fn read(ranges: &[[f32; 4]]) -> Self {
        let [t_low, t_size, sigma_low, sigma_size] = ranges[0];
        let [scale_low, scale_size, rotation_stretch, opacity_stretch] = ranges[1];
        let [base_low, base_size, ..] = ranges[2];
        Self {
            mean_t: [t_low, t_size],
            log_sigma_t: [sigma_low, sigma_size],
            log_scale: [scale_low, scale_size],
            rotation_stretch,
            opacity_stretch,
            base: [base_low, base_size],
        }
    }

    /// The four-vectors that [`read`](Self::read) reads.
    pub fn write(self) -> [[f32; 4]; SHARED_RANGES] {
        let Self { mean_t, log_sigma_t, log_scale, rotation_stretch, opacity_stretch, base } = self;
        [
            [mean_t[0], mean_t[1], log_sigma_t[0], log_sigma_t[1]],
            [log_scale[0], log_scale[1], rotation_stretch, opacity_stretch],
            [base[0], base[1], 0.0, 0.0],
        ]
    }
}

impl BlockRanges {
    /// Those of the block that Gaussian `index` belongs to; panics if `ranges` is too short.
    pub fn read(ranges: &[[f32; 4]], index: usize) -> Self {
        let first = SHARED_RANGES + index / BLOCK * BLOCK_RANGES;
        let ([x, y, z, displacement], [width, height, depth, rate]) = (ranges[first], ranges[first + 1]);
        Self { mean_low: [x, y, z], mean_size: [width, height, depth], displacement, rate }
    }

    /// The four-vectors that [`read`](Self::read) reads.
    pub fn write(self) -> [[f32; 4]; BLOCK_RANGES] {
        let ([x, y, z], [width, height, depth]) = (self.mean_low, self.mean_size);
        [[x, y, z, self.displacement], [width, height, depth, self.rate]]
    }
}

/// The record of these lanes.
pub(super) fn pack(lanes: [u16; LANES]) -> [u32; RECORD_WORDS] {
    std::array::from_fn(|word| u32::from(lanes[2 * word]) | u32::from(lanes[2 * word + 1]) << 16)
}

/// The lanes of a record.
pub(super) fn unpack(record: [u32; RECORD_WORDS]) -> [u16; LANES] {
    std::array::from_fn(|lane| (record[lane / 2] >> (16 * (lane % 2))) as u16)
}

/// The color record of the places of a first coefficient, with every code 0.
pub(super) fn pack_base([r, g, b]: [u32; 3]) -> [u32; COLOR_WORDS] {
    [r | g << 10 | b << 20, 0, 0]
}

/// The places of the first coefficient of a color record.
pub(super) fn unpack_base(record: [u32; COLOR_WORDS]) -> [u32; 3] {
    [0, 10, 20].map(|shift| record[0] >> shift & 1023)
}

/// Puts a code of 16 bits into a color record that has none there yet.
pub(super) fn pack_code(record: &mut [u32; COLOR_WORDS], stage: usize, code: u16) {
    record[1 + stage / 2] |= u32::from(code) << (16 * (stage % 2));
}

/// A code of a color record.
pub(super) fn unpack_code(record: [u32; COLOR_WORDS], stage: usize) -> u32 {
    record[1 + stage / 2] >> (16 * (stage % 2)) & 0xffff
}
