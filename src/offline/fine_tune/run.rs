//! A run of fine-tuning: its steps, evaluations and states.
//!
//! In: a scene, views and settings. Out: the best parameters, and the curve that led to them.

use super::resume::Checkpoint;
use super::schedule::{Schedule, decay};
use super::{Behind, CurvePoint, FineTuneSettings, FineTuned, Resume, belonging, targets};
use super::{GpuImage, Sample, Trainer, TrainerState};
use crate::offline::dataset::selection::{even_share, hold_out};
use crate::offline::dataset::{CoveredImage, TrainingView};
use crate::offline::metrics::{SizeMismatch, psnr};
use crate::offline::quantize::{self, CompressSettings, Quality, compress_tied, train_codebooks};
use crate::offline::{OfflineError, Progress};
use crate::renderer::Headless;
use crate::scene::{GaussianScene, TemporalFilter};
use crate::view::{Background, View};
use glam::Vec3;
use std::time::Instant;

/// Views that are drawn before the first step, so that there is room for the pairs of all.
const VIEWS_OF_ROOM: usize = 64;
/// Gaussians for each entry of a codebook, at least, and entries of a codebook, at least.
const CODED_GAUSSIANS_OF_ENTRY: usize = 64;
const LEAST_ENTRIES: usize = 64;
/// Factor on the rates while codebooks are trained.
const CODED_RATE: f64 = 0.5;
/// Most bytes of images that stay on the GPU.
const RESIDENT_BYTES: usize = 3 << 30;
/// Steps between two looks at gradients that are not finite.
const STEPS_OF_FAULTS: usize = 50;

/// Uploads images, as many as have room.
fn resident_images(trainer: &Trainer<'_>, shots: &[Shot]) -> Result<Vec<GpuImage>, OfflineError> {
    let mut bytes = 0;
    let fits = |shot: &&Shot| {
        bytes += 4 * shot.image.texels.len();
        bytes <= RESIDENT_BYTES
    };
    Ok(shots.iter().take_while(fits).map(|shot| trainer.upload(&shot.image)).collect::<Result<_, _>>()?)
}

/// A view with its image.
pub(super) struct Shot {
    pub view: View,
    name: String,
    pub image: CoveredImage,
}

/// A run of training.
pub(super) struct Run<'a> {
    trainer: Trainer<'a>,
    settings: &'a FineTuneSettings,
    shots: Vec<Shot>,
    /// The images of the first of them, on the GPU; others are uploaded when they are needed.
    resident: Vec<GpuImage>,
    held_out: Vec<Shot>,
    background: Background,
    /// Whether backgrounds are random.
    random: bool,
    /// That of the scene, which is not used in training.
    filter: Option<TemporalFilter>,
}

impl<'a> Run<'a> {
    /// Loads the images and uploads the scene.
    pub fn open(
        headless: &'a mut Headless,
        scene: GaussianScene,
        views: &[TrainingView],
        settings: &'a FineTuneSettings,
        progress: &mut dyn Progress,
    ) -> Result<Self, OfflineError> {
        let trained_with = scene.trained_with.clone();
        let filter = scene.filter.clone();
        let background = match scene.environment {
            Some(_) => Background::Environment,
            None => Background::Color(trained_with.background),
        };
        let (trained_on, held_out) = hold_out(views, settings.held_out);
        let load = |views: &[TrainingView], progress: &mut dyn Progress| -> Result<Vec<Shot>, OfflineError> {
            let images = targets::load(views, progress)?;
            let shot = |(view, image): (&TrainingView, CoveredImage)| Shot {
                view: view.camera.view(view.time, trained_with.raster_fov),
                name: view.name.clone(),
                image,
            };
            Ok(views.iter().zip(images).map(shot).collect())
        };
        let (shots, held_out) = (load(&trained_on, progress)?, load(&held_out, progress)?);
        let mut trainer = Trainer::new(headless, scene, settings.mode)?;
        trainer.set_terms(settings.terms)?;
        trainer.set_sparse(settings.sparse);
        let random = settings.behind == Behind::Random
            && background != Background::Environment
            && shots.iter().any(|shot| shot.image.has_gaps);
        let resident = resident_images(&trainer, &shots)?;
        let mut run = Self { trainer, settings, shots, resident, held_out, background, random, filter };
        for index in even_share(&trained_on, VIEWS_OF_ROOM) {
            run.trainer.make_room(&run.shots[index].view)?;
        }
        belonging::check(&mut run.trainer, &run.shots, run.background, &trained_on)?;
        Ok(run)
    }

    /// Trains.
    pub fn run(&mut self, resume: Option<Resume<'_>>, progress: &mut dyn Progress) -> Result<FineTuned, OfflineError> {
        let (settings, filter) = (self.settings, self.filter.take());
        let every = settings.evaluate_every.max(1);
        let fingerprint = resume.map(|resume| resume.fingerprint.and(&format!("{settings:?}")));
        let stored = resume.zip(fingerprint).and_then(|(resume, print)| Checkpoint::load(resume.work, print));
        let stored = stored.filter(|stored| self.trainer.resume(&stored.state));
        let (mut curve, mut best) = match stored {
            Some(Checkpoint { curve, best, .. }) => {
                progress.note(&format!("fine-tuning goes on after step {}", curve.last().map_or(0, |last| last.step)));
                (curve, best)
            }
            None => {
                let point = CurvePoint { step: 0, loss: None, training_psnr: None, psnr: self.evaluate()? };
                progress.note(&describe(&point, None));
                (vec![point], Best { point, state: self.trainer.state()?.buffers })
            }
        };
        let first = curve.last().map_or(0, |last| last.step);
        progress.begin("fine-tuning", settings.steps);
        (0..first).for_each(|_| progress.advance());
        let (mut seconds, mut interrupted, mut told) = (0.0, false, false);
        let mut start = Instant::now();
        let mut step = first;
        while step < settings.steps && !interrupted {
            self.step(step, step + 1, decay(step, settings.steps, settings.last_rate))?;
            step += 1;
            progress.advance();
            interrupted = progress.is_interrupted();
            if !told && step.is_multiple_of(STEPS_OF_FAULTS) {
                told = self.tell_faults(progress)?;
            }
            if !step.is_multiple_of(every) && step != settings.steps && !interrupted {
                continue;
            }
            // Waits for the steps made so far.
            let totals = self.trainer.totals()?;
            seconds += start.elapsed().as_secs_f64();
            let (loss, training_psnr) = (Some(totals.loss), Some(totals.psnr));
            let point = CurvePoint { step, loss, training_psnr, psnr: self.evaluate()? };
            let speed = (step - first) as f64 / seconds;
            progress.note(&describe(&point, Some(speed)));
            curve.push(point);
            if point.psnr > best.point.psnr {
                best = Best { point, state: self.trainer.state()?.buffers };
            }
            let goes_on = step < settings.steps || settings.compress.is_some();
            if let Some((resume, print)) = resume.zip(fingerprint)
                && (step.is_multiple_of(resume.every.max(1)) || interrupted)
                && goes_on
            {
                let checkpoint = Checkpoint { curve, best, state: self.trainer.state()? };
                checkpoint.store(resume.work, print, progress)?;
                Checkpoint { curve, best, .. } = checkpoint;
            }
            let waited = curve.iter().rev().take_while(|point| point.step > best.point.step).count();
            if settings.patience.is_some_and(|patience| waited >= patience) {
                progress.note(&format!("no better after {waited} evaluations: fine-tuning ends"));
                break;
            }
            start = Instant::now();
        }
        progress.finish();
        let faults = self.trainer.faults()?;
        self.trainer.resume(&TrainerState { buffers: best.state, ..TrainerState::default() });
        let scene = match settings.compress {
            Some((quality, steps)) if !interrupted => self.compress(quality, steps, &mut curve, filter, progress)?,
            _ => GaussianScene { filter, ..self.trainer.scene()? },
        };
        Ok(FineTuned {
            scene,
            curve,
            best: best.point,
            steps_per_second: (step > first).then(|| (step - first) as f64 / seconds),
            held_out: self.held_out.len(),
            faults,
            interrupted,
        })
    }

    /// Codes the colors by codebooks whose number of entries follows that of the Gaussians, trains these and everything else for some more
    /// steps, and compresses the result. A temporal filter of the kind support is that of the compressed Gaussians.
    fn compress(
        &mut self,
        quality: Quality,
        steps: usize,
        curve: &mut Vec<CurvePoint>,
        filter: Option<TemporalFilter>,
        progress: &mut dyn Progress,
    ) -> Result<GaussianScene, OfflineError> {
        let made = self.settings.steps;
        self.trainer.forget_moments();
        let scene = self.trainer.scene()?.into_runtime()?;
        let mut settings = CompressSettings::from(quality);
        let suiting = (scene.len() / CODED_GAUSSIANS_OF_ENTRY).next_power_of_two().max(LEAST_ENTRIES);
        settings.codebooks.iter_mut().for_each(|entries| *entries = (*entries).min(suiting));
        let steps = if settings.codebooks.is_empty() { 0 } else { steps };
        if steps > 0 {
            self.trainer.tie(train_codebooks(&scene, &settings)?)?;
        }
        progress.begin("training codebooks", steps);
        self.trainer.totals()?;
        for step in 0..steps {
            let factor = decay(step, steps, self.settings.last_rate);
            self.step(made + step, step + 1, factor * CODED_RATE)?;
            progress.advance();
            if progress.is_interrupted() {
                break;
            }
        }
        progress.finish();
        let scene = GaussianScene { filter, ..self.trainer.scene()? }.into_runtime()?;
        let (compressed, _) = match self.trainer.codebooks()? {
            Some(books) => compress_tied(scene, &settings, &books)?,
            None => quantize::compress(scene, &settings)?,
        };
        let totals = self.trainer.totals()?;
        let (loss, training_psnr) = (Some(totals.loss), Some(totals.psnr));
        let point = CurvePoint { step: made + steps, loss, training_psnr, psnr: self.evaluate()? };
        progress.note(&describe(&point, None));
        curve.push(point);
        Ok(compressed)
    }

    /// Makes the step with the views of number `step`, from 0; it is number `count`, from 1, since the moments were 0.
    fn step(&mut self, step: usize, count: usize, factor: f64) -> Result<(), OfflineError> {
        let settings = self.settings;
        let schedule = Schedule { seed: settings.seed, views: self.shots.len(), batch: settings.batch };
        let indices = schedule.batch(step);
        let uploaded = |&index: &usize| match self.resident.get(index) {
            Some(_) => Ok(None),
            None => self.trainer.upload(&self.shots[index].image).map(Some),
        };
        let uploaded: Vec<Option<GpuImage>> = indices.iter().map(uploaded).collect::<Result<_, _>>()?;
        let mut batch = Vec::with_capacity(indices.len());
        for (place, (index, own)) in indices.into_iter().zip(&uploaded).enumerate() {
            batch.push(Sample {
                view: &self.shots[index].view,
                image: own.as_ref().unwrap_or_else(|| &self.resident[index]),
                background: match self.random {
                    true => Background::Color(schedule.background(step, place)),
                    false => self.background,
                },
                number: index as u32,
            });
        }
        self.trainer.accumulate(&batch, settings.similarity_share)?;
        self.trainer.accumulate_terms(step)?;
        Ok(self.trainer.step(&settings.rates, factor, count)?)
    }

    /// Returns the mean PSNR on the held-out views.
    fn evaluate(&mut self) -> Result<f64, OfflineError> {
        mean_psnr(&mut self.trainer, &self.held_out, self.background)
    }

    /// Reports the first gradient that was not finite. Returns whether there was one.
    fn tell_faults(&self, progress: &mut dyn Progress) -> Result<bool, OfflineError> {
        let Some(faults) = self.trainer.faults()? else { return Ok(false) };
        let view = self.shots.get(faults.view as usize).map_or("", |shot| shot.name.as_str());
        progress.note(&format!(
            "note: the gradient of Gaussian {} in view {view} is not finite; such gradients are left out ({} so far)",
            faults.gaussian, faults.count
        ));
        Ok(true)
    }
}

/// The best parameters so far.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Best {
    pub point: CurvePoint,
    pub state: [Vec<u8>; 6],
}

/// Returns the mean over views of the PSNR against their images, as evaluations compute it.
fn mean_psnr(trainer: &mut Trainer<'_>, shots: &[Shot], background: Background) -> Result<f64, OfflineError> {
    let mut sum = 0.0;
    for shot in shots {
        sum += psnr_of(trainer, &shot.view, &shot.image, background)?;
    }
    Ok(sum / shots.len().max(1) as f64)
}

pub(super) fn psnr_of(
    trainer: &mut Trainer<'_>,
    view: &View,
    image: &CoveredImage,
    background: Background,
) -> Result<f64, OfflineError> {
    let picture = trainer.draw(view, background)?.picture.clamped();
    let found: Result<f64, SizeMismatch> = psnr(&image.over(behind(background)), &picture);
    Ok(found?)
}

/// Returns the color behind an image that does not cover all pixels.
fn behind(background: Background) -> Vec3 {
    match background {
        Background::Color(color) => Vec3::from(color),
        Background::None | Background::Environment => Vec3::ZERO,
    }
}

fn describe(point: &CurvePoint, speed: Option<f64>) -> String {
    let CurvePoint { step, loss, training_psnr, psnr } = point;
    let loss = loss.map_or(String::new(), |loss| format!("loss {loss:.5}, "));
    let training = training_psnr.map_or(String::new(), |psnr| format!("training {psnr:.2} dB, "));
    let speed = speed.map_or(String::new(), |speed| format!(", {speed:.1} steps a second"));
    format!("step {step}: {loss}{training}held-out {psnr:.3} dB{speed}")
}
