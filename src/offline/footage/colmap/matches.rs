//! The pictures of one moment, their features and their matches.
//!
//! In: a picture for each camera. Out: a folder with the pictures and with COLMAP's database, in which every camera has
//! a lens of its own. Names of cameras are replaced by their numbers, so that any name is allowed.

use super::error::ColmapError;
use super::program::{Program, Setting, Step};
use crate::offline::work::Progress;
use std::ffi::OsStr;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// The folder of the pictures, a folder for each camera, and the stem of each picture.
const IMAGES: &str = "images";
const STEM: &str = "picture";
/// The features and matches.
const DATABASE: &str = "database.db";
/// Every camera has a lens of its own.
const OWN_LENS: Setting<'static> = (&["ImageReader.single_camera_per_folder"], "1");
/// Graphics cards are not used: few pictures gain little, and Debian's program needs a screen for that.
const EXTRACTION_CARD: Setting<'static> = (&["FeatureExtraction.use_gpu", "SiftExtraction.use_gpu"], "0");
const MATCHING_CARD: Setting<'static> = (&["FeatureMatching.use_gpu", "SiftMatching.use_gpu"], "0");
/// Features that look alike from distant places, which take longer.
const CAREFUL_EXTRACTION: [Setting<'static>; 2] =
    [(&["SiftExtraction.estimate_affine_shape"], "1"), (&["SiftExtraction.domain_size_pooling"], "1")];
/// Matches that are searched again along the lines on which they must be.
const CAREFUL_MATCHING: Setting<'static> = (&["FeatureMatching.guided_matching", "SiftMatching.guided_matching"], "1");

/// The care with which features are found and matched.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Care {
    /// As the program does by default.
    Usual,
    /// For cameras that are far apart; takes several times as long.
    Great,
}

/// The folder of a moment.
pub(crate) struct Moment {
    folder: PathBuf,
    /// The pictures.
    pub images: PathBuf,
    /// The features and matches.
    pub database: PathBuf,
}

impl Moment {
    /// Returns the moment of a new folder, without pictures.
    pub(crate) fn in_folder(folder: PathBuf) -> Self {
        Self { images: folder.join(IMAGES), database: folder.join(DATABASE), folder }
    }

    /// Returns a new folder in that of the moment.
    ///
    /// # Errors
    /// A folder that cannot be written to.
    pub(crate) fn new_folder(&self, name: &str) -> Result<PathBuf, ColmapError> {
        let path = self.folder.join(name);
        match fs::create_dir_all(&path) {
            Ok(()) => Ok(path),
            Err(reason) => Err(ColmapError::Scratch { path, reason }),
        }
    }

    /// Returns the path for the picture of a camera, with this extension.
    ///
    /// # Errors
    /// A folder that cannot be written to.
    pub(crate) fn place(&self, camera: usize, extension: &str) -> Result<PathBuf, ColmapError> {
        let folder = self.new_folder(&format!("{IMAGES}/{}", folder_of(camera)))?;
        Ok(folder.join(format!("{STEM}.{extension}")))
    }

    /// Adds the picture of a camera, by a link if that is possible.
    ///
    /// # Errors
    /// A picture that cannot be read; a folder that cannot be written to.
    pub(crate) fn add(&self, camera: usize, picture: &Path) -> Result<(), ColmapError> {
        let extension = picture.extension().and_then(OsStr::to_str).unwrap_or("png").to_ascii_lowercase();
        let place = self.place(camera, &extension)?;
        let linked = |from: PathBuf| -> io::Result<()> {
            fs::hard_link(&from, &place).or_else(|_| fs::copy(&from, &place).map(drop))
        };
        let scratch = |reason| ColmapError::Scratch { path: picture.to_owned(), reason };
        picture.canonicalize().and_then(linked).map_err(scratch)
    }

    /// Finds the features of all pictures, for a model of lenses, and matches every two pictures. Returns the cameras
    /// in the order of the numbers of their pictures in the database, which begin with 1.
    ///
    /// # Errors
    /// Those of [`Program::run`].
    pub(crate) fn matched(
        &self,
        program: &Program,
        lens: &str,
        care: Care,
        progress: &dyn Progress,
    ) -> Result<Vec<usize>, ColmapError> {
        let model: Setting<'_> = (&["ImageReader.camera_model"], lens);
        let mut extraction: Vec<Setting<'_>> = vec![model, OWN_LENS, EXTRACTION_CARD];
        let mut matching: Vec<Setting<'_>> = vec![MATCHING_CARD];
        if care == Care::Great {
            extraction.extend(CAREFUL_EXTRACTION);
            matching.push(CAREFUL_MATCHING);
        }
        let database = ("database_path", self.database.as_path());
        let paths = [database, ("image_path", self.images.as_path())];
        let step = Step { name: "feature_extractor", paths: &paths, settings: &extraction };
        let said = self.run(program, &step, progress)?;
        self.run(program, &Step { name: "exhaustive_matcher", paths: &[database], settings: &matching }, progress)?;
        Ok(order(&said))
    }

    /// Runs a step, whose messages are kept in the folder.
    ///
    /// # Errors
    /// Those of [`Program::run`].
    pub(crate) fn run(
        &self,
        program: &Program,
        step: &Step<'_>,
        progress: &dyn Progress,
    ) -> Result<String, ColmapError> {
        program.run(step, &self.folder, progress)
    }
}

/// Returns the name of the picture of a camera, as the program writes it.
pub(crate) fn name_of(camera: usize) -> String {
    format!("{}/{STEM}.png", folder_of(camera))
}

/// Returns the camera of a picture, by its name.
pub(crate) fn camera_of(name: &str) -> Option<usize> {
    let (folder, picture) = name.split_once(['/', '\\'])?;
    picture.starts_with(STEM).then(|| folder.parse().ok()).flatten()
}

/// Returns the name of the folder of a camera; these names sort as the numbers do.
fn folder_of(camera: usize) -> String {
    format!("{camera:06}")
}

/// Returns the cameras in the order in which their pictures were added to the database: several threads find features,
/// and what is ready first is added, and named in a line `Name: ...`, first.
fn order(said: &str) -> Vec<usize> {
    said.lines().filter_map(|line| camera_of(line.split_once("Name:")?.1.trim())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_have_the_numbers_of_the_order_in_which_they_are_named() {
        let said = format!(
            "Processed file [1/2]\n  Name:            {}\n  Dimensions: 4 x 3\nI2026 feature_extraction.cc:273]   Name:  \
             {}\n  Name: other.png\n",
            name_of(12),
            name_of(3)
        );
        assert_eq!(order(&said), [12, 3], "in both forms of the messages, without other names");
    }

    #[test]
    fn pictures_of_cameras_are_links_or_copies_with_their_extension() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let picture = folder.path().join("a camera (1).JPG");
        fs::write(&picture, b"picture").expect("the folder can be written to");
        let moment = Moment::in_folder(folder.path().join("0"));
        moment.add(5, &picture).expect("the folder can be written to");
        let there = moment.images.join("000005/picture.jpg");
        assert_eq!(fs::read(there).expect("it is there"), b"picture", "the same contents");
        let error = moment.add(6, Path::new("missing.png")).expect_err("there is no such picture").to_string();
        assert!(error.contains("missing.png"), "the picture is named: {error}");
    }
}
