//! A run of training: its trainer, images and settings, and the operations that both phases use.
//!
//! In: a scene, views and settings. Out: one step, one evaluation, the trained scene, the result of a run.

use super::batch::Batches;
use super::evaluation::{behind, psnr};
use super::first_exposures::first_exposures;
use crate::offline::dataset::selection::even_subset;
use crate::offline::filter::temporal_filter::filter_of_views;
use crate::offline::score::GpuEngine;
use crate::offline::train::error::TrainError;
use crate::offline::train::images::TrainingImages;
use crate::offline::train::images::reduced::{Coarse, Detail};
use crate::offline::train::parts::Request;
use crate::offline::train::results::FineTuned;
use crate::offline::train::results::best_parameters::Progressed;
use crate::offline::train::settings::FineTuneSettings;
use crate::offline::train::start::capacity::{with_places, without_places};
use crate::offline::train::trainer::Trainer;
use crate::offline::work::Progress;
use crate::renderer::{Headless, ShaderChecks};
use crate::scene::{FilterKind, GaussianScene, RuntimeScene, TemporalFilter, TrainedWith};
use crate::view::{Background, Picture};
use std::borrow::Cow;

/// Views that are drawn before the first step, so that there is room for the pairs of all.
const VIEWS_OF_ROOM: usize = 64;

/// A run of training.
pub(super) struct Session<'a> {
    pub(super) trainer: Trainer<'a>,
    pub(super) settings: &'a FineTuneSettings,
    /// The images of the run, at whole size.
    given: &'a TrainingImages,
    /// The images at their present size.
    pub(super) images: Cow<'a, TrainingImages>,
    /// The present size; `None` before the first step of a run with sizes.
    detail: Option<Detail>,
    /// The sizes of the images; `None`: always whole.
    coarse: Option<Coarse>,
    batches: Batches,
    pub(super) background: Background,
    /// Segments of the scene's filter of the kind support, which changes no picture: it is left out of training and
    /// computed afterwards.
    support: Option<u32>,
}

impl<'a> Session<'a> {
    /// Uploads the scene and the images, and makes the optional parts that the settings ask for.
    pub(super) fn open(
        headless: &'a mut Headless,
        mut scene: GaussianScene,
        images: &'a TrainingImages,
        settings: &'a FineTuneSettings,
    ) -> Result<Self, TrainError> {
        let background = match scene.environment {
            Some(_) => Background::Environment,
            None => Background::Color(scene.trained_with.background),
        };
        let support = scene.filter.take_if(|filter| filter.kind == FilterKind::Support);
        let support = support.map(|filter| filter.segments);
        if let Some(cloning) = settings.growth.and_then(|growth| growth.cloning) {
            scene = with_places(&scene, cloning.capacity);
        }
        let mut trainer = Trainer::new(headless, scene, settings.mode)?;
        let cameras = if settings.exposure { images.cameras() } else { Vec::new() };
        let batch = settings.batch.min(images.len());
        trainer.prepare(&Request { cameras: &cameras, batch, ..Request::of(settings) })?;
        let batches = Batches::new(&trainer, images, settings, background)?;
        for index in even_subset(&images.views, VIEWS_OF_ROOM) {
            trainer.make_room(&images.shots[index].view)?;
        }
        let coarse = settings.coarse.map(|coarse| coarse.over(images.all_views().map(|view| view.size)));
        let detail = coarse.is_none().then_some(Detail::Whole);
        let (given, images) = (images, Cow::Borrowed(images));
        Ok(Self { trainer, settings, given, images, detail, coarse, batches, background, support })
    }

    /// Gives exposures their values before the first step of fine-tuning, if they are trained.
    pub(super) fn begin_exposures(&mut self) -> Result<(), TrainError> {
        if self.settings.exposure && self.settings.growth.is_none() {
            let exposures = first_exposures(&mut self.trainer, self.given, self.background)?;
            self.trainer.set_exposures(&exposures);
        }
        Ok(())
    }

    /// Uses images of the size of this step, from 0, from now on. Returns whether they had another size before. Begins
    /// the task "loading images", twice, if images are loaded.
    pub(super) fn enter(&mut self, step: usize, progress: &mut dyn Progress) -> Result<bool, TrainError> {
        let Some(coarse) = self.coarse else { return Ok(false) };
        let detail = coarse.detail(step, self.settings.steps);
        if self.detail == Some(detail) {
            return Ok(false);
        }
        // What was loaded at the size before is freed first.
        self.images = Cow::Borrowed(self.given);
        let images = self.given.at(&coarse, detail, progress)?;
        self.batches = Batches::new(&self.trainer, &images, self.settings, self.background)?;
        self.images = Cow::Owned(images);
        Ok(self.detail.replace(detail).is_some())
    }

    /// Returns whether the images have their whole size at present.
    pub(super) fn is_whole(&self) -> bool {
        self.detail == Some(Detail::Whole)
    }

    /// Returns the name of the task of the steps at the present size.
    pub(super) fn task(&self) -> &'static str {
        match (self.detail, self.settings.growth) {
            (Some(Detail::Quarter), Some(_)) => "training at a quarter of the size",
            (Some(Detail::Half), Some(_)) => "training at half the size",
            (Some(Detail::Quarter), None) => "fine-tuning at a quarter of the size",
            (Some(Detail::Half), None) => "fine-tuning at half the size",
            (Some(Detail::Whole) | None, _) => self.settings.task(),
        }
    }

    /// Makes the step of this number, from 0, which is number `count`, from 1, since the moments were 0, with this
    /// factor on all rates.
    pub(super) fn step(&mut self, index: usize, count: usize, factor: f64) -> Result<(), TrainError> {
        let step = self.settings.step(index, count, factor);
        let batch = self.batches.of_step(&self.trainer, &self.images, index)?;
        self.trainer.begin_step(&step)?;
        self.trainer.accumulate(&self.batches.samples(&self.images, &batch), self.settings.similarity_share)?;
        self.trainer.accumulate_terms(index)?;
        self.trainer.optimize(&step)?;
        Ok(self.trainer.end_step(&step)?)
    }

    /// Returns the error of an interrupted run, with the best result so far.
    pub(super) fn interrupted(&mut self, found: Progressed) -> TrainError {
        self.trainer.resume(&found.best.state);
        let tuned = self.scene().and_then(|scene| self.finished(scene, found));
        tuned.map_or_else(|error| error, |tuned| TrainError::Interrupted { tuned: Some(Box::new(tuned)) })
    }

    /// Returns the result of a run whose final scene is given.
    pub(super) fn finished(&self, scene: GaussianScene, found: Progressed) -> Result<FineTuned, TrainError> {
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

    /// Returns the scene as it is, without free places, and with its filter of the kind support.
    pub(super) fn scene(&self) -> Result<GaussianScene, TrainError> {
        let mut scene = self.trainer.scene()?;
        if self.settings.growth.is_some_and(|growth| growth.cloning.is_some()) {
            scene = without_places(scene);
        }
        if let Some(segments) = self.support {
            let TrainedWith { time_interval, marginal_cutoff, .. } = scene.trained_with;
            let gaussians = scene.gaussians()?.into_owned().into_iter();
            scene.filter = Some(TemporalFilter::support(gaussians, time_interval, marginal_cutoff, segments));
        }
        Ok(scene)
    }

    /// Computes the temporal filter again from the Gaussians as they are, if it is used in training.
    pub(super) fn refresh_filter(&mut self, progress: &mut dyn Progress) -> Result<(), TrainError> {
        let mut scene = self.trainer.scene()?;
        let Some(TemporalFilter { kind, segments, .. }) = scene.filter.take() else { return Ok(()) };
        let runtime = scene.into_runtime()?;
        let background = runtime.trained_background();
        let filter = {
            let mut scorer = GpuEngine::new(self.trainer.headless_mut(), &runtime, background, ShaderChecks::Off)?;
            filter_of_views(&mut scorer, &runtime, kind, segments + 1, &self.images.views, progress)?
        };
        Ok(self.trainer.set_filter(filter)?)
    }

    /// Returns the PSNR on the validation views of the scene as it is, dB; `None` without validation views.
    pub(super) fn evaluate(&mut self) -> Result<Option<f64>, TrainError> {
        let (trainer, background) = (&mut self.trainer, self.background);
        psnr(&self.images, background, |view| trainer.draw(view, background))
    }

    /// Returns the same of another scene, such as a compressed one.
    pub(super) fn evaluate_scene(&mut self, scene: &RuntimeScene) -> Result<Option<f64>, TrainError> {
        let (headless, background) = (self.trainer.headless_mut(), self.background);
        let capture = headless.upload(scene)?;
        psnr(&self.images, background, |view| headless.render(&capture, view, background))
    }

    /// Returns the image of a validation view over the background, of a training view without any, and the scene as it
    /// is there; `None` without views.
    pub(super) fn shown(&mut self) -> Result<Option<[Picture; 2]>, TrainError> {
        let Some((view, image)) = self.images.shown()? else { return Ok(None) };
        let frame = self.trainer.draw(view, self.background)?;
        Ok(Some([image.over(behind(self.background)), frame.picture]))
    }

    /// Reports the first gradient that was not finite. Returns whether there was one.
    pub(super) fn tell_faults(&self, progress: &mut dyn Progress) -> Result<bool, TrainError> {
        let Some(faults) = self.trainer.faults()? else { return Ok(false) };
        let view = self.images.shots.get(faults.view as usize).map_or("", |shot| shot.name.as_str());
        progress.note(&format!(
            "note: the gradient of Gaussian {} in view {view} is not finite; such gradients are left out ({} so far)",
            faults.gaussian, faults.count
        ));
        Ok(true)
    }
}
