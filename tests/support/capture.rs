//! A capture to be baked, trained and evaluated: a scene with its own pictures, in a temporary folder.
//!
//! In: a scene, how many pictures there are and from where. Out: a folder with `scene.gs4d` and the dataset `data`.

use crate::support::dataset;
use bevy_gs4d::codec::package::WriteSettings;
use bevy_gs4d::offline;
use bevy_gs4d::scene::GaussianScene;
use glam::{UVec2, Vec3};
use std::path::PathBuf;
use tempfile::TempDir;

/// The folder, which goes with this, and what is in it.
pub struct Capture {
    pub folder: TempDir,
    pub scene: PathBuf,
    pub data: PathBuf,
}

impl Capture {
    /// Writes both. The cameras and their times are those of [`dataset::write`]; the data belong to the scene if `center` is the origin.
    pub fn new(trained: GaussianScene, center: Vec3, cameras: usize, times: usize, size: UVec2, images: bool) -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let (scene, data) = (folder.path().join("scene.gs4d"), folder.path().join("data"));
        offline::save(&scene, &trained, &WriteSettings::default()).expect("the folder can be written to");
        let runtime = trained.into_runtime().expect("a synthetic scene can be drawn");
        dataset::write(&data, &runtime, center, cameras, times, size, images);
        Self { folder, scene, data }
    }

    /// Returns the path of a file in the folder.
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }
}
