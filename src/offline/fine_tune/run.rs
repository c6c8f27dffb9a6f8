//! A run of fine-tuning: its scene on the GPU, images and settings, and the operations that both phases use.
//!
//! In: a scene, views and settings. Out: one step, one evaluation, the trained scene, the result of a run.

use super::best::Progressed;
use super::cloner::CloningStep;
use super::grown::Grown;
use super::growth::Cloning;
use super::outcome::FineTuned;
use super::places::{with_places, without_places};
use super::prefetch::Prefetch;
use super::sample::{GpuImage, Sample};
use super::schedule::{Behind, Rates, Schedule, dropout_seed, noise_seed, relocation_seed};
use super::settings::FineTuneSettings;
use super::targets::{Shot, TrainingImages};
use super::trainer::{StepGrowth, Trainer};
use crate::offline::dataset::selection::even_subset;
use crate::offline::metrics::SquaredError;
use crate::offline::score::GpuEngine;
use crate::offline::temporal_filter::seen_filter;
use crate::offline::{OfflineError, Progress, sliced};
use crate::renderer::{GpuError, Headless, ShaderChecks};
use crate::scene::{FilterKind, GaussianScene, RuntimeScene, TemporalFilter, TrainedWith};
use crate::view::{Background, Frame, Picture, View};
use glam::Vec3;

/// Views that are drawn before the first step, so that there is room for the pairs of all.
const VIEWS_OF_ROOM: usize = 64;
/// Most bytes of images that stay on the GPU.
const RESIDENT_BYTES: usize = 512 << 20;

/// Uploads images that are in memory, as many as have room. The others are `None`.
fn resident_images(trainer: &Trainer<'_>, shots: &[Shot]) -> Result<Vec<Option<GpuImage>>, OfflineError> {
    let mut bytes = 0;
    let upload = |shot: &Shot| {
        let Some(image) = &shot.image else { return Ok(None) };
        bytes += 4 * image.texels.len();
        (bytes <= RESIDENT_BYTES).then(|| trainer.upload(image)).transpose()
    };
    Ok(shots.iter().map(upload).collect::<Result<_, GpuError>>()?)
}

/// A run of training.
pub(super) struct Run<'a> {
    pub(super) trainer: Trainer<'a>,
    pub(super) settings: &'a FineTuneSettings,
    images: &'a TrainingImages,
    /// Those on the GPU; others are uploaded when they are needed.
    resident: Vec<Option<GpuImage>>,
    prefetch: Prefetch<'a>,
    background: Background,
    /// Whether backgrounds are random.
    random: bool,
    /// Segments of the scene's filter of the kind support, which changes no picture: it is left out of training and computed afterwards.
    support: Option<u32>,
}

impl<'a> Run<'a> {
    /// Uploads the scene and the images.
    pub(super) fn open(
        headless: &'a mut Headless,
        mut scene: GaussianScene,
        images: &'a TrainingImages,
        settings: &'a FineTuneSettings,
    ) -> Result<Self, OfflineError> {
        let background = match scene.environment {
            Some(_) => Background::Environment,
            None => Background::Color(scene.trained_with.background),
        };
        let (used, support) =
            scene.filter.take().map_or((None, None), |filter| match filter.kind != FilterKind::Support {
                true => (Some(filter), None),
                false => (None, Some(filter.segments)),
            });
        scene.filter = used;
        let cloning = settings.growth.and_then(|growth| growth.cloning);
        if let Some(Cloning { capacity, .. }) = cloning {
            scene = with_places(&scene, capacity);
        }
        let mut trainer = Trainer::new(headless, scene, settings.mode)?;
        trainer.set_terms(settings.terms)?;
        if settings.exposure {
            trainer.set_exposure(&images.cameras())?;
        }
        if settings.growth.is_some() {
            trainer.set_growing()?;
        }
        if cloning.is_some() {
            trainer.set_cloning()?;
        }
        let random = settings.behind == Behind::Random && background != Background::Environment && images.has_gaps();
        let resident = resident_images(&trainer, &images.shots)?;
        let prefetch = Prefetch::new(images);
        let mut run = Self { trainer, settings, images, resident, prefetch, background, random, support };
        for index in even_subset(&images.views, VIEWS_OF_ROOM) {
            run.trainer.make_room(&images.shots[index].view)?;
        }
        Ok(run)
    }

    /// Returns the error of an interrupted run, with the best result so far.
    pub(super) fn interrupted(&mut self, found: Progressed) -> OfflineError {
        self.trainer.resume(&found.best.state);
        let tuned = self.scene().and_then(|scene| self.finished(scene, found));
        tuned.map_or_else(|error| error, |tuned| OfflineError::Interrupted { tuned: Some(Box::new(tuned)) })
    }

    /// Returns the result of a run whose final scene is given.
    pub(super) fn finished(&self, scene: GaussianScene, found: Progressed) -> Result<FineTuned, OfflineError> {
        let Progressed { curve, best, pace: (steps, seconds) } = found;
        Ok(FineTuned {
            scene,
            curve,
            best: best.point,
            steps_per_second: (steps > 0).then(|| steps as f64 / seconds),
            validation: self.images.validation.len(),
            faults: self.trainer.faults()?,
            exposures: self.trainer.exposures()?,
        })
    }

    /// Returns the scene as it is, with its filter.
    pub(super) fn scene(&self) -> Result<GaussianScene, OfflineError> {
        let mut scene = self.trainer.scene()?;
        if self.settings.growth.is_some_and(|growth| growth.cloning.is_some()) {
            scene = without_places(scene);
        }
        if let Some(segments) = self.support {
            let TrainedWith { time_interval, marginal_cutoff, .. } = scene.trained_with;
            let gaussians = sliced(&scene)?.into_owned().into_iter();
            scene.filter = Some(TemporalFilter::support(gaussians, time_interval, marginal_cutoff, segments));
        }
        Ok(scene)
    }

    /// Computes the temporal filter again from the Gaussians as they are, if it is used in training.
    pub(super) fn refresh_filter(&mut self, progress: &mut dyn Progress) -> Result<(), OfflineError> {
        let mut scene = self.trainer.scene()?;
        let Some(TemporalFilter { kind, segments, .. }) = scene.filter.take() else { return Ok(()) };
        let runtime = scene.into_runtime()?;
        let background = runtime.trained_background();
        let filter = {
            let mut scorer = GpuEngine::new(self.trainer.headless_mut(), &runtime, background, ShaderChecks::Off)?;
            seen_filter(&mut scorer, &runtime, kind, segments + 1, &self.images.views, progress)?
        };
        Ok(self.trainer.set_filter(filter)?)
    }

    /// Makes the step with the views of number `step`, from 0; it is number `count`, from 1, since the moments were 0.
    pub(super) fn step(&mut self, step: usize, count: usize, factor: f64) -> Result<(), OfflineError> {
        let settings = self.settings;
        let schedule = Schedule { seed: settings.seed, views: self.images.shots.len(), batch: settings.batch };
        let indices = schedule.batch(step);
        self.prefetch.follow(&schedule, step);
        let mut uploaded = Vec::with_capacity(indices.len());
        for &index in &indices {
            uploaded.push(match (&self.resident[index], &self.images.shots[index].image) {
                (Some(_), _) => None,
                (None, Some(image)) => Some(self.trainer.upload(image)?),
                (None, None) => Some(self.trainer.upload(&self.prefetch.take(step, index)?)?),
            });
        }
        let mut batch = Vec::with_capacity(indices.len());
        for (place, (index, own)) in indices.into_iter().zip(&uploaded).enumerate() {
            // One of both is there.
            let Some(image) = own.as_ref().or(self.resident[index].as_ref()) else { continue };
            batch.push(Sample {
                view: &self.images.shots[index].view,
                image,
                background: match self.random {
                    true => Background::Color(schedule.background(step, place)),
                    false => self.background,
                },
                number: index as u32,
            });
        }
        // The steps after the last, which train codebooks, do not grow.
        let growth = settings.growth.filter(|_| step < settings.steps);
        if let Some(growth) = growth {
            self.trainer.drop_out(growth.dropout(step), dropout_seed(settings.seed, step));
        }
        self.trainer.accumulate(&batch, settings.similarity_share)?;
        self.trainer.accumulate_terms(step)?;
        let Some(growth) = growth else {
            return Ok(self.trainer.step(&settings.rates, factor, count)?);
        };
        let mean = settings.rates.mean * growth.mean_rate(step, settings.steps);
        let of_step = StepGrowth {
            color_values: growth.color_values(step),
            noise: growth.noise,
            least_time_scale: growth.least_time_scale,
            seed: noise_seed(settings.seed, step),
            adds_up: growth.cloning.is_some_and(|cloning| cloning.adds_up(step)),
        };
        Ok(self.trainer.step_growing(&Rates { mean, ..settings.rates }, factor, count, Some(of_step))?)
    }

    /// Relocates the Gaussians that have faded, or clones, splits and removes Gaussians and resets opacities, as far as that is due after this
    /// number of steps.
    pub(super) fn grow(&mut self, steps: usize) -> Result<Grown, OfflineError> {
        let settings = self.settings;
        let mut grown = Grown::default();
        let Some(growth) = settings.growth else { return Ok(grown) };
        let seed = relocation_seed(settings.seed, steps);
        if growth.relocates_after(steps) {
            grown.relocated = self.trainer.relocate(seed)?;
        }
        let Some(cloning) = growth.cloning else { return Ok(grown) };
        if cloning.densifies_after(steps) {
            let batch = settings.batch.min(self.images.len());
            let step = CloningStep { batch, removes_large: cloning.removes_large_after(steps), seed };
            let densified = self.trainer.densify(&step)?;
            grown.cloned = densified.cloned;
            grown.split = densified.split;
            grown.removed = densified.removed;
        }
        if cloning.resets_after(steps) {
            self.trainer.reset_opacity()?;
        }
        Ok(grown)
    }

    /// Returns the PSNR in dB of the scene in its present state: that of the squared error of all pixels, channels and validation views together;
    /// `None` without validation views.
    pub(super) fn evaluate(&mut self) -> Result<Option<f64>, OfflineError> {
        let background = self.background;
        let trainer = &mut self.trainer;
        psnr(self.images, background, |view| trainer.draw(view, background))
    }

    /// Returns the image of a validation view over the background, of a training view without any, and the scene in its present state there;
    /// `None` without views.
    pub(super) fn shown(&mut self) -> Result<Option<(Picture, Picture)>, OfflineError> {
        let Some((view, image)) = self.images.shown()? else { return Ok(None) };
        let frame = self.trainer.draw(view, self.background)?;
        Ok(Some((image.over(behind(self.background)), frame.picture)))
    }

    /// Returns the same PSNR of another scene, such as a compressed one.
    pub(super) fn evaluate_scene(&mut self, scene: &RuntimeScene) -> Result<Option<f64>, OfflineError> {
        let background = self.background;
        let headless = self.trainer.headless_mut();
        let capture = headless.upload(scene)?;
        psnr(self.images, background, |view| headless.render(&capture, view, background))
    }

    /// Reports the first gradient that was not finite. Returns whether there was one.
    pub(super) fn tell_faults(&self, progress: &mut dyn Progress) -> Result<bool, OfflineError> {
        let Some(faults) = self.trainer.faults()? else { return Ok(false) };
        let view = self.images.shots.get(faults.view as usize).map_or("", |shot| shot.name.as_str());
        progress.note(&format!(
            "note: the gradient of Gaussian {} in view {view} is not finite; such gradients are left out ({} so far)",
            faults.gaussian, faults.count
        ));
        Ok(true)
    }
}

/// Returns the PSNR in dB of drawn frames, clamped to 0..1, against the validation images over the background, all pixels together; `None`
/// without validation views.
fn psnr(
    images: &TrainingImages,
    background: Background,
    mut draw: impl FnMut(&View) -> Result<Frame, GpuError>,
) -> Result<Option<f64>, OfflineError> {
    let mut error = SquaredError::default();
    for some in images.validated() {
        for (view, image) in some? {
            error.add(&image.over(behind(background)), &draw(view)?.picture.clamped())?;
        }
    }
    Ok((!images.validation.is_empty()).then(|| error.psnr()))
}

/// Returns the color behind an image that does not cover all pixels.
fn behind(background: Background) -> Vec3 {
    match background {
        Background::Color(color) => Vec3::from(color),
        Background::None | Background::Environment => Vec3::ZERO,
    }
}
