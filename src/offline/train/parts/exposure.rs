//! The exposures of the cameras, which are trained beside a scene.
//!
//! In: the camera of each view, finished frames. Out: [`TrainedExposures`]: commands of the passes of `exposure`,
//! around those of `loss`, and of `adam`. Exposures are part of the state of training, not of the scene.

use super::part::Part;
use super::request::Request;
use crate::offline::engine::layout::ExposureUniforms;
use crate::offline::engine::shaders::LIBRARIES;
use crate::offline::train::gpu::{GpuImage, Optimized, Quantity, RecordedView, Workspace};
use crate::offline::train::reference::exposure::{Exposure, IDENTITY, PULL};
use crate::offline::train::schedule::Step;
use crate::offline::train::trainer_error::TrainerError;
use crate::renderer::device::bind::{Bind, group_layout, pipeline};
use crate::renderer::device::memory::with_room;
use crate::renderer::shaders::ShaderSet;
use crate::renderer::{GpuError, Headless, ShaderChecks};
use crate::view::{Background, tiles};
use wgpu::{BufferUsages, TextureFormat};

/// The shader of the pass `exposure`.
pub(super) static SHADERS: ShaderSet =
    ShaderSet::new(&[("exposure", include_str!("../../../../shaders/offline/exposure.wgsl"))], LIBRARIES);

/// Four-vectors of an exposure.
const ROWS: u32 = 3;

/// Exposures that are trained.
#[derive(Debug)]
pub(crate) struct TrainedExposures {
    values: Optimized,
    /// The camera of each view.
    cameras: Vec<u32>,
    settings: wgpu::Buffer,
    layout: wgpu::BindGroupLayout,
    expose: wgpu::ComputePipeline,
    backward: wgpu::ComputePipeline,
    gather: wgpu::ComputePipeline,
    center: wgpu::ComputePipeline,
    /// Bindings of `center`, to all exposures.
    all: wgpu::BindGroup,
    corrected: Option<Corrected>,
}

/// The corrected picture, with the bindings of the passes that write and read it.
#[derive(Debug)]
struct Corrected {
    /// The buffer that the bindings were created for.
    pixel_gradients: wgpu::Buffer,
    group: wgpu::BindGroup,
    loss: wgpu::BindGroup,
}

impl TrainedExposures {
    /// Makes the part if exposures are trained.
    pub(super) fn make(work: &Workspace<'_>, request: &Request<'_>) -> Result<Option<Box<dyn Part>>, TrainerError> {
        if request.settings.exposure { Ok(Some(Box::new(Self::new(work, request.cameras)?))) } else { Ok(None) }
    }

    /// Compiles the passes. All exposures are the identity; `cameras` has the camera of each view, by the number of the
    /// view.
    fn new(work: &Workspace<'_>, cameras: &[u32]) -> Result<Self, GpuError> {
        use Bind::{Read, Target, Texture, Uniform, Write};
        let (allocator, device) = (work.headless.allocator(), &work.headless.context().device);
        let size = size_of::<ExposureUniforms>();
        let bindings = [Uniform(size), Texture, Target(TextureFormat::Rgba32Float), Read, Write, Write, Write];
        let layout = group_layout(device, "gs4d exposure", &bindings);
        let of_all = group_layout(device, "gs4d exposures", &[Write]);
        let shader = SHADERS.module(device, "exposure", &[], ShaderChecks::Off)?;
        let [expose, backward, gather] =
            ["expose", "backward", "gather"].map(|entry| pipeline(device, &shader, entry, &[Some(&layout)]));
        let center = pipeline(device, &shader, "center", &[None, Some(&of_all)]);
        let count = cameras.iter().max().map_or(1, |last| last + 1);
        let usage = BufferUsages::STORAGE | BufferUsages::COPY_SRC;
        let own = allocator.buffer("gs4d trained exposures", u64::from(count * ROWS) * 16, usage);
        work.queue().write_buffer(&own, 0, bytemuck::cast_slice(&vec![IDENTITY; count as usize]));
        let all = allocator.bind_group("gs4d exposures", &of_all, &[own.as_entire_binding()]);
        Ok(Self {
            values: Optimized::new(work.headless, &work.passes, own, count, ROWS),
            cameras: cameras.to_vec(),
            settings: allocator.buffer("gs4d exposure settings", size as u64, BufferUsages::UNIFORM),
            layout,
            expose,
            backward,
            gather,
            center,
            all,
            corrected: None,
        })
    }

    /// Sets the exposures of all cameras.
    pub(crate) fn write(&self, headless: &Headless, exposures: &[Exposure]) {
        headless.context().queue.write_buffer(&self.values.values, 0, bytemuck::cast_slice(exposures));
    }

    /// Creates the corrected picture of a view whose frame was recorded last, unless there is one for its buffers.
    fn fit(&mut self, work: &Workspace<'_>, view: &RecordedView<'_>) -> Result<(), GpuError> {
        if self.corrected.as_ref().is_none_or(|made| made.pixel_gradients != view.buffers.pixel_gradients) {
            let bytes = 16 * view.size.as_u64vec2().element_product();
            let create = || self.corrected(work, view);
            self.corrected = with_room(&work.headless.context().device, bytes, create)?;
        }
        Ok(())
    }

    fn corrected(&self, work: &Workspace<'_>, view: &RecordedView<'_>) -> Option<Corrected> {
        let frame = work.headless.finished()?;
        let allocator = work.headless.allocator();
        let picture = allocator.texture("gs4d corrected picture", view.size, TextureFormat::Rgba32Float);
        let picture = picture.create_view(&Default::default());
        let tiles = tiles(view.size).as_u64vec2().element_product();
        let sums = allocator.buffer("gs4d sums of exposure", tiles * u64::from(ROWS) * 16, BufferUsages::STORAGE);
        let Optimized { values, gradients, .. } = &self.values;
        let whole = wgpu::Buffer::as_entire_binding;
        let [drawn, written] = [frame.color, &picture].map(wgpu::BindingResource::TextureView);
        let pixel_gradients = &view.buffers.pixel_gradients;
        let read_and_written = [values, pixel_gradients, &sums, gradients].map(whole);
        let resources = [vec![whole(&self.settings), drawn, written], read_and_written.to_vec()].concat();
        Some(Corrected {
            pixel_gradients: pixel_gradients.clone(),
            group: allocator.bind_group("gs4d exposure", &self.layout, &resources),
            loss: view.buffers.loss_group(work, &picture),
        })
    }

    /// Returns the exposures of all cameras, or their gradients.
    ///
    /// # Errors
    /// A lost device.
    pub(crate) fn read(&self, headless: &Headless, what: Quantity) -> Result<Vec<Exposure>, GpuError> {
        Ok(bytemuck::pod_collect_to_vec(&self.values.read(headless, what)?))
    }
}

/// Returns the settings of the passes for a view of this camera.
fn settings_of(view: &RecordedView<'_>, camera: u32) -> ExposureUniforms {
    // An environment map is part of the scene, and is exposed; a color is not.
    let ([r, g, b], unexposed) = match view.background {
        Background::Color(color) => (color, 1.0),
        Background::None => ([0.0; 3], 1.0),
        Background::Environment => ([0.0; 3], 0.0),
    };
    ExposureUniforms {
        background: [r, g, b, unexposed],
        size: view.size.to_array(),
        tiles: tiles(view.size).to_array(),
        share: view.share,
        pull: PULL,
        camera,
        padding: 0,
    }
}

impl Part for TrainedExposures {
    /// Records the loss of the picture that the exposure of its camera corrects, and the gradients of both; nothing if
    /// the camera is unknown.
    fn record_loss(
        &mut self,
        work: &Workspace<'_>,
        view: &RecordedView<'_>,
        image: &GpuImage,
        encoder: &mut wgpu::CommandEncoder,
    ) -> Result<bool, GpuError> {
        let Some(&camera) = self.cameras.get(view.number as usize) else { return Ok(false) };
        work.queue().write_buffer(&self.settings, 0, bytemuck::bytes_of(&settings_of(view, camera)));
        self.fit(work, view)?;
        let Some(corrected) = &self.corrected else { return Ok(false) };
        let tiles = tiles(view.size);
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_bind_group(0, &corrected.group, &[]);
        pass.set_pipeline(&self.expose);
        pass.dispatch_workgroups(tiles.x, tiles.y, 1);
        view.buffers.dispatch_loss(&mut pass, &work.passes, &corrected.loss, image);
        pass.set_bind_group(0, &corrected.group, &[]);
        pass.set_pipeline(&self.backward);
        pass.dispatch_workgroups(tiles.x, tiles.y, 1);
        pass.set_pipeline(&self.gather);
        pass.dispatch_workgroups(1, 1, 1);
        Ok(true)
    }

    fn record_step(&self, work: &Workspace<'_>, pass: &mut wgpu::ComputePass<'_>, step: &Step) {
        let rate = (step.rates.exposure * step.factor) as f32;
        self.values.record_step(work.queue(), pass, &work.passes, [[rate; 4]; 5], step.count, None);
        pass.set_pipeline(&self.center);
        pass.set_bind_group(1, &self.all, &[]);
        pass.dispatch_workgroups(1, 1, 1);
    }

    fn optimized(&self) -> Option<&Optimized> {
        Some(&self.values)
    }
}
