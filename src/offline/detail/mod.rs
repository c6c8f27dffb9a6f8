//! Levels of detail: the same capture of fewer Gaussians, for pictures of few pixels.
//!
//! In: a scene, [`DetailSettings`]. Out: the scene with levels ([`Detailed`]), each with the size on the screen up to which it is drawn.
//!
//! 1. `merge` puts few Gaussians in place of many, with their moments in space and time; `rotation` makes raw parameters of these.
//! 2. `fit` trains them at the sizes for which they are meant, on the mean of two pictures: the truth, which is all Gaussians with many
//!    times as many pixels, made smaller, and all Gaussians drawn at that size, whose place they take. These are far apart: each splat is
//!    blurred to at least half a pixel, as in the original, so that many small ones look larger and denser than they are, and, made
//!    fainter for it ([anti-aliased]), thinner.
//! 3. `looks` compares them in other views, at one size after the other. A level is drawn up to the size at which it is still about as close
//!    to the truth as all Gaussians are, and a screen on which it takes their place hardly changes. A level without such a size is not kept.
//!
//! [anti-aliased]: crate::view::View::antialiased

mod fit;
mod looks;
mod merge;
mod rotation;

use super::quantize::{CompressSettings, Quality, compress};
use super::{OfflineError, Progress};
use crate::renderer::Headless;
use crate::scene::{Form, GaussianScene, Level, MAX_LEVELS, RuntimeScene, SceneForm, Sliced, TrainedWith};
use fit::fit;
pub use looks::Closeness;
use looks::{Around, FINE, Look, Sphere, closeness, looks};
use merge::merge;
use serde::Serialize;
use std::sync::Arc;

/// Sizes on the screen at which levels are compared, pixels: each about a quarter more than the one before.
const SIZES: [f32; 19] =
    [4.0, 5.0, 6.3, 8.0, 10.0, 12.5, 16.0, 20.0, 25.0, 32.0, 40.0, 50.0, 63.0, 80.0, 100.0, 125.0, 160.0, 200.0, 250.0];
/// How many times fewer Gaussians a level has than the one before.
const COARSER: usize = 7;
/// Gaussians for each square pixel of the size that a level is meant for.
const DENSITY: f32 = 0.2;
/// Sizes that a level is trained at, parts of the one that it is meant for.
const TRAINED_AT: [f32; 3] = [1.0, 0.7, 0.5];
/// How much farther from the truth than all Gaussians a level may be, dB.
const FARTHER: f64 = 0.5;
/// How many sizes below its limit a level must be as close to the truth at, too. Below these it is mostly the next level that is drawn.
const SMALLER: usize = 2;
/// Fewest Gaussians of a level.
const FEWEST: usize = 8;

/// Settings of the levels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DetailSettings {
    /// Levels to make, at most [`MAX_LEVELS`]; each has a seventh of the Gaussians of the one before. Default: 3.
    pub levels: usize,
    /// Lowest PSNR of a screen of 1280x720 pixels on which a level takes the place of all Gaussians, dB. Default: 45.
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
    /// How close it is at each size.
    pub measured: Vec<Closeness>,
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
        for one in &mut made {
            let is_kept = |pixels: &f32| {
                self.levels.iter().any(|level| level.pixels == *pixels && level.scene.len() == one.gaussians)
            };
            one.pixels = one.pixels.filter(is_kept);
        }
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
        looks(self.headless, &capture, &self.sphere, self.full.trained_with.pixel, around, sizes, progress)
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
            trained_with: TrainedWith {
                prefilter_var: -1.0,
                spatial_lr_scale: radius.into(),
                // Anti-aliased in any case: levels are drawn where pixels are large.
                pixel: Some(trained.pixel.unwrap_or(2.0 * radius / FINE)),
                ..trained.clone()
            },
            playback: self.full.playback,
            levels: Vec::new(),
        };
        if start.is_empty() {
            return Ok(MadeLevel { gaussians: 0, pixels: None, measured: Vec::new() });
        }
        let fitted = match self.settings.steps {
            0 => start,
            steps => {
                let sizes = TRAINED_AT.map(|part| (pixels * part).max(SIZES[0]));
                let shown: Vec<Look> = self.looks(&sizes, 0.0, progress)?.into_iter().flatten().collect();
                fit(self.headless, start, &shown, steps, progress)?
            }
        };
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
            // A finer level that is drawn no longer than this one is of no use.
            self.levels.retain(|finer| finer.pixels > pixels);
            self.levels.push(Level { pixels, scene: Arc::new(level) });
        }
        Ok(MadeLevel { gaussians, pixels: largest.map(|close| close.pixels), measured })
    }

    /// Returns a level in the form that is stored: packed if all Gaussians are.
    fn stored(&self, level: RuntimeScene) -> Result<RuntimeScene, OfflineError> {
        match &self.full.form {
            Form::Sliced(_) => Ok(level),
            Form::Packed(_) => {
                let settings = CompressSettings::suiting(Quality::Balanced, level.len());
                Ok(compress(level, &settings)?.0.into_runtime()?)
            }
        }
    }
}

/// Returns the largest size at which a level may be drawn: it holds there, and at the next smaller sizes. `None` if there is none.
fn largest(measured: &[Closeness], min_psnr: f64) -> Option<Closeness> {
    // NaN is not close.
    let holds = |close: &Closeness| close.screen >= min_psnr && close.truth >= close.all - FARTHER;
    let unseen = |close: &Closeness| close.screen >= min_psnr;
    let held = |&last: &usize| {
        measured[..last].iter().all(unseen) && measured[last.saturating_sub(SMALLER)..=last].iter().all(holds)
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
    fn a_level_holds_at_smaller_sizes_too() {
        let close = |pixels, screen, truth, all| Closeness { pixels, screen, truth, all };
        let good = |pixels| close(pixels, 50.0, 30.0, 20.0);
        let limit = |measured: &[Closeness]| largest(measured, 45.0).map(|close| close.pixels);
        assert_eq!(limit(&[good(4.0), good(6.0), close(8.0, 44.0, 30.0, 20.0)]), Some(6.0), "the screen changes");
        assert_eq!(
            limit(&[good(4.0), good(6.0), close(8.0, 50.0, 19.0, 20.0)]),
            Some(6.0),
            "all are closer to the truth"
        );
        let gap = [good(4.0), close(6.0, 50.0, 19.0, 20.0), good(8.0), good(11.0), good(16.0), good(23.0)];
        assert_eq!(limit(&gap), Some(23.0), "smaller sizes are those of other levels");
        assert_eq!(limit(&gap[..4]), Some(4.0), "but not the next two");
        assert_eq!(limit(&[close(4.0, f64::NAN, 1.0, 0.0)]), None, "no number is not close");
    }
}
