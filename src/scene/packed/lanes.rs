//! The lanes of packed records: the position and the range of each value.
//!
//! In: quantized positions, codes, and the ranges of the positions. Out: the words of records and ranges; and back. The
//! encoder and the decoder both use this table; `shaders/shared/packed.wgsl` repeats it.
//!
//! A record of geometry is 16 lanes of 16 bits, each a position in a range:
//!
//! | lane | value | range |
//! |---|---|---|
//! | 0-2 | mean, capture units | box of the block of 256 Gaussians |
//! | 3 | temporal mean, timestamp units | all Gaussians |
//! | 4-6 | displacement (velocity · σ_t, or less: see `BlockRanges::rate`), square root with sign, around 32768 | largest of the block |
//! | 7 | logarithm of σ_t; 65535: infinite, at rest | all Gaussians |
//! | 8-10 | logarithm of the scale along the rotated axes | all Gaussians |
//! | 11-13 | the three smaller components of the rotation | ±1/√2 |
//! | 14 | opacity | 0 to 1 |
//! | 15 | which component of the rotation (w, x, y, z) is left out | |
//!
//! A record of coded color is one word with three positions of 10 bits, the DC coefficient, and two words with four
//! codes of 16 bits.

/// Number of Gaussians in a block, for which the range of the means is stored.
pub const BLOCK: usize = 256;
/// Number of four-vectors of [`PackedScene::ranges`](super::PackedScene::ranges) before those of the blocks.
pub const SHARED_RANGES: usize = 3;
/// Number of four-vectors of each block.
pub const BLOCK_RANGES: usize = 2;
/// Number of words of a record of geometry.
pub const RECORD_WORDS: usize = 8;
/// Number of words of a record of coded color.
pub const COLOR_WORDS: usize = 3;
/// Largest number of codebooks, whose entries are summed.
pub const MAX_STAGES: usize = 4;
/// Largest number of entries of a codebook, which has codes of 16 bits.
pub const MAX_ENTRIES: u32 = 1 << 16;

/// Number of lanes of a record of geometry.
pub(super) const LANES: usize = 2 * RECORD_WORDS;
/// Largest value of a lane.
pub(super) const LANE_MAX: f32 = 65535.0;
/// Largest position of the DC coefficient of a coded color.
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
/// Lane with the index of the component of the rotation that is left out.
pub(super) const LEFT_OUT: usize = 15;

/// Value of lane [`SIGMA_T`] for an infinite σ_t: the Gaussian is present at every time.
pub(super) const ALWAYS: u16 = u16::MAX;
/// Lane value of displacement 0.
pub(super) const AT_REST: f32 = 32768.0;
/// Difference of the lane value of the largest displacement from [`AT_REST`].
pub(super) const FARTHEST: f32 = 32767.0;

/// Ranges of the lanes that all Gaussians share. A lane of fewer bits never reaches 65535; sizes and stretches
/// compensate for it.
#[derive(Debug, Clone, Copy)]
pub(super) struct SharedRanges {
    /// Low end and size of the temporal mean, timestamp units.
    pub mean_t: [f32; 2],
    /// Low end and size of the logarithm of σ_t.
    pub log_sigma_t: [f32; 2],
    /// Low end and size of the logarithm of the scale.
    pub log_scale: [f32; 2],
    /// Factor on the positions of the rotation.
    pub rotation_stretch: f32,
    /// Factor on the position of the opacity.
    pub opacity_stretch: f32,
    /// Low end and size of the DC coefficient of coded colors.
    pub base: [f32; 2],
}

/// Ranges of the lanes of one block.
#[derive(Debug, Clone, Copy)]
pub(super) struct BlockRanges {
    /// Low corner of the box of the means, capture space.
    pub mean_low: [f32; 3],
    /// Size of the box, capture units.
    pub mean_size: [f32; 3],
    /// Largest displacement, capture units.
    pub displacement: f32,
    /// 1 over the length of the time interval: velocity = displacement · max(1 / σ_t, rate), since motion is visible in
    /// the interval only.
    pub rate: f32,
}

impl SharedRanges {
    /// Reads the ranges of a scene; panics if `ranges` is too short.
    pub(super) fn read(ranges: &[[f32; 4]]) -> Self {
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

    /// Returns the four-vectors that [`read`](Self::read) reads.
    pub(super) fn write(self) -> [[f32; 4]; SHARED_RANGES] {
        let Self { mean_t, log_sigma_t, log_scale, rotation_stretch, opacity_stretch, base } = self;
        [
            [mean_t[0], mean_t[1], log_sigma_t[0], log_sigma_t[1]],
            [log_scale[0], log_scale[1], rotation_stretch, opacity_stretch],
            [base[0], base[1], 0.0, 0.0],
        ]
    }
}

impl BlockRanges {
    /// Reads the ranges of the block that Gaussian `index` belongs to; panics if `ranges` is too short.
    pub(super) fn read(ranges: &[[f32; 4]], index: usize) -> Self {
        let first = SHARED_RANGES + index / BLOCK * BLOCK_RANGES;
        let ([x, y, z, displacement], [width, height, depth, rate]) = (ranges[first], ranges[first + 1]);
        Self { mean_low: [x, y, z], mean_size: [width, height, depth], displacement, rate }
    }

    /// Returns the four-vectors that [`read`](Self::read) reads.
    pub(super) fn write(self) -> [[f32; 4]; BLOCK_RANGES] {
        let ([x, y, z], [width, height, depth]) = (self.mean_low, self.mean_size);
        [[x, y, z, self.displacement], [width, height, depth, self.rate]]
    }
}

/// Returns the record of these lanes.
pub(super) fn pack(lanes: [u16; LANES]) -> [u32; RECORD_WORDS] {
    std::array::from_fn(|word| u32::from(lanes[2 * word]) | u32::from(lanes[2 * word + 1]) << 16)
}

/// Returns the lanes of a record.
pub(super) fn unpack(record: [u32; RECORD_WORDS]) -> [u16; LANES] {
    std::array::from_fn(|lane| (record[lane / 2] >> (16 * (lane % 2))) as u16)
}

/// Returns the record with opacity 0.
pub(super) fn hidden(record: [u32; RECORD_WORDS]) -> [u32; RECORD_WORDS] {
    let mut lanes = unpack(record);
    lanes[OPACITY] = 0;
    pack(lanes)
}

/// Returns the lane of a record with the index of the component of the rotation that is left out.
pub(super) fn left_out(record: [u32; RECORD_WORDS]) -> u32 {
    record[LEFT_OUT / 2] >> (16 * (LEFT_OUT % 2)) & 0xffff
}

/// Returns the color record of the positions of a DC coefficient, with every code 0.
pub(super) fn pack_base([r, g, b]: [u32; 3]) -> [u32; COLOR_WORDS] {
    [r | g << 10 | b << 20, 0, 0]
}

/// Returns the positions of the DC coefficient of a color record.
pub(super) fn unpack_base(record: [u32; COLOR_WORDS]) -> [u32; 3] {
    [0, 10, 20].map(|shift| record[0] >> shift & 1023)
}

/// Writes a code of 16 bits into a color record in which it is 0.
pub(super) fn pack_code(record: &mut [u32; COLOR_WORDS], stage: usize, code: u16) {
    record[1 + stage / 2] |= u32::from(code) << (16 * (stage % 2));
}

/// Returns a code of a color record.
pub(super) fn unpack_code(record: [u32; COLOR_WORDS], stage: usize) -> u32 {
    record[1 + stage / 2] >> (16 * (stage % 2)) & 0xffff
}
