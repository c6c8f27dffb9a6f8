//! The training of a capture that deforms.
//!
//! In: training images with silhouettes, a number of steps. Out: [`Fit`]: Gaussians in canonical space, nodes and colors, which can be drawn at any time.

use super::canonical::Canonical;
use super::native::{Deforming, Extent};
use super::nodes::Nodes;
use super::rigidity::Rigidity;
use super::skin::{Bond, backward, bonds, deformed, spread};
use super::window::Window;
use crate::gaussian::GradientMode;
use crate::offline::dataset::CoveredImage;
use crate::offline::fine_tune::{GpuImage, GradientSums, Rates, Sample, Trainer, TrainerError, TrainingImages, decay};
use crate::offline::metrics::SquaredError;
use crate::offline::train::StartError;
use crate::offline::train::hull::hull;
use crate::offline::train::region::Region;
use crate::offline::train::start::{begun, still};
use crate::offline::{OfflineError, Progress, proceed};
use crate::renderer::Headless;
use crate::scene::random::Random;
use crate::scene::{PlaybackHints, SceneForm, Trained, TrainedWith};
use crate::view::{Background, Frame, View};
use glam::Vec3;
use std::collections::HashMap;
use std::time::Instant;

/// Number of nodes.
const NODES: usize = 1024;
/// Views for each span of the curves of nodes.
const VIEWS_OF_SPAN: usize = 6;
/// Fewest and most spans.
const SPANS: [usize; 2] = [4, 64];
/// Weight of the rigidity of nodes in the loss.
const RIGIDITY: f32 = 3e-4;
/// Weight of SSIM in the loss.
const SIMILARITY: f64 = 0.2;
/// Rate of the control points of nodes.
const NODE_RATE: f64 = 1e-3;
/// Factor on the rate of means.
const MEAN_RATE: f64 = 4.0;
/// Further factor on the rate of means at the last step.
const LAST_MEAN_RATE: f64 = 0.01;
/// Factor on all rates at the last step.
const LAST_RATE: f64 = 0.1;
/// Share of the Gaussians that a step is drawn without, and the share of the steps of which this is so.
const DROPOUT: f64 = 0.1;
const DROPS_OUT: f64 = 0.6;
/// Steps between two relocations, and the share of the steps during which there are any.
const RELOCATES_EVERY: usize = 100;
const RELOCATES: f64 = 0.8;
/// Degree of color.
const DEGREE: u32 = 3;
/// Most bytes of images that stay on the GPU.
const RESIDENT_BYTES: usize = 512 << 20;
/// Views that are drawn before the first step, so that there is room for the pairs of all.
const VIEWS_OF_ROOM: usize = 16;

/// A capture that deforms.
#[derive(Debug)]
pub(in crate::offline::train) struct Fit<'a> {
    trainer: Trainer<'a>,
    canonical: Canonical,
    nodes: Nodes,
    bonds: Vec<Bond>,
    spatial_lr_scale: f64,
    /// Images on the GPU, each since a step has seen it, as far as there is room.
    resident: HashMap<u32, GpuImage>,
    resident_bytes: usize,
}

/// Trains a capture of so many Gaussians that deforms. Begins the task "training a deformation".
///
/// # Errors
/// Images without silhouettes or with an empty hull, a scene that does not fit the GPU, a lost device; [`OfflineError::Interrupted`] if the user has
/// asked to end.
pub(in crate::offline::train) fn fit<'a>(
    headless: &'a mut Headless,
    images: &TrainingImages,
    trained_with: &TrainedWith,
    gaussians: usize,
    (steps, seed): (usize, u64),
    progress: &mut dyn Progress,
) -> Result<Fit<'a>, OfflineError> {
    if !images.has_gaps() {
        return Err(StartError::NoSilhouettes.into());
    }
    let pairs: Vec<(&View, &CoveredImage)> = images.first().collect();
    let times: Vec<f32> = pairs.iter().map(|(view, _)| view.time).collect();
    let window = Window::new(&times, steps);
    let near: Vec<_> = window.first().iter().map(|&index| pairs[index]).collect();
    let region = Region::of(pairs.iter().map(|(view, _)| *view))?;
    let interval = trained_with.time_interval;
    let points = hull(&near, &region, interval, gaussians, seed);
    if points.is_empty() {
        return Err(StartError::NoHull.into());
    }
    let scene = begun(still(&points, DEGREE), None, trained_with.clone(), PlaybackHints::default());
    let mut trainer = Trainer::with_sums(headless, scene, GradientMode::Exact, GradientSums::default())?;
    trainer.set_relocating()?;
    for (view, _) in pairs.iter().step_by(pairs.len().div_ceil(VIEWS_OF_ROOM)) {
        trainer.make_room(view)?;
    }
    let canonical = Canonical::new(trainer.records()?);
    let spans = (pairs.len() / VIEWS_OF_SPAN).clamp(SPANS[0], SPANS[1]);
    let nodes = Nodes::new(spread(&canonical.records, NODES), interval, spans);
    let bonds = bonds(&canonical.records, nodes.places());
    let spatial_lr_scale = trained_with.spatial_lr_scale;
    let (resident, resident_bytes) = (HashMap::new(), 0);
    let mut fit = Fit { trainer, canonical, nodes, bonds, spatial_lr_scale, resident, resident_bytes };
    let rigidity = Rigidity::new(fit.nodes.places());
    let mut random = Random::new(seed);
    let start = Instant::now();
    progress.begin("training a deformation", steps);
    for step in 0..steps {
        proceed(progress)?;
        let index = window.view(step, &mut random);
        fit.step(pairs[index], index as u32, (step, steps), &window, &rigidity, &mut random)?;
        progress.advance();
    }
    progress.finish();
    let pace = steps as f64 / start.elapsed().as_secs_f64().max(1e-9);
    let psnr = fit.psnr(images)?.map(|psnr| format!("validation {psnr:.3} dB, ")).unwrap_or_default();
    progress.note(&format!("deformation step {steps}: {psnr}{pace:.1} steps per second, {} Gaussians", points.len()));
    Ok(fit)
}

impl Fit<'_> {
    /// Makes a step, counted from 0, with a view.
    fn step(
        &mut self,
        (view, image): (&View, &CoveredImage),
        number: u32,
        (step, steps): (usize, usize),
        window: &Window,
        rigidity: &Rigidity,
        random: &mut Random,
    ) -> Result<(), OfflineError> {
        let Self { trainer, canonical, nodes, bonds, spatial_lr_scale, resident, resident_bytes } = self;
        let done = step as f64 / steps as f64;
        nodes.reach(view.time);
        let poses = nodes.poses(view.time);
        trainer.write_records(&deformed(&canonical.records, bonds, &poses));
        if done < DROPS_OUT {
            trainer.drop_out(DROPOUT, (random.unit() * (1u32 << 24) as f32) as u32);
        }
        let background = Background::Color([(); 3].map(|()| random.unit()));
        let bytes = size_of_val(&image.texels[..]);
        let uploaded = match resident.get(&number) {
            Some(_) => None,
            None => Some(trainer.upload(image)?),
        };
        if let Some(image) = uploaded.as_ref().or(resident.get(&number)) {
            trainer.accumulate(&[Sample { view, image, background, number }], SIMILARITY)?;
        }
        if let Some(image) = uploaded.filter(|_| *resident_bytes + bytes <= RESIDENT_BYTES) {
            *resident_bytes += bytes;
            resident.insert(number, image);
        }
        let mut gradients = trainer.record_gradients()?;
        let factor = decay(step, steps, LAST_RATE);
        let still = Rates { mean: 0.0, mean_t: 0.0, scale: 0.0, rotation: 0.0, opacity: 0.0, ..Rates::OURS };
        trainer.step(&still, factor, step + 1)?;
        let mut of_poses = backward(&canonical.records, bonds, &poses, &mut gradients);
        rigidity.add(&poses, RIGIDITY, &mut of_poses);
        nodes.collect(view.time, &of_poses);
        nodes.step(view.time, (NODE_RATE * factor) as f32);
        let of_means = MEAN_RATE * window.since_all(step).map_or(1.0, |since| LAST_MEAN_RATE.powf(since));
        let rates = Rates { mean: Rates::OURS.mean * of_means, ..Rates::OURS };
        let rates = rates.of_parameters(*spatial_lr_scale, factor);
        canonical.step(&gradients, rates, step + 1);
        if (step + 1) % RELOCATES_EVERY == 0 {
            if done < RELOCATES {
                let moves = canonical.relocate((f64::from(random.unit()) * (1u64 << 24) as f64) as u64);
                trainer.move_colors(&canonical.records, &moves);
            }
            *bonds = super::skin::bonds(&canonical.records, nodes.places());
        }
        Ok(())
    }

    /// Returns native Gaussians that move as these do.
    ///
    /// # Errors
    /// A lost device.
    pub(super) fn native(&self, interval: [f32; 2], extent: Extent) -> Result<Trained, OfflineError> {
        let Self { trainer, canonical, nodes, bonds, .. } = self;
        let SceneForm::Trained(Trained { harmonics, .. }) = trainer.scene()?.form else {
            return Err(TrainerError::NotTrained.into());
        };
        let deforming = Deforming { records: &canonical.records, bonds, nodes, harmonics: &harmonics, interval };
        Ok(deforming.native(extent))
    }

    /// Draws a view at its time.
    ///
    /// # Errors
    /// A picture that does not fit the GPU, a lost device.
    pub(super) fn draw(&mut self, view: &View, background: Background) -> Result<Frame, OfflineError> {
        let Self { trainer, canonical, nodes, bonds, .. } = self;
        trainer.write_records(&deformed(&canonical.records, bonds, &nodes.poses(view.time)));
        Ok(trainer.draw(view, background)?)
    }

    /// Returns the PSNR in dB over black of all validation views together; `None` if there are none.
    fn psnr(&mut self, images: &TrainingImages) -> Result<Option<f64>, OfflineError> {
        let (mut error, mut views) = (SquaredError::default(), 0);
        for some in images.validated() {
            for (view, image) in some? {
                error.add(&image.over(Vec3::ZERO), &self.draw(view, Background::Color([0.0; 3]))?.picture.clamped())?;
                views += 1;
            }
        }
        Ok((views > 0).then(|| error.psnr()))
    }
}
