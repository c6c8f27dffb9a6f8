//! Levels of detail: the same capture of fewer Gaussians, for pictures of few pixels.
//!
//! In: a scene, [`DetailSettings`]. Out: the scene with levels ([`Detailed`]), each with the size on the screen up to which no view of it
//! is farther from all Gaussians than the settings allow.
//!
//! 1. `merge` puts few Gaussians in place of many, with their moments in space and time; `rotation` makes raw parameters of these.
//! 2. `fit` trains them on pictures of all Gaussians at the sizes for which they are meant. That matters: each splat is blurred to at least
//!    half a pixel without becoming fainter, as in the original, so that many small ones together look larger and denser than they are.
//! 3. `looks` compares them with all Gaussians, in other views, at one size after the other. A level that is close enough at none is not kept.

mod fit;
mod looks;
mod merge;
mod rotation;

use super::quantize::{CompressSettings, Quality, compress};
use super::{OfflineError, Progress};
use crate::renderer::Headless;
use crate::scene::{Form, GaussianScene, Level, MAX_LEVELS, RuntimeScene, SceneForm, Sliced, TrainedWith};
use fit::fit;
use looks::{Around, Look, Sphere, looks, worst_psnr};
use merge::merge;
use serde::Serialize;
use std::sync::Arc;

/// Sizes on the screen at which levels are compared, pixels: each about 1.4 times the one before.
const SIZES: [f32; 14] = [4.0, 6.0, 8.0, 11.0, 16.0, 23.0, 32.0, 45.0, 64.0, 91.0, 128.0, 181.0, 256.0, 362.0];
/// How many times fewer Gaussians a level has than the one before.
const COARSER: usize = 7;
/// Gaussians for each square pixel of the size that a level is meant for.
const DENSITY: f32 = 10.0;
/// Sizes that a level is trained at, parts of the one that it is meant for.
const TRAINED_AT: [f32; 3] = [1.0, 0.7, 0.5];
/// Fewest Gaussians of a level.
const FEWEST: usize = 8;

/// Settings of the levels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DetailSettings {
    /// Levels to make, at most [`MAX_LEVELS`]; each has a seventh of the Gaussians of the one before. Default: 3.
    pub levels: usize,
    /// Lowest PSNR of a view against all Gaussians, dB. Default: 45.
    pub min_psnr: f64,
    /// Steps of training of each level; 0 leaves it as it was merged. Default: 2000.
    pub steps: usize,
    /// Directions from which each level is trained and compared, and times of each. Default: 24 and 6.
    pub directions: usize,
    /// See [`directions`](Self::directions).
    pub times: usize,
}

impl Default for DetailSettings {
    fn default() -> Self {
        Self { levels: 3, min_psnr: 45.0, steps: 2000, directions: 24, times: 6 }
    }
}

/// A level that was made, kept or not.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MadeLevel {
    /// Number of Gaussians.
    pub gaussians: usize,
    /// The largest size on the screen at which it is drawn, pixels; `None` if it is not kept.
    pub pixels: Option<f32>,
    /// The sizes at which it was compared, pixels, with the lowest PSNR of a view, dB; infinite (null in JSON) for equal pictures.
    pub psnr: Vec<(f32, f64)>,
}

/// A scene with levels of detail.
#[derive(Debug, Clone, PartialEq)]
pub struct Detailed {
    /// The scene. Nothing else of it has changed.
    pub scene: GaussianScene,
    /// The levels that were made, finest first.
    pub made: Vec<MadeLevel>,
}

/// Makes levels of detail, in place of those that the scene has. The levels of a packed scene are packed, those of others in single
/// precision; none has a temporal filter. Begins the task "levels" and, inside it, tasks for each level.
///
/// # Errors
/// A scene with an environment map, or of which nothing is drawn; one that does not fit the GPU, a lost device.
pub fn detail(
    headless: &mut Headless,
    mut scene: GaussianScene,
    settings: &DetailSettings,
    progress: &mut dyn Progress,
) -> Result<Detailed, OfflineError> {
    if scene.environment.is_some() {
        return Err(OfflineError::Surrounded);
    }
    scene.levels.clear();
    let full = scene.clone().into_runtime()?;
    let sphere = Sphere::of(&full).ok_or(OfflineError::NothingToOrbit)?;
    let mut maker = Maker { headless, settings, sphere, full, levels: Vec::new() };
    let made = maker.run(progress)?;
    scene.levels = maker.levels;
    Ok(Detailed { scene, made })
}

/// What all levels are made from.
struct Maker<'a> {
    headless: &'a mut Headless,
    settings: &'a DetailSettings,
    sphere: Sphere,
    /// All Gaussians, as they are stored.
    full: RuntimeScene,
    /// Those that are kept, finest first.
    levels: Vec<Level>,
}

impl Maker<'_> {
    fn run(&mut self, progress: &mut dyn Progress) -> Result<Vec<MadeLevel>, OfflineError> {
        let count = self.settings.levels.min(MAX_LEVELS);
        let sliced = match &self.full.form {
            Form::Sliced(sliced) => sliced.clone(),
            Form::Packed(packed) => packed.clone().unpack(),
        };
        progress.begin("levels", count + 1);
        let compared = self.looks(&SIZES, 0.5, progress)?;
        progress.advance();
        let mut made = Vec::new();
        let mut left = self.full.len();
        for _ in 0..count {
            left /= COARSER;
            if left < FEWEST {
                progress.note("fewer Gaussians than these make no level");
                break;
            }
            made.push(self.make(&sliced, left, &compared, progress)?);
            progress.advance();
        }
        progress.finish();
        Ok(made)
    }

    /// Draws all Gaussians in the views of this shift.
    fn looks(
        &mut self,
        sizes: &[f32],
        shift: f32,
        progress: &mut dyn Progress,
    ) -> Result<Vec<Vec<Look>>, OfflineError> {
        let DetailSettings { directions, times, .. } = *self.settings;
        let around = Around { directions: directions.max(1), times: times.max(1), shift };
        let capture = self.headless.upload(&self.full)?;
        let interval = self.full.trained_with.time_interval;
        looks(self.headless, &capture, &self.sphere, interval, around, sizes, progress)
    }

    /// Makes a level of at most `count` Gaussians, and keeps it if it is close enough at some size.
    fn make(
        &mut self,
        sliced: &Sliced,
        count: usize,
        compared: &[Vec<Look>],
        progress: &mut dyn Progress,
    ) -> Result<MadeLevel, OfflineError> {
        let pixels = (count as f32 / DENSITY).sqrt().clamp(SIZES[0], SIZES[SIZES.len() - 1]);
        let trained = &self.full.trained_with;
        let radius = self.sphere.radius;
        let pixel = 2.0 * f64::from(radius) / f64::from(pixels);
        let merged = merge(sliced, trained.time_interval, radius, count, pixel);
        let start = GaussianScene {
            form: SceneForm::Trained(merged),
            environment: None,
            filter: None,
            // The temporal deviations that were merged contain the prefilter.
            trained_with: TrainedWith { prefilter_var: -1.0, spatial_lr_scale: radius.into(), ..trained.clone() },
            playback: self.full.playback,
            levels: Vec::new(),
        };
        if start.is_empty() {
            return Ok(MadeLevel { gaussians: 0, pixels: None, psnr: Vec::new() });
        }
        let sizes = TRAINED_AT.map(|part| (pixels * part).max(SIZES[0]));
        let shown: Vec<Look> = self.looks(&sizes, 0.0, progress)?.into_iter().flatten().collect();
        let fitted = fit(self.headless, start, &shown, self.settings.steps, progress)?.into_runtime()?;
        let level = self.stored(fitted)?;
        let capture = self.headless.upload(&level)?;
        let mut psnr = Vec::new();
        let mut largest = None;
        for (&pixels, looks) in SIZES.iter().zip(compared) {
            let worst = worst_psnr(self.headless, &capture, looks)?;
            psnr.push((pixels, worst));
            // NaN is not close.
            if worst < self.settings.min_psnr || worst.is_nan() {
                break;
            }
            largest = Some(pixels);
        }
        progress.note(&describe(level.len(), largest, &psnr));
        let gaussians = level.len();
        if let Some(pixels) = largest {
            // A finer level that is drawn no longer than this one is of no use.
            self.levels.retain(|finer| finer.pixels > pixels);
            self.levels.push(Level { pixels, scene: Arc::new(level) });
        }
        Ok(MadeLevel { gaussians, pixels: largest, psnr })
    }

    /// Returns a level in the form that is stored: packed if all Gaussians are.
    fn stored(&self, level: RuntimeScene) -> Result<RuntimeScene, OfflineError> {
        match &self.full.form {
            Form::Sliced(_) => Ok(level),
            Form::Packed(_) => {
                let settings = CompressSettings::from(Quality::VisuallyLossless);
                Ok(compress(level, &settings)?.0.into_runtime()?)
            }
        }
    }
}

/// Returns a line about a level.
fn describe(gaussians: usize, largest: Option<f32>, psnr: &[(f32, f64)]) -> String {
    let last = psnr.last().map_or(String::new(), |(pixels, worst)| format!("; {worst:.1} dB at {pixels} pixels"));
    match largest {
        Some(pixels) => format!("{gaussians} Gaussians: up to {pixels} pixels{last}"),
        None => format!("{gaussians} Gaussians: not close enough at any size{last}"),
    }
}
