//! Plates of standing cameras, and masks of what moves before them, as files.
//!
//! In: the frames of each camera, a folder of masks that are given. Out: `plates/CAMERA.png`,
//! `plates/confidence/CAMERA.png` (black where the plate is not known) and `motion/CAMERA/FRAME.png` (white is what
//! moves), of the size of the pictures to work with. A mask that is given is used as it is, and what it has does not
//! become part of the plate.

use super::output::{Listed, Unfinished, listed};
use crate::offline::dataset::TrainingView;
use crate::offline::dataset::mask::INSIDE;
use crate::offline::footage::plates::{masks, plate};
use crate::offline::footage::take::{Filmed, Frame, Take};
use crate::offline::footage::working::WorkingPictures;
use crate::offline::footage::{FootageError, FootageSettings};
use crate::offline::work::{FileError, Progress, proceed};
use image::{GrayImage, ImageError, RgbImage};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::path::{Path, PathBuf};

/// The folder of plates.
pub(super) const PLATES: &str = "plates";
/// The folder of the confidences of plates, in that of plates.
const CONFIDENCE: &str = "confidence";
/// The folder of masks of what moves.
pub(super) const MOTION: &str = "motion";
/// The folders of given masks in that of the footage.
const GIVEN: [&str; 2] = ["seg", MOTION];
/// Least number of frames of a camera that has a plate.
const FEWEST: usize = 4;
/// Pictures that are in memory at once.
const AT_ONCE: usize = 240;

/// The names of frames, by the paths of their images.
pub(super) type Names<'a> = HashMap<&'a Path, &'a str>;

/// The files of plates and masks.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Masked {
    plates: Vec<Listed>,
    motion: Vec<Listed>,
}

impl Masked {
    /// Returns whether all files are in the folder of the dataset.
    pub(super) fn is_in(&self, out: &Path) -> bool {
        listed(&out.join(PLATES)) == self.plates && listed(&out.join(MOTION)) == self.motion
    }

    /// Returns the number of masks.
    pub(super) fn masks(&self) -> usize {
        self.motion.len()
    }
}

/// The given masks.
pub(super) struct Given {
    folder: PathBuf,
    /// Whether the user has named the folder, so that it must have masks.
    is_named: bool,
}

impl Given {
    /// Returns the folder of masks that is named, or else one in the folder of the footage, if there is one.
    pub(super) fn of(named: Option<&Path>, footage: &Path) -> Option<Self> {
        let found = GIVEN.iter().map(|name| footage.join(name)).find(|folder| folder.is_dir());
        let (folder, is_named) = named.map_or((found, false), |named| (Some(named.to_owned()), true));
        folder.map(|folder| Self { folder, is_named })
    }

    /// Returns a sentence about the masks, of which there are so many.
    pub(super) fn note(&self, count: usize) -> String {
        format!("note: {}: {count} masks of what moves are used as they are", self.folder.display())
    }

    /// Returns the path of the mask of a frame, if it were there.
    fn path(&self, camera: &Filmed, frame: &Frame, names: &Names<'_>) -> PathBuf {
        self.folder.join(&camera.name).join(file_name(frame, names))
    }

    /// Reads the mask of a frame; `None` if it is not there.
    fn mask(&self, camera: &Filmed, frame: &Frame, names: &Names<'_>) -> Result<Option<GrayImage>, FootageError> {
        let path = self.path(camera, frame, names);
        if path.is_file() { given_mask(frame, &path).map(Some) } else { Ok(None) }
    }

    /// Returns the masks that are there.
    ///
    /// # Errors
    /// A folder that is named and has no mask.
    pub(super) fn files(&self, (take, names): (&Take, &Names<'_>)) -> Result<Vec<PathBuf>, FootageError> {
        let frames = take.cameras.iter().flat_map(|camera| camera.frames.iter().map(move |frame| (camera, frame)));
        let mut paths = frames.map(|(camera, frame)| self.path(camera, frame, names)).peekable();
        let example = paths.peek().cloned().unwrap_or_default();
        let there: Vec<PathBuf> = paths.filter(|path| path.is_file()).collect();
        if there.is_empty() && self.is_named {
            return Err(FootageError::NoMasks { folder: self.folder.clone(), example });
        }
        Ok(there)
    }
}

/// Writes plates and masks. Begins the task "plates and masks".
///
/// # Errors
/// A picture that cannot be read or written, an interruption.
pub(super) fn write_masks(
    (take, names): (&Take, &Names<'_>),
    working: &WorkingPictures,
    given: Option<&Given>,
    settings: &FootageSettings,
    progress: &mut dyn Progress,
) -> Result<Masked, FootageError> {
    let out = &settings.out;
    let standing: Vec<&Filmed> = take.cameras.iter().filter(|camera| camera.frames.len() >= FEWEST).collect();
    let [plates, motion] = [Unfinished::begin(out, PLATES)?, Unfinished::begin(out, MOTION)?];
    for camera in take.cameras.iter().filter(|camera| camera.frames.len() < FEWEST) {
        // Too few frames for a plate: what moves is known of those with a given mask.
        for frame in &camera.frames {
            let Some(mask) = given.map_or(Ok(None), |given| given.mask(camera, frame, names))? else { continue };
            let path = motion.path(&camera.name, &file_name(frame, names))?;
            mask.save(&path).map_err(|error| of_image(&path, error))?;
        }
    }
    progress.begin("plates and masks", standing.iter().map(|camera| camera.frames.len()).sum());
    for camera in standing {
        proceed(progress)?;
        let is_whole = camera.frames.len() <= AT_ONCE;
        let step = camera.frames.len().div_ceil(AT_ONCE);
        let read = |frames: &[&Frame]| -> Result<(Vec<RgbImage>, Vec<Option<GrayImage>>), FootageError> {
            let mask = |frame: &&Frame| given.map_or(Ok(None), |given| given.mask(camera, frame, names));
            Ok((load(frames, working)?, frames.par_iter().map(mask).collect::<Result<_, _>>()?))
        };
        let (mut pictures, mut known) = read(&camera.frames.iter().step_by(step).collect::<Vec<_>>())?;
        let plate = plate(&pictures, &known);
        let name = plate_name(&camera.name);
        let (picture, confidence) = (plates.path("", &name)?, plates.path(CONFIDENCE, &name)?);
        plate.picture.save(&picture).map_err(|error| of_image(&picture, error))?;
        plate.confidence.save(&confidence).map_err(|error| of_image(&confidence, error))?;
        for frames in camera.frames.chunks(AT_ONCE) {
            proceed(progress)?;
            if !is_whole {
                (pictures, known) = read(&frames.iter().collect::<Vec<_>>())?;
            }
            let made = masks(&pictures, &plate, settings.smallest as f32).into_par_iter().zip(&known);
            frames.par_iter().zip(made).try_for_each(|(frame, (mask, known))| -> Result<(), FootageError> {
                let path = motion.path(&camera.name, &file_name(frame, names))?;
                Ok(known.as_ref().unwrap_or(&mask).save(&path).map_err(|error| of_image(&path, error))?)
            })?;
            frames.iter().for_each(|_| progress.advance());
        }
    }
    progress.finish();
    Ok(Masked { plates: plates.finish()?, motion: motion.finish()? })
}

/// Reads the plate of a camera and its confidence; `None` if it has none.
///
/// # Errors
/// A plate that cannot be read.
pub(super) fn read_plate(out: &Path, camera: &Filmed) -> Result<Option<(RgbImage, GrayImage)>, FootageError> {
    let (folder, name) = (out.join(PLATES), plate_name(&camera.name));
    if !folder.join(&name).is_file() {
        return Ok(None);
    }
    let open = |path: PathBuf| image::open(&path).map_err(|error| of_image(&path, error));
    let confidence = open(folder.join(CONFIDENCE).join(&name))?.into_luma8();
    Ok(Some((open(folder.join(&name))?.into_rgb8(), confidence)))
}

/// Reads the mask of a frame; `None` if it has none.
///
/// # Errors
/// A mask that cannot be read.
pub(super) fn read_mask(
    out: &Path,
    camera: &Filmed,
    frame: &Frame,
    names: &Names<'_>,
) -> Result<Option<GrayImage>, FootageError> {
    let path = out.join(MOTION).join(&camera.name).join(file_name(frame, names));
    if !path.is_file() {
        return Ok(None);
    }
    Ok(Some(image::open(&path).map_err(|error| of_image(&path, error))?.into_luma8()))
}

/// Returns the name of the file of the plate of a camera.
fn plate_name(camera: &str) -> String {
    format!("{camera}.png")
}

/// Returns the name of the file of the mask of a frame.
fn file_name(frame: &Frame, names: &Names<'_>) -> String {
    format!("{}.png", names.get(&*frame.view.image).copied().unwrap_or(&frame.view.name))
}

/// Loads pictures.
fn load(frames: &[&Frame], working: &WorkingPictures) -> Result<Vec<RgbImage>, FootageError> {
    Ok(frames.par_iter().map(|frame| working.picture(&frame.view)).collect::<Result<_, _>>()?)
}

/// Returns a given mask with the lens and the size of its frame: white or black.
fn given_mask(frame: &Frame, path: &Path) -> Result<GrayImage, FootageError> {
    let view = TrainingView { image: path.to_owned(), mask: None, ..frame.view.clone() };
    let covered = view.load_covered()?;
    let values: Vec<u8> = covered.texels.iter().map(|&[red, green, blue, _]| red.max(green).max(blue)).collect();
    let are_labels = values.iter().all(|value| *value < INSIDE);
    // Labels of objects are 1 and more.
    let inside = if are_labels { 1 } else { INSIDE };
    let bytes = values.into_iter().map(|value| if value >= inside { u8::MAX } else { 0 }).collect();
    Ok(GrayImage::from_raw(covered.size.x, covered.size.y, bytes).unwrap_or_default())
}

fn of_image(path: &Path, error: ImageError) -> FileError {
    FileError::at(path, error)
}
