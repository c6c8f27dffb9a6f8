//! One step of training on the GPU, with the renderer's own passes.
//!
//! In: a scene in the trained form, views with their images, the [`Step`]s of a schedule. Out: [`Trainer`], whose
//! parameters change with each step. Sums are added in a fixed order, so that every run gives the same result.
//!
//! | method | pass | reads | writes |
//! |---|---|---|---|
//! | `begin_step` | `rounding` | sliced Gaussians, what packing changes of each | sliced Gaussians |
//! | | `dropout` | sliced Gaussians | the same, some without opacity |
//! | `accumulate` | the passes of the global sort | sliced Gaussians, color | splats, pairs, picture |
//! | | `exposure` | picture, exposure of the camera | the picture that `loss` reads; gradients of exposures |
//! | | `loss` | picture, image | gradients of pixels, sums |
//! | | `blend_backward` | splats, pairs, gradients of pixels | gradients of pairs |
//! | | `project_backward` | gradients of pairs, parameters | gradients of parameters; which Gaussians were seen |
//! | | `environment_backward` | gradients of pixels, transmittance | gradients of the environment map |
//! | `accumulate_terms` | `regularize` | parameters, their slice, neighbors | gradients of parameters |
//! | `optimize` | `codebooks` | gradients of coefficients; entries | gradients of entries; coefficients |
//! | | `adam` | gradients, moments | parameters; gradients and moments |
//! | | `noise` | raw parameters | the same, with means moved at random |
//! | | `standing` | raw parameters, color | the same, at rest if they live long |
//! | | `statistics` | gradients of Gaussians on the screen | their sums over steps |
//! | | `slice` | raw parameters | sliced Gaussians |
//! | `end_step` | `relocate` | moves, colors | colors of the Gaussians that move, moments |
//!
//! Every training has the passes of the global sort, `loss`, `blend_backward`, `project_backward`, `adam` and `slice`.
//! The others are those of [optional parts](crate::offline::train::parts), whose list this file does not know.

use crate::gaussian::GradientMode;
use crate::offline::dataset::CoveredImage;
use crate::offline::engine::layout::LossUniforms;
use crate::offline::train::gpu::{Backward, GpuImage, RecordedView, Sample, Workspace};
use crate::offline::train::parts::{Parts, Request};
use crate::offline::train::schedule::{Rates, Step};
use crate::offline::train::settings::FineTuneSettings;
use crate::offline::train::trainer_error::TrainerError;
use crate::renderer::{GpuError, Headless};
use crate::scene::GaussianScene;
use crate::view::{Background, View};
use std::collections::VecDeque;

/// Steps that may be submitted before the first of them has finished.
pub const STEPS_IN_FLIGHT: usize = 4;

/// A scene that is trained: its parameters with their passes and optimizer, and the optional parts.
#[derive(Debug)]
pub struct Trainer<'a> {
    pub(super) work: Workspace<'a>,
    pub(super) parts: Parts,
    pub(super) backward: Backward,
    in_flight: VecDeque<wgpu::SubmissionIndex>,
}

impl<'a> Trainer<'a> {
    /// Uploads a scene in the trained form. What its temporal filter leaves out is neither drawn nor trained.
    ///
    /// # Errors
    /// A Gaussian that cannot be drawn, a scene that does not fit one binding of the device, a limit that is too low.
    pub fn new(headless: &'a mut Headless, scene: GaussianScene, mode: GradientMode) -> Result<Self, TrainerError> {
        let work = Workspace::new(headless, scene, mode)?;
        let backward = Backward::new(work.headless);
        let mut trainer = Self { work, parts: Parts::default(), backward, in_flight: VecDeque::new() };
        trainer.prepare(&Request::of(&FineTuneSettings::default()))?;
        Ok(trainer)
    }

    /// Adds the optional parts that a request asks for and that there are not yet.
    ///
    /// # Errors
    /// Settings that contradict the scene, a weight of a term that is negative or not a number, a shader that does not
    /// compile.
    pub fn prepare(&mut self, request: &Request<'_>) -> Result<(), TrainerError> {
        self.parts.add(&self.work, request)?;
        self.refresh();
        Ok(())
    }

    /// Returns the adapter's description and the device.
    pub fn headless(&self) -> &Headless {
        self.work.headless
    }

    /// Returns the renderer, for scoring between steps.
    pub(crate) fn headless_mut(&mut self) -> &mut Headless {
        self.work.headless
    }

    /// Uploads an image.
    ///
    /// # Errors
    /// An image that does not fit one binding of the device.
    pub fn upload(&self, image: &CoveredImage) -> Result<GpuImage, GpuError> {
        GpuImage::new(self.work.headless, &self.work.passes, image)
    }

    /// Prepares a step before its views are drawn.
    ///
    /// # Errors
    /// Gaussians that the packed form cannot hold, if geometry is rounded; a lost device.
    pub fn begin_step(&mut self, step: &Step) -> Result<(), TrainerError> {
        self.parts.iter_mut().try_for_each(|part| part.before_views(&self.work, step))
    }

    /// Adds the gradients of the loss of a batch, each view with the same share.
    ///
    /// # Errors
    /// A picture or pairs that do not fit the GPU, an image of another size than its view.
    pub fn accumulate(&mut self, batch: &[Sample<'_>], similarity_share: f64) -> Result<(), GpuError> {
        let share = 1.0 / batch.len().max(1) as f32;
        batch.iter().try_for_each(|sample| self.accumulate_view(sample, similarity_share as f32, share))
    }

    /// Adds the gradients of the loss of a view, which has this share in that of its batch.
    fn accumulate_view(&mut self, sample: &Sample<'_>, similarity_share: f32, share: f32) -> Result<(), GpuError> {
        let Sample { view, image, background, number } = *sample;
        if image.size != view.size {
            return Err(GpuError::Scene("an image to train on has another size than its view"));
        }
        let mut encoder = self.work.encoder("gs4d view");
        self.work.headless.record(&mut encoder, &self.work.capture, view, background)?;
        let work = &self.work;
        let Some(buffers) = self.backward.fit(work, view.size)? else { return Ok(()) };
        let mut settings = LossUniforms {
            background: color_of(background),
            size: view.size.to_array(),
            tiles: view.tiles().to_array(),
            share,
            similarity_share,
            mask_weight: 0.0,
            padding: 0,
        };
        self.parts.iter().for_each(|part| part.adjust_loss(&mut settings));
        work.queue().write_buffer(&buffers.loss_settings, 0, bytemuck::bytes_of(&settings));
        work.parameters.write_scene(work.queue(), number);
        let view = RecordedView { buffers, size: view.size, background, number, share };
        let mut is_recorded = false;
        for part in self.parts.iter_mut() {
            is_recorded = is_recorded || part.record_loss(work, &view, image, &mut encoder)?;
        }
        if !is_recorded {
            buffers.record_loss(&mut encoder, &work.passes, image);
        }
        submit_backward(work, &self.parts, &view, encoder);
        Ok(())
    }

    /// Adds the gradients of a loss whose gradient with respect to each pixel is given: of red, green, blue and
    /// opacity, and of expected depth.
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
        self.work.headless.draw(&self.work.capture, view, background)?;
        let work = &self.work;
        let Some(buffers) = self.backward.fit(work, view.size)? else { return Ok(()) };
        work.queue().write_buffer(&buffers.pixel_gradients, 0, bytemuck::cast_slice(pixels));
        work.queue().write_buffer(&buffers.depth_gradients, 0, bytemuck::cast_slice(depths));
        work.parameters.write_scene(work.queue(), 0);
        let view = RecordedView { buffers, size: view.size, background, number: 0, share: 1.0 };
        submit_backward(work, &self.parts, &view, work.encoder("gs4d view"));
        Ok(())
    }

    /// Adds the gradients of terms of the loss that depend on no view to those of the batch of a step, counted from 0.
    ///
    /// # Errors
    /// A lost device.
    pub fn accumulate_terms(&mut self, index: usize) -> Result<(), GpuError> {
        self.parts.iter_mut().try_for_each(|part| part.accumulate(&self.work, index))
    }

    /// Makes step number `count`, from 1, of fine-tuning: [`optimize`](Self::optimize) without the rest.
    ///
    /// # Errors
    /// A lost device.
    pub fn step(&mut self, rates: &Rates, factor: f64, count: usize) -> Result<(), GpuError> {
        self.optimize(&Step::new(*rates, factor, count))
    }

    /// Changes the parameters by the gradients accumulated so far, which become 0.
    ///
    /// # Errors
    /// A lost device.
    pub fn optimize(&mut self, step: &Step) -> Result<(), GpuError> {
        let Self { work, parts, .. } = &*self;
        let mut encoder = work.encoder("gs4d step");
        {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            let mut own = *step;
            parts.iter().for_each(|part| part.before_optimizer(work, &mut pass, &mut own));
            work.parameters.record_step(work.queue(), &mut pass, &work.passes, &work.scene.trained_with, &own);
            parts.iter().for_each(|part| part.record_step(work, &mut pass, step));
            work.parameters.record_slice(&mut pass, &work.passes);
            parts.iter().for_each(|part| part.record_slice(work, &mut pass));
        }
        parts.iter().for_each(|part| part.refresh(work, &mut encoder));
        work.parameters.forget_seen(&mut encoder);
        let submitted = work.queue().submit([encoder.finish()]);
        self.wait_for_earlier(submitted)
    }

    /// Moves, removes and adds Gaussians as far as that is due after a step.
    ///
    /// # Errors
    /// A lost device.
    pub fn end_step(&mut self, step: &Step) -> Result<(), GpuError> {
        let mut has_changed = false;
        for part in self.parts.iter_mut() {
            has_changed |= part.after_step(&self.work, step)?;
        }
        if has_changed {
            self.slice();
        }
        Ok(())
    }

    /// Waits until no more than [`STEPS_IN_FLIGHT`] steps are unfinished, of which the last was just submitted.
    fn wait_for_earlier(&mut self, submitted: wgpu::SubmissionIndex) -> Result<(), GpuError> {
        self.in_flight.push_back(submitted);
        if self.in_flight.len() > STEPS_IN_FLIGHT
            && let Some(oldest) = self.in_flight.pop_front()
        {
            let wait = wgpu::PollType::Wait { submission_index: Some(oldest), timeout: None };
            let waited = self.work.headless.context().device.poll(wait);
            waited.map_err(|error| GpuError::Device(error.to_string()))?;
        }
        Ok(())
    }

    /// Draws the next views with the parameters and the values of all parts as they are.
    pub(super) fn refresh(&self) {
        let mut encoder = self.work.encoder("gs4d refresh");
        self.parts.iter().for_each(|part| part.refresh(&self.work, &mut encoder));
        self.work.queue().submit([encoder.finish()]);
        self.slice();
    }

    /// Slices the parameters.
    fn slice(&self) {
        self.work.slice(|pass| self.parts.iter().for_each(|part| part.record_slice(&self.work, pass)));
    }
}

/// Records the passes that turn the gradients of the pixels of a view into those of parameters, and submits the view.
fn submit_backward(work: &Workspace<'_>, parts: &Parts, view: &RecordedView<'_>, mut encoder: wgpu::CommandEncoder) {
    view.buffers.record_backward(work, &mut encoder);
    parts.iter().for_each(|part| part.record_view(work, view, &mut encoder));
    work.queue().submit([encoder.finish()]);
}

/// Returns the color behind an image where its coverage is below 1, as `loss` reads it.
fn color_of(background: Background) -> [f32; 4] {
    let [r, g, b] = match background {
        Background::Color(color) => color,
        Background::None | Background::Environment => [0.0; 3],
    };
    [r, g, b, 0.0]
}
