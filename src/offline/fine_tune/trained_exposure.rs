//! The exposures of the cameras, which are trained beside a scene.
//!
//! In: the camera of each view, finished frames. Out: [`TrainedExposure`]: commands of the passes of `exposure`, around those of `loss`, and of
//! `adam`. Exposures are part of the state of training, not of the scene.

use super::exposure::{Exposure, IDENTITY, PULL};
use super::optimized::Optimized;
use super::passes::Passes;
use super::sample::{GpuImage, Sample};
use super::view_buffers::ViewBuffers;
use crate::offline::layout::ExposureUniforms;
use crate::offline::shaders::SHADERS;
use crate::renderer::bind::{Bind, group_layout, pipeline};
use crate::renderer::memory::with_room;
use crate::renderer::{GpuError, Headless, ShaderChecks};
use crate::view::{Background, tiles};
use glam::UVec2;
use wgpu::{BufferUsages, TextureFormat};

/// Four-vectors of an exposure.
const ROWS: u32 = 3;

/// Exposures that are trained.
#[derive(Debug)]
pub(super) struct TrainedExposure {
    pub values: Optimized,
    /// The camera of each view.
    cameras: Vec<u32>,
    settings: wgpu::Buffer,
    layout: wgpu::BindGroupLayout,
    expose: wgpu::ComputePipeline,
    backward: wgpu::ComputePipeline,
    gather: wgpu::ComputePipeline,
    center: wgpu::ComputePipeline,
    every: wgpu::BindGroup,
    corrected: Option<Corrected>,
}

/// The corrected picture, with the bindings of the passes that write and read it.
#[derive(Debug)]
struct Corrected {
    /// What it was created for.
    pixel_gradients: wgpu::Buffer,
    size: UVec2,
    group: wgpu::BindGroup,
    loss: wgpu::BindGroup,
}

/// The correction of one view, around the passes of its loss.
#[derive(Debug, Clone, Copy)]
pub(super) struct Correction<'a> {
    trained: &'a TrainedExposure,
    corrected: &'a Corrected,
}

impl TrainedExposure {
    /// Compiles the passes. All exposures are the identity; `cameras` has the camera of each view, by the number of the view.
    ///
    /// # Errors
    /// A shader that does not compile.
    pub(super) fn new(headless: &Headless, passes: &Passes, cameras: &[u32]) -> Result<Self, GpuError> {
        use Bind::{Read, Target, Texture, Uniform, Write};
        let (allocator, context) = (headless.allocator(), headless.context());
        let size = size_of::<ExposureUniforms>();
        let bindings = [Uniform(size), Texture, Target(TextureFormat::Rgba32Float), Read, Write, Write, Write];
        let layout = group_layout(&context.device, "gs4d exposure", &bindings);
        let of_every = group_layout(&context.device, "gs4d exposures", &[Write]);
        let shader = SHADERS.module(&context.device, "exposure", &[], ShaderChecks::Off)?;
        let [expose, backward, gather] =
            ["expose", "backward", "gather"].map(|entry| pipeline(&context.device, &shader, entry, &[Some(&layout)]));
        let center = pipeline(&context.device, &shader, "center", &[None, Some(&of_every)]);
        let count = cameras.iter().max().map_or(1, |last| last + 1);
        let usage = BufferUsages::STORAGE | BufferUsages::COPY_SRC;
        let own = allocator.buffer("gs4d trained exposures", u64::from(count * ROWS) * 16, usage);
        context.queue.write_buffer(&own, 0, bytemuck::cast_slice(&vec![IDENTITY; count as usize]));
        let every = allocator.bind_group("gs4d exposures", &of_every, &[own.as_entire_binding()]);
        Ok(Self {
            values: Optimized::new(headless, passes, own, count, ROWS),
            cameras: cameras.to_vec(),
            settings: allocator.buffer("gs4d exposure settings", size as u64, BufferUsages::UNIFORM),
            layout,
            expose,
            backward,
            gather,
            center,
            every,
            corrected: None,
        })
    }

    /// Returns the correction of the view whose frame was recorded last, and whose loss has this share in that of the batch; `None` if its
    /// camera is unknown. Creates the corrected picture only if sizes have changed.
    ///
    /// # Errors
    /// A picture that does not fit the GPU.
    pub(super) fn correction(
        &mut self,
        headless: &Headless,
        passes: &Passes,
        buffers: &ViewBuffers,
        sample: &Sample<'_>,
        share: f32,
    ) -> Result<Option<Correction<'_>>, GpuError> {
        let Some(&camera) = self.cameras.get(sample.number as usize) else { return Ok(None) };
        let size = sample.view.size;
        // An environment map is part of the scene, a color is not.
        let ([r, g, b], kept) = match sample.background {
            Background::Color(color) => (color, 1.0),
            Background::None => ([0.0; 3], 1.0),
            Background::Environment => ([0.0; 3], 0.0),
        };
        let settings = ExposureUniforms {
            background: [r, g, b, kept],
            size: size.to_array(),
            tiles: tiles(size).to_array(),
            share,
            pull: PULL,
            camera,
            padding: 0,
        };
        headless.context().queue.write_buffer(&self.settings, 0, bytemuck::bytes_of(&settings));
        if self.corrected.as_ref().is_none_or(|made| made.pixel_gradients != buffers.pixel_gradients) {
            let pixels = size.as_u64vec2().element_product();
            let create = || self.corrected(headless, passes, buffers, size);
            self.corrected = with_room(&headless.context().device, 16 * pixels, create)?;
        }
        let trained = &*self;
        Ok(trained.corrected.as_ref().map(|corrected| Correction { trained, corrected }))
    }

    fn corrected(&self, headless: &Headless, passes: &Passes, buffers: &ViewBuffers, size: UVec2) -> Option<Corrected> {
        let frame = headless.finished()?;
        let allocator = headless.allocator();
        let picture = allocator.texture("gs4d corrected picture", size, TextureFormat::Rgba32Float);
        let picture = picture.create_view(&Default::default());
        let tiles = tiles(size).as_u64vec2().element_product();
        let sums = allocator.buffer("gs4d sums of exposure", tiles * u64::from(ROWS) * 16, BufferUsages::STORAGE);
        let Optimized { values, gradients, .. } = &self.values;
        let whole = wgpu::Buffer::as_entire_binding;
        let [drawn, written] = [frame.color, &picture].map(wgpu::BindingResource::TextureView);
        let pixel_gradients = &buffers.pixel_gradients;
        let read_and_written = [values, pixel_gradients, &sums, gradients].map(whole);
        let resources = [vec![whole(&self.settings), drawn, written], read_and_written.to_vec()].concat();
        Some(Corrected {
            pixel_gradients: pixel_gradients.clone(),
            size,
            group: allocator.bind_group("gs4d exposure", &self.layout, &resources),
            loss: buffers.loss_group(headless, passes, &picture),
        })
    }

    /// Records step number `step`, counted from 1, at this rate.
    pub(super) fn record_step(
        &self,
        queue: &wgpu::Queue,
        pass: &mut wgpu::ComputePass<'_>,
        passes: &Passes,
        rate: f32,
        step: usize,
    ) {
        self.values.record_step(queue, pass, passes, [[rate; 4]; 5], step, None);
        pass.set_pipeline(&self.center);
        pass.set_bind_group(1, &self.every, &[]);
        pass.dispatch_workgroups(1, 1, 1);
    }

    /// Returns the exposures of all cameras.
    ///
    /// # Errors
    /// A lost device.
    pub(super) fn exposures(&self, headless: &Headless) -> Result<Vec<Exposure>, GpuError> {
        Ok(bytemuck::pod_collect_to_vec(&self.values.read_values(headless)?))
    }

    /// Returns the gradients with respect to the exposures.
    ///
    /// # Errors
    /// A lost device.
    pub(super) fn gradients(&self, headless: &Headless) -> Result<Vec<Exposure>, GpuError> {
        Ok(bytemuck::pod_collect_to_vec(&self.values.read_gradients(headless)?))
    }
}

impl Correction<'_> {
    /// Records the loss of the corrected picture, and its gradients.
    pub(super) fn record_loss(
        self,
        encoder: &mut wgpu::CommandEncoder,
        passes: &Passes,
        buffers: &ViewBuffers,
        image: &GpuImage,
    ) {
        let Self { trained, corrected } = self;
        let tiles = tiles(corrected.size);
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_bind_group(0, &corrected.group, &[]);
        pass.set_pipeline(&trained.expose);
        pass.dispatch_workgroups(tiles.x, tiles.y, 1);
        buffers.dispatch_loss(&mut pass, passes, &corrected.loss, image);
        pass.set_bind_group(0, &corrected.group, &[]);
        pass.set_pipeline(&trained.backward);
        pass.dispatch_workgroups(tiles.x, tiles.y, 1);
        pass.set_pipeline(&trained.gather);
        pass.dispatch_workgroups(1, 1, 1);
    }
}
