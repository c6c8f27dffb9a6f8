//! Drawing without a window: for commands, scoring and tests.
//!
//! In: scenes and views. Out: [`Frame`]s on the host, or [`Timings`](crate::renderer::Timings). Most calls wait for the GPU; there is no
//! read-back within a frame.

use crate::renderer::active::ActiveList;
use crate::renderer::capture::GpuCapture;
use crate::renderer::device::GpuContext;
use crate::renderer::device::GpuError;
use crate::renderer::device::WorkCounters;
use crate::renderer::device::memory::{Allocator, require_texture, with_room};
use crate::renderer::frame::Design;
use crate::renderer::frame::{Instance, ViewParameters, max_pairs};
use crate::renderer::global_sort::FinishedFrame;
use crate::renderer::layout::Counters;
use crate::renderer::pipelines::Renderer;
use crate::renderer::shaders::{ColorPrecision, ShaderChecks, Storage};
use crate::renderer::view::ViewRenderer;
use crate::scene::{RuntimeScene, TemporalFilter};
use crate::view::{Appearance, Background, Counts, Frame, Picture, View};
use glam::{UVec2, Vec3};

/// A renderer with its own device and one view.
#[derive(Debug)]
pub struct Headless {
    pub(super) context: GpuContext,
    pub(super) renderer: Renderer,
    pub(super) view: ViewRenderer,
    pub(super) filtered: bool,
    /// Whether measured frames have depths.
    pub(super) depths: bool,
    pub(super) precision: ColorPrecision,
    /// The list of the capture drawn last.
    pub(super) active: Option<ActiveList>,
}

impl Headless {
    /// Creates a renderer on the device and compiles its passes.
    ///
    /// # Errors
    /// When the device cannot run the passes.
    pub fn new(context: GpuContext, checks: ShaderChecks) -> Result<Self, GpuError> {
        let renderer = Renderer::new(&context.device, checks)?;
        let mut view = ViewRenderer::new(&context.device, &renderer);
        view.draws_again = true;
        Ok(Self {
            context,
            renderer,
            view,
            filtered: true,
            depths: false,
            precision: ColorPrecision::Single,
            active: None,
        })
    }

    /// Returns the device and its adapter.
    pub fn context(&self) -> &GpuContext {
        &self.context
    }

    /// Returns the counters of resources created, bytes uploaded and lists recorded so far.
    pub fn work(&self) -> &WorkCounters {
        self.renderer.work()
    }

    /// Returns an allocator for resources of clients of this renderer.
    pub fn allocator(&self) -> Allocator<'_> {
        self.renderer.allocator(&self.context.device)
    }

    /// Sets the design with which views are drawn. Default: [`Design::Auto`].
    pub fn set_design(&mut self, design: Design) {
        self.view.set_design(&self.renderer, design);
    }

    /// Compiles the passes that the first frame of a capture with this storage needs, for clients that load the capture at the same time.
    ///
    /// # Errors
    /// When a shader does not compile.
    pub fn compile_ahead(&self, storage: Storage) -> Result<(), GpuError> {
        let (blending, precision) = Default::default();
        self.renderer.passes.compile_ahead(&self.context.device, self.design(), storage, blending, precision)
    }

    /// Returns the design with which views are drawn, as [`ViewRenderer::design`]: never [`Design::Auto`].
    pub fn design(&self) -> Design {
        self.view.design()
    }

    /// Sets whether the frames that [`time`](Self::time) measures have expected and median depth. Default: `false`, only color and
    /// transmittance.
    pub fn measure_depths(&mut self, depths: bool) {
        self.depths = depths;
    }

    /// Sets the precision of the color of frames that [`time`](Self::time) measures. Default: [`ColorPrecision::Single`].
    pub fn measure_precision(&mut self, precision: ColorPrecision) {
        self.precision = precision;
    }

    /// Returns the renderer, for captures in chunk files.
    pub fn renderer(&self) -> &Renderer {
        &self.renderer
    }

    /// Sets whether temporal filters are used. Default: `true`.
    pub fn use_filters(&mut self, filtered: bool) {
        self.filtered = filtered;
    }

    /// Uploads a scene.
    ///
    /// # Errors
    /// As [`GpuCapture::upload`], and when the device has too little memory.
    pub fn upload(&self, scene: &RuntimeScene) -> Result<GpuCapture, GpuError> {
        let GpuContext { device, queue, .. } = &self.context;
        with_room(device, scene.size() as u64, || GpuCapture::upload(device, queue, &self.renderer, scene))?
    }

    /// Returns the list of the Gaussians that are active at a time according to the filter of a capture, for
    /// [`render_all`](Self::render_all); `None` if the capture has no filter.
    pub fn active(&self, capture: &GpuCapture, time: f32) -> Option<ActiveList> {
        let GpuContext { device, queue, .. } = &self.context;
        let mut active = ActiveList::new(device, &self.renderer, capture)?;
        self.activate(&mut active, queue, capture, time);
        Some(active)
    }

    /// Draws one capture as trained.
    ///
    /// # Errors
    /// When the picture exceeds a limit of the device or the device is lost.
    pub fn render(&mut self, capture: &GpuCapture, view: &View, background: Background) -> Result<Frame, GpuError> {
        let parameters = ViewParameters { background, ..ViewParameters::default() };
        let active = self.take_active(capture, view.time);
        let frame = self.render_all(&[instance(capture, active.as_ref(), view)], &parameters);
        self.active = active;
        frame
    }

    /// Draws several captures into one picture, in order of depth and behind opaque surfaces if given. Depths are empty if the parameters
    /// disable them.
    ///
    /// # Errors
    /// As [`render`](Self::render).
    pub fn render_all(
        &mut self,
        instances: &[Instance<'_>],
        parameters: &ViewParameters<'_>,
    ) -> Result<Frame, GpuError> {
        let size = instances.first().map_or(UVec2::ONE, |instance| instance.view.size);
        self.require_readable(size, parameters.precision)?;
        let mut counters = self.submit(instances, parameters)?;
        if self.view.must_draw_again(&self.renderer, &counters) {
            counters = self.submit(instances, parameters)?;
        }
        // This frame is complete, but later frames are faster with a larger capacity.
        self.view.make_room(&counters);
        let (color, depth) = self.read_targets(size)?;
        Ok(Frame {
            picture: Picture { size, pixels: color.iter().map(|p| Vec3::new(p[0], p[1], p[2])).collect() },
            transmittance: color.iter().map(|p| p[3]).collect(),
            depth: depth.iter().map(|p| p[0]).collect(),
            median_depth: depth.iter().map(|p| p[1]).collect(),
            counts: Counts { visible: counters.visible, pairs: self.view.design.pair_count(&counters) },
        })
    }

    /// Takes the list in `active` if it belongs to this capture, or creates a new one, and activates it for a time. Returns `None` without a
    /// filter. The caller stores the list in `active` after use.
    pub(super) fn take_active(&mut self, capture: &GpuCapture, time: f32) -> Option<ActiveList> {
        if !self.filtered {
            return None;
        }
        let made = self.active.take().filter(|active| active.is_for(capture));
        let mut active = made.or_else(|| ActiveList::new(&self.context.device, &self.renderer, capture))?;
        self.activate(&mut active, &self.context.queue, capture, time);
        Some(active)
    }

    pub(super) fn activate(&self, active: &mut ActiveList, queue: &wgpu::Queue, capture: &GpuCapture, time: f32) {
        if active.prepare(queue, capture, time) {
            let label = wgpu::CommandEncoderDescriptor { label: Some("gs4d activate") };
            let mut encoder = self.context.device.create_command_encoder(&label);
            active.record(&self.renderer, &mut encoder, capture);
            queue.submit([encoder.finish()]);
        }
    }

    /// Draws all Gaussians of one capture, without its filter. The results stay on the GPU; the lists contain all pairs.
    ///
    /// # Errors
    /// As [`render`](Self::render), and if the pairs exceed the limits of the device.
    pub fn draw(&mut self, capture: &GpuCapture, view: &View, background: Background) -> Result<(), GpuError> {
        // Clients read the buffers of this design.
        self.set_design(Design::GlobalSort);
        let parameters = ViewParameters { background, ..ViewParameters::default() };
        let instances = [instance(capture, None, view)];
        loop {
            let counters = self.submit(&instances, &parameters)?;
            let (pairs, capacity) = (self.view.design.pair_count(&counters), self.view.pair_capacity());
            if pairs <= capacity {
                return Ok(());
            }
            let limit = max_pairs(&self.context.device);
            if capacity == limit {
                let (needed, limit) = (u64::from(pairs) * 4, u64::from(limit) * 4);
                return Err(GpuError::TooLarge { what: "the pairs of splats and tiles", needed, limit });
            }
            self.view.make_room(&counters);
        }
    }

    /// Records a frame of one capture, with its filter, without waiting for it. The picture is complete, but the lists omit pairs beyond the
    /// capacity, which grows from frame to frame. Submit the encoder before the next frame is recorded.
    ///
    /// # Errors
    /// As [`render`](Self::render).
    pub fn record(
        &mut self,
        encoder: &mut wgpu::CommandEncoder,
        capture: &GpuCapture,
        view: &View,
        background: Background,
    ) -> Result<(), GpuError> {
        self.set_design(Design::GlobalSort);
        let active = self.take_active(capture, view.time);
        let parameters = ViewParameters { background, ..ViewParameters::default() };
        let instances = [instance(capture, active.as_ref(), view)];
        let prepared = self.prepare(&instances, &parameters);
        if prepared.is_ok() {
            self.view.record(&self.renderer, encoder, &instances);
        }
        self.active = active;
        prepared
    }

    /// Replaces the temporal filter of a capture. `interval` is the time interval of the capture.
    ///
    /// # Errors
    /// As [`GpuCapture::replace_filter`].
    pub fn replace_filter(
        &self,
        capture: &mut GpuCapture,
        filter: &TemporalFilter,
        interval: [f32; 2],
    ) -> Result<(), GpuError> {
        capture.replace_filter(&self.context.device, &self.context.queue, &self.renderer, filter, interval)
    }

    /// Returns the bind group layouts of the geometry of captures in single precision and of lists of active Gaussians, for passes of
    /// clients.
    pub fn capture_layouts(&self) -> [&wgpu::BindGroupLayout; 2] {
        let layouts = &self.renderer.layouts;
        [&layouts.captures[Storage::Sliced as usize][0], &layouts.active]
    }

    /// Returns the bind group of the list of the Gaussians that were active in the frame [recorded](Self::record) last, which begins at
    /// `first_listed` of its instance; without a filter, of one that is not read.
    pub fn recorded_list(&self) -> &wgpu::BindGroup {
        self.renderer.list(self.active.as_ref())
    }

    /// Returns the resources of the last frame on the GPU; `None` before the first frame, and in [`Design::TileBins`], which has other buffers.
    pub fn finished(&self) -> Option<FinishedFrame<'_>> {
        self.view.finished()
    }

    /// Draws one frame and waits for it. Returns its counters.
    fn submit(&mut self, instances: &[Instance<'_>], parameters: &ViewParameters<'_>) -> Result<Counters, GpuError> {
        self.prepare(instances, parameters)?;
        let GpuContext { device, queue, .. } = &self.context;
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("gs4d") });
        self.view.record(&self.renderer, &mut encoder, instances);
        queue.submit([encoder.finish()]);
        self.wait()?;
        let Some((counters, offset)) = self.view.design.counters() else { return Ok(Counters::default()) };
        let counters = self.copy_out_from(counters, offset, size_of::<Counters>() as u64)?;
        Ok(bytemuck::pod_read_unaligned(&counters))
    }

    /// Prepares a frame. Too little memory for its targets is an error.
    fn prepare(&mut self, instances: &[Instance<'_>], parameters: &ViewParameters<'_>) -> Result<(), GpuError> {
        let GpuContext { device, queue, .. } = &self.context;
        let size = instances.first().map_or(UVec2::ONE, |instance| instance.view.size);
        let needed = size.as_u64vec2().element_product() * texel_bytes(parameters.precision);
        let prepare = || self.view.prepare(device, queue, &self.renderer, instances, parameters);
        let prepared = with_room(device, needed, prepare);
        if prepared.is_err() {
            // Some of the created resources may be invalid.
            self.view.release();
        }
        prepared?
    }

    /// Checks that a picture of this size can be drawn and read back, without drawing it.
    ///
    /// # Errors
    /// The limit of the device that it exceeds.
    pub(crate) fn require_picture(&self, size: UVec2) -> Result<(), GpuError> {
        require_texture(size, &self.context.device.limits())?;
        self.require_readable(size, ColorPrecision::Single)
    }

    /// Checks before drawing that a picture of this size can be read back.
    fn require_readable(&self, size: UVec2, precision: ColorPrecision) -> Result<(), GpuError> {
        let row = u64::from(size.x) * texel_bytes(precision);
        let needed = row.next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT.into()) * u64::from(size.y);
        let limit = self.context.device.limits().max_buffer_size;
        match needed > limit {
            true => Err(GpuError::Picture { size: size.to_array(), what: "its pixels", needed, limit }),
            false => Ok(()),
        }
    }

    pub(super) fn wait(&self) -> Result<(), GpuError> {
        let wait = wgpu::PollType::wait_indefinitely();
        self.context.device.poll(wait).map(|_| ()).map_err(|error| GpuError::Device(error.to_string()))
    }

    /// Returns color with transmittance, and depths, of every pixel.
    fn read_targets(&self, size: UVec2) -> Result<(Vec<[f32; 4]>, Vec<[f32; 2]>), GpuError> {
        let Some((color, depth)) = self.view.textures() else { return Ok(Default::default()) };
        let colors = self.read_colors(color, size)?;
        let depths = depth.map(|depth| self.read_texture(depth, size)).transpose()?.unwrap_or_default();
        Ok((colors, bytemuck::pod_collect_to_vec(&depths)))
    }

    /// Returns the motion of each pixel between the previous frame and the last frame, as described in [`ViewRenderer::motion`]; empty if the
    /// last frame was drawn without [`previous`](ViewParameters::previous) views.
    ///
    /// # Errors
    /// When the device is lost.
    pub fn read_motion(&self) -> Result<Vec<[f32; 4]>, GpuError> {
        let Some((motion, size)) = self.view.motion_texture() else { return Ok(Vec::new()) };
        self.read_colors(motion, size)
    }

    /// Returns the texels of a texture of either precision.
    fn read_colors(&self, texture: &wgpu::Texture, size: UVec2) -> Result<Vec<[f32; 4]>, GpuError> {
        let bytes = self.read_texture(texture, size)?;
        if texture.format() == ColorPrecision::Half.format() {
            let halves = bytemuck::pod_collect_to_vec::<u8, [half::f16; 4]>(&bytes);
            Ok(halves.iter().map(|p| p.map(half::f16::to_f32)).collect())
        } else {
            Ok(bytemuck::pod_collect_to_vec(&bytes))
        }
    }

    /// Returns the texels of a texture, without the padding of rows.
    fn read_texture(&self, texture: &wgpu::Texture, size: UVec2) -> Result<Vec<u8>, GpuError> {
        let GpuContext { device, queue, .. } = &self.context;
        let row = size.x * texture.format().block_copy_size(None).unwrap_or(0);
        let padded = row.next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
        let buffer = readback_buffer(device, u64::from(padded) * u64::from(size.y))?;
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encoder.copy_texture_to_buffer(
            texture.as_image_copy(),
            wgpu::TexelCopyBufferInfo {
                buffer: &buffer,
                layout: wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(padded), rows_per_image: None },
            },
            wgpu::Extent3d { width: size.x, height: size.y, depth_or_array_layers: 1 },
        );
        queue.submit([encoder.finish()]);
        let bytes = self.read(&buffer)?;
        let rows: Vec<&[u8]> = bytes.chunks_exact(padded as usize).map(|padded| &padded[..row as usize]).collect();
        Ok(rows.concat())
    }

    /// Copies the first `size` bytes of a buffer to the host, waits for them and returns them.
    ///
    /// # Errors
    /// When the device is lost.
    pub fn copy_out(&self, source: &wgpu::Buffer, size: u64) -> Result<Vec<u8>, GpuError> {
        self.copy_out_from(source, 0, size)
    }

    fn copy_out_from(&self, source: &wgpu::Buffer, offset: u64, size: u64) -> Result<Vec<u8>, GpuError> {
        let GpuContext { device, queue, .. } = &self.context;
        let buffer = readback_buffer(device, size)?;
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encoder.copy_buffer_to_buffer(source, offset, &buffer, 0, size);
        queue.submit([encoder.finish()]);
        self.read(&buffer)
    }

    /// Maps a buffer, waits for the GPU and returns the bytes.
    fn read(&self, buffer: &wgpu::Buffer) -> Result<Vec<u8>, GpuError> {
        let (sender, receiver) = std::sync::mpsc::channel();
        buffer.slice(..).map_async(wgpu::MapMode::Read, move |result| {
            // Sending fails only if the receiver below is dropped; the result is not needed then.
            let _ = sender.send(result);
        });
        self.wait()?;
        match receiver.try_recv() {
            Ok(Ok(())) => {
                let bytes = buffer.slice(..).get_mapped_range().to_vec();
                buffer.unmap();
                Ok(bytes)
            }
            _ => Err(GpuError::Device("a buffer could not be read back".into())),
        }
    }
}

/// Returns the instance of a capture with the default appearance: as trained.
pub(super) fn instance<'a>(capture: &'a GpuCapture, active: Option<&'a ActiveList>, view: &View) -> Instance<'a> {
    Instance { capture, active, view: *view, appearance: Appearance::default() }
}

/// Returns the bytes of the color of a pixel.
pub(super) fn texel_bytes(precision: ColorPrecision) -> u64 {
    precision.format().block_copy_size(None).unwrap_or(0).into()
}

fn readback_buffer(device: &wgpu::Device, size: u64) -> Result<wgpu::Buffer, GpuError> {
    let buffer = wgpu::BufferDescriptor {
        label: Some("gs4d readback"),
        size,
        usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    };
    with_room(device, size, || device.create_buffer(&buffer))
}
