//! Making the levels one after the other.
//!
//! In: all Gaussians, [`DetailSettings`]. Out: the levels that are kept, and the closeness of every level
//! ([`MadeLevel`]).

use super::fit::fit;
use super::looks::{Around, Closeness, FINE, Look, Sphere, closeness, looks};
use super::merge::merge;
use super::{DetailError, DetailSettings};
use crate::offline::compress::{CompressSettings, Quality, compress};
use crate::offline::work::Progress;
use crate::renderer::Headless;
use crate::scene::{Form, GaussianScene, Level, MAX_LEVELS, RuntimeScene, SceneForm, Sliced, Trained, TrainedWith};
use serde::Serialize;
use std::sync::Arc;

/// Sizes on the screen at which levels are compared, pixels: each about a quarter larger than the previous size.
const SIZES: [f32; 19] =
    [4.0, 5.0, 6.3, 8.0, 10.0, 12.5, 16.0, 20.0, 25.0, 32.0, 40.0, 50.0, 63.0, 80.0, 100.0, 125.0, 160.0, 200.0, 250.0];
/// The number of Gaussians of a level is that of the finer level divided by this.
const COARSER: usize = 7;
/// Gaussians for each square pixel of the design size of a level.
const DENSITY: f32 = 0.2;
/// Sizes at which a level is trained, as fractions of its design size.
const TRAINED_AT: [f32; 3] = [1.0, 0.7, 0.5];
/// Largest difference by which the PSNR of a level against the truth may be below that of all Gaussians, dB.
const FARTHER: f64 = 0.5;
/// Number of sizes below its limit at which a level must be as close to the truth too. Below these sizes, a coarser
/// level is usually drawn.
const SMALLER: usize = 2;
/// Smallest number of Gaussians of a level.
const LEAST_GAUSSIANS: usize = 8;

/// A level, kept or not.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MadeLevel {
    /// Number of Gaussians.
    pub gaussians: usize,
    /// The largest size on the screen at which the level is drawn, pixels; `None` if it is not kept.
    pub pixels: Option<f32>,
    /// The closeness to all Gaussians at each size.
    pub measured: Vec<Closeness>,
}

/// The inputs of all levels, and the levels kept so far.
pub(super) struct Maker<'a> {
    pub headless: &'a mut Headless,
    pub settings: &'a DetailSettings,
    pub sphere: Sphere,
    /// All Gaussians, in the form that is stored.
    pub full: RuntimeScene,
    /// The levels that are kept, finest first.
    pub levels: Vec<Level>,
}

impl Maker<'_> {
    /// Makes all levels. Begins the task "levels" and, inside it, tasks for each level.
    pub(super) fn run(&mut self, progress: &mut dyn Progress) -> Result<Vec<MadeLevel>, DetailError> {
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
            if left < LEAST_GAUSSIANS {
                progress.note("fewer Gaussians than these make no level");
                break;
            }
            made.push(self.make(&sliced, left, &compared, progress)?);
            progress.advance();
        }
        progress.finish();
        for one in &mut made {
            let is_kept = |pixels: &f32| {
                self.levels.iter().any(|level| level.pixels == *pixels && level.scene.len() == one.gaussians)
            };
            one.pixels = one.pixels.filter(is_kept);
        }
        Ok(made)
    }

    /// Draws all Gaussians at each of these sizes, pixels, in the views with this shift.
    fn looks(&mut self, sizes: &[f32], shift: f32, progress: &mut dyn Progress) -> Result<Vec<Vec<Look>>, DetailError> {
        let DetailSettings { directions, times, .. } = *self.settings;
        let around = Around { directions: directions.max(1), times: times.max(1), shift };
        let capture = self.headless.upload(&self.full)?;
        let trained_pixel = Some(self.full.optics(0, true).trained_pixel);
        looks(self.headless, &capture, &self.sphere, trained_pixel, around, sizes, progress)
    }

    /// Makes a level of at most `count` Gaussians, and keeps it if it is close enough at some size.
    fn make(
        &mut self,
        sliced: &Sliced,
        count: usize,
        compared: &[Vec<Look>],
        progress: &mut dyn Progress,
    ) -> Result<MadeLevel, DetailError> {
        let pixels = (count as f32 / DENSITY).sqrt().clamp(SIZES[0], SIZES[SIZES.len() - 1]);
        let trained = &self.full.trained_with;
        let radius = self.sphere.radius;
        let pixel = 2.0 * f64::from(radius) / f64::from(pixels);
        let merged = merge(sliced, trained.time_interval, trained.marginal_cutoff, radius, count, pixel);
        let merged = self.scene_of(merged);
        if merged.is_empty() {
            return Ok(MadeLevel { gaussians: 0, pixels: None, measured: Vec::new() });
        }
        let fitted = self.fitted(merged, pixels, progress)?;
        let level = self.stored(fitted.into_runtime()?)?;
        let capture = self.headless.upload(&level)?;
        let mut measured = Vec::new();
        for (&pixels, looks) in SIZES.iter().zip(compared) {
            measured.push(closeness(self.headless, &capture, level.trained_with.pixel, pixels, looks)?);
        }
        let largest = largest(&measured, self.settings.min_psnr);
        let gaussians = level.len();
        progress.note(&describe(gaussians, largest));
        if let Some(Closeness { pixels, .. }) = largest {
            // A finer level whose largest size is not larger than this level's is never drawn.
            self.levels.retain(|finer| finer.pixels > pixels);
            self.levels.push(Level { pixels, scene: Arc::new(level) });
        }
        Ok(MadeLevel { gaussians, pixels: largest.map(|close| close.pixels), measured })
    }

    /// Returns a scene of merged Gaussians.
    fn scene_of(&self, merged: Trained) -> GaussianScene {
        let (trained, radius) = (&self.full.trained_with, self.sphere.radius);
        GaussianScene {
            form: SceneForm::Trained(merged),
            environment: None,
            filter: None,
            trained_with: TrainedWith {
                // The merged temporal deviations include the prefilter.
                prefilter_var: -1.0,
                spatial_lr_scale: radius.into(),
                // Levels are always anti-aliased, since they are drawn where pixels are large, and therefore without
                // the mip filter.
                pixel: Some(trained.pixel.unwrap_or(2.0 * radius / FINE)),
                mip_filter: false,
                ..trained.clone()
            },
            playback: self.full.playback,
            levels: Vec::new(),
            sockets: Vec::new(),
            colliders: None,
            sound: None,
            chunks: None,
        }
    }

    /// Trains merged Gaussians for a design size of `pixels` pixels, unless the settings have no steps.
    fn fitted(
        &mut self,
        merged: GaussianScene,
        pixels: f32,
        progress: &mut dyn Progress,
    ) -> Result<GaussianScene, DetailError> {
        if self.settings.steps == 0 {
            return Ok(merged);
        }
        let sizes = TRAINED_AT.map(|part| (pixels * part).max(SIZES[0]));
        let shown: Vec<Look> = self.looks(&sizes, 0.0, progress)?.into_iter().flatten().collect();
        fit(self.headless, merged, &shown, self.settings.steps, progress)
    }

    /// Returns a level in the form that is stored: packed if all Gaussians are.
    fn stored(&self, level: RuntimeScene) -> Result<RuntimeScene, DetailError> {
        match &self.full.form {
            Form::Sliced(_) => Ok(level),
            Form::Packed(_) => {
                let settings = CompressSettings::suiting(Quality::Balanced, level.len());
                Ok(compress(level, &settings)?.0.into_runtime()?)
            }
        }
    }
}

/// Returns the largest size at which a level may be drawn: the level is close enough there and at the next smaller
/// sizes. `None` if there is no such size.
fn largest(measured: &[Closeness], min_psnr: f64) -> Option<Closeness> {
    // NaN fails every comparison.
    let holds = |close: &Closeness| close.screen >= min_psnr && close.truth >= close.all - FARTHER;
    let hardly_visible = |close: &Closeness| close.screen >= min_psnr;
    let held = |&last: &usize| {
        measured[..last].iter().all(hardly_visible) && measured[last.saturating_sub(SMALLER)..=last].iter().all(holds)
    };
    (0..measured.len()).rev().find(held).map(|last| measured[last])
}

/// Returns a line about a level.
fn describe(gaussians: usize, largest: Option<Closeness>) -> String {
    match largest {
        Some(Closeness { pixels, screen, truth, all }) => format!(
            "{gaussians} Gaussians: up to {pixels} pixels; there {screen:.1} dB on a screen, {truth:.1} dB to the truth (all: {all:.1} dB)"
        ),
        None => format!("{gaussians} Gaussians: not close enough at any size"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_size_of_a_level_also_holds_at_smaller_sizes() {
        let close = |pixels, screen, truth, all| Closeness { pixels, screen, truth, all };
        let good = |pixels| close(pixels, 50.0, 30.0, 20.0);
        let limit = |measured: &[Closeness]| largest(measured, 45.0).map(|close| close.pixels);
        assert_eq!(
            limit(&[good(4.0), good(6.0), close(8.0, 44.0, 30.0, 20.0)]),
            Some(6.0),
            "the screen changes at 8 pixels"
        );
        assert_eq!(
            limit(&[good(4.0), good(6.0), close(8.0, 50.0, 19.0, 20.0)]),
            Some(6.0),
            "all Gaussians are closer to the truth at 8 pixels"
        );
        let gap = [good(4.0), close(6.0, 50.0, 19.0, 20.0), good(8.0), good(11.0), good(16.0), good(23.0)];
        assert_eq!(limit(&gap), Some(23.0), "a size far below the limit need not be close to the truth");
        assert_eq!(limit(&gap[..4]), Some(4.0), "the two sizes below the limit must be close to the truth");
        assert_eq!(limit(&[close(4.0, f64::NAN, 1.0, 0.0)]), None, "NaN is not close");
    }
}
