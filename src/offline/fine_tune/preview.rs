//! The picture that shows how far a training from pictures is.
//!
//! In: the folder of the state, a run. Out: `training.png` in that folder: the image of a view, the scene as it is, and their difference times
//! [`GAIN`], side by side. It is rewritten at each evaluation, and removed when the training has ended.

use super::run::Run;
use crate::offline::metrics::side_by_side;
use crate::offline::{OfflineError, Progress, write_png};
use std::fs;
use std::path::{Path, PathBuf};

/// Name of the file.
const FILE: &str = "training.png";
/// Factor on the difference.
const GAIN: f32 = 4.0;

/// Where the picture is written.
pub(super) struct Preview {
    path: PathBuf,
    is_told: bool,
}

impl Preview {
    /// Returns the picture in this folder, which is not written yet.
    pub(super) fn new(folder: &Path) -> Self {
        Self { path: folder.join(FILE), is_told: false }
    }

    /// Writes the picture of a run as it is, and says where the first time.
    ///
    /// # Errors
    /// An image that cannot be read, a lost device, a folder that cannot be written to.
    pub(super) fn write(&mut self, run: &mut Run<'_>, progress: &mut dyn Progress) -> Result<(), OfflineError> {
        let Some((image, scene)) = run.shown()? else { return Ok(()) };
        write_png(&self.path, &side_by_side(&image, &scene, GAIN))?;
        if !self.is_told {
            let path = self.path.display();
            progress.note(&format!("{path} shows a view at each evaluation: its image, the capture, their difference"));
            self.is_told = true;
        }
        Ok(())
    }

    /// Removes the picture.
    pub(super) fn remove(self) {
        // It may not have been written.
        let _ = fs::remove_file(self.path);
    }
}
