//! The buffers of a capture in pages.
//!
//! In: the form and the filter of the first chunk file; the Gaussians of all files, some pages at a time. Out: storage
//! buffers, in the order of the shader's bindings, of a number of pages. Each page is written as a block of a capture that
//! is loaded whole; what a page has after the last Gaussian of a file is never active.

use super::buffers::{self, Content, FILTER_KIND, Kind};
use crate::renderer::device::memory::Allocator;
use crate::renderer::layout::PAGE;
use crate::scene::packed::{BLOCK_RANGES, SHARED_RANGES};
use crate::scene::{ActiveSets, Form, RuntimeScene, TemporalFilter};
use std::ops::Range;

/// Gaussians of a page.
const GAUSSIANS: usize = PAGE as usize;
/// Words of a page in the set of a segment.
const WORDS: usize = GAUSSIANS / 32;
/// An interval of no segment.
const NEVER: u32 = 0x0000_ffff;

/// The kind of a buffer in pages.
#[derive(Debug, Clone, Copy)]
pub(super) struct PageKind {
    kind: Kind,
    /// Records before the first page, and of a page.
    before: usize,
    per_page: usize,
}

impl PageKind {
    fn new(kind: Kind) -> Self {
        match kind.content {
            Content::Ranges => Self { kind, before: SHARED_RANGES, per_page: BLOCK_RANGES },
            _ => Self { kind, before: 0, per_page: GAUSSIANS },
        }
    }

    /// Returns the kinds of the buffers of geometry and color. `stride` is as for a capture that is loaded whole.
    pub(super) fn of_gaussians(form: &Form, stride: usize) -> [Self; 3] {
        let [a, b] = buffers::geometry_kinds(form);
        [a, b, buffers::color_kind(form, stride)].map(Self::new)
    }

    /// Returns the kind of the buffer of active sets.
    pub(super) fn of_filter(filter: &TemporalFilter) -> Self {
        let per_page = match filter.sets {
            ActiveSets::Bits(_) => WORDS * filter.segments as usize,
            ActiveSets::Intervals(_) => GAUSSIANS,
        };
        Self { kind: FILTER_KIND, before: 0, per_page }
    }

    /// Returns the bytes of a page.
    pub(super) fn page_bytes(&self) -> u64 {
        (self.per_page * self.kind.size) as u64
    }

    /// Returns the bytes before a page.
    fn offset(&self, page: u32) -> u64 {
        (self.before * self.kind.size) as u64 + u64::from(page) * self.page_bytes()
    }
}

/// A buffer in pages.
#[derive(Debug)]
pub(super) struct PageBuffer {
    kind: PageKind,
    pub buffer: wgpu::Buffer,
}

impl PageBuffer {
    /// Creates a buffer of a number of pages.
    pub(super) fn new(allocator: Allocator<'_>, kind: PageKind, pages: u32) -> Self {
        Self { kind, buffer: buffers::storage(allocator, kind.kind.label, kind.offset(pages) as usize) }
    }

    /// Writes what is before the first page: the ranges that all files share.
    pub(super) fn write_shared(&self, queue: &wgpu::Queue, shared: &[[f32; 4]]) {
        if self.kind.before > 0 {
            queue.write_buffer(&self.buffer, 0, bytemuck::cast_slice(shared));
        }
    }

    /// Writes pages of a file, which has this temporal filter, from the page `to` on. `bytes` is scratch memory. Returns the
    /// number of bytes written.
    pub(super) fn write(
        &self,
        queue: &wgpu::Queue,
        scene: &RuntimeScene,
        filter: Option<&TemporalFilter>,
        pages: Range<usize>,
        to: u32,
        bytes: &mut Vec<u8>,
    ) -> u64 {
        let PageKind { kind, before, per_page } = self.kind;
        bytes.clear();
        bytes.resize(pages.len() * per_page * kind.size, 0);
        match filter.filter(|_| kind.content == Content::Filter) {
            Some(filter) => convert_filter(filter, pages, bytes),
            None => {
                let records = before + pages.start * per_page..before + pages.end * per_page;
                let records = records.start..records.end.min(kind.records(scene.len()));
                // The last page of a file may not be full.
                let own = &mut bytes[..records.len() * kind.size];
                buffers::convert(kind.content, &scene.form, 0, records, own);
            }
        }
        queue.write_buffer(&self.buffer, self.kind.offset(to), bytes);
        bytes.len() as u64
    }

    /// Records the copy of pages into a buffer of the same kind: each from the first to the second.
    pub(super) fn copy(&self, encoder: &mut wgpu::CommandEncoder, to: &Self, pages: &[[u32; 2]]) {
        for run in pages.chunk_by(|a, b| a[0] + 1 == b[0] && a[1] + 1 == b[1]) {
            let ([from, at], bytes) = (run[0], run.len() as u64 * self.kind.page_bytes());
            encoder.copy_buffer_to_buffer(
                &self.buffer,
                self.kind.offset(from),
                &to.buffer,
                self.kind.offset(at),
                bytes,
            );
        }
    }
}

/// Converts the active sets of pages of a file.
fn convert_filter(filter: &TemporalFilter, pages: Range<usize>, to: &mut [u8]) {
    match &filter.sets {
        ActiveSets::Intervals(intervals) => {
            let own = intervals.iter().copied().chain(std::iter::repeat(NEVER)).skip(pages.start * GAUSSIANS);
            for (word, record) in own.zip(to.chunks_exact_mut(size_of::<u32>())) {
                record.copy_from_slice(&word.to_ne_bytes());
            }
        }
        ActiveSets::Bits(bits) => {
            let (all, segments) = (TemporalFilter::words(filter.count), filter.segments as usize);
            let word_of = |page: usize, segment: usize, word: usize| {
                let word = page * WORDS + word;
                // Bits after those of the last Gaussian have no meaning.
                let after = ((word + 1) * 32).saturating_sub(filter.count).min(31);
                if word < all { bits[segment * all + word] & (u32::MAX >> after) } else { 0 }
            };
            let words = pages.flat_map(|page| {
                (0..segments).flat_map(move |segment| (0..WORDS).map(move |word| (page, segment, word)))
            });
            for ((page, segment, word), record) in words.zip(to.chunks_exact_mut(size_of::<u32>())) {
                record.copy_from_slice(&word_of(page, segment, word).to_ne_bytes());
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::FilterKind;

    #[test]
    fn nothing_is_active_after_the_last_gaussian_of_a_file() {
        let (count, segments) = (GAUSSIANS + 40, 3);
        let words = TemporalFilter::words(count);
        // Bits after the last Gaussian, which have no meaning, are set.
        let bits = vec![u32::MAX; words * segments as usize];
        let of = |sets| TemporalFilter { kind: FilterKind::Support, segments, count, sets };
        let filters = [of(ActiveSets::Bits(bits)), of(ActiveSets::Intervals(vec![2 << 16; count]))];
        for filter in &filters {
            let kind = PageKind::of_filter(filter);
            let mut to = vec![0; 2 * kind.page_bytes() as usize];
            convert_filter(filter, 0..2, &mut to);
            let written: &[u32] = bytemuck::cast_slice(&to);
            let is_active = |segment: usize, place: usize| match &filter.sets {
                ActiveSets::Bits(_) => {
                    let word = (place / GAUSSIANS * segments as usize + segment) * WORDS + place % GAUSSIANS / 32;
                    written[word] >> (place % 32) & 1 == 1
                }
                ActiveSets::Intervals(_) => {
                    (written[place] & 0xffff..=written[place] >> 16).contains(&(segment as u32))
                }
            };
            for segment in 0..segments as usize {
                let active = (0..2 * GAUSSIANS).filter(|place| is_active(segment, *place)).collect::<Vec<_>>();
                assert_eq!(active, (0..count).collect::<Vec<_>>(), "in segment {segment} of {:?}", filter.sets);
            }
            let mut second = vec![0; kind.page_bytes() as usize];
            convert_filter(filter, 1..2, &mut second);
            assert_eq!(second, to[second.len()..], "a page alone");
        }
    }
}
