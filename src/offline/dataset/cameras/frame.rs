//! One frame of a dataset, before the size of its picture is chosen.
//!
//! In: the entries of a file about a frame, in double precision. Out: its [`TrainingView`] at the size to render, in
//! single precision, counted from an origin.

use super::distortion::{Distortion, Undistortion};
use super::lens::{OriginalLens, reduced};
use super::pose;
use crate::codec::text::is_obeyed;
use crate::offline::dataset::view::Correction;
use crate::offline::dataset::{CameraOptions, DatasetError, FrameProblem, TrainingView};
use crate::scene::Origin;
use crate::view::{Camera, RasterFov};
use glam::{DMat4, DVec2, DVec3, UVec2};
use std::collections::HashSet;
use std::path::{Path, PathBuf};

/// A frame of any format.
#[derive(Debug, Clone)]
pub(crate) struct Frame {
    /// Unique name for output files.
    pub name: String,
    pub image: PathBuf,
    pub mask: Option<Mask>,
    /// As the file counts it.
    pub time: f64,
    /// From the coordinates of the file.
    pub world_to_camera: DMat4,
    pub lens: OriginalLens,
    pub distortion: Distortion,
}

/// The mask of a frame.
#[derive(Debug, Clone)]
pub(crate) struct Mask {
    pub path: PathBuf,
    /// Whether the image has been multiplied by it already.
    pub applied: bool,
}

impl Frame {
    /// Returns the view of a frame whose original picture has this size, counted from an origin. `reducible` is false
    /// if the resolution has no effect.
    pub(crate) fn into_view(
        self,
        original: UVec2,
        options: &CameraOptions,
        reducible: bool,
        origin: &Origin,
        failed: impl Fn(FrameProblem) -> DatasetError,
    ) -> Result<TrainingView, DatasetError> {
        let (size, divisor) = match options.size {
            Some(size) => (size, original.as_dvec2() / size.as_dvec2()),
            None if reducible => {
                let (size, divisor) = reduced(original, options.resolution)?;
                (size, DVec2::splat(divisor))
            }
            None => (original, DVec2::ONE),
        };
        let world_to_camera = pose::counted_from(DVec3::from(origin.place), self.world_to_camera);
        let world_to_camera = pose::single_precision(world_to_camera).map_err(&failed)?;
        let time = (self.time - origin.time) as f32;
        if !time.is_finite() {
            return Err(failed(FrameProblem::Time(self.time)));
        }
        let full = self.lens.scaled(original, DVec2::ONE).map_err(&failed)?;
        let lens = self.lens.scaled(original, divisor).map_err(&failed)?;
        let undistortion = Undistortion::new(self.distortion, full, original).map_err(&failed)?;
        let lens = undistortion.map_or(lens, |undistortion| undistortion.pinhole(lens));
        let camera = Camera { world_to_camera, size, lens };
        let is_finite = |fov: RasterFov| camera.view(time, fov).is_finite();
        if ![RasterFov::Reference, RasterFov::Corrected].into_iter().all(is_finite) {
            return Err(failed(FrameProblem::Projection(self.name)));
        }
        Ok(TrainingView {
            name: self.name,
            camera,
            time,
            original,
            image: self.image,
            correction: Correction { undistortion, masks: self.mask.as_ref().is_some_and(|mask| !mask.applied) },
            mask: self.mask.map(|mask| mask.path),
        })
    }
}

/// Returns the stem of an image path, made unique with the index of the frame; `None` if the stem is not a plain file
/// name, or if the path has control characters, since reports and errors show it.
pub(crate) fn output_name(file: &str, index: usize, taken: &mut HashSet<String>) -> Option<String> {
    if file.contains(is_obeyed) {
        return None;
    }
    let path = Path::new(file);
    let stem = path.extension().and(path.file_stem())?.to_str()?;
    if Path::new(stem).file_name()? != stem {
        return None;
    }
    let mut name = stem.to_owned();
    while !taken.insert(name.clone()) {
        name = format!("{name}-{index}");
    }
    Some(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn output_names_are_stems_and_unique() {
        let mut taken = HashSet::new();
        assert_eq!(output_name("./images/c04_f00.jpg", 0, &mut taken).as_deref(), Some("c04_f00"), "stem");
        assert_eq!(
            output_name("x/frame.001.png", 1, &mut taken).as_deref(),
            Some("frame.001"),
            "dots in the stem are kept"
        );
        assert_eq!(output_name("y/c04_f00.png", 2, &mut taken).as_deref(), Some("c04_f00-2"), "a repeated stem");
        assert_eq!(output_name("...png", 3, &mut taken), None, "a stem that leads out of the folder");
        assert_eq!(output_name(".png", 4, &mut taken), None, "an empty path");
        assert_eq!(output_name("a\u{1b}[2J/b.png", 5, &mut taken), None, "a control character");
    }
}
