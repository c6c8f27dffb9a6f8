//! A model, as its files have it.
//!
//! In: what the readers of binary and text files find. Out: cameras and images, which are not checked against each other.

use super::super::{DatasetError, FrameProblem};
use super::camera::ModelCamera;
use crate::codec::text::printable;
use std::collections::HashMap;
use std::path::PathBuf;

/// The image of a model: where its camera was.
pub(super) struct Registered {
    pub name: String,
    pub camera: u32,
    /// Quaternion (w, x, y, z) and translation, world to camera.
    pub pose: ([f64; 4], [f64; 3]),
}

/// A model: the cameras by number, and the images.
pub(super) struct Model {
    /// The file of images, for errors.
    pub source: PathBuf,
    pub cameras: HashMap<u32, ModelCamera>,
    pub images: Vec<Registered>,
}

impl Model {
    /// Returns the camera of an image.
    ///
    /// # Errors
    /// The model does not have it.
    pub(super) fn camera_of(&self, image: &Registered) -> Result<&ModelCamera, DatasetError> {
        self.cameras.get(&image.camera).ok_or_else(|| {
            let reason = format!(
                "image {:?} has camera {}, which the model does not have: write the model again with COLMAP",
                image.name, image.camera
            );
            DatasetError::Unusable { path: self.source.clone(), reason }
        })
    }

    /// Returns the error of a problem of an image.
    pub(super) fn failed(&self, image: &Registered) -> impl Fn(FrameProblem) -> DatasetError {
        move |problem| {
            let reason = format!("image {}: {problem}", printable(&image.name));
            DatasetError::Unusable { path: self.source.clone(), reason }
        }
    }
}
