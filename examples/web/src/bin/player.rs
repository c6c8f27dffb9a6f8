//! The player of a page, without Bevy.
//!
//! In: a canvas, then a file, then cameras and times. Out: pictures on the canvas, of the beginning of a file before
//! all of it has been received. The page calls [`Player`] from JavaScript (`page/player.js`); nothing here waits: a
//! file is opened in steps, and the page asks whether the device has finished the last picture. Of an index of chunk
//! files, the page fetches those that a [`Plan`] names.

use bevy_gs4d::renderer::{
    ActiveList, CaptureUpload, Design, GpuCapture, GpuContext, Instance, Renderer, ShaderChecks, ViewParameters,
    ViewRenderer,
};
use bevy_gs4d::scene::{Importances, RuntimeScene};
use bevy_gs4d::view::{Appearance, Background, Optics, Thinning, View};
use glam::{Mat4, UVec2};
use gs4d_web::{About, Faults, Opening, OpeningStep, report_panics, view};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use wasm_bindgen::prelude::wasm_bindgen;
use web_sys::HtmlCanvasElement;

#[path = "player/present.rs"]
mod present;
#[path = "player/streamed.rs"]
mod streamed;

use present::Present;
use streamed::{Stepped, Streamed, Target};

/// Bytes that a step uploads.
const UPLOAD: u64 = 1 << 18;

/// Bytes that are uploaded before the device has to have taken them: a browser blocks the page where it has no more
/// memory for them.
const UPLOADED_AT_ONCE: u64 = 1 << 22;

/// An importance that every Gaussian exceeds that can be seen, capture units.
const FAINTEST: f32 = 1e-30;

/// A player on a canvas.
#[wasm_bindgen]
pub struct Player {
    context: GpuContext,
    faults: Faults,
    surface: wgpu::Surface<'static>,
    configuration: wgpu::SurfaceConfiguration,
    renderer: Renderer,
    view: ViewRenderer,
    present: Present,
    opening: Option<Loader>,
    /// The beginning of the file that is being received.
    preview: Option<Loader>,
    shown: Option<Shown>,
    /// The background in place of that of the capture.
    background: Option<[f32; 3]>,
    /// The share of the Gaussians that is drawn.
    share: f32,
    /// Whether the device has finished the last picture, and whether it has taken what was uploaded.
    finished: Arc<AtomicBool>,
    taken: Arc<AtomicBool>,
    /// Bytes that were uploaded since the device had taken all.
    untaken: u64,
    /// The number of captures in chunk files that were opened.
    streams: u32,
}

/// What a page does next for a capture in chunk files.
#[wasm_bindgen(getter_with_clone)]
pub struct Plan {
    /// Numbers of the files to fetch, the most urgent first.
    pub fetch: Vec<u32>,
    /// Numbers of the files to fetch no further.
    pub give_up: Vec<u32>,
}

/// What a step with the files of a capture has done.
#[wasm_bindgen]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Step {
    /// There is nothing to do.
    Nothing,
    /// A part of the work.
    Part,
    /// The picture may be another one now.
    File,
}

/// A file, or the beginning of one, that is being opened.
enum Loader {
    Reading(Opening),
    /// With the share of the Gaussians of the file that the scene has.
    Read(Box<RuntimeScene>, f32),
    Uploading(Box<CaptureUpload<RuntimeScene>>, Kept, Option<Box<Streamed>>),
    /// The first picture of a capture in chunk files needs the first of these.
    Uploaded(Box<Shown>),
}

/// What is kept of a scene beside its Gaussians.
struct Kept {
    about: About,
    background: Background,
    optics: Optics,
    importances: Importances,
    /// The share of the Gaussians of the file that the scene has.
    of: f32,
}

/// The capture that is shown, or its beginning.
struct Shown {
    capture: GpuCapture,
    active: Option<ActiveList>,
    kept: Kept,
    /// Its files, if it is in chunk files.
    stream: Option<Box<Streamed>>,
}

impl Shown {
    /// Returns the capture in a view, thinned to the most important share of its Gaussians. Those of the beginning of a
    /// file also fill the gaps of the Gaussians that are missing.
    fn instance(&self, view: View, share: f32) -> Instance<'_> {
        let Kept { of, .. } = &self.kept;
        // Those of files come and go.
        let of_files = self.stream.as_ref().filter(|_| share < 1.0).map(|stream| stream.importances());
        let importances = of_files.as_ref().unwrap_or(&self.kept.importances);
        let least = importances.least_of(share);
        let thinning = if *of < 1.0 {
            let least = least.max(FAINTEST);
            Thinning::new(least, importances.share_above(least) * of)
        } else {
            importances.thinning(least)
        };
        let appearance = Appearance { thinning, ..Appearance::default() };
        Instance { capture: &self.capture, active: self.active.as_ref(), view, appearance }
    }

    /// Returns whether the files of its first picture are missing.
    fn lacks_picture(&self) -> bool {
        self.stream.as_ref().is_some_and(|stream| !stream.has_first_picture())
    }

    /// Returns whether no file has been received that is not drawn.
    fn is_idle(&self) -> bool {
        self.stream.as_ref().is_none_or(|stream| stream.is_idle())
    }

    /// Notes where the Gaussians of the first files are.
    fn note_place(&mut self) {
        if let Some(stream) = &mut self.stream {
            self.kept.about.place(stream.gaussians(), stream.take_core());
        }
    }

    fn parameters(&self, background: Option<[f32; 3]>) -> ViewParameters<'static> {
        let background = background.map_or(self.kept.background, Background::Color);
        ViewParameters { background, depths: false, ..ViewParameters::default() }
    }
}

impl Player {
    /// Does one step of a file. Returns the file, if there are further steps, and what there is to tell about its
    /// capture when it is shown.
    ///
    /// # Errors
    /// As [`step`](Self::step).
    fn advance(&mut self, file: Loader) -> Result<(Option<Loader>, Option<About>), String> {
        let GpuContext { device, queue, .. } = &self.context;
        let next = match file {
            Loader::Reading(mut opening) => match opening.advance()? {
                OpeningStep::Part => Loader::Reading(opening),
                OpeningStep::Scene(scene) => Loader::Read(scene, opening.share()),
            },
            Loader::Read(scene, of) => {
                let kept = Kept {
                    about: About::of(&scene),
                    background: scene.trained_background(),
                    optics: scene.trained_with.optics(),
                    importances: Importances::of(&scene),
                    of,
                };
                let stream = Streamed::new(self.streams, &scene).map(Box::new);
                self.streams += u32::from(stream.is_some());
                let upload = CaptureUpload::new(device, &self.renderer, *scene).map_err(|e| e.to_string())?;
                ViewRenderer::check_room(device, upload.most_drawn()).map_err(|e| e.to_string())?;
                Loader::Uploading(Box::new(upload), kept, stream)
            }
            uploading @ Loader::Uploading(..) if self.waits() => uploading,
            Loader::Uploading(mut upload, kept, stream) => {
                let uploaded = upload.advance(queue, &self.renderer, UPLOAD);
                if uploaded > 0 {
                    self.note_uploaded(uploaded);
                    Loader::Uploading(upload, kept, stream)
                } else {
                    let capture = upload.finish(queue, &self.renderer);
                    let active = ActiveList::new(device, &self.renderer, &capture);
                    Loader::Uploaded(Box::new(Shown { capture, active, kept, stream }))
                }
            }
            Loader::Uploaded(mut shown) if shown.lacks_picture() => {
                self.step_file(&mut shown)?;
                Loader::Uploaded(shown)
            }
            Loader::Uploaded(mut shown) => {
                shown.note_place();
                // The passes are compiled here, so that the first picture does not take long.
                let size = UVec2::new(self.configuration.width, self.configuration.height);
                let view = view(&Mat4::IDENTITY.to_cols_array(), &[0.5, 0.5], size, 0.0, shown.kept.optics)?;
                let prepared = self.view.prepare(
                    device,
                    queue,
                    &self.renderer,
                    &[shown.instance(view, self.share)],
                    &shown.parameters(self.background),
                );
                prepared.map_err(|e| e.to_string())?;
                let about = shown.kept.about.clone();
                self.shown = Some(*shown);
                return Ok((None, Some(about)));
            }
        };
        Ok((Some(next), None))
    }

    /// Counts bytes that were uploaded, of which the device has to take some before there are more.
    fn note_uploaded(&mut self, bytes: u64) {
        self.untaken += bytes;
        if self.untaken >= UPLOADED_AT_ONCE {
            self.untaken = 0;
            self.taken.store(false, Ordering::Relaxed);
            let taken = self.taken.clone();
            self.context.queue.on_submitted_work_done(move || taken.store(true, Ordering::Relaxed));
        }
    }

    /// Does one step with the files of a capture that have been received.
    fn step_file(&mut self, shown: &mut Shown) -> Result<Step, String> {
        let Some(stream) = &mut shown.stream else { return Ok(Step::Nothing) };
        if self.waits_for_device() {
            return Ok(Step::Nothing);
        }
        let GpuContext { device, queue, .. } = &self.context;
        let to = Target { device, queue, renderer: &self.renderer, bytes: UPLOAD };
        Ok(match stream.step(&mut shown.capture, &mut shown.active, to)? {
            Stepped::Nothing => Step::Nothing,
            Stepped::Part(uploaded) => {
                self.note_uploaded(uploaded);
                Step::Part
            }
            Stepped::File(uploaded) => {
                self.note_uploaded(uploaded);
                Step::File
            }
        })
    }

    fn waits_for_device(&self) -> bool {
        !self.taken.load(Ordering::Relaxed)
    }

    /// Returns the capture in chunk files of this number that is opened or shown, and its files.
    fn streamed(&mut self, stream: u32) -> Option<(&mut GpuCapture, &mut Streamed)> {
        let opening = match &mut self.opening {
            Some(Loader::Uploaded(shown)) => Some(&mut **shown),
            _ => None,
        };
        let mut all = opening.into_iter().chain(&mut self.shown);
        all.find_map(|Shown { capture, stream: own, .. }| {
            own.as_deref_mut().filter(|own| own.id == stream).map(|own| (capture, own))
        })
    }
}

#[wasm_bindgen]
impl Player {
    /// Opens a device that draws on a canvas. `format` is the format that the browser prefers for canvases.
    ///
    /// # Errors
    /// A message about a browser without WebGPU, or a device that cannot run the passes.
    pub async fn create(canvas: HtmlCanvasElement, format: &str) -> Result<Player, String> {
        report_panics();
        let size = UVec2::new(canvas.width(), canvas.height()).max(UVec2::ONE);
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor {
            backends: wgpu::Backends::BROWSER_WEBGPU,
            ..wgpu::InstanceDescriptor::new_without_display_handle()
        });
        let surface = instance.create_surface(wgpu::SurfaceTarget::Canvas(canvas)).map_err(|e| e.to_string())?;
        let context = GpuContext::open(&instance, Some(&surface)).await.map_err(|e| e.to_string())?;
        let device = &context.device;
        let faults = Faults::of(device);
        let renderer = Renderer::new(device, ShaderChecks::Off).map_err(|e| e.to_string())?;
        // Their values are encoded, as those of the renderer.
        let format = match format {
            "rgba8unorm" => wgpu::TextureFormat::Rgba8Unorm,
            _ => wgpu::TextureFormat::Bgra8Unorm,
        };
        let configuration = wgpu::SurfaceConfiguration {
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT,
            format,
            width: size.x,
            height: size.y,
            present_mode: wgpu::PresentMode::Fifo,
            desired_maximum_frame_latency: 2,
            alpha_mode: wgpu::CompositeAlphaMode::Opaque,
            view_formats: Vec::new(),
        };
        surface.configure(device, &configuration);
        let view = ViewRenderer::new(device, &renderer);
        let present = Present::new(device, format);
        let (opening, preview, shown, background) = (None, None, None, None);
        let [finished, taken] = [true; 2].map(|done| Arc::new(AtomicBool::new(done)));
        Ok(Self {
            context,
            faults,
            surface,
            configuration,
            renderer,
            view,
            present,
            opening,
            preview,
            shown,
            background,
            share: 1.0,
            finished,
            taken,
            untaken: 0,
            streams: 0,
        })
    }

    /// Sets the size of the pictures to that of the canvas, pixels.
    pub fn resize(&mut self, width: u32, height: u32) {
        let limit = self.context.device.limits().max_texture_dimension_2d;
        let size = UVec2::new(width, height).clamp(UVec2::ONE, UVec2::splat(limit));
        (self.configuration.width, self.configuration.height) = (size.x, size.y);
        self.surface.configure(&self.context.device, &self.configuration);
    }

    /// Sets the background: three numbers from 0 to 1, sRGB-encoded; without them, that of the capture.
    pub fn set_background(&mut self, color: Option<Vec<f32>>) {
        self.background = color.and_then(|color| color.try_into().ok());
    }

    /// Chooses the design of the renderer by its name.
    ///
    /// # Errors
    /// A message about an unknown name.
    pub fn set_design(&mut self, name: &str) -> Result<(), String> {
        let design = Design::NAMES.iter().find(|(known, _)| *known == name).ok_or("no such design")?;
        self.view.set_design(&self.renderer, design.1);
        Ok(())
    }

    /// Sets the share of the Gaussians that is drawn, 0 to 1: the most important ones, larger and more opaque.
    pub fn set_share(&mut self, share: f32) {
        self.share = share;
    }

    /// Begins to open a file, whose length is 0 if it is not known. The capture that is shown stays until the file, or
    /// a preview of it, is open.
    pub fn open(&mut self, name: &str, length: usize) {
        // The memory of a file that was being opened is free before that of the next is needed.
        (self.opening, self.preview) = (None, None);
        self.opening = Some(Loader::Reading(Opening::new(name, length)));
    }

    /// Ends the opening of a file, whose memory is free then. What is shown stays.
    pub fn close(&mut self) {
        (self.opening, self.preview) = (None, None);
    }

    /// Receives bytes of the file. [`step`](Self::step) begins once all have been received.
    ///
    /// # Errors
    /// A message about a file that is larger than the memory.
    pub fn receive(&mut self, piece: &[u8]) -> Result<(), String> {
        match &mut self.opening {
            Some(Loader::Reading(opening)) => opening.receive(piece),
            _ => Err("no file is being opened".to_owned()),
        }
    }

    /// Begins a preview of the file: of the layers that have been received, if there are more of them than at the last
    /// call. Returns whether it did.
    pub fn begin_preview(&mut self) -> bool {
        let Some(Loader::Reading(opening)) = &mut self.opening else { return false };
        self.preview = opening.beginning().map(Loader::Reading);
        self.preview.is_some()
    }

    /// Does one step of the preview. Returns what there is to tell about the beginning of the capture when it is shown.
    ///
    /// # Errors
    /// A message about a damaged layer, or a capture that the device cannot draw. The preview is then at its end;
    /// [`step`](Self::step) has the same fault.
    pub fn step_preview(&mut self) -> Result<Option<About>, String> {
        let file = self.preview.take().ok_or("no preview was begun")?;
        let (next, about) = self.advance(file)?;
        self.preview = next;
        Ok(about)
    }

    /// Does one step of opening, once all bytes have been received. Returns what there is to tell about the capture
    /// when it is shown, in place of a preview.
    ///
    /// # Errors
    /// A message about a file of an unknown format, a damaged file, or a capture that the device cannot draw.
    pub fn step(&mut self) -> Result<Option<About>, String> {
        // A preview that is not at its end would replace the capture.
        self.preview = None;
        let file = self.opening.take().ok_or("no file is being opened")?;
        let (next, about) = self.advance(file)?;
        self.opening = next;
        Ok(about)
    }

    /// Returns whether a step does nothing yet: the device has to take what was uploaded, or a capture in chunk files
    /// needs one that has not been received.
    pub fn waits(&self) -> bool {
        let lacks_file = match &self.opening {
            Some(Loader::Uploaded(shown)) => shown.lacks_picture() && shown.is_idle(),
            _ => false,
        };
        self.waits_for_device() || lacks_file
    }

    /// Returns the number of the capture that is being opened, once it is known to be in chunk files.
    pub fn opening_stream(&self) -> Option<u32> {
        let Some(Loader::Uploaded(shown)) = &self.opening else { return None };
        shown.stream.as_ref().map(|stream| stream.id)
    }

    /// Decides which files of a capture come next. `now` is a clock in seconds, `seconds` the time that is played, at
    /// `velocity` times its speed: 0 while it is paused. `None` if the capture is neither opened nor shown any more.
    pub fn plan(&mut self, stream: u32, now: f64, seconds: f64, velocity: f64, loops: bool) -> Option<Plan> {
        let (capture, own) = self.streamed(stream)?;
        let plan = own.plan(capture, now, seconds, velocity, loops);
        let [fetch, give_up] =
            [plan.fetch, plan.give_up].map(|files| files.into_iter().map(|file| file as u32).collect());
        Some(Plan { fetch, give_up })
    }

    /// Returns the length of the index, bytes, if chunk files follow it in the file that is being received.
    pub fn index_length(&mut self) -> Option<f64> {
        match &mut self.opening {
            Some(Loader::Reading(opening)) => opening.index_length().map(|length| length as f64),
            _ => None,
        }
    }

    /// Ends receiving at the index: the page fetches the files that follow as they are needed.
    ///
    /// # Errors
    /// A message about an index that is damaged, or has not been received.
    pub fn end_at_index(&mut self) -> Result<(), String> {
        match &mut self.opening {
            Some(Loader::Reading(opening)) => opening.end_at_index(),
            _ => Err("no file is being received".to_owned()),
        }
    }

    /// Returns where a file is in the file of its index: its first byte, and the byte after its last. `None`: it is
    /// beside the index.
    pub fn file_range(&mut self, stream: u32, file: u32) -> Option<Vec<f64>> {
        let (_, own) = self.streamed(stream)?;
        own.file_range(file as usize).map(|range| vec![range.start as f64, range.end as f64])
    }

    /// Returns the name of a file of a capture, which may be beside its index.
    pub fn file_name(&mut self, stream: u32, file: u32) -> Option<String> {
        self.streamed(stream).map(|(_, own)| own.file_name(file as usize))
    }

    /// Receives a file of a capture.
    pub fn receive_file(&mut self, stream: u32, file: u32, bytes: Vec<u8>) {
        if let Some((capture, own)) = self.streamed(stream) {
            own.receive(capture, file as usize, bytes);
        }
    }

    /// Notes that a file of a capture could not be fetched.
    pub fn fail_file(&mut self, stream: u32, file: u32) {
        if let Some((capture, own)) = self.streamed(stream) {
            own.fail(capture, file as usize);
        }
    }

    /// Does one step with the files that have been received of the capture that is shown.
    ///
    /// # Errors
    /// A message about a file that is not of the capture.
    pub fn step_files(&mut self) -> Result<Step, String> {
        let Some(mut shown) = self.shown.take() else { return Ok(Step::Nothing) };
        let stepped = self.step_file(&mut shown);
        self.shown = Some(shown);
        stepped
    }

    /// Returns whether the most important Gaussians of a time are there, seconds since the start of a capture.
    pub fn has_picture(&mut self, stream: u32, seconds: f64) -> bool {
        self.streamed(stream).is_some_and(|(_, own)| own.has_picture(seconds))
    }

    /// Returns the share of the Gaussians of a time that is there, 0 to 1.
    pub fn share_there(&mut self, stream: u32, seconds: f64) -> f32 {
        self.streamed(stream).map_or(0.0, |(_, own)| own.share(seconds))
    }

    /// Returns why the picture of a time may never be there.
    pub fn obstacle(&mut self, stream: u32, seconds: f64) -> Option<String> {
        self.streamed(stream).and_then(|(_, own)| own.obstacle(seconds))
    }

    /// Returns the part of the opening that is done, 0 to 1.
    pub fn progress(&self) -> f32 {
        match &self.opening {
            Some(Loader::Reading(opening)) => opening.progress(),
            Some(Loader::Read(..) | Loader::Uploading(..) | Loader::Uploaded(_)) | None => 1.0,
        }
    }

    /// Returns whether the device has finished the last picture.
    pub fn is_ready(&self) -> bool {
        self.finished.load(Ordering::Relaxed)
    }

    /// Returns the first fault that the device has reported since the last call.
    pub fn fault(&self) -> Option<String> {
        self.faults.take()
    }

    /// Draws the capture at a time, in its own unit, from a camera: see [`view`].
    ///
    /// # Errors
    /// A message about a camera that is none, a picture that is too large, or a canvas that is lost.
    pub fn draw(&mut self, time: f32, pose: &[f32], lens: &[f32]) -> Result<(), String> {
        let Some(shown) = &mut self.shown else { return Ok(()) };
        let GpuContext { device, queue, .. } = &self.context;
        let time = shown.stream.as_mut().map_or(time, |stream| stream.time_of_picture(time));
        let size = UVec2::new(self.configuration.width, self.configuration.height);
        let view = view(pose, lens, size, time, shown.kept.optics)?;
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("gs4d page") });
        if let Some(active) = &mut shown.active
            && active.prepare(queue, &shown.capture, time)
        {
            active.record(&self.renderer, &mut encoder, &shown.capture);
        }
        let (instances, parameters) = ([shown.instance(view, self.share)], shown.parameters(self.background));
        self.view.prepare(device, queue, &self.renderer, &instances, &parameters).map_err(|e| e.to_string())?;
        self.view.record(&self.renderer, &mut encoder, &instances);
        let canvas = match self.surface.get_current_texture() {
            wgpu::CurrentSurfaceTexture::Success(canvas) | wgpu::CurrentSurfaceTexture::Suboptimal(canvas) => canvas,
            other => return Err(format!("the canvas cannot be drawn on: {other:?}")),
        };
        let target = canvas.texture.create_view(&wgpu::TextureViewDescriptor::default());
        if let Some(color) = self.view.color() {
            self.present.record(device, &mut encoder, color, &target);
        }
        self.finished.store(false, Ordering::Relaxed);
        queue.submit([encoder.finish()]);
        let finished = self.finished.clone();
        queue.on_submitted_work_done(move || finished.store(true, Ordering::Relaxed));
        canvas.present();
        Ok(())
    }
}

fn main() {}
