//! Training the Gaussians of a level on pictures of all Gaussians.
//!
//! In: a scene in the trained form, [`Look`]s of all Gaussians. Out: the scene after a number of steps. Backgrounds are
//! random, so that opacity is trained too. The scene is drawn with anti-aliasing, as levels are; the gradients leave
//! out the factor of anti-aliasing on opacity.

use super::DetailError;
use super::looks::Look;
use crate::gaussian::GradientMode;
use crate::offline::dataset::CoveredImage;
use crate::offline::train::{GpuImage, Rates, Sample, Trainer};
use crate::offline::work::{Progress, proceed};
use crate::renderer::Headless;
use crate::scene::GaussianScene;
use crate::scene::random::Random;
use crate::view::{Background, Frame, View};
use glam::Vec3;

/// Number of views of a step.
const BATCH: usize = 4;
/// Factor on the learning rates at the last step.
const LAST_RATE: f64 = 0.05;
/// Learning rates: those of color are higher than in fine-tuning, because the initial colors are estimates.
const RATES: Rates = Rates { harmonics: 1e-3, color: 5e-3, ..Rates::OURS };

/// Trains a scene on at least one look. Begins the task "fitting".
pub(super) fn fit(
    headless: &mut Headless,
    scene: GaussianScene,
    looks: &[Look],
    steps: usize,
    progress: &mut dyn Progress,
) -> Result<GaussianScene, DetailError> {
    let trained_pixel = scene.trained_with.pixel;
    let views: Vec<View> = looks.iter().map(|look| look.view.antialiased(trained_pixel)).collect();
    let mut trainer = Trainer::new(headless, scene, GradientMode::Exact)?;
    let images = looks.iter().map(|look| trainer.upload(&covered(&look.target())));
    let images: Vec<GpuImage> = images.collect::<Result<_, _>>()?;
    if let Some(largest) = views.iter().max_by_key(|view| view.size.x) {
        trainer.make_room(largest)?;
    }
    progress.begin("fitting", steps);
    let mut random = Random::new(1);
    for step in 0..steps {
        proceed(progress)?;
        let mut batch = Vec::with_capacity(BATCH);
        for _ in 0..BATCH {
            let index = random.below(looks.len());
            let background = Background::Color([random.unit(), random.unit(), random.unit()]);
            let (view, image) = (&views[index], &images[index]);
            batch.push(Sample { view, image, background, number: index as u32 });
        }
        // Without SSIM, whose windows are larger than the details of these pictures.
        trainer.accumulate(&batch, 0.0)?;
        let factor = 1.0 - (1.0 - LAST_RATE) * step as f64 / steps as f64;
        trainer.step(&RATES, factor, step + 1)?;
        progress.advance();
    }
    progress.finish();
    Ok(trainer.scene()?)
}

/// Returns the picture of a frame that was drawn over black, with its opacity as coverage.
fn covered(frame: &Frame) -> CoveredImage {
    let byte = |value: f32| (value.clamp(0.0, 1.0) * 255.0).round() as u8;
    let texel = |(color, left): (&Vec3, &f32)| {
        let [r, g, b] = color.to_array().map(byte);
        [r, g, b, byte(1.0 - left)]
    };
    let texels = frame.picture.pixels.iter().zip(&frame.transmittance).map(texel).collect();
    CoveredImage { size: frame.picture.size, texels, has_gaps: true }
}
