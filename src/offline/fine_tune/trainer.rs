//! Training on the GPU, with the renderer's own passes.
//!
//! In: a scene in the trained form, views with their images. Out: the scene after some steps. Nothing is added without order, so that every
//! run gives the same result, unless [sums](GradientSums) are atomic.
//!
//! | pass | reads | writes |
//! |---|---|---|
//! | `slice` | raw parameters | the records that `project` reads |
//! | `rounding` | these records, what packing changes of each | the same, once geometry is [rounded](Trainer::round) |
//! | the passes of the reference design | records, color | splats, pairs, picture |
//! | `loss` | picture, image | gradients of pixels, sums |
//! | `blend_backward` | splats, pairs, gradients of pixels | gradients of pairs |
//! | `project_backward` | gradients of pairs, parameters | gradients of raw parameters, added up over a batch; which Gaussians were seen |
//! | `regularize` | parameters, their slice, neighbors | gradients of raw parameters, if there are [`Terms`] of Gaussians alone |
//! | `adam` | gradients, moments | parameters; of Gaussians that were seen only, if steps are [sparse](Trainer::set_sparse) |
//! | `codebooks` | gradients of coefficients; entries | gradients of entries; coefficients, once colors are [tied](Trainer::tie) |

use super::adam::correction;
use super::optimized::Optimized;
use super::passes::Passes;
use super::records::records;
use super::regularizer::Regularizer;
use super::rounding::Rounder;
use super::schedule::Rates;
use super::sums::GradientSums;
use super::terms::Terms;
use super::tied::Tied;
use super::view_buffers::ViewBuffers;
use crate::gaussian::harmonics::evaluated;
use crate::gaussian::{GradientMode, InvalidGaussian, Model};
use crate::offline::dataset::CoveredImage;
use crate::offline::metrics::decibels;
use crate::offline::quantize::CompressError;
use crate::renderer::layout::{AdamUniforms, FIRST_SEEN, LossUniforms, TrainedScene};
use crate::renderer::memory::binding_limit;
use crate::renderer::shaders::{COMPAT, COMPAT_WITHOUT_TIME};
use crate::renderer::{GpuCapture, GpuError, Headless, ShaderChecks};
use crate::scene::{GaussianScene, SceneForm, TemporalFilter};
use crate::view::{Background, Frame, View};
use glam::UVec2;
use std::collections::VecDeque;
use wgpu::BufferUsages;

/// Steps that may be submitted before the first of them has finished.
const STEPS_IN_FLIGHT: usize = 4;
/// Bytes of the notes of `project_backward` about gradients that are not finite, before a word for each Gaussian.
const FAULT_BYTES: u64 = 4 * FIRST_SEEN as u64;
/// Most workgroups of `adam`.
pub(super) const ADAM_GROUPS: u32 = 4096;

/// A scene that is trained.
#[derive(Debug)]
pub struct Trainer<'a> {
    pub(super) headless: &'a mut Headless,
    pub(super) passes: Passes,
    pub(super) capture: GpuCapture,
    /// What is not trained: switches, coefficients that are not evaluated.
    pub(super) scene: GaussianScene,
    model: Model,
    pub(super) geometry: Optimized,
    pub(super) color: Optimized,
    pub(super) scene_settings: wgpu::Buffer,
    slice: wgpu::BindGroup,
    parameters: wgpu::BindGroup,
    /// Gradients that were not finite; which Gaussians the views since the last step have shown.
    pub(super) notes: wgpu::Buffer,
    pub(super) totals: wgpu::Buffer,
    pub(super) tied: Option<Tied>,
    pub(super) terms: Terms,
    pub(super) regularizer: Option<Regularizer>,
    pub(super) rounder: Option<Rounder>,
    sparse: bool,
    pub(super) sums: GradientSums,
    pub(super) view: Option<ViewBuffers>,
    in_flight: VecDeque<wgpu::SubmissionIndex>,
}

/// An image on the GPU.
#[derive(Debug)]
pub struct GpuImage {
    size: UVec2,
    group: wgpu::BindGroup,
}

/// One view of a batch.
#[derive(Debug, Clone, Copy)]
pub struct Sample<'a> {
    /// Camera and time.
    pub view: &'a View,
    /// What it should look like, in the size of the view.
    pub image: &'a GpuImage,
    /// Behind the scene, and behind the image if it is a color.
    pub background: Background,
    /// Number of the view, for reports.
    pub number: u32,
}

/// Sums over the views since the last report.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Totals {
    /// Mean loss, without the terms of Gaussians alone.
    pub loss: f64,
    /// PSNR of all pixels together, dB.
    pub psnr: f64,
    /// Number of views.
    pub views: u64,
}

/// Gradients that were not finite and have been left out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Faults {
    /// Their number.
    pub count: u32,
    /// The Gaussian and the view of the first.
    pub gaussian: u32,
    /// Number of that view.
    pub view: u32,
}

impl<'a> Trainer<'a> {
    /// Uploads a scene in the trained form. What its temporal filter leaves out is neither drawn nor trained.
    ///
    /// # Errors
    /// A Gaussian that cannot be drawn, a scene that does not fit one binding of the device, a limit that is too low.
    pub fn new(headless: &'a mut Headless, scene: GaussianScene, mode: GradientMode) -> Result<Self, TrainerError> {
        Self::with_sums(headless, scene, mode, GradientSums::default())
    }

    /// As [`new`](Self::new), with gradients summed in this way.
    ///
    /// # Errors
    /// As [`new`](Self::new), and a device that cannot sum in this way.
    pub fn with_sums(
        headless: &'a mut Headless,
        mut scene: GaussianScene,
        mode: GradientMode,
        sums: GradientSums,
    ) -> Result<Self, TrainerError> {
        sums.check(headless)?;
        // They are of the Gaussians as they were.
        scene.levels.clear();
        let SceneForm::Trained(trained) = &scene.form else { return Err(TrainerError::NotTrained) };
        let model = trained.parameters.model();
        let records = records(&trained.parameters);
        let runtime = scene.clone().into_runtime()?;
        let plain = model == Model::Static3d || scene.trained_with.force_sh_3d;
        let definitions = match mode {
            GradientMode::Exact => &[][..],
            GradientMode::Compat if plain => COMPAT_WITHOUT_TIME,
            GradientMode::Compat => COMPAT,
        };
        let definitions = [definitions, sums.definitions()].concat();
        let passes = Passes::new(headless, &definitions, ShaderChecks::Off)?;
        let degrees = runtime.form.color_degrees();
        let stride = evaluated(degrees.degree, degrees.degree_t) * 3;
        let stride = stride.div_ceil(4) as u32;
        let count = runtime.len() as u32;
        let limit = binding_limit(&headless.context().device.limits());
        let needed = u64::from(count) * 16 * u64::from(stride.max(5));
        if needed > limit {
            return Err(GpuError::TooLarge { what: "the Gaussians that are trained", needed, limit }.into());
        }
        let capture = headless.upload(&runtime)?;
        let Some(writable) = capture.writable() else { return Err(TrainerError::Empty) };
        let [gaussians, lifespans, harmonics] = writable.map(wgpu::Buffer::clone);
        let allocator = headless.allocator();
        let queue = &headless.context().queue;
        let storage = BufferUsages::STORAGE | BufferUsages::COPY_SRC;
        let raw = allocator.buffer("gs4d trained", size_of_val(&records[..]) as u64, storage);
        queue.write_buffer(&raw, 0, bytemuck::cast_slice(&records));
        let notes = allocator.buffer("gs4d notes", FAULT_BYTES + 4 * u64::from(count), storage);
        let geometry = Optimized::new(headless, &passes, &notes, raw, count, 5);
        let color = Optimized::new(headless, &passes, &notes, harmonics, count, stride);
        let uniform = BufferUsages::UNIFORM;
        let scene_settings = allocator.buffer("gs4d trained scene", size_of::<TrainedScene>() as u64, uniform);
        let totals = allocator.buffer("gs4d totals", 16, storage);
        let slice = allocator.bind_group(
            "gs4d slice",
            &passes.slice_group,
            &[&scene_settings, &geometry.values, &gaussians, &lifespans].map(wgpu::Buffer::as_entire_binding),
        );
        let buffers = [&geometry.values, &color.values, &geometry.gradients, &color.gradients, &notes];
        let parameters = allocator.bind_group(
            "gs4d parameters",
            &passes.parameters_group,
            &buffers.map(wgpu::Buffer::as_entire_binding),
        );
        let mut trainer = Self {
            headless,
            passes,
            capture,
            scene,
            model,
            geometry,
            color,
            scene_settings,
            slice,
            parameters,
            notes,
            totals,
            tied: None,
            terms: Terms::default(),
            regularizer: None,
            rounder: None,
            sparse: false,
            sums,
            view: None,
            in_flight: VecDeque::new(),
        };
        trainer.slice();
        Ok(trainer)
    }

    /// Returns the adapter's description and the device.
    pub fn headless(&self) -> &Headless {
        self.headless
    }

    /// Draws the scene as it is.
    ///
    /// # Errors
    /// A picture that does not fit the GPU, a lost device.
    pub fn draw(&mut self, view: &View, background: Background) -> Result<Frame, GpuError> {
        self.headless.render(&self.capture, view, background)
    }

    /// Draws a view of the scene, so that later frames have room for at least as many pairs.
    ///
    /// # Errors
    /// As [`draw`](Self::draw).
    pub fn make_room(&mut self, view: &View) -> Result<(), GpuError> {
        self.headless.draw(&self.capture, view, Background::None)
    }

    /// Uploads an image.
    ///
    /// # Errors
    /// An image that does not fit one binding of the device.
    pub fn upload(&self, image: &CoveredImage) -> Result<GpuImage, GpuError> {
        let bytes: &[u8] = bytemuck::cast_slice(&image.texels);
        let (needed, limit) = (bytes.len() as u64, binding_limit(&self.headless.context().device.limits()));
        if needed > limit || needed == 0 {
            return Err(GpuError::TooLarge { what: "an image", needed, limit });
        }
        let allocator = self.headless.allocator();
        let buffer = allocator.buffer("gs4d image", needed, BufferUsages::STORAGE);
        self.headless.context().queue.write_buffer(&buffer, 0, bytes);
        let group = allocator.bind_group("gs4d image", &self.passes.image_group, &[buffer.as_entire_binding()]);
        Ok(GpuImage { size: image.size, group })
    }

    /// Adds the gradients of the loss of a batch, each view with the same share.
    ///
    /// # Errors
    /// A picture or pairs that do not fit the GPU, an image of another size than its view.
    pub fn accumulate(&mut self, batch: &[Sample<'_>], similarity_share: f64) -> Result<(), GpuError> {
        let share = 1.0 / batch.len().max(1) as f32;
        for sample in batch {
            if sample.image.size != sample.view.size {
                return Err(GpuError::Scene("an image to train on has another size than its view"));
            }
            let mut encoder = self.encoder("gs4d view");
            self.headless.record(&mut encoder, &self.capture, sample.view, sample.background)?;
            self.fit(sample.view.size)?;
            let Some(buffers) = &self.view else { continue };
            let queue = &self.headless.context().queue;
            let [r, g, b] = match sample.background {
                Background::Color(color) => color,
                Background::None | Background::Environment => [0.0; 3],
            };
            let settings = LossUniforms {
                background: [r, g, b, 0.0],
                size: sample.view.size.to_array(),
                tiles: sample.view.tiles().to_array(),
                share,
                similarity_share: similarity_share as f32,
                mask_weight: self.terms.mask as f32,
                padding: 0,
            };
            queue.write_buffer(&buffers.loss_settings, 0, bytemuck::bytes_of(&settings));
            self.write_scene(sample.number);
            self.record_backward(&mut encoder, buffers, sample.view, Some(sample.image));
            queue.submit([encoder.finish()]);
        }
        Ok(())
    }

    /// Adds the gradients of a loss whose gradient with respect to each pixel is given: of red, green, blue and opacity, and of expected depth.
    ///
    /// # Errors
    /// As [`accumulate`](Self::accumulate).
    pub fn accumulate_pixels(
        &mut self,
        view: &View,
        background: Background,
        pixels: &[[f32; 4]],
        depths: &[f32],
    ) -> Result<(), GpuError> {
        self.headless.draw(&self.capture, view, background)?;
        self.fit(view.size)?;
        let Some(buffers) = &self.view else { return Ok(()) };
        let queue = &self.headless.context().queue;
        queue.write_buffer(&buffers.pixel_gradients, 0, bytemuck::cast_slice(pixels));
        queue.write_buffer(&buffers.depth_gradients, 0, bytemuck::cast_slice(depths));
        self.write_scene(0);
        let mut encoder = self.encoder("gs4d view");
        self.record_backward(&mut encoder, buffers, view, None);
        queue.submit([encoder.finish()]);
        Ok(())
    }

    /// Records the passes after the picture; with an image, that of its loss.
    fn record_backward(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        buffers: &ViewBuffers,
        view: &View,
        image: Option<&GpuImage>,
    ) {
        let Some(frame) = self.headless.finished() else { return };
        let (tiles, passes) = (view.tiles(), &self.passes);
        if self.sums == GradientSums::Atomic {
            encoder.clear_buffer(&buffers.gradients, 0, None);
        }
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        if let Some(image) = image {
            pass.set_bind_group(0, &buffers.loss, &[]);
            pass.set_bind_group(1, &image.group, &[]);
            pass.set_pipeline(&passes.similarity);
            pass.dispatch_workgroups(tiles.x, tiles.y, 1);
            pass.set_pipeline(&passes.gradient);
            pass.dispatch_workgroups(tiles.x, tiles.y, 1);
            pass.set_pipeline(&passes.total);
            pass.dispatch_workgroups(1, 1, 1);
        }
        pass.set_bind_group(0, &buffers.blended, &[]);
        pass.set_bind_group(1, &buffers.sums, &[]);
        if self.sums == GradientSums::Deterministic {
            pass.set_pipeline(&passes.place);
            pass.dispatch_workgroups(frame.slots.div_ceil(256), 1, 1);
        }
        pass.set_pipeline(&passes.pairs);
        pass.dispatch_workgroups(tiles.x, tiles.y, 1);
        pass.set_pipeline(&passes.project_backward);
        pass.set_bind_group(0, &buffers.splat_gradients, &[]);
        pass.set_bind_group(1, self.capture.geometry(), &[]);
        pass.set_bind_group(2, self.headless.recorded_list(), &[]);
        pass.set_bind_group(3, &self.parameters, &[]);
        pass.dispatch_workgroups((self.capture.len() as u32).div_ceil(64), 1, 1);
    }

    /// Sets whether a step leaves Gaussians as they are, with their moments, that no view of its batch shows. Default: `false`. Entries of
    /// codebooks are stepped in any case.
    pub fn set_sparse(&mut self, sparse: bool) {
        self.sparse = sparse;
    }

    /// Makes a step with the gradients accumulated so far, which become 0; the first `step` is 1.
    ///
    /// # Errors
    /// A lost device.
    pub fn step(&mut self, rates: &Rates, factor: f64, step: usize) -> Result<(), GpuError> {
        let scale = self.scene.trained_with.spatial_lr_scale;
        let colors = rates.of_harmonics(factor);
        let sparse = u32::from(self.sparse);
        let mut rated = vec![(&self.geometry, rates.of_parameters(scale, factor), sparse)];
        match &self.tied {
            // The first coefficient of each Gaussian is its own; entries are of many.
            Some(tied) => rated.extend([
                (&self.color, Rates { harmonics: 0.0, ..*rates }.of_harmonics(factor), sparse),
                (&tied.entries, [colors[1]; 5], 0),
            ]),
            None => rated.push((&self.color, colors, sparse)),
        }
        let queue = &self.headless.context().queue;
        let mut encoder = self.encoder("gs4d step");
        {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            if let Some(Tied { entries, group, .. }) = &self.tied {
                pass.set_pipeline(&self.passes.collect);
                pass.set_bind_group(0, group, &[]);
                pass.dispatch_workgroups(entries.count, 1, 1);
            }
            pass.set_pipeline(&self.passes.adam);
            for (optimized, rates, sparse) in rated {
                let Optimized { count, stride, .. } = *optimized;
                let sparse = [sparse, 0, 0, 0];
                let settings = AdamUniforms { rates, correction: correction(step), count, stride, sparse };
                queue.write_buffer(&optimized.settings, 0, bytemuck::bytes_of(&settings));
                pass.set_bind_group(0, &optimized.group, &[]);
                pass.dispatch_workgroups((count * stride).div_ceil(256).min(ADAM_GROUPS), 1, 1);
            }
            if let Some(tied) = &self.tied {
                self.expand(&mut pass, tied);
            }
            self.record_slice(&mut pass);
        }
        encoder.clear_buffer(&self.notes, FAULT_BYTES, None);
        let index = queue.submit([encoder.finish()]);
        self.in_flight.push_back(index);
        if self.in_flight.len() > STEPS_IN_FLIGHT
            && let Some(oldest) = self.in_flight.pop_front()
        {
            let wait = wgpu::PollType::Wait { submission_index: Some(oldest), timeout: None };
            let waited = self.headless.context().device.poll(wait);
            waited.map_err(|error| GpuError::Device(error.to_string()))?;
        }
        Ok(())
    }

    /// Returns the sums over the views since the last call, and begins new ones.
    ///
    /// # Errors
    /// A lost device.
    pub fn totals(&mut self) -> Result<Totals, GpuError> {
        let bytes = self.headless.copy_out(&self.totals, 16)?;
        let [loss, _, squares, views]: [f32; 4] = bytemuck::pod_read_unaligned(&bytes);
        self.headless.context().queue.write_buffer(&self.totals, 0, &[0; 16]);
        let each = 1.0 / f64::from(views.max(1.0));
        let psnr = decibels(f64::from(squares) * each);
        Ok(Totals { loss: f64::from(loss) * each, psnr, views: views as u64 })
    }

    /// Returns the gradients that were not finite so far; `None` if there were none.
    ///
    /// # Errors
    /// A lost device.
    pub fn faults(&self) -> Result<Option<Faults>, GpuError> {
        let bytes = self.headless.copy_out(&self.notes, FAULT_BYTES)?;
        let [count, gaussian, view]: [u32; 3] = bytemuck::pod_read_unaligned(&bytes);
        Ok((count > 0).then(|| Faults { count, gaussian: gaussian.saturating_sub(1), view }))
    }

    /// Replaces the temporal filter.
    ///
    /// # Errors
    /// A filter of another number of Gaussians.
    pub fn set_filter(&mut self, filter: TemporalFilter) -> Result<(), GpuError> {
        self.headless.replace_filter(&mut self.capture, &filter, self.scene.trained_with.time_interval)?;
        self.scene.filter = Some(filter);
        Ok(())
    }

    pub(super) fn encoder(&self, label: &str) -> wgpu::CommandEncoder {
        let label = wgpu::CommandEncoderDescriptor { label: Some(label) };
        self.headless.context().device.create_command_encoder(&label)
    }

    fn write_scene(&self, view: u32) {
        let settings = TrainedScene {
            count: self.capture.len() as u32,
            model: match self.model {
                Model::Static3d => 0,
                Model::Unrotated4d => 1,
                Model::Rotated4d => 2,
            },
            prefilter_var: self.scene.trained_with.prefilter_var,
            view,
        };
        self.headless.context().queue.write_buffer(&self.scene_settings, 0, bytemuck::bytes_of(&settings));
    }

    /// Records that the parameters are sliced, and rounded if geometry is.
    fn record_slice(&self, pass: &mut wgpu::ComputePass<'_>) {
        let groups = (self.capture.len() as u32).div_ceil(256);
        pass.set_pipeline(&self.passes.slice);
        pass.set_bind_group(0, &self.slice, &[]);
        pass.dispatch_workgroups(groups, 1, 1);
        if let Some(rounder) = &self.rounder {
            rounder.record(pass, groups);
        }
    }

    /// Slices the parameters.
    pub(super) fn slice(&mut self) {
        self.write_scene(0);
        let mut encoder = self.encoder("gs4d slice");
        self.record_slice(&mut encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default()));
        self.headless.context().queue.submit([encoder.finish()]);
    }
}

/// Why a scene cannot be trained.
#[derive(Debug, thiserror::Error)]
pub enum TrainerError {
    /// The scene has lost its raw parameters.
    #[error("only the trained form can be fine-tuned: give the checkpoint, or a package written with --form trained")]
    NotTrained,
    /// Codebooks of another scene.
    #[error("the codebooks are not of the colors of this scene")]
    Codebooks,
    /// The packed form cannot hold the scene.
    #[error(transparent)]
    Compress(#[from] CompressError),
    /// A term of the loss cannot have this weight.
    #[error("the weight of the term {term} is {weight}: it must be a number, zero or above")]
    Weight {
        /// The term.
        term: &'static str,
        /// Its weight.
        weight: f64,
    },
    /// The device has no float atomics.
    #[error(
        "the adapter `{adapter}` cannot add floating-point numbers atomically: sum gradients with --sums deterministic, or choose another \
         one with --adapter"
    )]
    NoAtomics {
        /// Name of the adapter.
        adapter: String,
    },
    /// There is nothing to train.
    #[error("there are no Gaussians to fine-tune")]
    Empty,
    /// A Gaussian cannot be drawn.
    #[error(transparent)]
    Invalid(#[from] InvalidGaussian),
    /// The GPU cannot train the scene.
    #[error(transparent)]
    Gpu(#[from] GpuError),
}
