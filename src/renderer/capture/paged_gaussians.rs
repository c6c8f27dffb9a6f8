//! The Gaussians of a capture in chunk files, on the GPU.
//!
//! In: files, one after another. Out: [`PagedGaussians`], which knows the buffers, the pages of each file, and what all files
//! have in common: a file that differs is refused.

use super::instance_settings::settings;
use super::page_buffers::{PageBuffer, PageKind};
use super::pages::{Pages, PartListing};
use crate::renderer::device::GpuError;
use crate::renderer::layout::{InstanceUniforms, PAGE};
use crate::renderer::shaders::Storage;
use crate::scene::packed::SHARED_RANGES;
use crate::scene::{ActiveSets, ChunkTable, ColorCodebooks, FilterKind, Form, RuntimeScene, TemporalFilter};
use std::ops::Range;
use std::sync::Arc;

/// The Gaussians of a capture in chunk files.
#[derive(Debug)]
pub(in crate::renderer) struct PagedGaussians {
    pub(super) table: Arc<ChunkTable>,
    pub(super) pages: Pages,
    /// The kinds of buffers: geometry, color, active sets if there is a filter.
    pub(super) kinds: Vec<PageKind>,
    /// The buffers of each part, of these kinds.
    pub(super) buffers: Vec<Vec<PageBuffer>>,
    /// The codebooks and their buffer, if colors are coded.
    pub(super) codebooks: Option<(Arc<ColorCodebooks>, wgpu::Buffer)>,
    /// Whether the sets of the filter are bits; `None` without a filter.
    pub(super) has_bits: Option<bool>,
    /// Bytes of a page as the table counts them, and those that are written.
    pub(super) page_bytes: u64,
    pub(super) written_bytes: u64,
    /// Gaussians of all files of the table.
    pub(super) all: u64,
    /// What all files share.
    pub(super) shared: Shared,
}

/// What all chunk files of a capture share, besides codebooks.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Shared {
    pub storage: Storage,
    pub settings: InstanceUniforms,
    /// The first ranges, of packed Gaussians.
    pub ranges: Vec<[f32; 4]>,
    pub interval: [f32; 2],
    /// Number of segments of the filter; 0 without one.
    pub segments: u32,
    /// Whether it is a filter of windows.
    pub is_window: bool,
}

impl Shared {
    pub(super) fn of(scene: &RuntimeScene) -> Self {
        let ranges = match &scene.form {
            Form::Sliced(_) => &[],
            Form::Packed(packed) => &packed.ranges[..packed.ranges.len().min(SHARED_RANGES)],
        };
        Self {
            storage: Storage::of(&scene.form),
            settings: settings(scene),
            ranges: ranges.to_vec(),
            interval: scene.trained_with.time_interval,
            segments: scene.filter.as_ref().map_or(0, |filter| filter.segments),
            is_window: scene.filter.as_ref().is_some_and(|filter| filter.kind == FilterKind::Window),
        }
    }
}

/// Returns the codebooks of a scene, if its colors are coded.
pub(super) fn codebooks_of(scene: &RuntimeScene) -> Option<&Arc<ColorCodebooks>> {
    scene.form.coded_colors().map(|colors| &colors.codebooks)
}

/// Returns whether two captures have the same codebooks, which they usually share.
pub(super) fn are_same(a: Option<&Arc<ColorCodebooks>>, b: Option<&Arc<ColorCodebooks>>) -> bool {
    match (a, b) {
        (Some(a), Some(b)) => Arc::ptr_eq(a, b) || a == b,
        (None, None) => true,
        (Some(_), None) | (None, Some(_)) => false,
    }
}

impl PagedGaussians {
    /// Returns what is listed of each part in segments, from the first to the last.
    pub(in crate::renderer) fn listing(&self, segments: [u32; 2]) -> Vec<PartListing> {
        self.pages.listing(segments)
    }

    /// Returns a number that changes with the files that can be drawn.
    pub(in crate::renderer) fn version(&self) -> u64 {
        self.pages.version()
    }

    /// Returns the number of Gaussians of all files of the table.
    pub(in crate::renderer) fn all(&self) -> u64 {
        self.all
    }

    /// Returns the number of pages.
    pub(in crate::renderer) fn count(&self) -> u32 {
        self.pages.count()
    }

    /// Checks that a scene is a file of this capture.
    ///
    /// # Errors
    /// A description of the first part that does not fit.
    pub(super) fn check(&self, file: usize, scene: &RuntimeScene) -> Result<(), GpuError> {
        scene.check().map_err(GpuError::Scene)?;
        let most = self.table.files.get(file).map_or(0, |chunk| chunk.gaussians);
        if scene.len() as u64 > most {
            return Err(GpuError::Scene("it has more Gaussians than the index of the chunk files says"));
        }
        let has_codebooks = are_same(codebooks_of(scene), self.codebooks.as_ref().map(|(codebooks, _)| codebooks));
        if !has_codebooks || Shared::of(scene) != self.shared {
            return Err(GpuError::Scene("its settings, ranges or codebooks are not those of the other chunk files"));
        }
        Ok(())
    }

    /// Returns the filter of a file with sets as those of the other files, if it has others; `None` if it has the same.
    ///
    /// # Errors
    /// When the sets are no intervals.
    pub(super) fn converted(&self, filter: &TemporalFilter) -> Result<Option<TemporalFilter>, GpuError> {
        let sets = match (self.has_bits, &filter.sets) {
            (Some(true), ActiveSets::Intervals(_)) => ActiveSets::Bits(filter.to_bits()),
            (Some(false), ActiveSets::Bits(_)) => {
                let broken =
                    GpuError::Scene("its temporal filter is not one of intervals, as in the other chunk files");
                ActiveSets::Intervals(filter.to_intervals().ok_or(broken)?)
            }
            _ => return Ok(None),
        };
        Ok(Some(TemporalFilter { sets, ..filter.clone() }))
    }

    /// Takes pages for the Gaussians of a file. Returns `false` if too few are free.
    pub(super) fn place(&mut self, file: usize, gaussians: usize, filter: Option<&TemporalFilter>) -> bool {
        let Self { table, pages, .. } = self;
        pages.place(file, gaussians, |own| match filter {
            // Gaussians that are active outside the stretches of their file are not listed there: the table is the bound.
            Some(filter) => within_stretches(table, file, filter.active_counts(own)),
            None => all_in_stretches(table, file, own),
        })
    }
}

/// Returns numbers of each segment of time, or 0 in segments that have none of the stretches of a file.
fn within_stretches(table: &ChunkTable, file: usize, mut counts: Vec<u32>) -> Vec<u32> {
    let [first, last] = table.files.get(file).map_or([1, 0], |chunk| chunk.stretches);
    let segments = counts.len() as u32;
    for (segment, count) in (0..).zip(&mut counts) {
        let own = ChunkTable::stretches_of([segment; 2], segments, table.stretches);
        if own[1] < first || own[0] > last {
            *count = 0;
        }
    }
    counts
}

/// Returns how many Gaussians of a file without a filter are listed in each stretch of time: all of its pages in its stretches.
fn all_in_stretches(table: &ChunkTable, file: usize, own: Range<usize>) -> Vec<u32> {
    let mut counts = vec![0; table.stretches as usize];
    let stretches = table.files.get(file).map(|chunk| chunk.stretches.map(|stretch| stretch as usize));
    if let Some([first, last]) = stretches
        && let Some(counts) = counts.get_mut(first..=last)
    {
        counts.fill((own.len() as u32).next_multiple_of(PAGE));
    }
    counts
}
