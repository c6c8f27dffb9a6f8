//! Scoring views on the GPU, with the renderer's own passes.
//!
//! In: a finished frame of a [`Headless`] renderer. Out: the contribution of each Gaussian to the frame
//! ([`ViewScore`]), summed without float atomics, so that every run gives the same result.

use super::{ScoreEngine, ScoreError, ViewScore, Want};
use crate::offline::engine::EngineError;
use crate::offline::engine::shaders::SHADERS;
use crate::renderer::device::bind::{Bind, group_layout, pipeline};
use crate::renderer::device::memory::{Allocator, binding_limit};
use crate::renderer::{GpuCapture, GpuContext, GpuError, Headless, ShaderChecks, layout};
use crate::scene::RuntimeScene;
use crate::view::{Background, View};

/// Pipelines and buffers of `score`, on the device of a [`Headless`].
#[derive(Debug)]
pub struct Scorer {
    inputs: wgpu::BindGroupLayout,
    outputs: wgpu::BindGroupLayout,
    place: wgpu::ComputePipeline,
    pairs: wgpu::ComputePipeline,
    gather: wgpu::ComputePipeline,
    buffers: Option<Buffers>,
}

#[derive(Debug)]
struct Buffers {
    slots: u32,
    pairs: u32,
    scores: wgpu::Buffer,
    outputs: wgpu::BindGroup,
}

impl Scorer {
    /// Compiles the pass.
    ///
    /// # Errors
    /// If a limit of the device is too low.
    pub fn new(headless: &Headless, checks: ShaderChecks) -> Result<Self, GpuError> {
        let device = &headless.context().device;
        let limits = device.limits();
        // Two arrays of 8 x 256 and one of 256 vectors.
        let needs = [
            ("max_compute_workgroup_storage_size", limits.max_compute_workgroup_storage_size, 20_496),
            ("max_storage_buffers_per_shader_stage", limits.max_storage_buffers_per_shader_stage, 10),
        ];
        for (what, found, needed) in needs {
            if found < needed {
                return Err(GpuError::Limit { what, found: found.into(), needed: needed.into() });
            }
        }
        let frame = Bind::Uniform(size_of::<layout::FrameUniforms>());
        let inputs = group_layout(
            device,
            "gs4d score inputs",
            &[frame, Bind::Read, Bind::Read, Bind::Read, Bind::Read, Bind::Read, Bind::Read, Bind::Read, Bind::Texture],
        );
        let outputs = group_layout(device, "gs4d score outputs", &[Bind::Write, Bind::Write, Bind::Write]);
        let shader = SHADERS.module(device, "score", &[], checks)?;
        let pipeline = |entry| pipeline(device, &shader, entry, &[&inputs, &outputs].map(Some));
        Ok(Self {
            place: pipeline("place"),
            pairs: pipeline("pairs"),
            gather: pipeline("gather"),
            inputs,
            outputs,
            buffers: None,
        })
    }

    /// Draws the view and scores it.
    ///
    /// # Errors
    /// If the picture or the pairs do not fit the device, or the device is lost.
    pub fn score(
        &mut self,
        headless: &mut Headless,
        capture: &GpuCapture,
        view: &View,
        background: Background,
    ) -> Result<ViewScore, GpuError> {
        headless.draw(capture, view, background)?;
        let GpuContext { device, queue, .. } = headless.context();
        let Some(frame) = headless.finished() else { return Err(GpuError::Device("nothing was drawn".into())) };
        let buffers = match self.buffers.take() {
            Some(made) if (made.slots, made.pairs) == (frame.slots, frame.pairs) => made,
            _ => self.new_buffers(headless.allocator(), frame.slots, frame.pairs)?,
        };
        let buffers = self.buffers.insert(buffers);
        let inputs = [
            frame.frame,
            frame.counters,
            &frame.buffers.tile_ranges,
            &frame.buffers.pair_splats,
            &frame.buffers.splats,
            &frame.buffers.order,
            &frame.buffers.offsets,
            &frame.buffers.depth_keys,
        ];
        let mut inputs = inputs.map(wgpu::Buffer::as_entire_binding).to_vec();
        inputs.push(wgpu::BindingResource::TextureView(frame.color));
        let inputs = headless.allocator().bind_group("gs4d score inputs", &self.inputs, &inputs);
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("gs4d score") });
        {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            pass.set_bind_group(0, &inputs, &[]);
            pass.set_bind_group(1, &buffers.outputs, &[]);
            let blocks = frame.slots.div_ceil(256);
            let tiles = view.tiles();
            pass.set_pipeline(&self.place);
            pass.dispatch_workgroups(blocks, 1, 1);
            pass.set_pipeline(&self.pairs);
            pass.dispatch_workgroups(tiles.x, tiles.y, 1);
            pass.set_pipeline(&self.gather);
            pass.dispatch_workgroups(blocks, 1, 1);
        }
        queue.submit([encoder.finish()]);
        let bytes = headless.copy_out(&buffers.scores, capture.len() as u64 * 16)?;
        let sums: Vec<[f32; 4]> = bytes.chunks_exact(16).map(bytemuck::pod_read_unaligned).collect();
        let column = |at: usize| sums.iter().map(|sum| sum[at]).collect();
        Ok(ViewScore { contribution: column(0), energy: column(1), removal: column(2) })
    }

    /// Creates the buffers for these numbers of slots and pairs.
    fn new_buffers(&self, allocator: Allocator<'_>, slots: u32, pairs: u32) -> Result<Buffers, GpuError> {
        let limit = binding_limit(&allocator.device.limits());
        let needed = u64::from(pairs) * 16;
        if needed > limit {
            return Err(GpuError::TooLarge { what: "the scores of pairs", needed, limit });
        }
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC;
        let buffer = |label, count: u32, each: u64| allocator.buffer(label, u64::from(count) * each, usage);
        let first_pairs = buffer("gs4d first pairs", slots, 4);
        let pair_scores = buffer("gs4d pair scores", pairs, 16);
        let scores = buffer("gs4d scores", slots, 16);
        let resources = [&first_pairs, &pair_scores, &scores].map(|b| b.as_entire_binding());
        let outputs = allocator.bind_group("gs4d score outputs", &self.outputs, &resources);
        Ok(Buffers { slots, pairs, scores, outputs })
    }
}

/// A scene on the GPU, prepared for scoring. Its CPU reference is [`CpuEngine`](super::engine::CpuEngine).
#[derive(Debug)]
pub struct GpuEngine<'a> {
    headless: &'a mut Headless,
    scorer: Scorer,
    capture: GpuCapture,
    background: Background,
}

impl<'a> GpuEngine<'a> {
    /// Uploads the scene and compiles the pass.
    ///
    /// # Errors
    /// If the scene or the pass does not fit the device.
    pub fn new(
        headless: &'a mut Headless,
        scene: &RuntimeScene,
        background: Background,
        checks: ShaderChecks,
    ) -> Result<Self, GpuError> {
        let scorer = Scorer::new(headless, checks)?;
        let capture = headless.upload(scene)?;
        Ok(Self { headless, scorer, capture, background })
    }
}

impl ScoreEngine for GpuEngine<'_> {
    /// Always computes all sums: `want` has no effect.
    fn score(&mut self, view: &View, _want: Want) -> Result<ViewScore, ScoreError> {
        Ok(self.scorer.score(self.headless, &self.capture, view, self.background).map_err(EngineError::from)?)
    }
}
