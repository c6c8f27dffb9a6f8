//! The pages of a capture on the GPU: made, made anew, taken over, freed.
//!
//! In: the table of the chunk files, the first file, the bytes that the buffers may have. Out: a [`GpuCapture`] with buffers of
//! as many pages, into which [`FileUpload`](super::FileUpload)s write files.

use super::buffers;
use super::gpu_capture::{Filter, GpuCapture, Part, next_id, per_part};
use super::instance_settings::stride;
use super::page_buffers::{PageBuffer, PageKind};
use super::paged_gaussians::{PagedGaussians, Shared, are_same, codebooks_of};
use super::pages::{Pages, all_pages, most_listed};
use crate::renderer::device::GpuError;
use crate::renderer::device::memory::{Allocator, catch_known};
use crate::renderer::layout::{self, PAGE};
use crate::renderer::pipelines::Renderer;
use crate::scene::{ActiveSets, ChunkTable, RuntimeScene};
use std::sync::Arc;

/// The chunk files of a capture.
#[derive(Debug, Clone, Copy)]
pub struct ChunkFiles<'a> {
    /// Their table.
    pub table: &'a Arc<ChunkTable>,
    /// The scene of the index, which has no Gaussians; `None` if it is not in memory any more.
    pub index: Option<&'a RuntimeScene>,
    /// The scene of one of the files.
    pub first: &'a RuntimeScene,
}

impl GpuCapture {
    /// Returns the number of bytes of the buffers into which chunk files are written; `None` before the first file.
    pub fn paged_bytes(&self) -> Option<u64> {
        self.pages.as_ref().map(|paged| u64::from(paged.count()) * paged.page_bytes)
    }

    /// Returns the largest number of Gaussians that the pages list at any time; `None` before the first file.
    pub fn most_paged(&self) -> Option<usize> {
        self.filter.as_ref().filter(|_| self.pages.is_some()).map(|filter| filter.most as usize)
    }

    /// Returns whether a chunk file of so many Gaussians finds pages.
    pub fn has_room(&self, gaussians: usize) -> bool {
        self.pages.as_ref().is_some_and(|paged| paged.pages.has_room(gaussians))
    }

    /// Makes buffers for the chunk files of a capture, the index of which this is, of at most `bytes` and at least a page. All
    /// files have the same settings, ranges and codebooks.
    ///
    /// # Errors
    /// When a page is larger than the device can bind, the device has no memory for the buffers, the file is not one of the
    /// index, or its Gaussians take more bytes than the table says.
    pub fn open_pages(
        &mut self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        renderer: &Renderer,
        files: ChunkFiles<'_>,
        bytes: u64,
    ) -> Result<(), GpuError> {
        let ChunkFiles { table, index, first } = files;
        table.check().map_err(GpuError::Scene)?;
        first.check().map_err(GpuError::Scene)?;
        let shared = Shared::of(first);
        let Shared { segments, is_window, .. } = shared;
        let of_index = index.map(|index| Shared { segments, is_window, ..Shared::of(index) });
        let has_codebooks = index.is_none_or(|index| are_same(codebooks_of(index), codebooks_of(first)));
        if !has_codebooks || of_index.is_some_and(|of_index| of_index != shared) {
            return Err(GpuError::Scene(
                "its settings, ranges or codebooks are not those of the index of the chunk files",
            ));
        }
        let allocator = renderer.allocator(device);
        let mut kinds = PageKind::of_gaussians(&first.form, stride(first)).to_vec();
        kinds.extend(first.filter.as_ref().map(PageKind::of_filter));
        let written_bytes: u64 = kinds.iter().map(PageKind::page_bytes).sum();
        let page_bytes = u64::from(table.gaussian_bytes) * u64::from(PAGE);
        if written_bytes > page_bytes {
            return Err(GpuError::Scene("its Gaussians take more bytes than the index of the chunk files says"));
        }
        let per_part = (per_part(&device.limits(), first, stride(first))? / PAGE as usize) as u32;
        let pages = Pages::new(pages_within(table, page_bytes, bytes), per_part);
        let buffers = page_buffers(allocator, queue, &kinds, &pages, &shared)?;
        let codebooks = first.form.coded_colors().map(|colors| {
            let (buffer, filling) = renderer.codebooks.claim(allocator, colors);
            if let Some(mut filling) = filling {
                let mut chunk = Vec::new();
                while filling.bytes_left() > 0 {
                    renderer.work().add_uploaded(filling.fill(queue, first, u64::MAX, &mut chunk));
                }
            }
            (colors.codebooks.clone(), buffer)
        });
        let has_bits = first.filter.as_ref().map(|filter| matches!(filter.sets, ActiveSets::Bits(_)));
        let paged = PagedGaussians {
            table: table.clone(),
            pages,
            kinds,
            buffers,
            codebooks,
            has_bits,
            page_bytes,
            written_bytes,
            all: table.files.iter().map(|file| file.gaussians).sum(),
            shared,
        };
        self.set_pages(device, renderer, paged);
        Ok(())
    }

    /// Makes the buffers for chunk files anew, of at most `bytes`, and copies the files into them. Returns `false`, and
    /// changes nothing, if there are as many pages already, or files do not fit yet, or while a file is being written.
    ///
    /// # Errors
    /// When the device has no memory for the buffers. Nothing changes.
    pub fn resize_pages(
        &mut self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        renderer: &Renderer,
        bytes: u64,
    ) -> Result<bool, GpuError> {
        let Some(paged) = &self.pages else { return Ok(false) };
        let count = pages_within(&paged.table, paged.page_bytes, bytes);
        let moved = (count != paged.count()).then(|| paged.pages.moved(count)).flatten();
        let Some((pages, moves)) = moved else { return Ok(false) };
        let buffers = page_buffers(renderer.allocator(device), queue, &paged.kinds, &pages, &paged.shared)?;
        let label = wgpu::CommandEncoderDescriptor { label: Some("gs4d pages") };
        let mut encoder = device.create_command_encoder(&label);
        let parts = |[from, to]: [u32; 2]| (paged.pages.local(from).0, pages.local(to).0);
        for run in moves.chunk_by(|a, b| parts(*a) == parts(*b)) {
            let (from, to) = parts(run[0]);
            let local: Vec<[u32; 2]> =
                run.iter().map(|[from, to]| [paged.pages.local(*from).1, pages.local(*to).1]).collect();
            for (from, to) in paged.buffers[from].iter().zip(&buffers[to]) {
                from.copy(&mut encoder, to, &local);
            }
        }
        queue.submit([encoder.finish()]);
        if let Some(paged) = self.pages.take() {
            self.set_pages(device, renderer, PagedGaussians { pages, buffers, ..paged });
        }
        Ok(true)
    }

    /// Takes over the pages of another upload of the same capture, with the files in them.
    pub fn take_pages(&mut self, from: &mut Self) {
        if from.pages.is_some() {
            let (environment, own) = (from.environment_bytes(), self.environment_bytes());
            (self.storage, self.settings, self.id) = (from.storage, from.settings, next_id());
            self.parts = std::mem::take(&mut from.parts);
            (self.filter, self.pages) = (from.filter.take(), from.pages.take());
            (self.len, self.bytes, self.bounds) = (from.len, from.bytes - environment + own, from.bounds);
            from.close_pages();
        }
    }

    /// Frees the buffers of chunk files.
    pub fn close_pages(&mut self) {
        self.parts.clear();
        (self.filter, self.pages, self.bounds) = (None, None, None);
        (self.len, self.bytes, self.id) = (0, self.environment_bytes(), next_id());
    }

    fn environment_bytes(&self) -> u64 {
        self.environment.as_ref().map_or(0, |map| map.buffer.size())
    }

    /// Removes a chunk file, if it is there. Its pages are free.
    pub fn remove_file(&mut self, file: usize) {
        if let Some(paged) = &mut self.pages {
            paged.pages.remove(file);
            self.len = paged.pages.gaussians();
        }
    }

    /// Makes the bind groups of pages, which replace those of before. Lists of them are no longer valid.
    fn set_pages(&mut self, device: &wgpu::Device, renderer: &Renderer, paged: PagedGaussians) {
        let codebooks = paged.codebooks.as_ref().map(|(_, buffer)| buffer.clone());
        let allocator = renderer.allocator(device);
        let part = |(pages, buffers): (u32, &Vec<PageBuffer>)| {
            let buffers: Vec<wgpu::Buffer> = buffers.iter().map(|own| own.buffer.clone()).collect();
            let own = [&buffers[..2], &buffers[2..3], codebooks.as_slice()];
            let mut part = Part::new(device, renderer, paged.shared.storage, pages * PAGE, own);
            // Passes may not leave out a binding.
            let sets = buffers.get(3).cloned().unwrap_or_else(|| buffers::storage(allocator, "gs4d no filter", 4));
            let resources = [sets.as_entire_binding()];
            part.filter = Some(allocator.bind_group("gs4d filter", &renderer.layouts.filter, &resources));
            part
        };
        self.parts = paged.pages.of_parts().zip(&paged.buffers).map(part).collect();
        let Shared { storage, settings, segments, is_window, interval, .. } = paged.shared;
        (self.storage, self.settings, self.id) = (storage, settings, next_id());
        let own: u64 = paged.buffers.iter().flatten().map(|own| own.buffer.size()).sum();
        self.bytes = own + self.environment_bytes();
        let segments = if segments == 0 { paged.table.stretches } else { segments };
        let slots = u64::from(paged.count()) * u64::from(PAGE);
        self.filter = Some(Filter {
            mode: match paged.has_bits {
                None => layout::FILTER_ALL,
                Some(true) => layout::FILTER_BITS,
                Some(false) => layout::FILTER_INTERVALS,
            },
            is_window,
            segments,
            interval,
            counts: Vec::new(),
            prefix_counts: Vec::new(),
            bytes: 0,
            most: most_listed(&paged.table, segments, paged.has_bits.is_none()).min(slots) as u32,
        });
        self.pages = Some(paged);
    }
}

/// Creates the buffers of each part, of these kinds, with what all files share.
///
/// # Errors
/// When the device has no memory for them.
fn page_buffers(
    allocator: Allocator<'_>,
    queue: &wgpu::Queue,
    kinds: &[PageKind],
    pages: &Pages,
    shared: &Shared,
) -> Result<Vec<Vec<PageBuffer>>, GpuError> {
    let of_part = |pages: u32| kinds.iter().map(|kind| PageBuffer::new(allocator, *kind, pages)).collect();
    let create = || pages.of_parts().map(of_part).collect::<Vec<Vec<PageBuffer>>>();
    let needed = u64::from(pages.count()) * kinds.iter().map(PageKind::page_bytes).sum::<u64>();
    let buffers = catch_known(allocator.device, needed, create)?;
    buffers.iter().flatten().for_each(|buffer| buffer.write_shared(queue, &shared.ranges));
    Ok(buffers)
}

/// Most pages of a capture: a thousand million Gaussians.
const MOST_PAGES: u32 = 1 << 22;

/// Returns the number of pages that buffers of so many bytes have for the files of a table: at least one.
fn pages_within(table: &ChunkTable, page_bytes: u64, bytes: u64) -> u32 {
    u32::try_from((bytes / page_bytes).min(all_pages(table))).map_or(MOST_PAGES, |pages| pages.clamp(1, MOST_PAGES))
}
