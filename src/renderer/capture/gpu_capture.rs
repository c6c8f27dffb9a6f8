//! A capture on the GPU.
//!
//! In: a [`RuntimeScene`]. Out: [`GpuCapture`], whose buffers live as long as the capture. Large captures are split into parts, so that
//! no binding exceeds the limit of the device. One dispatch of `project` draws a part; instances of a capture of a single part are drawn
//! by one dispatch.

use super::buffers::{self, Filling};
use super::instance_settings::{settings, stride};
use super::paged_gaussians::PagedGaussians;
use super::prefixes::Prefixes;
use crate::renderer::device::GpuError;
use crate::renderer::device::memory::{Allocator, binding_limit};
use crate::renderer::layout::{self, BLOCK, InstanceUniforms};
use crate::renderer::list_rooms::ListRooms;
use crate::renderer::pipelines::Renderer;
use crate::renderer::shaders::Storage;
use crate::scene::filter::segment_of;
use crate::scene::{ActiveSets, Bounds, FilterKind, RuntimeScene, TemporalFilter};
use glam::Vec4;
use std::sync::atomic::{AtomicU64, Ordering};

/// A capture on the GPU: its Gaussians, color and environment map in buffers, in as many parts as the binding limit
/// requires.
#[derive(Debug)]
pub struct GpuCapture {
    pub(in crate::renderer) parts: Vec<Part>,
    pub(in crate::renderer) environment: Option<EnvironmentBuffer>,
    /// Storage of its Gaussians and colors.
    pub(in crate::renderer) storage: Storage,
    /// Identifies this upload within the process.
    pub(in crate::renderer) id: u64,
    pub(in crate::renderer) filter: Option<Filter>,
    /// The buffers of the lists of its placements.
    pub(in crate::renderer) lists: ListRooms,
    /// The pages of its buffers, if its Gaussians are in chunk files.
    pub(in crate::renderer) pages: Option<PagedGaussians>,
    /// Of its Gaussians, those that a thinned capture needs.
    pub(in crate::renderer) prefixes: Prefixes,
    /// Bytes of its buffers, without the filter.
    pub(super) bytes: u64,
    /// The box around its Gaussians at all times, in capture space, if it is known. It changes no picture.
    pub(crate) bounds: Option<Bounds>,
    /// Color and time settings of the uniforms of an instance; the rest is zero.
    pub(in crate::renderer) settings: InstanceUniforms,
    pub(super) len: usize,
}

/// A range of Gaussians that fits into one binding.
#[derive(Debug)]
pub(in crate::renderer) struct Part {
    pub count: u32,
    pub geometry: wgpu::BindGroup,
    pub color: wgpu::BindGroup,
    /// The buffers of geometry and color.
    buffers: Vec<wgpu::Buffer>,
    /// The active sets of the Gaussians of this part, if there is a filter.
    pub filter: Option<wgpu::BindGroup>,
}

impl Part {
    /// Creates the bind groups of a part of so many Gaussians, given the buffers of geometry, of color, and of the codebooks, if
    /// colors are coded.
    pub(super) fn new(
        device: &wgpu::Device,
        renderer: &Renderer,
        storage: Storage,
        count: u32,
        [geometry, color, codebooks]: [&[wgpu::Buffer]; 3],
    ) -> Self {
        let [of_geometry, of_color] = &renderer.layouts.captures[storage as usize];
        let group = |layout: &wgpu::BindGroupLayout, buffers: &[wgpu::Buffer]| {
            let resources: Vec<_> = buffers.iter().map(wgpu::Buffer::as_entire_binding).collect();
            renderer.allocator(device).bind_group("gs4d capture", layout, &resources)
        };
        let colors = [color, codebooks].concat();
        Self {
            count,
            geometry: group(of_geometry, geometry),
            color: group(of_color, &colors),
            buffers: [geometry, &colors].concat(),
            filter: None,
        }
    }
}

/// Times within this part of a stretch of chunk files from its boundary belong to both stretches.
const NEAR_BOUNDARY: f32 = 0.01;

/// The data of a temporal filter that the host needs.
#[derive(Debug)]
pub(in crate::renderer) struct Filter {
    /// `FILTER_*`.
    pub mode: u32,
    /// Whether the capture has other Gaussians at other times, as the frames of a sequence.
    pub is_window: bool,
    pub segments: u32,
    pub interval: [f32; 2],
    /// Number of active Gaussians, part by part and segment by segment. Pages have those of a capture in chunk files.
    pub counts: Vec<u32>,
    /// The same of each prefix.
    pub prefix_counts: Vec<Vec<u32>>,
    /// Bytes of its buffers.
    pub bytes: u64,
    /// Largest number of active Gaussians of all parts in any segment.
    pub most: u32,
}

impl Filter {
    fn new(filter: &TemporalFilter, interval: [f32; 2], parts: &[Part], prefixes: &Prefixes, bytes: u64) -> Self {
        let counts_up_to = |end: usize| {
            let mut counts = Vec::with_capacity(parts.len() * filter.segments as usize);
            let mut first = 0;
            for part in parts {
                let after = first + part.count as usize;
                counts.extend(filter.active_counts(first.min(end)..after.min(end)));
                first = after;
            }
            counts
        };
        let counts = counts_up_to(usize::MAX);
        let prefix_counts = prefixes.iter().map(|prefix| counts_up_to(prefix.end)).collect();
        let mode = match filter.sets {
            ActiveSets::Bits(_) => layout::FILTER_BITS,
            ActiveSets::Intervals(_) => layout::FILTER_INTERVALS,
        };
        let segments = filter.segments as usize;
        let of_all_parts = |segment: usize| counts.iter().skip(segment).step_by(segments.max(1)).sum::<u32>();
        let most = (0..segments).map(of_all_parts).max().unwrap_or_default();
        let is_window = filter.kind == FilterKind::Window;
        Self { mode, is_window, segments: filter.segments, interval, counts, prefix_counts, bytes, most }
    }

    /// Returns the segment of a time, in the capture's unit.
    pub(crate) fn segment_of(&self, time: f32) -> u32 {
        segment_of(time, self.interval, self.segments)
    }

    /// Returns the segment of a time, twice. Where there is no filter but the stretches of chunk files, returns both
    /// stretches next to a boundary, which a player may round to the one or the other.
    pub(crate) fn segments_around(&self, time: f32) -> [u32; 2] {
        let [start, end] = self.interval;
        let near = match self.mode {
            layout::FILTER_ALL => (end - start) / self.segments.max(1) as f32 * NEAR_BOUNDARY,
            _ => 0.0,
        };
        [-near, near].map(|near| self.segment_of(time + near))
    }

    /// Returns the number of active Gaussians of a part in a segment; of those in the prefix with an index, if there is
    /// one.
    pub(crate) fn count(&self, part: usize, segment: u32, prefix: Option<usize>) -> u32 {
        let counts = prefix.map_or(&self.counts, |prefix| &self.prefix_counts[prefix]);
        counts.get(part * self.segments as usize + segment as usize).copied().unwrap_or_default()
    }
}

#[derive(Debug)]
pub(in crate::renderer) struct EnvironmentBuffer {
    pub buffer: wgpu::Buffer,
    pub size: [u32; 2],
}

impl GpuCapture {
    /// Creates the buffers of a scene, which are filled later.
    pub(super) fn allocate(
        device: &wgpu::Device,
        renderer: &Renderer,
        scene: &RuntimeScene,
    ) -> Result<(Self, Vec<Filling>), GpuError> {
        scene.check().map_err(GpuError::Scene)?;
        let (allocator, form) = (renderer.allocator(device), &scene.form);
        let stride = stride(scene);
        let per_part = per_part(&device.limits(), scene, stride)?;
        let storage = Storage::of(form);
        let (mut parts, mut fillings) = (Vec::new(), Vec::new());
        let codebooks = form.coded_colors().map(|colors| renderer.codebooks.claim(allocator, colors));
        let shared: Vec<_> = codebooks.iter().map(|(buffer, _)| buffer.clone()).collect();
        for first in (0..scene.len()).step_by(per_part) {
            let own = first..(first + per_part).min(scene.len());
            let geometry = buffers::geometry(allocator, form, own.clone());
            let color = buffers::color(allocator, form, own.clone(), stride);
            let buffers = geometry.each_ref().map(|filling| filling.buffer.clone());
            let buffers = [&buffers[..], std::slice::from_ref(&color.buffer), &shared];
            parts.push(Part::new(device, renderer, storage, own.len() as u32, buffers));
            fillings.extend(geometry.into_iter().chain([color]));
        }
        fillings.extend(codebooks.and_then(|(_, filling)| filling));
        let environment = scene.environment.as_ref().map(|map| {
            let texels = buffers::environment(allocator, map);
            let buffer = texels.buffer.clone();
            fillings.push(texels);
            EnvironmentBuffer { buffer, size: [map.width, map.height] }
        });
        let bytes = fillings.iter().map(|filling| filling.buffer.size()).sum();
        let mut capture = Self {
            parts,
            environment,
            storage,
            id: next_id(),
            filter: None,
            lists: ListRooms::default(),
            pages: None,
            prefixes: Prefixes::of(scene),
            bytes,
            bounds: None,
            settings: settings(scene),
            len: scene.len(),
        };
        if let Some(filter) = &scene.filter {
            fillings.extend(capture.allocate_filter(allocator, renderer, filter, scene.trained_with.time_interval));
        }
        Ok((capture, fillings))
    }

    /// Replaces the buffers of the temporal filter by buffers of another filter of the same number of Gaussians, which are filled later.
    fn allocate_filter(
        &mut self,
        allocator: Allocator<'_>,
        renderer: &Renderer,
        filter: &TemporalFilter,
        interval: [f32; 2],
    ) -> Vec<Filling> {
        let (mut first, mut fillings) = (0, Vec::with_capacity(self.parts.len()));
        for part in &mut self.parts {
            let end = first + part.count as usize;
            let sets = buffers::filter(allocator, filter, first..end);
            let resources = [sets.buffer.as_entire_binding()];
            part.filter = Some(allocator.bind_group("gs4d filter", &renderer.layouts.filter, &resources));
            fillings.push(sets);
            first = end;
        }
        let bytes = fillings.iter().map(|filling| filling.buffer.size()).sum();
        self.filter = Some(Filter::new(filter, interval, &self.parts, &self.prefixes, bytes));
        // Active lists of the previous filter become invalid.
        self.id = next_id();
        fillings
    }

    /// Replaces the temporal filter, for clients that change the Gaussians. `interval` is the time interval of the capture.
    ///
    /// # Errors
    /// When the filter is not one of as many Gaussians.
    pub fn replace_filter(
        &mut self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        renderer: &Renderer,
        filter: &TemporalFilter,
        interval: [f32; 2],
    ) -> Result<(), GpuError> {
        filter.check(self.len).map_err(GpuError::Scene)?;
        for sets in self.allocate_filter(renderer.allocator(device), renderer, filter, interval) {
            sets.fill_filter(queue, filter);
        }
        Ok(())
    }

    /// Returns the number of Gaussians; of a capture in chunk files, those of the files that are there.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Returns whether the capture has no Gaussians.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Returns whether the capture has an environment map.
    pub fn has_environment(&self) -> bool {
        self.environment.is_some()
    }

    /// Returns whether the capture has a temporal filter.
    pub fn has_filter(&self) -> bool {
        self.filter.is_some()
    }

    /// Returns the bytes of the capture's buffers on the GPU.
    pub fn bytes(&self) -> u64 {
        self.bytes + self.filter.as_ref().map_or(0, |filter| filter.bytes)
    }

    /// Returns for each part its number of Gaussians and its buffers of records, lifespans and color coefficients, for passes of clients that
    /// write them. Returns nothing if the capture is packed or in chunk files.
    pub fn writable(&self) -> impl Iterator<Item = (u32, [&wgpu::Buffer; 3])> {
        let is_writable = self.storage == Storage::Sliced && self.pages.is_none();
        let parts = if is_writable { &self.parts[..] } else { &[] };
        parts.iter().filter_map(|part| {
            let buffers = part.buffers.iter().collect::<Vec<_>>().try_into().ok()?;
            Some((part.count, buffers))
        })
    }

    /// Returns the buffer of the texels of the environment map, planar, for passes of clients that write them. Returns `None` if the capture
    /// has no map.
    pub fn environment(&self) -> Option<&wgpu::Buffer> {
        self.environment.as_ref().map(|map| &map.buffer)
    }

    /// Returns the bind group of the geometry of each part, for passes of clients.
    pub fn geometry(&self) -> impl Iterator<Item = &wgpu::BindGroup> {
        self.parts.iter().map(|part| &part.geometry)
    }

    /// Returns the depth of the center of the bounds; `f32::MIN` if they are not known. `row` is row z of capture-to-camera.
    pub(in crate::renderer) fn middle(&self, row: [f32; 4]) -> f32 {
        let depth = |bounds: Bounds| Vec4::from(row).dot(bounds.center().extend(1.0));
        self.bounds.map(depth).filter(|depth| depth.is_finite()).unwrap_or(f32::MIN)
    }
}

/// Returns the identifier of another upload.
pub(super) fn next_id() -> u64 {
    static NEXT: AtomicU64 = AtomicU64::new(0);
    NEXT.fetch_add(1, Ordering::Relaxed)
}

/// Returns the number of Gaussians of each part but the last: a multiple of the block that one workgroup of `activate` processes. `stride` is the
/// number of four-vectors of color coefficients per Gaussian.
pub(super) fn per_part(limits: &wgpu::Limits, scene: &RuntimeScene, stride: usize) -> Result<usize, GpuError> {
    let limit = binding_limit(limits);
    let map = scene.environment.as_ref().map_or(0, |map| size_of_val(map.texels.as_slice()) as u64);
    if map > limit {
        return Err(GpuError::TooLarge { what: "the environment map", needed: map, limit });
    }
    let bits = scene.filter.as_ref().map_or(0, |filter| match filter.sets {
        ActiveSets::Bits(_) => u64::from(filter.segments).div_ceil(8),
        ActiveSets::Intervals(_) => 4,
    });
    let record = buffers::largest_record(&scene.form, stride).max(bits);
    let threads = u64::from(limits.max_compute_workgroups_per_dimension) * 256;
    match (limit / record).min(threads) as usize / BLOCK as usize {
        0 => Err(GpuError::TooLarge { what: "the Gaussians", needed: record * u64::from(BLOCK), limit }),
        blocks => Ok(blocks * BLOCK as usize),
    }
}
