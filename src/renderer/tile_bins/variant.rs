//! The variants of the passes of tile bins.
//!
//! In: the limits of a device, the number of Gaussians, the targets and surfaces of a view. Out: [`BinVariant`], and the shader definitions of
//! its passes.

use crate::renderer::frame::Blending;
use crate::renderer::shaders::{ColorPrecision, Pixels};

/// Capacity of the list of splats that `sort_bins` sorts in workgroup memory. With a small capacity, more workgroups run at the same time;
/// bins with more splats are sorted in rounds.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Lists {
    /// 1280 splats, 256 threads: for every device.
    #[default]
    Short,
    /// 2304 splats, 512 threads.
    Medium,
    /// 5120 splats, 512 threads.
    Long,
}

impl Lists {
    /// All lengths.
    pub const ALL: [Self; 3] = [Self::Short, Self::Medium, Self::Long];

    /// Returns the definitions of `sort_bins`.
    pub fn definitions(self) -> &'static [&'static str] {
        match self {
            Self::Short => &[],
            Self::Medium => &["MEDIUM_LISTS"],
            Self::Long => &["LONG_LISTS"],
        }
    }

    /// Returns the number of splats that `sort_bins` sorts at once, and its threads: `LIST` and `THREADS` of the shader.
    pub(in crate::renderer) fn sizes(self) -> [u32; 2] {
        match self {
            Self::Short => [1280, 256],
            Self::Medium => [2304, 512],
            Self::Long => [5120, 512],
        }
    }

    /// Returns an upper bound of the workgroup memory of `sort_bins` with these lists, bytes.
    pub fn memory(self) -> u32 {
        match self {
            Self::Short => 16 * 1024,
            Self::Medium => 32 * 1024,
            Self::Long => 48 * 1024,
        }
    }

    /// Returns the length that suits a device and the number of splats of the fullest bin.
    pub(in crate::renderer) fn suiting(limits: &wgpu::Limits, fullest: u32) -> Self {
        let memory = limits.max_compute_workgroup_storage_size;
        let threads = limits.max_compute_workgroup_size_x.min(limits.max_compute_invocations_per_workgroup);
        if threads < 512 || memory < Self::Medium.memory() {
            Self::Short
        } else if fullest <= Self::Medium.sizes()[0] || memory < Self::Long.memory() {
            Self::Medium
        } else {
            Self::Long
        }
    }
}

/// Definitions of `blend_blocks` for small pictures.
pub const LARGE_BATCHES: &[&str] = &["LARGE_BATCHES"];

/// Definitions of `blend_blocks` for small pictures with [`Blending::Color`] and [`Blending::ColorBehindSurfaces`]: each thread processes more
/// splats of its pixel at once, since few threads run.
pub const EIGHT_AT_ONCE: &[&str] = &["LARGE_BATCHES", "EIGHT_AT_ONCE"];

/// The definition of `sort_bins` for bins that are counted before they are filled.
pub const COUNTED: &[&str] = &["COUNTED"];

/// Definitions of `project_bin` for at most 512 bins.
pub const FEW_BINS: &[&str] = &["FEW_BINS"];

/// The definition of `project_bin` for frames behind opaque surfaces.
pub const OPAQUE: &[&str] = &["OPAQUE"];

/// The number of counters of bins with [`FEW_BINS`].
pub(super) const FEW_BINS_LIMIT: u32 = 512;

/// The variants of the passes of a frame.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(in crate::renderer) struct BinVariant {
    pub few_bins: bool,
    /// Whether bins are counted before they are filled, and have exact room, in place of room for the same number of splats.
    pub counted: bool,
    pub lists: Lists,
    pub blending: Blending,
    pub precision: ColorPrecision,
    pub large_batches: bool,
}

impl BinVariant {
    /// Number of variants of `blend_blocks`.
    pub(in crate::renderer) const BLENDS: usize = 4 * Blending::ALL.len();

    /// Returns the index of its `blend_blocks`, below [`BLENDS`](Self::BLENDS).
    pub(in crate::renderer) fn blend_index(self) -> usize {
        (self.blending as usize * 2 + self.precision as usize) * 2 + usize::from(self.large_batches)
    }

    /// Returns the definitions of `project_bin`.
    pub(in crate::renderer) fn project_definitions(self) -> Vec<&'static str> {
        let few = if self.few_bins { FEW_BINS } else { &[] };
        [few, if self.blending.leaves_out_hidden() { OPAQUE } else { &[] }].concat()
    }

    /// Returns the definitions of `sort_bins`.
    pub(in crate::renderer) fn sort_definitions(self) -> Vec<&'static str> {
        [self.lists.definitions(), if self.counted { COUNTED } else { &[] }].concat()
    }

    /// Returns the definitions of `blend_blocks`.
    pub(in crate::renderer) fn blend_definitions(self) -> Vec<&'static str> {
        let batches = match self.blending {
            _ if !self.large_batches => &[],
            Blending::Color | Blending::ColorBehindSurfaces => EIGHT_AT_ONCE,
            _ => LARGE_BATCHES,
        };
        [self.blending.definitions(), self.precision.definitions(), batches].concat()
    }

    /// Returns the other variants that draw the same picture, perhaps not as fast: with lists of other lengths, counters for any number of bins,
    /// batches of another size, bins that are counted first. Bins that are to be counted are: without, they may have no room.
    pub(in crate::renderer) fn substitutes(self) -> impl Iterator<Item = Self> {
        let bins = if self.few_bins { &[true, false][..] } else { &[false] };
        let lists = [self.lists].into_iter().chain(Lists::ALL);
        let batches = [self.large_batches, !self.large_batches];
        let counted: &[bool] = if self.counted { &[true] } else { &[false, true] };
        lists
            .flat_map(move |lists| batches.map(|large_batches| Self { lists, large_batches, ..self }))
            .flat_map(move |variant| counted.iter().map(move |&counted| Self { counted, ..variant }))
            .flat_map(move |variant| bins.iter().map(move |&few_bins| Self { few_bins, ..variant }))
    }

    pub(in crate::renderer) fn pixels(self) -> Pixels {
        Pixels { multisampled: self.blending.is_multisampled(), precision: self.precision }
    }
}
