//! A capture for tests of baking, training and evaluation: a scene and a dataset of its pictures, in a temporary
//! folder.
//!
//! In: a scene, the number of cameras and times, the center of the cameras. Out: a folder with `scene.gs4d` and the
//! dataset `data`.

use crate::support::dataset;
use bevy_gs4d::codec::package::WriteSettings;
use bevy_gs4d::offline;
use bevy_gs4d::scene::GaussianScene;
use glam::{UVec2, Vec3};
use std::path::PathBuf;
use tempfile::TempDir;

/// The folder, which is removed when this value is dropped, and the paths in it.
pub struct Capture {
    pub folder: TempDir,
    pub scene: PathBuf,
    pub data: PathBuf,
}

impl Capture {
    /// Writes the scene and the dataset, with the cameras and times of [`dataset::write`]. The dataset matches the
    /// scene if `center` is the origin.
    pub fn new(trained: GaussianScene, center: Vec3, cameras: usize, times: usize, size: UVec2, images: bool) -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let (scene, data) = (folder.path().join("scene.gs4d"), folder.path().join("data"));
        offline::work::save(&scene, &trained, &WriteSettings::default()).expect("the folder can be written to");
        let runtime = trained.into_runtime().expect("a synthetic scene can be drawn");
        dataset::write(&data, &runtime, center, cameras, times, size, images);
        Self { folder, scene, data }
    }

    /// Returns the path of a file in the folder.
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }
}
