//! The buffers of training that depend on the size of the picture and of the renderer's buffers.
//!
//! In: the frame that was recorded last. Out: [`ViewBuffers`], created anew only if sizes have changed.

use super::sums::GradientSums;
use super::trainer::Trainer;
use crate::renderer::layout::{InstanceUniforms, LossUniforms, TILE_SIZE};
use crate::renderer::memory::binding_limit;
use crate::renderer::{FinishedFrame, GpuError};
use glam::UVec2;
use wgpu::BufferUsages;

/// Values that `blend_backward` writes for each pair or splat.
const SUMS: u64 = 10;

/// What depends on the size of the picture and of the renderer's buffers.
#[derive(Debug)]
pub(super) struct ViewBuffers {
    /// What it was created for.
    splats: wgpu::Buffer,
    color: wgpu::TextureView,
    size: UVec2,
    pub loss_settings: wgpu::Buffer,
    pub pixel_gradients: wgpu::Buffer,
    pub depth_gradients: wgpu::Buffer,
    /// Those of pairs, or of splats if sums are atomic.
    pub gradients: wgpu::Buffer,
    pub loss: wgpu::BindGroup,
    pub blended: wgpu::BindGroup,
    pub sums: wgpu::BindGroup,
    pub splat_gradients: wgpu::BindGroup,
}

impl Trainer<'_> {
    /// Creates what depends on the sizes of the frame that has been recorded, unless it has been.
    pub(super) fn fit(&mut self, size: UVec2) -> Result<(), GpuError> {
        let Some(frame) = self.headless.finished() else { return Ok(()) };
        let fits =
            |made: &ViewBuffers| made.size == size && made.splats == frame.buffers.splats && made.color == *frame.color;
        if !self.view.as_ref().is_some_and(fits) {
            self.view = Some(self.make(&frame, size)?);
        }
        Ok(())
    }

    fn make(&self, frame: &FinishedFrame<'_>, size: UVec2) -> Result<ViewBuffers, GpuError> {
        let (allocator, passes) = (self.headless.allocator(), &self.passes);
        let limit = binding_limit(&allocator.device.limits());
        let (what, count) = match self.sums {
            GradientSums::Deterministic => ("the gradients of pairs", frame.pairs),
            GradientSums::Atomic => ("the gradients of splats", frame.slots),
        };
        let needed = u64::from(count) * SUMS * 4;
        if needed > limit {
            return Err(GpuError::TooLarge { what, needed, limit });
        }
        let pixels = u64::from(size.x) * u64::from(size.y);
        let tiles = u64::from(size.x.div_ceil(TILE_SIZE)) * u64::from(size.y.div_ceil(TILE_SIZE));
        let storage = |label, size| allocator.buffer(label, size, BufferUsages::STORAGE);
        let settings = size_of::<LossUniforms>() as u64;
        let loss_settings = allocator.buffer("gs4d loss settings", settings, BufferUsages::UNIFORM);
        let slopes = storage("gs4d slopes of similarity", pixels * 48);
        let pixel_gradients = storage("gs4d gradients of pixels", pixels * 16);
        // Zero: the loss does not depend on depth.
        let depth_gradients = storage("gs4d gradients of depths", pixels * 4);
        let tile_sums = storage("gs4d sums of tiles", tiles * 16);
        let first_pairs = storage("gs4d first pairs", u64::from(frame.slots) * 4);
        let gradients = storage("gs4d gradients of splats", needed);
        let color = wgpu::BindingResource::TextureView(frame.color);
        let whole = wgpu::Buffer::as_entire_binding;
        let written = [&slopes, &pixel_gradients, &tile_sums, &self.totals].map(whole);
        let loss = [vec![whole(&loss_settings), color.clone()], written.to_vec()].concat();
        let buffers = frame.buffers;
        let read = [
            frame.frame,
            frame.counters,
            &buffers.tile_ranges,
            &buffers.pair_splats,
            &buffers.splats,
            &buffers.order,
            &buffers.offsets,
        ];
        let depth = wgpu::BindingResource::TextureView(frame.depth);
        let blended = [read.map(whole).to_vec(), vec![color, depth]].concat();
        let sums = [&first_pairs, &gradients, &pixel_gradients, &depth_gradients].map(whole);
        let instance = wgpu::BindingResource::Buffer(wgpu::BufferBinding {
            buffer: frame.instances,
            offset: 0,
            size: std::num::NonZeroU64::new(size_of::<InstanceUniforms>() as u64),
        });
        let splats = [&self.scene_settings, &buffers.splats, &buffers.depth_keys, &first_pairs, &gradients].map(whole);
        let splat_gradients = [vec![instance], splats.to_vec()].concat();
        Ok(ViewBuffers {
            splats: buffers.splats.clone(),
            color: frame.color.clone(),
            size,
            loss: allocator.bind_group("gs4d loss", &passes.loss_group, &loss),
            blended: allocator.bind_group("gs4d blended", &passes.blended_group, &blended),
            sums: allocator.bind_group("gs4d sums", &passes.sums_group, &sums),
            splat_gradients: allocator.bind_group("gs4d splats", &passes.splats_group, &splat_gradients),
            loss_settings,
            pixel_gradients,
            depth_gradients,
            gradients,
        })
    }
}
