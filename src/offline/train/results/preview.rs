//! The picture that shows how far a training from pictures is.
//!
//! In: the folder of the state, the image of a view and the scene there. Out: `training.png` in that folder: both, and
//! their difference times [`GAIN`], side by side. It is rewritten at each evaluation, and removed when the training has
//! ended.

use crate::offline::measure::metrics::side_by_side;
use crate::offline::train::error::TrainError;
use crate::offline::work::{Progress, write_png};
use crate::view::Picture;
use std::fs;
use std::path::{Path, PathBuf};

/// Name of the file.
const FILE: &str = "training.png";
/// Factor on the difference.
const GAIN: f32 = 4.0;

/// Where the picture is written.
pub(crate) struct Preview {
    path: PathBuf,
    is_told: bool,
}

impl Preview {
    /// Returns the picture in this folder, which is not written yet.
    pub(crate) fn new(folder: &Path) -> Self {
        Self { path: folder.join(FILE), is_told: false }
    }

    /// Writes the image of a view and the scene there, if there is a view, and says where the first time.
    ///
    /// # Errors
    /// A folder that cannot be written to.
    pub(crate) fn write(&mut self, shown: Option<[Picture; 2]>, progress: &mut dyn Progress) -> Result<(), TrainError> {
        let Some([image, scene]) = shown else { return Ok(()) };
        write_png(&self.path, &side_by_side(&image, &scene, GAIN))?;
        if !self.is_told {
            let path = self.path.display();
            progress.note(&format!("{path} shows a view at each evaluation: its image, the capture, their difference"));
            self.is_told = true;
        }
        Ok(())
    }

    /// Removes the picture.
    pub(crate) fn remove(self) {
        // It is missing if there was no view to draw.
        let _ = fs::remove_file(self.path);
    }
}
