//! Training on the GPU, with the renderer's own passes.
//!
//! In: a scene in the trained form, views with their images. Out: the scene after some steps, its gradients, its state. Nothing is added without order, so that every
//! run gives the same result.
//!
//! | pass | reads | writes |
//! |---|---|---|
//! | `slice` | raw parameters | the records that `project` reads |
//! | `rounding` | these records, what packing changes of each | the same, once geometry is [rounded](Trainer::round) |
//! | the passes of the global sort | records, color | splats, pairs, picture |
//! | `loss` | picture, image | gradients of pixels, sums |
//! | `exposure` | picture, exposure of the camera | the picture that `loss` reads; gradients of exposures ([if trained](Trainer::set_exposure)) |
//! | `blend_backward` | splats, pairs, gradients of pixels | gradients of pairs |
//! | `environment_backward` | gradients of pixels, transmittance | gradients of the environment map, if the scene has one |
//! | `project_backward` | gradients of pairs, parameters | gradients of raw parameters, added up over a batch; which Gaussians were seen |
//! | `regularize` | parameters, their slice, neighbors | gradients of raw parameters, if there are [`Terms`] of Gaussians alone |
//! | `adam` | gradients, moments | parameters |
//! | `dropout` | the records of `slice` | the same, some without opacity, if Gaussians are [dropped](Trainer::drop_out) |
//! | `noise` | raw parameters | the same with means moved at random and no too small temporal scale, if the scene [grows](Trainer::set_growing) |
//! | `statistics` | views of a Gaussian, its gradients on the screen | sums over steps, if the scene [grows as the original](Trainer::set_cloning) |
//! | `relocate` | moves, colors | colors of the Gaussians that move, moments, if the scene grows |
//! | `codebooks` | gradients of coefficients; entries | gradients of entries; coefficients, once colors are [tied](Trainer::tie) |

use super::backward::Backward;
use super::cloner::{Cloner, CloningStep, reset, taken};
use super::cloning::Densified;
use super::exposure::Exposure;
use super::grower::Grower;
use super::optimized::Optimized;
use super::parameters::ParameterBuffers;
use super::passes::Passes;
use super::records::{records, set_harmonics, set_parameters};
use super::regularizer::Regularizer;
use super::room::{bytes, require_gaussians, stride};
use super::rounding::{Rounder, changes};
use super::sample::{GpuImage, Sample};
use super::schedule::Rates;
use super::state::TrainerState;
use super::terms::Terms;
use super::tied::Tied;
use super::totals::{Faults, Totals};
use super::trained_environment::TrainedEnvironment;
use super::trained_exposure::TrainedExposure;
use super::trainer_error::TrainerError;
use crate::gaussian::{GradientMode, Model};
use crate::offline::dataset::CoveredImage;
use crate::offline::layout::{LossUniforms, NoiseUniforms, TrainedRecord};
use crate::offline::quantize::codebook::Centers;
use crate::offline::shaders::{COMPAT, COMPAT_WITHOUT_TIME, MIP_FILTER};
use crate::renderer::memory::with_room;
use crate::renderer::{GpuCapture, GpuError, Headless, ShaderChecks};
use crate::scene::{Bits, Environment, GaussianScene, SceneForm, TemporalFilter, Trained};
use crate::view::{Background, Frame, View};
use std::collections::VecDeque;
use std::iter;

/// Steps that may be submitted before the first of them has finished.
pub const STEPS_IN_FLIGHT: usize = 4;

/// What a step of training from pictures alone has beside the step of the optimizer.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StepGrowth {
    /// Number of values of the color of each Gaussian that are trained.
    pub color_values: u32,
    /// Factor on the rate of means that gives the strength of the noise.
    pub noise: f64,
    /// Least temporal scale, as a share of the interval.
    pub least_time_scale: f64,
    /// Seed of the noise.
    pub seed: u32,
    /// Whether gradients are added up, if the scene [grows as the original](Trainer::set_cloning).
    pub adds_up: bool,
}

/// A scene that is trained.
#[derive(Debug)]
pub struct Trainer<'a> {
    headless: &'a mut Headless,
    passes: Passes,
    capture: GpuCapture,
    /// What is not trained: switches, coefficients that are not evaluated.
    scene: GaussianScene,
    parameters: ParameterBuffers,
    backward: Backward,
    environment: Option<TrainedEnvironment>,
    exposure: Option<TrainedExposure>,
    tied: Option<Tied>,
    /// Weight of the term of the mask.
    mask_weight: f32,
    regularizer: Option<Regularizer>,
    rounder: Option<Rounder>,
    grower: Option<Grower>,
    cloner: Option<Cloner>,
    in_flight: VecDeque<wgpu::SubmissionIndex>,
}

impl<'a> Trainer<'a> {
    /// Uploads a scene in the trained form. What its temporal filter leaves out is neither drawn nor trained.
    ///
    /// # Errors
    /// A Gaussian that cannot be drawn, a scene that does not fit one binding of the device, a limit that is too low.
    pub fn new(headless: &'a mut Headless, mut scene: GaussianScene, mode: GradientMode) -> Result<Self, TrainerError> {
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
        let filter = if scene.trained_with.mip_filter { MIP_FILTER } else { &[] };
        let definitions = [definitions, filter].concat();
        let passes = Passes::new(headless, &definitions, ShaderChecks::Off)?;
        let degrees = runtime.form.color_degrees();
        let stride = stride(degrees.degree, degrees.degree_t);
        let count = runtime.len() as u32;
        require_gaussians(headless, count.into())?;
        if count == 0 {
            return Err(TrainerError::Empty);
        }
        let settings = (model, scene.trained_with.prefilter_var);
        let (capture, parameters) = with_room(&headless.context().device, bytes(count.into(), stride), || {
            let capture = headless.upload(&runtime)?;
            let parameters = ParameterBuffers::new(headless, &passes, settings, &records, stride, capture.writable());
            Ok::<_, GpuError>((capture, parameters))
        })??;
        let backward = Backward::new(headless);
        let environment = match (&scene.environment, capture.environment()) {
            (Some(Environment { texels, .. }), Some(map)) => {
                Some(TrainedEnvironment::new(headless, &passes, map, texels)?)
            }
            _ => None,
        };
        let trainer = Self {
            headless,
            passes,
            capture,
            scene,
            parameters,
            backward,
            environment,
            exposure: None,
            tied: None,
            mask_weight: 0.0,
            regularizer: None,
            rounder: None,
            grower: None,
            cloner: None,
            in_flight: VecDeque::new(),
        };
        trainer.slice();
        Ok(trainer)
    }

    /// Returns the adapter's description and the device.
    pub fn headless(&self) -> &Headless {
        self.headless
    }

    /// Returns the number of Gaussians.
    pub fn count(&self) -> u32 {
        self.parameters.count()
    }

    /// Returns the renderer, for scoring between steps.
    pub(super) fn headless_mut(&mut self) -> &mut Headless {
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
        GpuImage::new(self.headless, &self.passes, image)
    }

    /// Sets the weights of further terms of the loss, which are 0 at first.
    ///
    /// # Errors
    /// A weight that is negative or not a number, a shader that does not compile.
    pub fn set_terms(&mut self, terms: Terms) -> Result<(), TrainerError> {
        if let Some((term, weight)) = terms.wrong() {
            return Err(TrainerError::Weight { term, weight });
        }
        let unit = self.scene.trained_with.unit_length();
        self.regularizer = match terms.is_regularizing() {
            true => Some(Regularizer::new(self.headless, &self.parameters, &terms, unit)?),
            false => None,
        };
        self.mask_weight = terms.mask as f32;
        Ok(())
    }

    /// Trains an exposure for each camera from now on, which is the identity at first, and corrects by it what the loss sees of the views of
    /// that camera. `cameras` has the camera of each view, numbered from 0. Exposures are not part of the scene, and [`draw`](Self::draw) does
    /// not use them.
    ///
    /// # Errors
    /// A shader that does not compile.
    pub fn set_exposure(&mut self, cameras: &[u32]) -> Result<(), GpuError> {
        self.exposure = Some(TrainedExposure::new(self.headless, &self.passes, cameras)?);
        Ok(())
    }

    /// Returns the exposures of all cameras; none unless they are [trained](Self::set_exposure).
    ///
    /// # Errors
    /// A lost device.
    pub fn exposures(&self) -> Result<Vec<Exposure>, GpuError> {
        self.exposure.as_ref().map_or(Ok(Vec::new()), |exposure| exposure.exposures(self.headless))
    }

    /// Returns the gradients with respect to the exposures, accumulated since the last step.
    ///
    /// # Errors
    /// A lost device.
    pub fn exposure_gradients(&self) -> Result<Vec<Exposure>, GpuError> {
        self.exposure.as_ref().map_or(Ok(Vec::new()), |exposure| exposure.gradients(self.headless))
    }

    /// Adds the gradients of the loss of a batch, each view with the same share.
    ///
    /// # Errors
    /// A picture or pairs that do not fit the GPU, an image of another size than its view.
    pub fn accumulate(&mut self, batch: &[Sample<'_>], similarity_share: f64) -> Result<(), GpuError> {
        let Self { headless, passes, capture, parameters, backward, environment, exposure, mask_weight, .. } = self;
        let share = 1.0 / batch.len().max(1) as f32;
        for sample in batch {
            if sample.image.size != sample.view.size {
                return Err(GpuError::Scene("an image to train on has another size than its view"));
            }
            let mut encoder = encoder(headless, "gs4d view");
            headless.record(&mut encoder, capture, sample.view, sample.background)?;
            let Some(buffers) = backward.fit(headless, passes, parameters, sample.view.size)? else { continue };
            let queue = &headless.context().queue;
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
                mask_weight: *mask_weight,
                padding: 0,
            };
            queue.write_buffer(&buffers.loss_settings, 0, bytemuck::bytes_of(&settings));
            parameters.write_scene(queue, sample.number);
            let correction = match exposure {
                Some(exposure) => exposure.correction(headless, passes, buffers, sample, share)?,
                None => None,
            };
            match correction {
                Some(correction) => correction.record_loss(&mut encoder, passes, buffers, sample.image),
                None => buffers.record_loss(&mut encoder, passes, sample.image),
            }
            buffers.record(&mut encoder, headless, passes, capture, parameters);
            if let Some(environment) = environment.as_ref().filter(|_| sample.background == Background::Environment) {
                environment.record_scatter(&mut encoder, headless, &buffers.pixel_gradients, sample.view.size);
            }
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
        let Self { headless, passes, capture, parameters, backward, environment, .. } = self;
        headless.draw(capture, view, background)?;
        let Some(buffers) = backward.fit(headless, passes, parameters, view.size)? else { return Ok(()) };
        let queue = &headless.context().queue;
        queue.write_buffer(&buffers.pixel_gradients, 0, bytemuck::cast_slice(pixels));
        queue.write_buffer(&buffers.depth_gradients, 0, bytemuck::cast_slice(depths));
        parameters.write_scene(queue, 0);
        let mut encoder = encoder(headless, "gs4d view");
        buffers.record(&mut encoder, headless, passes, capture, parameters);
        if let Some(environment) = environment.as_ref().filter(|_| background == Background::Environment) {
            environment.record_scatter(&mut encoder, headless, &buffers.pixel_gradients, view.size);
        }
        queue.submit([encoder.finish()]);
        Ok(())
    }

    /// Adds the gradients of the terms that depend on Gaussians alone to those of the batch of a step, from 0. Neighbors are searched for
    /// before the first and again as often as the terms say.
    ///
    /// # Errors
    /// A lost device.
    pub fn accumulate_terms(&mut self, step: usize) -> Result<(), GpuError> {
        let Some(regularizer) = &mut self.regularizer else { return Ok(()) };
        regularizer.search(self.headless, &self.parameters, step)?;
        submit(self.headless, "gs4d terms", |pass| regularizer.record(pass, &self.parameters));
        Ok(())
    }

    /// Compiles the passes of training from pictures alone, for [`step_growing`](Self::step_growing) and [`relocate`](Self::relocate).
    ///
    /// # Errors
    /// Gaussians of another model than the native one, a shader that does not compile.
    pub fn set_growing(&mut self) -> Result<(), TrainerError> {
        if self.scene.model() != Some(Model::Rotated4d) {
            return Err(TrainerError::Model);
        }
        self.grower = Some(Grower::new(self.headless, &self.parameters)?);
        Ok(())
    }

    /// Hides a share of the Gaussians, drawn with this seed, until the next step is made; 0 unless the scene [grows](Self::set_growing).
    pub fn drop_out(&mut self, share: f64, seed: u32) {
        if let Some(grower) = self.grower.as_ref().filter(|_| share > 0.0) {
            let (queue, parameters) = (&self.headless.context().queue, &self.parameters);
            submit(self.headless, "gs4d dropout", |pass| grower.record_dropout(queue, pass, parameters, seed, share));
        }
    }

    /// Relocates the Gaussians that have faded, by random numbers of this seed. Returns their number; 0 unless the scene
    /// [grows](Self::set_growing).
    ///
    /// # Errors
    /// A lost device.
    pub fn relocate(&mut self, seed: u64) -> Result<usize, GpuError> {
        let Some(grower) = &self.grower else { return Ok(0) };
        let moved = grower.relocate(self.headless, &self.parameters, seed)?;
        self.slice();
        Ok(moved)
    }

    /// Compiles the pass of the densification of the original, for a scene that [grows](Self::set_growing): for [`densify`](Self::densify).
    ///
    /// # Errors
    /// A shader that does not compile.
    pub fn set_cloning(&mut self) -> Result<(), GpuError> {
        self.cloner = Some(Cloner::new(self.headless, &self.parameters)?);
        Ok(())
    }

    /// Removes, clones and splits Gaussians by their gradients in the steps since the last call. Nothing is done unless the scene
    /// [grows as the original](Self::set_cloning).
    ///
    /// # Errors
    /// A lost device.
    pub fn densify(&mut self, step: &CloningStep) -> Result<Densified, GpuError> {
        let (Some(grower), Some(cloner)) = (&self.grower, &self.cloner) else { return Ok(Densified::default()) };
        let extent = self.scene.trained_with.spatial_lr_scale;
        let densified = cloner.densify(self.headless, &self.parameters, grower, extent, step)?;
        self.slice();
        Ok(densified)
    }

    /// Returns the mean gradient of each Gaussian on the screen in the steps since the last densification; none unless the scene
    /// [grows as the original](Self::set_cloning).
    ///
    /// # Errors
    /// A lost device.
    pub fn screen_gradients(&self, batch: usize) -> Result<Vec<f32>, GpuError> {
        self.cloner.as_ref().map_or(Ok(Vec::new()), |cloner| cloner.gradients(self.headless, batch))
    }

    /// Lowers all opacities to at most 0.01, as the original does from time to time.
    ///
    /// # Errors
    /// A lost device.
    pub fn reset_opacity(&mut self) -> Result<(), GpuError> {
        reset(self.headless, &self.parameters)?;
        self.slice();
        Ok(())
    }

    /// Returns the number of Gaussians, without free places if the scene [grows as the original](Self::set_cloning).
    ///
    /// # Errors
    /// A lost device.
    pub fn taken(&self) -> Result<usize, GpuError> {
        match &self.cloner {
            Some(_) => taken(self.headless, &self.parameters),
            None => Ok(self.count() as usize),
        }
    }

    /// Makes a step with the gradients accumulated so far, which become 0; the first `step` is 1.
    ///
    /// # Errors
    /// A lost device.
    pub fn step(&mut self, rates: &Rates, factor: f64, step: usize) -> Result<(), GpuError> {
        self.step_growing(rates, factor, step, None)
    }

    /// As [`step`](Self::step); with `growth`, some values of color are not updated, and, if the scene [grows](Self::set_growing), noise
    /// moves means.
    ///
    /// # Errors
    /// A lost device.
    pub fn step_growing(
        &mut self,
        rates: &Rates,
        factor: f64,
        step: usize,
        growth: Option<StepGrowth>,
    ) -> Result<(), GpuError> {
        let Self { headless, passes, parameters, environment, exposure, tied, .. } = &*self;
        let ParameterBuffers { geometry, parts, .. } = parameters;
        let colors = rates.of_harmonics(factor);
        let spatial_lr_scale = self.scene.trained_with.spatial_lr_scale;
        let unit = self.scene.trained_with.unit_length();
        let geometry_rates = rates.of_parameters(spatial_lr_scale, unit, factor);
        let of_color = growth.map(|growth| growth.color_values);
        let mut rated = vec![(geometry, geometry_rates, None)];
        let of_parts = parts.iter().map(|part| &part.color);
        match tied {
            // The first coefficient of each Gaussian is its own; entries are of many.
            Some(tied) => {
                let own = Rates { harmonics: 0.0, ..*rates }.of_harmonics(factor);
                rated.extend(of_parts.map(|color| (color, own, None)));
                rated.push((&tied.entries, [colors[1]; 5], None));
            }
            None => rated.extend(of_parts.map(|color| (color, colors, of_color))),
        }
        let queue = &headless.context().queue;
        let mut encoder = encoder(headless, "gs4d step");
        {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            if let Some(tied) = tied {
                tied.record_collect(&mut pass, passes);
            }
            for (optimized, rates, values) in rated {
                optimized.record_step(queue, &mut pass, passes, rates, step, values);
            }
            if let Some(environment) = environment {
                environment.record_step(queue, &mut pass, passes, (rates.environment * factor) as f32, step);
            }
            if let Some(exposure) = exposure {
                exposure.record_step(queue, &mut pass, passes, (rates.exposure * factor) as f32, step);
            }
            if let (Some(grower), Some(StepGrowth { noise, least_time_scale, seed, .. })) = (&self.grower, growth) {
                // Times a variance it is the deviation, a length, as the rate alone is.
                let strength = (noise * rates.mean * spatial_lr_scale * factor / (unit * unit)) as f32;
                let least = least_time_scale * f64::from(self.scene.trained_with.time_span());
                let least_log_scale_t = least.max(f64::from(f32::MIN_POSITIVE)).ln() as f32;
                let settings = NoiseUniforms { count: parameters.count(), seed, strength, least_log_scale_t };
                grower.record_noise(queue, &mut pass, settings);
            }
            if let (Some(cloner), Some(StepGrowth { adds_up: true, .. })) = (&self.cloner, growth) {
                cloner.record(&mut pass, parameters.count());
            }
            if let Some(tied) = tied {
                tied.record_expand(&mut pass, passes, parameters);
            }
            self.record_slice(&mut pass);
        }
        if let Some(environment) = environment {
            environment.record_show(&mut encoder);
        }
        parameters.forget_seen(&mut encoder);
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
        self.backward.totals(self.headless)
    }

    /// Returns the gradients that were not finite so far; `None` if there were none.
    ///
    /// # Errors
    /// A lost device.
    pub fn faults(&self) -> Result<Option<Faults>, GpuError> {
        self.parameters.faults(self.headless)
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

    /// Makes all color coefficients but the first of each Gaussian sums of entries of codebooks, which are trained in their place. Rows are
    /// Gaussians.
    ///
    /// # Errors
    /// Codebooks of other Gaussians or coefficients.
    pub fn tie(&mut self, books: Centers) -> Result<(), TrainerError> {
        self.tied = Some(Tied::new(self.headless, &self.passes, &self.parameters, books)?);
        self.expand();
        Ok(())
    }

    /// Returns the codebooks as they are; `None` unless colors are [tied](Self::tie).
    ///
    /// # Errors
    /// A lost device.
    pub fn codebooks(&self) -> Result<Option<Centers>, GpuError> {
        self.tied.as_ref().map(|tied| tied.codebooks(self.headless)).transpose()
    }

    /// Packs the Gaussians as they are, by the rules of compression, and draws them from now on with what that changes of each: now as the
    /// package would be drawn, after further steps as far from the parameters as now. Parameters and their gradients are not rounded; terms
    /// of the loss that depend on Gaussians alone see them rounded too.
    ///
    /// # Errors
    /// Gaussians that the packed form cannot hold, a shader that does not compile, a lost device.
    pub fn round(&mut self, bits: &Bits) -> Result<(), TrainerError> {
        let SceneForm::Trained(Trained { parameters, .. }) = &self.scene.form else {
            return Err(TrainerError::NotTrained);
        };
        let mut parameters = parameters.clone();
        let trained: Vec<TrainedRecord> =
            bytemuck::pod_collect_to_vec(&self.parameters.geometry.read_values(self.headless)?);
        set_parameters(&mut parameters, &trained);
        let changes = changes(&parameters, &self.scene.trained_with, bits)?;
        let rounder = match self.rounder.take() {
            Some(rounder) => rounder,
            None => Rounder::new(self.headless, &self.parameters)?,
        };
        rounder.write(&self.headless.context().queue, &changes);
        self.rounder = Some(rounder);
        self.slice();
        Ok(())
    }

    /// Returns the scene as it is.
    ///
    /// # Errors
    /// A lost device.
    pub fn scene(&self) -> Result<GaussianScene, GpuError> {
        let records = self.parameters.geometry.read_values(self.headless)?;
        let values = self.parameters.read_colors(self.headless)?;
        let texels = self.environment.as_ref().map(|map| map.texels(self.headless)).transpose()?;
        Ok(self.with(&records, &values, texels))
    }

    /// Returns the gradients accumulated since the last step, as raw parameters, color coefficients and texels of the environment map.
    ///
    /// # Errors
    /// A lost device.
    pub fn gradients(&self) -> Result<GaussianScene, GpuError> {
        let records = self.parameters.geometry.read_gradients(self.headless)?;
        let values = self.parameters.read_color_gradients(self.headless)?;
        let texels = self.environment.as_ref().map(|map| map.gradients(self.headless)).transpose()?;
        let mut gradients = self.with(&records, &values, texels);
        if let SceneForm::Trained(Trained { harmonics, .. }) = &mut gradients.form {
            let (used, own) = (harmonics.evaluated() * 3, harmonics.coefficients * 3);
            // Coefficients that are not evaluated change nothing.
            harmonics.values.chunks_exact_mut(own.max(1)).for_each(|values| values[used..].fill(0.0));
        }
        Ok(gradients)
    }

    /// Returns the scene with these records and color coefficients, as they are on the GPU, and these texels of the environment map.
    fn with(&self, records: &[u8], values: &[u8], texels: Option<Vec<f32>>) -> GaussianScene {
        let mut scene = self.scene.clone();
        if let (Some(map), Some(texels)) = (&mut scene.environment, texels) {
            map.texels = texels;
        }
        if let SceneForm::Trained(Trained { parameters, harmonics }) = &mut scene.form {
            let records: Vec<TrainedRecord> = bytemuck::pod_collect_to_vec(records);
            set_parameters(parameters, &records);
            let stride = self.parameters.stride() as usize * 4;
            set_harmonics(harmonics, &bytemuck::pod_collect_to_vec::<u8, f32>(values), stride);
        }
        scene
    }

    /// Returns parameters, moments and neighbors, to resume from.
    ///
    /// # Errors
    /// A lost device.
    pub fn state(&self) -> Result<TrainerState, GpuError> {
        let read = |buffer: &wgpu::Buffer| self.headless.copy_out(buffer, buffer.size());
        let buffers = self.stored().into_iter().map(read).collect::<Result<_, _>>()?;
        let neighbors = self.regularizer.as_ref().map(|regularizer| regularizer.neighbors(self.headless));
        let neighbors = neighbors.transpose()?.unwrap_or_default();
        Ok(TrainerState { buffers, neighbors, filter: self.scene.filter.clone() })
    }

    /// Replaces parameters, moments and filter by those of [`state`](Self::state), and neighbors if it has some that are needed. Returns
    /// whether they are of as many Gaussians, of as many entries if colors are tied, and rounded if these are; if not, nothing is replaced.
    pub fn resume(&mut self, state: &TrainerState) -> bool {
        if !state.fits(&self.stored(), self.parameters.count()) {
            return false;
        }
        if state.filter != self.scene.filter
            && state.filter.clone().is_none_or(|filter| self.set_filter(filter).is_err())
        {
            return false;
        }
        for (bytes, buffer) in state.buffers.iter().zip(self.stored()) {
            self.headless.context().queue.write_buffer(buffer, 0, bytes);
        }
        if let Some(regularizer) = &mut self.regularizer {
            regularizer.resume(self.headless, &state.neighbors);
        }
        if let Some(environment) = &self.environment {
            let mut encoder = encoder(self.headless, "gs4d environment");
            environment.record_show(&mut encoder);
            self.headless.context().queue.submit([encoder.finish()]);
        }
        self.expand();
        self.slice();
        true
    }

    /// Returns the buffers of a state, in its order.
    fn stored(&self) -> Vec<&wgpu::Buffer> {
        let ParameterBuffers { geometry, parts, .. } = &self.parameters;
        let environment = self.environment.as_ref().map(|environment| &environment.values);
        let exposure = self.exposure.as_ref().map(|exposure| &exposure.values);
        let gaussians = iter::once(geometry).chain(parts.iter().map(|part| &part.color));
        let others = [environment, exposure, self.tied.as_ref().map(|tied| &tied.entries)];
        let optimized = gaussians.chain(others.into_iter().flatten()).flat_map(Optimized::stored);
        let others = [
            self.rounder.as_ref().map(|rounder| &rounder.changes),
            self.cloner.as_ref().map(|cloner| &cloner.statistics),
        ];
        optimized.chain(others.into_iter().flatten()).collect()
    }

    /// Sets all moments to 0, as before the first step.
    pub fn forget_moments(&mut self) {
        let mut encoder = encoder(self.headless, "gs4d moments");
        self.parameters.geometry.forget_moments(&mut encoder);
        self.parameters.parts.iter().for_each(|part| part.color.forget_moments(&mut encoder));
        if let Some(environment) = &self.environment {
            environment.values.forget_moments(&mut encoder);
        }
        if let Some(exposure) = &self.exposure {
            exposure.values.forget_moments(&mut encoder);
        }
        self.headless.context().queue.submit([encoder.finish()]);
    }

    /// Computes the coefficients from the entries of codebooks, if colors are tied.
    fn expand(&self) {
        if let Some(tied) = &self.tied {
            submit(self.headless, "gs4d expand", |pass| tied.record_expand(pass, &self.passes, &self.parameters));
        }
    }

    /// Slices the parameters.
    fn slice(&self) {
        self.parameters.write_scene(&self.headless.context().queue, 0);
        submit(self.headless, "gs4d slice", |pass| self.record_slice(pass));
    }

    /// Records that the parameters are sliced, and rounded if geometry is.
    fn record_slice(&self, pass: &mut wgpu::ComputePass<'_>) {
        self.parameters.record_slice(pass, &self.passes);
        if let Some(rounder) = &self.rounder {
            rounder.record(pass, &self.parameters);
        }
    }
}

fn encoder(headless: &Headless, label: &str) -> wgpu::CommandEncoder {
    let label = wgpu::CommandEncoderDescriptor { label: Some(label) };
    headless.context().device.create_command_encoder(&label)
}

/// Submits one compute pass.
fn submit(headless: &Headless, label: &str, record: impl FnOnce(&mut wgpu::ComputePass<'_>)) {
    let mut encoder = encoder(headless, label);
    record(&mut encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default()));
    headless.context().queue.submit([encoder.finish()]);
}
