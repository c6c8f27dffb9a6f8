//! Fine-tuning: training what pruning has left, so that it makes up for what was removed.
//!
//! In: a scene in the trained form, its training views with their images, [`FineTuneSettings`]. Out: the scene with the best parameters that
//! were found ([`FineTuned`]), and how its quality developed. The number of Gaussians stays.
//!
//! Some training views are held out: they tell which parameters are the best. The loss is `0.8 L1 + 0.2 (1 − SSIM)`, the optimizer Adam
//! (section 6 of the 4DGS model). Views, backgrounds and rates of a step follow from its number alone, so that a run which is resumed ends
//! as one which was not interrupted.

mod adam;
mod belonging;
mod loss;
mod resume;
mod schedule;
mod targets;
mod trainer;

pub use adam::{DECAY, Moments, adam};
pub use loss::{Loss, loss};
pub use schedule::{Behind, Rates};
pub use trainer::{Faults, GpuImage, Sample, Totals, Trainer, TrainerError, TrainerState};

use super::dataset::selection::{even_share, hold_out};
use super::dataset::{CoveredImage, TrainingView};
use super::metrics::{SizeMismatch, psnr};
use super::quantize::{self, CompressSettings, Quality, compress_tied, train_codebooks};
use super::work::{Fingerprint, Work};
use super::{OfflineError, Progress};
use crate::gaussian::GradientMode;
use crate::renderer::Headless;
use crate::scene::{GaussianScene, TemporalFilter};
use crate::view::View;
use glam::Vec3;
use resume::Checkpoint;
use schedule::{Schedule, decay};
use serde::{Deserialize, Serialize};
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

/// Settings of fine-tuning.
#[derive(Debug, Clone, PartialEq)]
pub struct FineTuneSettings {
    /// Number of steps. Default: 5000.
    pub steps: usize,
    /// Views of each step. Default: 2.
    pub batch: usize,
    /// Rates of the optimizer at first.
    pub rates: Rates,
    /// Factor on the rates at the end, which they fall to. Default: 0.05; 1 keeps them.
    pub last_rate: f64,
    /// Share of SSIM in the loss. Default: 0.2.
    pub similarity_share: f64,
    /// What is behind images that do not cover all of their pixels.
    pub behind: Behind,
    /// Seed of the order of views and of random backgrounds.
    pub seed: u64,
    /// Training views that are not trained on; they tell which parameters are the best. Default: 8; at most a quarter of all are.
    pub held_out: usize,
    /// Steps between two evaluations on them. Default: 500.
    pub evaluate_every: usize,
    /// Evaluations without an improvement after which training ends. Default: `None`, all steps are made.
    pub patience: Option<usize>,
    /// Whether gradients are those of the original, with its deviations.
    pub mode: GradientMode,
    /// How the result is compressed, and the number of further steps in which the codebooks of color are trained; `None` leaves the scene in
    /// the trained form.
    pub compress: Option<(Quality, usize)>,
}

impl Default for FineTuneSettings {
    fn default() -> Self {
        Self {
            steps: 5000,
            batch: 2,
            rates: Rates::OURS,
            last_rate: 0.05,
            similarity_share: 0.2,
            behind: Behind::default(),
            seed: 0,
            held_out: 8,
            evaluate_every: 500,
            patience: None,
            mode: GradientMode::default(),
            compress: None,
        }
    }
}

/// The quality after some steps.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct CurvePoint {
    /// Steps made.
    pub step: usize,
    /// Mean loss of the steps since the point before; `None` before the first.
    pub loss: Option<f64>,
    /// PSNR of these steps, all pixels together, dB; `None` before the first.
    pub training_psnr: Option<f64>,
    /// PSNR on the held-out views, dB.
    pub psnr: f64,
}

/// A scene after fine-tuning.
#[derive(Debug, Clone, PartialEq)]
pub struct FineTuned {
    /// The scene with the best parameters.
    pub scene: GaussianScene,
    /// The quality before the first step, at every evaluation and at the end.
    pub curve: Vec<CurvePoint>,
    /// The point with the best parameters.
    pub best: CurvePoint,
    /// Steps a second, of those made now, without evaluations; `None` if there were none.
    pub steps_per_second: Option<f64>,
    /// Number of held-out views.
    pub held_out: usize,
    /// Gradients that were not finite and have been left out.
    pub faults: Option<Faults>,
    /// Whether it ended before all steps were made because the user wanted it to.
    pub interrupted: bool,
}

/// Where the state of training is stored, and what it depends on.
#[derive(Debug, Clone, Copy)]
pub struct Resume<'a> {
    /// The folder.
    pub work: &'a Work,
    /// Everything that the result depends on besides the settings.
    pub fingerprint: Fingerprint,
    /// Steps between two states.
    pub every: usize,
}

/// Trains a scene on views. Begins the tasks "loading images" and "fine-tuning".
///
/// # Errors
/// A scene that is not in the trained form or does not fit the GPU, images that are missing or show something else, a lost device.
pub fn fine_tune(
    headless: &mut Headless,
    scene: GaussianScene,
    views: &[TrainingView],
    settings: &FineTuneSettings,
    resume: Option<Resume<'_>>,
    progress: &mut dyn Progress,
) -> Result<FineTuned, OfflineError> {
    let trained_with = scene.trained_with.clone();
    let filter = scene.filter.clone();
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
    let trainer = Trainer::new(headless, scene, settings.mode)?;
    let random = settings.behind == Behind::Random && shots.iter().any(|shot| shot.image.has_gaps);
    let resident = resident_images(&trainer, &shots)?;
    let mut run = Run { trainer, settings, shots, resident, held_out, background: trained_with.background, random };
    for index in even_share(&trained_on, VIEWS_OF_ROOM) {
        run.trainer.make_room(&run.shots[index].view)?;
    }
    belonging::check(&mut run.trainer, &run.shots, run.background, &trained_on)?;
    run.run(filter, resume, progress)
}

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
struct Shot {
    view: View,
    name: String,
    image: CoveredImage,
}

/// A run of training.
struct Run<'a> {
    trainer: Trainer<'a>,
    settings: &'a FineTuneSettings,
    shots: Vec<Shot>,
    /// The images of the first of them, on the GPU; others are uploaded when they are needed.
    resident: Vec<GpuImage>,
    held_out: Vec<Shot>,
    background: [f32; 3],
    /// Whether backgrounds are random.
    random: bool,
}

impl Run<'_> {
    /// Trains; `filter` is that of the scene.
    fn run(
        &mut self,
        filter: Option<TemporalFilter>,
        resume: Option<Resume<'_>>,
        progress: &mut dyn Progress,
    ) -> Result<FineTuned, OfflineError> {
        let settings = self.settings;
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
            let state = self.trainer.state()?;
            if point.psnr > best.point.psnr {
                best = Best { point, state: state.buffers.clone() };
            }
            if let Some((resume, print)) = resume.zip(fingerprint) {
                let due = step.is_multiple_of(resume.every.max(1)) || interrupted;
                let checkpoint = Checkpoint { curve, best, state };
                if due && (step < settings.steps || settings.compress.is_some()) {
                    checkpoint.store(resume.work, print, progress)?;
                }
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
        self.trainer.resume(&TrainerState { buffers: best.state });
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
        let books = if settings.codebooks.is_empty() {
            None
        } else {
            let books = train_codebooks(&scene, &settings)?;
            self.trainer.tie(books)?;
            Some(())
        };
        progress.begin("training codebooks", steps);
        self.trainer.totals()?;
        if books.is_some() {
            for step in 0..steps {
                let factor = decay(step, steps, self.settings.last_rate);
                self.step(made + step, step + 1, factor * CODED_RATE)?;
                progress.advance();
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
                background: if self.random { schedule.background(step, place) } else { self.background },
                number: index as u32,
            });
        }
        self.trainer.accumulate(&batch, settings.similarity_share)?;
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
struct Best {
    point: CurvePoint,
    state: [Vec<u8>; 6],
}

/// Returns the mean over views of the PSNR against their images, as evaluations compute it.
fn mean_psnr(trainer: &mut Trainer<'_>, shots: &[Shot], background: [f32; 3]) -> Result<f64, OfflineError> {
    let mut sum = 0.0;
    for shot in shots {
        sum += psnr_of(trainer, &shot.view, &shot.image, background)?;
    }
    Ok(sum / shots.len().max(1) as f64)
}

fn psnr_of(
    trainer: &mut Trainer<'_>,
    view: &View,
    image: &CoveredImage,
    background: [f32; 3],
) -> Result<f64, OfflineError> {
    let picture = trainer.draw(view, background)?.picture.clamped();
    let found: Result<f64, SizeMismatch> = psnr(&image.over(Vec3::from(background)), &picture);
    Ok(found?)
}

fn describe(point: &CurvePoint, speed: Option<f64>) -> String {
    let CurvePoint { step, loss, training_psnr, psnr } = point;
    let loss = loss.map_or(String::new(), |loss| format!("loss {loss:.5}, "));
    let training = training_psnr.map_or(String::new(), |psnr| format!("training {psnr:.2} dB, "));
    let speed = speed.map_or(String::new(), |speed| format!(", {speed:.1} steps a second"));
    format!("step {step}: {loss}{training}held-out {psnr:.3} dB{speed}")
}
