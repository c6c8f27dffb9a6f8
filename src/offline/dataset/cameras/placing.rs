//! Views from frames, with a common origin and without a common scale.
//!
//! In: all frames of a dataset or a camera file, in double precision and the coordinates of the files. Out: their
//! views, in single precision, counted from an origin that all of them have in common, and sentences about a scale that
//! was undone.

use super::frame::Frame;
use super::{origin, pose};
use crate::offline::dataset::view::TrainingView;
use crate::offline::dataset::{CameraOptions, DatasetError, FrameProblem};
use crate::scene::Origin;
use glam::UVec2;

/// A frame whose view is not made yet.
pub(crate) struct Unplaced<F> {
    pub frame: Frame,
    /// Size of the original picture, pixels.
    pub original: UVec2,
    /// Returns the error of a problem of the frame.
    pub failed: F,
}

/// The views of frames.
pub(crate) struct Placed {
    /// In the order of the frames.
    pub views: Vec<TrainingView>,
    /// The origin of the views in the coordinates of the files.
    pub origin: Origin,
    /// Sentences about a scale that was undone.
    pub notes: Vec<String>,
}

/// Returns the views of frames: with the origin of the options, or else one near them if they are far from 0.
/// `reducible` is false if the resolution has no effect.
pub(crate) fn place<F: Fn(FrameProblem) -> DatasetError>(
    mut frames: Vec<Unplaced<F>>,
    options: &CameraOptions,
    reducible: bool,
) -> Result<Placed, DatasetError> {
    if options.is_static {
        frames.iter_mut().for_each(|unplaced| unplaced.frame.time = 0.0);
    }
    let notes = unscale(&mut frames)?.into_iter().collect();
    let origin = options.origin.unwrap_or_else(|| automatic(&frames));
    let view = |Unplaced { frame, original, failed }: Unplaced<F>| {
        frame.into_view(original, options, reducible, &origin, failed)
    };
    let views = frames.into_iter().map(view).collect::<Result<_, _>>()?;
    Ok(Placed { views, origin, notes })
}

fn automatic<F>(frames: &[Unplaced<F>]) -> Origin {
    let frames = || frames.iter().map(|unplaced| &unplaced.frame);
    let times: Vec<f64> = frames().map(|frame| frame.time).collect();
    origin::automatic(frames().map(|frame| pose::center(&frame.world_to_camera)).collect(), &times)
}

/// Undoes a scale that all cameras have in common, and returns a sentence about it if there is one. Places of cameras
/// stay where they are.
///
/// # Errors
/// A frame whose camera has another scale than most.
fn unscale<F: Fn(FrameProblem) -> DatasetError>(frames: &mut [Unplaced<F>]) -> Result<Option<String>, DatasetError> {
    let scales: Vec<f64> = frames.iter().map(|unplaced| pose::scale(&unplaced.frame.world_to_camera)).collect();
    let mut sorted = scales.clone();
    sorted.sort_by(f64::total_cmp);
    let Some(&usual) = sorted.get(sorted.len() / 2) else { return Ok(None) };
    let is_alike = |scale: f64, other: f64| (scale / other - 1.0).abs() <= pose::ROUNDED;
    if let Some((unplaced, scale)) = frames.iter().zip(&scales).find(|(_, scale)| !is_alike(**scale, usual)) {
        return Err((unplaced.failed)(FrameProblem::Scale { found: length(*scale), usual: length(usual) }));
    }
    if is_alike(usual, 1.0) {
        return Ok(None);
    }
    for (unplaced, scale) in frames.iter_mut().zip(scales) {
        unplaced.frame.world_to_camera = pose::unscaled(unplaced.frame.world_to_camera, scale);
    }
    Ok(Some(format!(
        "its camera matrices are rotations times {}, a scale that is left out: the places of the cameras stay as they \
         are",
        length(usual)
    )))
}

/// Returns the length of the axes of a camera in the world from the scale of its world-to-camera matrix, rounded for
/// messages.
fn length(scale: f64) -> f64 {
    let length = 1.0 / scale;
    format!("{length:.4e}").parse().unwrap_or(length)
}
