//! The buffers of training that depend on the size of the picture and of the renderer's buffers.
//!
//! In: the frame that was recorded last. Out: [`ViewBuffers`]; commands of the loss and of the backward pass.

use super::optimized::across_and_down;
use super::parameters::ParameterChunk;
use super::passes::Passes;
use super::sample::GpuImage;
use super::workspace::Workspace;
use crate::offline::engine::layout::LossUniforms;
use crate::renderer::device::memory::binding_limit;
use crate::renderer::layout::{INSTANCE_STRIDE, InstanceUniforms};
use crate::renderer::{FinishedFrame, GpuError, Headless};
use crate::view::{Background, tiles};
use glam::UVec2;
use std::num::NonZeroU64;
use wgpu::BufferUsages;

/// Values that `blend_backward` writes for each pair.
const SUMS: u64 = 10;

/// Bytes of the slopes of similarity of a pixel, the most of all buffers by pixels.
const SLOPES: u64 = 48;

/// Checks that the device binds the buffers of a picture of this size.
///
/// # Errors
/// The largest buffer, and the limit of the device.
pub(crate) fn require_bindings(headless: &Headless, size: UVec2) -> Result<(), GpuError> {
    let limit = binding_limit(&headless.context().device.limits());
    let needed = size.as_u64vec2().element_product() * SLOPES;
    match needed > limit {
        true => Err(GpuError::Picture { size: size.to_array(), what: "the slopes of similarity", needed, limit }),
        false => Ok(()),
    }
}

/// A view whose frame has been recorded, and the buffers of its passes after the picture.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RecordedView<'a> {
    pub buffers: &'a ViewBuffers,
    /// Size of the picture, pixels.
    pub size: UVec2,
    /// What is behind the scene.
    pub background: Background,
    /// Number of the view.
    pub number: u32,
    /// Weight of the view in the loss of the batch.
    pub share: f32,
}

/// Buffers and bindings that depend on the size of the picture and of the renderer's buffers.
#[derive(Debug)]
pub(crate) struct ViewBuffers {
    /// The resources and the size that the buffers were created for.
    splats: wgpu::Buffer,
    color: wgpu::TextureView,
    size: UVec2,
    pub loss_settings: wgpu::Buffer,
    slopes: wgpu::Buffer,
    pub pixel_gradients: wgpu::Buffer,
    tile_sums: wgpu::Buffer,
    totals: wgpu::Buffer,
    pub depth_gradients: wgpu::Buffer,
    loss: wgpu::BindGroup,
    blended: wgpu::BindGroup,
    sums: wgpu::BindGroup,
    /// For each chunk of the Gaussians.
    splat_gradients: Vec<wgpu::BindGroup>,
}

impl ViewBuffers {
    /// Returns the bytes of the buffers by pixels, which are the largest.
    pub(crate) fn bytes(size: UVec2) -> u64 {
        size.as_u64vec2().element_product() * (SLOPES + 16 + 4)
    }

    /// Creates the buffers for a frame of this size. Losses are added to `totals`.
    pub(crate) fn new(
        work: &Workspace<'_>,
        totals: &wgpu::Buffer,
        frame: &FinishedFrame<'_>,
        size: UVec2,
    ) -> Result<Self, GpuError> {
        let allocator = work.headless.allocator();
        let limit = binding_limit(&allocator.device.limits());
        let needed = u64::from(frame.pairs) * SUMS * 4;
        if needed > limit {
            return Err(GpuError::TooLarge { what: "the gradients of pairs", needed, limit });
        }
        require_bindings(work.headless, size)?;
        let pixels = size.as_u64vec2().element_product();
        let tiles = tiles(size).as_u64vec2().element_product();
        let storage = |label, size| allocator.buffer(label, size, BufferUsages::STORAGE);
        let settings = size_of::<LossUniforms>() as u64;
        let loss_settings = allocator.buffer("gs4d loss settings", settings, BufferUsages::UNIFORM);
        let slopes = storage("gs4d slopes of similarity", pixels * SLOPES);
        let pixel_gradients = storage("gs4d gradients of pixels", pixels * 16);
        // Zero: the loss does not depend on depth.
        let depth_gradients = storage("gs4d gradients of depths", pixels * 4);
        let tile_sums = storage("gs4d sums of tiles", tiles * 16);
        let first_pairs = storage("gs4d first pairs", u64::from(frame.slots) * 4);
        let gradients = storage("gs4d gradients of pairs", needed);
        let sums = [&first_pairs, &gradients, &pixel_gradients, &depth_gradients].map(wgpu::Buffer::as_entire_binding);
        let of_loss = [&loss_settings, &slopes, &pixel_gradients, &tile_sums, totals];
        Ok(Self {
            splats: frame.buffers.splats.clone(),
            color: frame.color.clone(),
            size,
            loss: bind_loss(work, of_loss, frame.color),
            blended: bind_blended(work, frame),
            sums: allocator.bind_group("gs4d sums", &work.passes.sums_group, &sums),
            splat_gradients: bind_splats(work, frame, [&first_pairs, &gradients]),
            loss_settings,
            slopes,
            pixel_gradients,
            tile_sums,
            totals: totals.clone(),
            depth_gradients,
        })
    }

    /// Returns the bindings of the pass `loss` for a picture with these colors.
    pub(crate) fn loss_group(&self, work: &Workspace<'_>, color: &wgpu::TextureView) -> wgpu::BindGroup {
        let Self { loss_settings, slopes, pixel_gradients, tile_sums, totals, .. } = self;
        bind_loss(work, [loss_settings, slopes, pixel_gradients, tile_sums, totals], color)
    }

    /// Returns whether the buffers were created for the resources of this frame and this size.
    pub(crate) fn fits(&self, frame: &FinishedFrame<'_>, size: UVec2) -> bool {
        self.size == size && self.splats == frame.buffers.splats && self.color == *frame.color
    }

    /// Records the pass `loss`.
    pub(crate) fn record_loss(&self, encoder: &mut wgpu::CommandEncoder, passes: &Passes, image: &GpuImage) {
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        self.dispatch_loss(&mut pass, passes, &self.loss, image);
    }

    /// Records the pass `loss` in a pass that has been begun, with the bindings of a picture.
    pub(crate) fn dispatch_loss(
        &self,
        pass: &mut wgpu::ComputePass<'_>,
        passes: &Passes,
        loss: &wgpu::BindGroup,
        image: &GpuImage,
    ) {
        let tiles = tiles(self.size);
        pass.set_bind_group(0, loss, &[]);
        pass.set_bind_group(1, &image.group, &[]);
        pass.set_pipeline(&passes.similarity);
        pass.dispatch_workgroups(tiles.x, tiles.y, 1);
        pass.set_pipeline(&passes.gradient);
        pass.dispatch_workgroups(tiles.x, tiles.y, 1);
        pass.set_pipeline(&passes.total);
        pass.dispatch_workgroups(1, 1, 1);
    }

    /// Records the passes that turn the gradients of pixels into those of parameters.
    pub(crate) fn record_backward(&self, work: &Workspace<'_>, encoder: &mut wgpu::CommandEncoder) {
        let Workspace { headless, passes, capture, parameters, .. } = work;
        let Some(frame) = headless.finished() else { return };
        let tiles = tiles(self.size);
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_bind_group(0, &self.blended, &[]);
        pass.set_bind_group(1, &self.sums, &[]);
        pass.set_pipeline(&passes.place);
        pass.dispatch_workgroups(frame.slots.div_ceil(256), 1, 1);
        pass.set_pipeline(&passes.pairs);
        pass.dispatch_workgroups(tiles.x, tiles.y, 1);
        pass.set_pipeline(&passes.project_backward);
        for ((chunk, splats), geometry) in parameters.chunks.iter().zip(&self.splat_gradients).zip(capture.geometry()) {
            pass.set_bind_group(0, splats, &[]);
            pass.set_bind_group(1, geometry, &[]);
            pass.set_bind_group(2, headless.recorded_list(), &[]);
            pass.set_bind_group(3, &chunk.group, &[]);
            let [across, down] = across_and_down(chunk.count().div_ceil(64));
            pass.dispatch_workgroups(across, down, 1);
        }
    }
}

/// Returns the bindings of the pass `loss`, for a picture with these colors: its settings and what it writes, in the
/// order of the shader.
fn bind_loss(
    work: &Workspace<'_>,
    [settings, written @ ..]: [&wgpu::Buffer; 5],
    color: &wgpu::TextureView,
) -> wgpu::BindGroup {
    let read = [settings.as_entire_binding(), wgpu::BindingResource::TextureView(color)];
    let resources = [&read[..], &written.map(wgpu::Buffer::as_entire_binding)].concat();
    work.headless.allocator().bind_group("gs4d loss", &work.passes.loss_group, &resources)
}

/// Returns the bindings of `blend_backward` to a frame.
fn bind_blended(work: &Workspace<'_>, frame: &FinishedFrame<'_>) -> wgpu::BindGroup {
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
    let targets = [frame.color, frame.depth].map(wgpu::BindingResource::TextureView);
    let resources = [&read.map(wgpu::Buffer::as_entire_binding)[..], &targets].concat();
    work.headless.allocator().bind_group("gs4d blended", &work.passes.blended_group, &resources)
}

/// Returns the bindings of `project_backward` to the splats of a frame, for each chunk: those to the first pair of each
/// splat and to the gradients of pairs too.
fn bind_splats(
    work: &Workspace<'_>,
    frame: &FinishedFrame<'_>,
    [first_pairs, gradients]: [&wgpu::Buffer; 2],
) -> Vec<wgpu::BindGroup> {
    let buffers = frame.buffers;
    let bind = |(index, chunk): (u64, &ParameterChunk)| {
        let instance = wgpu::BindingResource::Buffer(wgpu::BufferBinding {
            buffer: frame.instances,
            offset: index * u64::from(INSTANCE_STRIDE),
            size: NonZeroU64::new(size_of::<InstanceUniforms>() as u64),
        });
        let splats = [&chunk.scene_settings, &buffers.splats, &buffers.depth_keys, first_pairs, gradients];
        let resources = [&[instance][..], &splats.map(wgpu::Buffer::as_entire_binding)].concat();
        work.headless.allocator().bind_group("gs4d splats", &work.passes.splats_group, &resources)
    };
    (0..).zip(&work.parameters.chunks).map(bind).collect()
}
