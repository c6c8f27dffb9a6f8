//! The buffers of a capture, which `project` and `activate` read.
//!
//! In: the [`Form`] of a scene, its filter and its environment map, and a range of its Gaussians. Out: storage buffers in the order of the
//! shader's bindings, which are filled in chunks. Packed scenes are uploaded without unpacking. `scene/gaussian_bytes.rs` has the size of all
//! for each Gaussian.

use crate::gaussian::Gaussian;
use crate::renderer::device::memory::Allocator;
use crate::scene::packed::{BLOCK, BLOCK_RANGES, COLOR_WORDS, RECORD_WORDS, SHARED_RANGES};
use crate::scene::{ActiveSets, CodedColors, Environment, Form, RuntimeScene, TemporalFilter};
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Largest number of bytes that are converted and written at once. It limits the memory of converted records on the host.
pub(super) const BYTES_AT_ONCE: u64 = 1 << 20;

/// A buffer of records and the number of records written.
#[derive(Debug)]
pub(super) struct Filling {
    pub buffer: wgpu::Buffer,
    content: Content,
    /// The range of Gaussians in the buffer.
    own: Range<usize>,
    /// Bytes of a record.
    size: usize,
    /// Number of records.
    count: usize,
    /// Number of records that have been written.
    done: usize,
    /// Tells other captures that all records have been written, if they share the buffer.
    is_filled: Option<Arc<AtomicBool>>,
}

/// A kind of buffers.
#[derive(Debug, Clone, Copy)]
pub(super) struct Kind {
    pub label: &'static str,
    pub content: Content,
    /// Bytes of a record.
    pub size: usize,
}

impl Kind {
    /// Returns the number of records of so many Gaussians, from the beginning of a block.
    pub(super) fn records(&self, gaussians: usize) -> usize {
        match self.content {
            Content::Ranges => SHARED_RANGES + gaussians.div_ceil(BLOCK) * BLOCK_RANGES,
            _ => gaussians,
        }
    }
}

/// The content of a buffer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Content {
    /// Gaussians, with `1/σ_t` in place of `σ_t`: zero instead of infinity.
    Gaussians,
    /// A copy of `mean_t` and `1/σ_t`.
    Lifespans,
    /// The coefficients that are evaluated, padded to whole four-vectors per Gaussian.
    Harmonics,
    /// Packed geometry.
    Records,
    /// The ranges of all Gaussians, then the ranges of each block.
    Ranges,
    /// Colors by codebook.
    ColorRecords,
    /// All codebooks, entry by entry.
    Codebooks,
    /// The words of all Gaussians, segment after segment; or one word with an interval for each Gaussian.
    Filter,
    /// The texels of the environment map.
    Environment,
}

/// Returns the bytes of one Gaussian in the largest buffer. `stride` is the number of four-vectors per Gaussian if coefficients are stored
/// whole.
pub(super) fn largest_record(form: &Form, stride: usize) -> u64 {
    let geometry = match form {
        Form::Sliced(_) => size_of::<Gaussian>(),
        Form::Packed(_) => size_of::<[u32; RECORD_WORDS]>(),
    };
    let color = form.coded_colors().map_or(stride * size_of::<[f32; 4]>(), |_| size_of::<[u32; COLOR_WORDS]>());
    geometry.max(color) as u64
}

/// Returns the kinds of buffers of the geometry.
pub(super) fn geometry_kinds(form: &Form) -> [Kind; 2] {
    let kind = |label, content, size| Kind { label, content, size };
    match form {
        Form::Sliced(_) => [
            kind("gs4d gaussians", Content::Gaussians, size_of::<Gaussian>()),
            kind("gs4d lifespans", Content::Lifespans, size_of::<[f32; 2]>()),
        ],
        Form::Packed(_) => [
            kind("gs4d records", Content::Records, size_of::<[u32; RECORD_WORDS]>()),
            kind("gs4d ranges", Content::Ranges, size_of::<[f32; 4]>()),
        ],
    }
}

/// Returns the kind of the buffer of colors, without codebooks. `stride` as for [`largest_record`].
pub(super) fn color_kind(form: &Form, stride: usize) -> Kind {
    match form.coded_colors() {
        Some(_) => {
            Kind { label: "gs4d color records", content: Content::ColorRecords, size: size_of::<[u32; COLOR_WORDS]>() }
        }
        None => Kind { label: "gs4d harmonics", content: Content::Harmonics, size: stride * 16 },
    }
}

/// Creates the buffers of the geometry of the Gaussians in `own`, which starts at a multiple of a block.
pub(super) fn geometry(allocator: Allocator<'_>, form: &Form, own: Range<usize>) -> [Filling; 2] {
    geometry_kinds(form).map(|kind| Filling::new(allocator, kind, own.clone(), kind.records(own.len())))
}

/// Creates the buffer of the colors of the Gaussians in `own`, without codebooks. `stride` as for [`largest_record`].
pub(super) fn color(allocator: Allocator<'_>, form: &Form, own: Range<usize>, stride: usize) -> Filling {
    let count = own.len();
    Filling::new(allocator, color_kind(form, stride), own, count)
}

/// Returns the words of one codebook entry on the GPU: 48 half-precision values for each time harmonic, independent of the spatial degree.
pub(super) fn entry_words(colors: &CodedColors) -> usize {
    colors.words_per_entry().next_multiple_of(12) * 2
}

/// Coefficients of a share (a partial sum) of a color, number of shares, and words of one share that are contiguous: as in `coded_share` of
/// the shaders.
const SHARE_COEFFICIENTS: usize = 4;
const SHARES: usize = 4;
const SIDE_BY_SIDE: usize = 4;

/// Returns the index on the GPU of a value of an entry of `words` words. RGB is innermost; the words of the shares of a color are interleaved
/// in groups of four words, then in groups of the remaining two, if any.
fn place_in_entry(index: usize, words: usize) -> usize {
    let (harmonic, value) = (index / 48, index % 48);
    let values = SHARE_COEFFICIENTS * 3;
    let (share, own) = (value / values, harmonic * values + value % values);
    let (word, half) = (own / 2, own % 2);
    let whole = words / SHARES / SIDE_BY_SIDE * SIDE_BY_SIDE;
    let turn = if word < whole { SIDE_BY_SIDE } else { words / SHARES - whole };
    let at = word / SIDE_BY_SIDE * SIDE_BY_SIDE * SHARES + share * turn + word % SIDE_BY_SIDE;
    2 * at + half
}

/// Creates the buffer of all codebooks.
pub(super) fn codebooks(allocator: Allocator<'_>, colors: &CodedColors) -> wgpu::Buffer {
    storage(allocator, "gs4d codebooks", colors.codebooks.total().max(1) * entry_words(colors) * 4)
}

/// Fills the buffer of all codebooks; then `is_filled` is true.
pub(super) fn codebooks_in(buffer: wgpu::Buffer, colors: &CodedColors, is_filled: Arc<AtomicBool>) -> Filling {
    let (size, count) = (entry_words(colors) * 4, colors.codebooks.total());
    Filling { buffer, content: Content::Codebooks, own: 0..0, size, count, done: 0, is_filled: Some(is_filled) }
}

/// Creates a buffer of this many bytes that shaders read. A binding of no bytes is not allowed.
pub(super) fn storage(allocator: Allocator<'_>, label: &str, bytes: usize) -> wgpu::Buffer {
    // A binding of no bytes is not allowed.
    allocator.buffer(label, bytes as u64, wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC)
}

/// The kind of the buffers of active sets.
pub(super) const FILTER_KIND: Kind = Kind { label: "gs4d filter", content: Content::Filter, size: size_of::<u32>() };

/// Creates the buffer of the active sets of the Gaussians in `own`, which starts at a multiple of 32.
pub(super) fn filter(allocator: Allocator<'_>, filter: &TemporalFilter, own: Range<usize>) -> Filling {
    let count = match &filter.sets {
        ActiveSets::Bits(_) => own_words(&own).len() * filter.segments as usize,
        ActiveSets::Intervals(_) => own.len(),
    };
    Filling::new(allocator, FILTER_KIND, own, count)
}

/// Creates the buffer of an environment map.
pub(super) fn environment(allocator: Allocator<'_>, map: &Environment) -> Filling {
    let kind = Kind { label: "gs4d environment", content: Content::Environment, size: size_of::<f32>() };
    Filling::new(allocator, kind, 0..0, map.texels.len())
}

/// Returns the range of words of these Gaussians in a bit set.
fn own_words(own: &Range<usize>) -> Range<usize> {
    own.start / 32..own.end.div_ceil(32)
}

impl Filling {
    /// Creates a buffer. It is filled through the queue, since mapping would panic on a lost device.
    fn new(allocator: Allocator<'_>, Kind { label, content, size }: Kind, own: Range<usize>, count: usize) -> Self {
        let buffer = storage(allocator, label, count.max(1) * size);
        Self { buffer, content, own, size, count, done: 0, is_filled: None }
    }

    /// Returns the bytes of a record.
    pub(super) fn record_size(&self) -> u64 {
        self.size as u64
    }

    /// Returns the bytes that have not been written.
    pub(super) fn bytes_left(&self) -> u64 {
        (self.count - self.done) as u64 * self.size as u64
    }

    /// Writes at most `bytes` of the remaining bytes, but at least one record, and returns the number of bytes written. `chunk` is scratch
    /// memory.
    pub(super) fn fill(&mut self, queue: &wgpu::Queue, scene: &RuntimeScene, bytes: u64, chunk: &mut Vec<u8>) -> u64 {
        let most = (bytes.min(BYTES_AT_ONCE) / self.size as u64).max(1) as usize;
        let records = self.done..self.count.min(self.done + most);
        // Padding is zero.
        chunk.clear();
        chunk.resize(records.len() * self.size, 0);
        self.convert(scene, records.clone(), chunk);
        queue.write_buffer(&self.buffer, (records.start * self.size) as u64, chunk);
        self.done = records.end;
        if let Some(is_filled) = self.is_filled.as_ref().filter(|_| self.done == self.count) {
            is_filled.store(true, Ordering::Relaxed);
        }
        chunk.len() as u64
    }

    /// Writes all active sets of another filter of the same number of Gaussians.
    pub(super) fn fill_filter(&self, queue: &wgpu::Queue, filter: &TemporalFilter) {
        let mut words = vec![0; self.count * self.size];
        self.convert_filter(filter, 0..self.count, &mut words);
        queue.write_buffer(&self.buffer, 0, &words);
    }

    /// Converts a range of records. Returns `None` if the buffer does not belong to the form of this scene.
    fn convert(&self, scene: &RuntimeScene, records: Range<usize>, to: &mut [u8]) -> Option<()> {
        match self.content {
            Content::Codebooks => convert_entries(scene.form.coded_colors()?, records.start, self.size, to),
            Content::Filter => self.convert_filter(scene.filter.as_ref()?, records, to),
            Content::Environment => {
                to.copy_from_slice(bytemuck::cast_slice(&scene.environment.as_ref()?.texels[records]));
            }
            of_gaussians => convert(of_gaussians, &scene.form, self.own.start, records, to)?,
        }
        Some(())
    }

    fn convert_filter(&self, filter: &TemporalFilter, records: Range<usize>, to: &mut [u8]) {
        match &filter.sets {
            ActiveSets::Bits(bits) => {
                let (all, words) = (TemporalFilter::words(filter.count), own_words(&self.own));
                each(records, self.size, to, |index, record| {
                    let word = bits[index / words.len() * all + words.start + index % words.len()];
                    record.copy_from_slice(bytemuck::bytes_of(&word));
                });
            }
            ActiveSets::Intervals(intervals) => {
                let own = self.own.start + records.start..self.own.start + records.end;
                to.copy_from_slice(bytemuck::cast_slice(&intervals[own]));
            }
        }
    }
}

/// Converts a range of records of geometry or color of the Gaussians from `first` on, which starts a block. Returns `None`
/// if the form has no such records.
pub(super) fn convert(content: Content, form: &Form, first: usize, records: Range<usize>, to: &mut [u8]) -> Option<()> {
    if records.is_empty() {
        return Some(());
    }
    let (own, size) = (first + records.start..first + records.end, to.len() / records.len());
    match content {
        Content::Gaussians => {
            let gaussians = &form.as_sliced()?.gaussians;
            each(own, size, to, |index, record| {
                let gaussian = gaussians[index];
                let sigma_t = gaussian.sigma_t.recip();
                record.copy_from_slice(bytemuck::bytes_of(&Gaussian { sigma_t, ..gaussian }));
            });
        }
        Content::Lifespans => {
            let gaussians = &form.as_sliced()?.gaussians;
            each(own, size, to, |index, record| {
                let Gaussian { mean_t, sigma_t, .. } = gaussians[index];
                record.copy_from_slice(bytemuck::bytes_of(&[mean_t, sigma_t.recip()]));
            });
        }
        Content::Harmonics => {
            let harmonics = form.harmonics()?;
            let used = harmonics.evaluated() * 3;
            each(own, size, to, |index, record| {
                record[..used * 4].copy_from_slice(bytemuck::cast_slice(&harmonics.of(index)[..used]));
            });
        }
        Content::Records => to.copy_from_slice(bytemuck::cast_slice(&form.as_packed()?.records[own])),
        Content::Ranges => {
            let ranges = &form.as_packed()?.ranges;
            let before = first / BLOCK * BLOCK_RANGES;
            each(records, size, to, |index, record| {
                let index = if index < SHARED_RANGES { index } else { before + index };
                record.copy_from_slice(bytemuck::bytes_of(&ranges[index]));
            });
        }
        Content::ColorRecords => to.copy_from_slice(bytemuck::cast_slice(&form.coded_colors()?.records[own])),
        Content::Codebooks | Content::Filter | Content::Environment => return None,
    }
    Some(())
}

/// Converts entries of the codebooks, from the entry `first` on, of `size` bytes each.
fn convert_entries(colors: &CodedColors, first: usize, size: usize, to: &mut [u8]) {
    for ((words, scales), record) in colors.all_entries().skip(first).zip(to.chunks_exact_mut(size)) {
        let halves = words.iter().zip(scales).flat_map(|(&word, scale)| CodedColors::values(word, scale));
        for (index, half) in halves.enumerate() {
            let at = 2 * place_in_entry(index, size / 4);
            record[at..at + 2].copy_from_slice(&half.to_ne_bytes());
        }
    }
}

/// Calls `fill` with the index and the bytes of each record.
fn each(records: Range<usize>, size: usize, to: &mut [u8], fill: impl Fn(usize, &mut [u8])) {
    for (index, record) in records.zip(to.chunks_exact_mut(size)) {
        fill(index, record);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_of_an_entry_have_distinct_indices() {
        for words in [24, 48, 72] {
            let mut places: Vec<usize> = (0..2 * words).map(|index| place_in_entry(index, words)).collect();
            places.sort_unstable();
            assert!(places.iter().copied().eq(0..2 * words), "the indices are a permutation, {words} words");
        }
    }

    #[test]
    fn words_of_the_shares_are_interleaved() {
        // Red of the first coefficient of each share, then blue of the last coefficient of the last harmonic.
        let first: Vec<usize> = (0..4).map(|share| place_in_entry(12 * share, 72)).collect();
        assert_eq!(first, [0, 8, 16, 24], "groups of four words");
        let last: Vec<usize> = (0..4).map(|share| place_in_entry(96 + 12 * share + 11, 72)).collect();
        assert_eq!(last, [131, 135, 139, 143], "the last value of groups of two words");
    }
}
