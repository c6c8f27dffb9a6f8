//! The list of active Gaussians of one placed capture, common to all views that draw the capture.
//!
//! In: a capture with a temporal filter and a time. Out: the indices of the Gaussians that are active in the segment of
//! that time, ascending, part by part; of a capture in chunk files, in the order of the files. `activate` writes them only
//! when the segment, or the files that are there, have changed. The lists of several placements of a capture are in one
//! buffer, so that one dispatch draws them.

use super::capture::{Filter, GpuCapture, PartListing, Prefix};
use super::layout::{Activation, BLOCK, INSTANCE_STRIDE, PAGE};
use super::list_rooms::ListPlace;
use super::pipelines::Renderer;
use wgpu::BufferUsages;

/// The list of the Gaussians of a capture that are drawn.
#[derive(Debug)]
pub struct ActiveList {
    capture: u64,
    /// Segments of the time prepared last, and version of the pages; `recorded`: whether the list of them has been recorded.
    prepared: Option<([u32; 2], u64)>,
    recorded: bool,
    /// What is listed of each part of a capture in chunk files.
    listing: Vec<PartListing>,
    uniforms: wgpu::Buffer,
    /// The pages that are listed, part after part.
    pages: wgpu::Buffer,
    activate: wgpu::BindGroup,
    place: ListPlace,
}

impl ActiveList {
    /// Creates an empty list; returns `None` if the capture has no filter.
    pub fn new(device: &wgpu::Device, renderer: &Renderer, capture: &GpuCapture) -> Option<Self> {
        let most = capture.filter.as_ref()?.most;
        let allocator = renderer.allocator(device);
        let place = capture.lists.place(device, renderer, most);
        let count: u64 = capture.parts.iter().map(|part| u64::from(part.count)).sum();
        let count = count.max(1).next_multiple_of(u64::from(BLOCK));
        let pages = capture.pages.as_ref().map_or(1, |paged| u64::from(paged.count()));
        let parts = capture.parts.len().max(1) as u64;
        let uniforms = allocator.buffer("gs4d activations", parts * u64::from(INSTANCE_STRIDE), BufferUsages::UNIFORM);
        let pages = allocator.buffer("gs4d active pages", pages * 4, BufferUsages::STORAGE);
        let blocks = allocator.buffer("gs4d active blocks", count / u64::from(BLOCK) * 4, BufferUsages::STORAGE);
        let uniform = wgpu::BindingResource::Buffer(wgpu::BufferBinding {
            buffer: &uniforms,
            offset: 0,
            size: std::num::NonZeroU64::new(size_of::<Activation>() as u64),
        });
        let of_list = [place.buffer(), &blocks, &pages].map(wgpu::Buffer::as_entire_binding);
        let resources = [[uniform].as_slice(), &of_list].concat();
        let activate = allocator.bind_group("gs4d activate", &renderer.layouts.activate, &resources);
        let (prepared, listing) = (None, Vec::new());
        Some(Self { capture: capture.id, prepared, recorded: false, listing, uniforms, pages, activate, place })
    }

    /// Returns the index of the first entry of the list in its buffer, which may have other lists, too.
    pub(super) fn first(&self) -> u32 {
        self.place.first()
    }

    /// Returns whether this list and another one are in one buffer.
    pub(super) fn is_beside(&self, other: &Self) -> bool {
        self.place.is_beside(&other.place)
    }

    /// Returns whether the list belongs to this upload of a capture. If not, create a new list.
    pub fn is_for(&self, capture: &GpuCapture) -> bool {
        self.capture == capture.id
    }

    /// Sets the time, in the capture's unit. Returns whether the list must be [recorded](Self::record) before the capture
    /// is drawn.
    pub fn prepare(&mut self, queue: &wgpu::Queue, capture: &GpuCapture, time: f32) -> bool {
        let Some(filter) = &capture.filter else { return false };
        let segments = filter.segments_around(time);
        let segment = segments[0];
        let wanted = (segments, capture.pages.as_ref().map_or(0, |paged| paged.version()));
        if self.prepared != Some(wanted) {
            self.prepared = Some(wanted);
            self.recorded = false;
            self.listing = capture.pages.as_ref().map(|paged| paged.listing(segments)).unwrap_or_default();
            let pages: Vec<u32> = self.listing.iter().flat_map(|part| &part.pages).copied().collect();
            queue.write_buffer(&self.pages, 0, bytemuck::cast_slice(&pages));
            let (mut first, mut first_page) = (self.first(), 0);
            for (index, part) in capture.parts.iter().enumerate() {
                let listing = self.listing.get(index);
                let activation = Activation {
                    count: listing.map_or(part.count, listed_slots),
                    first,
                    filter_mode: filter.mode,
                    segment,
                    paged: u32::from(listing.is_some()),
                    first_page,
                    segments: filter.segments,
                    padding: 0,
                };
                let at = index as u64 * u64::from(INSTANCE_STRIDE);
                queue.write_buffer(&self.uniforms, at, bytemuck::bytes_of(&activation));
                first += self.count(filter, index, None);
                first_page += listing.map_or(0, |listing| listing.pages.len() as u32);
            }
        }
        !self.recorded
    }

    /// Records `activate`, unless the list of the current segment has been recorded.
    pub fn record(&mut self, renderer: &Renderer, encoder: &mut wgpu::CommandEncoder, capture: &GpuCapture) {
        if self.recorded {
            return;
        }
        self.recorded = true;
        renderer.work().add_activated();
        let mut pass = encoder
            .begin_compute_pass(&wgpu::ComputePassDescriptor { label: Some("gs4d activate"), timestamp_writes: None });
        for (index, part) in capture.parts.iter().enumerate() {
            let Some(filter) = &part.filter else { continue };
            let count = self.listing.get(index).map_or(part.count, listed_slots);
            if count == 0 {
                continue;
            }
            let blocks = count.div_ceil(BLOCK);
            pass.set_bind_group(0, &self.activate, &[index as u32 * INSTANCE_STRIDE]);
            pass.set_bind_group(1, filter, &[]);
            for (pipeline, blocks) in renderer.activate.iter().zip([blocks, 1, blocks]) {
                pass.set_pipeline(pipeline);
                pass.dispatch_workgroups(blocks, 1, 1);
            }
        }
    }

    /// Returns the number of active Gaussians of a part, or of those in a prefix.
    fn count(&self, filter: &Filter, part: usize, prefix: Option<usize>) -> u32 {
        match (self.listing.get(part), self.prepared) {
            (Some(listing), _) => listing.active,
            (None, Some(([segment, _], _))) => filter.count(part, segment, prefix),
            (None, None) => 0,
        }
    }
}

impl Renderer {
    /// Returns the bind group of a list; without a list, of one that is not read.
    pub(super) fn list<'a>(&'a self, active: Option<&'a ActiveList>) -> &'a wgpu::BindGroup {
        active.map_or(&self.no_list, |active| active.place.group())
    }
}

/// Returns the number of Gaussians that the pages of a part have room for.
fn listed_slots(listing: &PartListing) -> u32 {
    listing.pages.len() as u32 * PAGE
}

/// Returns the number of Gaussians of a part of a capture that its list has; without a list all, or none of a capture in
/// chunk files. Of those in a prefix, if there is one.
pub(super) fn listed_count(
    capture: &GpuCapture,
    part: usize,
    active: Option<&ActiveList>,
    prefix: Option<(usize, Prefix)>,
) -> u32 {
    let count = capture.parts[part].count;
    match (&capture.filter, active, prefix) {
        (Some(filter), Some(active), _) => active.count(filter, part, prefix.map(|(index, _)| index)),
        _ if capture.pages.is_some() => 0,
        (_, _, None) => count,
        (_, _, Some((_, Prefix { end, .. }))) => {
            let first: usize = capture.parts[..part].iter().map(|part| part.count as usize).sum();
            end.saturating_sub(first).min(count as usize) as u32
        }
    }
}

/// Returns the largest number of Gaussians of a capture that are drawn at any time.
pub(super) fn most_drawn(capture: &GpuCapture, active: Option<&ActiveList>) -> usize {
    match (&capture.filter, active) {
        (Some(filter), active) if active.is_some() || capture.pages.is_some() => filter.most as usize,
        _ => capture.len(),
    }
}

/// Returns the number of Gaussians by which the sizes of bins are chosen: the largest number at any time of a capture with other Gaussians at other
/// times, as the frames of a sequence, otherwise all, also those of chunk files that are not there.
pub(super) fn most_at_once(capture: &GpuCapture, active: Option<&ActiveList>) -> usize {
    if capture.filter.as_ref().is_some_and(|filter| filter.is_window) {
        most_drawn(capture, active)
    } else {
        capture.pages.as_ref().map_or(capture.len(), |paged| paged.all() as usize)
    }
}
