//! The list of active Gaussians of one placed capture, common to all views that draw the capture.
//!
//! In: a capture with a temporal filter and a time. Out: the indices of the Gaussians that are active in the segment of
//! that time, ascending, part by part. `activate` writes them only when the segment has changed.

use super::capture::{Filter, GpuCapture, Prefix};
use super::layout::{Activation, BLOCK, INSTANCE_STRIDE};
use super::pipelines::Renderer;
use wgpu::BufferUsages;

/// The list of the Gaussians of a capture that are drawn.
#[derive(Debug)]
pub struct ActiveList {
    capture: u64,
    /// Segment of the time prepared last; `recorded`: whether the list of this segment has been recorded.
    segment: Option<u32>,
    recorded: bool,
    uniforms: wgpu::Buffer,
    activate: wgpu::BindGroup,
    /// Bind group of the list, which `project` reads.
    pub(super) list: wgpu::BindGroup,
}

impl ActiveList {
    /// Creates an empty list; returns `None` if the capture has no filter.
    pub fn new(device: &wgpu::Device, renderer: &Renderer, capture: &GpuCapture) -> Option<Self> {
        let most = capture.filter.as_ref()?.most;
        let allocator = renderer.allocator(device);
        let count = (capture.len().max(1) as u64).next_multiple_of(u64::from(BLOCK));
        let parts = capture.parts.len().max(1) as u64;
        let uniforms = allocator.buffer("gs4d activations", parts * u64::from(INSTANCE_STRIDE), BufferUsages::UNIFORM);
        let list = allocator.buffer("gs4d active list", u64::from(most.max(1)) * 4, BufferUsages::STORAGE);
        let blocks = allocator.buffer("gs4d active blocks", count / u64::from(BLOCK) * 4, BufferUsages::STORAGE);
        let uniform = wgpu::BindingResource::Buffer(wgpu::BufferBinding {
            buffer: &uniforms,
            offset: 0,
            size: std::num::NonZeroU64::new(size_of::<Activation>() as u64),
        });
        let resources = [uniform, list.as_entire_binding(), blocks.as_entire_binding()];
        let activate = allocator.bind_group("gs4d activate", &renderer.layouts.activate, &resources);
        let list = allocator.bind_group("gs4d active list", &renderer.layouts.active, &[list.as_entire_binding()]);
        Some(Self { capture: capture.id, segment: None, recorded: false, uniforms, activate, list })
    }

    /// Returns whether the list belongs to this upload of a capture. If not, create a new list.
    pub fn is_for(&self, capture: &GpuCapture) -> bool {
        self.capture == capture.id
    }

    /// Sets the time, in the capture's unit. Returns whether the list must be [recorded](Self::record) before the capture
    /// is drawn.
    pub fn prepare(&mut self, queue: &wgpu::Queue, capture: &GpuCapture, time: f32) -> bool {
        let Some(filter) = &capture.filter else { return false };
        let segment = filter.segment_of(time);
        if self.segment != Some(segment) {
            self.segment = Some(segment);
            self.recorded = false;
            let mut first = 0;
            for (index, part) in capture.parts.iter().enumerate() {
                let activation = Activation { count: part.count, first, filter_mode: filter.mode, segment };
                let at = index as u64 * u64::from(INSTANCE_STRIDE);
                queue.write_buffer(&self.uniforms, at, bytemuck::bytes_of(&activation));
                first += filter.count(index, segment, None);
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
            let blocks = part.count.div_ceil(BLOCK);
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
        self.segment.map_or(0, |segment| filter.count(part, segment, prefix))
    }
}

/// Returns the number of Gaussians of a part of a capture that its list has, or all without a list; of those in a prefix,
/// if there is one.
pub(super) fn listed_count(
    capture: &GpuCapture,
    part: usize,
    active: Option<&ActiveList>,
    prefix: Option<(usize, Prefix)>,
) -> u32 {
    let count = capture.parts[part].count;
    match (&capture.filter, active, prefix) {
        (Some(filter), Some(active), _) => active.count(filter, part, prefix.map(|(index, _)| index)),
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
        (Some(filter), Some(_)) => filter.most as usize,
        _ => capture.len(),
    }
}

/// Returns the number of Gaussians by which the sizes of bins are chosen: the largest number at any time of a capture with other Gaussians at other
/// times, as the frames of a sequence, otherwise all.
pub(super) fn most_at_once(capture: &GpuCapture, active: Option<&ActiveList>) -> usize {
    if capture.filter.as_ref().is_some_and(|filter| filter.is_window) {
        most_drawn(capture, active)
    } else {
        capture.len()
    }
}
