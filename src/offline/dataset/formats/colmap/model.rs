//! A model, as its files have it.
//!
//! In: what the readers of binary and text files find. Out: cameras and images, which are not checked against each
//! other.

use super::camera::ModelCamera;
use crate::codec::text::printable;
use crate::offline::dataset::{DatasetError, FrameProblem};
use std::collections::HashMap;
use std::path::PathBuf;

/// An image of a model, with the pose of its camera.
pub(crate) struct Registered {
    pub name: String,
    pub camera: u32,
    /// Quaternion (w, x, y, z) and translation, world to camera.
    pub pose: ([f64; 4], [f64; 3]),
}

/// A model: the cameras by number, and the images.
pub(crate) struct Model {
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
    pub(crate) fn camera_of(&self, image: &Registered) -> Result<&ModelCamera, DatasetError> {
        self.cameras.get(&image.camera).ok_or_else(|| {
            let reason = format!(
                "image {:?} has camera {}, which the model does not have: write the model again with COLMAP",
                image.name, image.camera
            );
            DatasetError::Unusable { path: self.source.clone(), reason }
        })
    }

    /// Returns the error of a problem of an image.
    pub(crate) fn failed(&self, image: &Registered) -> impl Fn(FrameProblem) -> DatasetError {
        move |problem| {
            let reason = format!("image {}: {problem}", printable(&image.name));
            DatasetError::Unusable { path: self.source.clone(), reason }
        }
    }
}
