//! Settings that a checkpoint does not contain: `cfg_args` in its folder, and the options in RON.
//!
//! In: texts of the trainer and of the settings of a loader. Out: changed texts, read together with a valid checkpoint
//! and a valid package.

use super::checkpoint::checkpoints;
use super::{Outcome, Reader};
use crate::accepted::{self, DrawnBy};
use crate::change::text;
use crate::support::packed_scene;
use crate::support::random::Random;
use bevy_gs4d::codec::package::WriteSettings;
use bevy_gs4d::codec::{self, ReadOptions};
use bevy_gs4d::offline;
use bevy_gs4d::scene::GaussianScene;
use std::fs;
use std::path::PathBuf;
use tempfile::TempDir;

/// The reader of `cfg_args`.
pub struct CfgArgs {
    folder: Folder,
}

/// The reader of options.
pub struct Options {
    folder: Folder,
}

/// A folder with a checkpoint and a package.
struct Folder {
    path: TempDir,
}

impl Folder {
    fn new() -> Self {
        let folder = Self { path: tempfile::tempdir().expect("a temporary folder") };
        let pth = checkpoints().remove(0).bytes();
        fs::write(folder.file("chkpnt.pth"), pth).expect("the folder can be written to");
        let scene = GaussianScene::from(packed_scene::scene(12, 0, 0));
        offline::work::save(&folder.file("scene.gs4d"), &scene, &WriteSettings::default()).expect("a synthetic scene");
        folder
    }

    fn file(&self, name: &str) -> PathBuf {
        self.path.path().join(name)
    }

    /// Reads a file with these options and checks the scene.
    fn read(&self, name: &str, options: &ReadOptions) -> Result<Outcome, String> {
        match codec::load(&self.file(name), options) {
            Ok(scene) => accepted::check(scene, DrawnBy::Cpu),
            Err(error) => Ok(Outcome::Refused(error.to_string())),
        }
    }
}

impl CfgArgs {
    /// Makes the checkpoint.
    pub fn new() -> Self {
        Self { folder: Folder::new() }
    }
}

impl Reader for CfgArgs {
    fn input(&self, random: &mut Random) -> Vec<u8> {
        const SEEDS: [&str; 2] = [
            "Namespace(sh_degree=3, source_path='/data/a, b', model_path=\"it's\", white_background=True, \
             extra=[1, (2, 3)], eval=True, prefilter_var=0.25)",
            "Namespace(white_background=False, prefilter_var=-1.0, loaded_pth='')",
        ];
        text::file(&SEEDS, random)
    }

    fn read(&self, bytes: &[u8]) -> Result<Outcome, String> {
        fs::write(self.folder.file("cfg_args"), bytes).expect("the folder can be written to");
        self.folder.read("chkpnt.pth", &ReadOptions::default())
    }
}

impl Options {
    /// Makes the checkpoint and the package.
    pub fn new() -> Self {
        Self { folder: Folder::new() }
    }
}

impl Reader for Options {
    fn input(&self, random: &mut Random) -> Vec<u8> {
        const SEEDS: [&str; 2] = [
            "(time_interval: Some((0.0, 10.0)), background: Some((0.0, 0.5, 1.0)), \
             rotation_convention: Some(unflipped), raster_fov: Some(corrected), cameras: Some(intrinsics), \
             sh_direction: Some(displaced), force_sh_3d: Some(true), prefilter_var: Some(0.25), up: Some(neg_y), \
             duration_seconds: Some(3.0))",
            "(time_interval: Some((-1.0, 1.0)), prefilter_var: Some(1e-3))",
        ];
        text::file(&SEEDS, random)
    }

    fn read(&self, bytes: &[u8]) -> Result<Outcome, String> {
        let options: ReadOptions = match ron::de::from_bytes(bytes) {
            Ok(options) => options,
            Err(error) => return Ok(Outcome::Refused(error.to_string())),
        };
        self.folder.read("scene.gs4d", &options)?;
        self.folder.read("chkpnt.pth", &options)
    }
}
