//! The quality of a scene on the validation views.
//!
//! In: images, drawn frames. Out: the PSNR of all pixels together.

use crate::offline::measure::metrics::SquaredError;
use crate::offline::train::error::TrainError;
use crate::offline::train::images::TrainingImages;
use crate::renderer::GpuError;
use crate::view::{Background, Frame, View};
use glam::Vec3;

/// Returns the PSNR in dB of drawn frames, clamped to 0..1, against the validation images over the background: that of
/// the squared error of all pixels, channels and views together; `None` without validation views.
pub(super) fn psnr(
    images: &TrainingImages,
    background: Background,
    mut draw: impl FnMut(&View) -> Result<Frame, GpuError>,
) -> Result<Option<f64>, TrainError> {
    let mut error = SquaredError::default();
    for some in images.validated() {
        for (view, image) in some? {
            error.add(&image.over(behind(background)), &draw(view)?.picture.clamped())?;
        }
    }
    Ok((!images.validation.is_empty()).then(|| error.psnr()))
}

/// Returns the color behind an image that does not cover all pixels.
pub(super) fn behind(background: Background) -> Vec3 {
    match background {
        Background::Color(color) => Vec3::from(color),
        Background::None | Background::Environment => Vec3::ZERO,
    }
}

/// Returns the color behind the scene, which no exposure changes; `None` if an environment map is there.
pub(super) fn color_behind(background: Background) -> Option<Vec3> {
    match background {
        Background::Environment => None,
        Background::Color(_) | Background::None => Some(behind(background)),
    }
}
