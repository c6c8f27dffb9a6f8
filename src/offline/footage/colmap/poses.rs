//! Poses and lenses of cameras by their pictures.
//!
//! In: for each camera its name and pictures of some moments. Out: a [`Calibration`] in COLMAP's unit of length, which
//! is no meter.
//!
//! A moment is enough: cameras stand still, and what moves is at one place in all pictures of a moment. The moment in
//! the middle is tried first, the others if it does not place all cameras, and the best once more with features that
//! are found with greater care. Moments are not matched with each other: what moves would contradict what stands.

use super::error::{ColmapError, left_out};
use super::matches::{Care, Moment, camera_of};
use super::program::{Program, Setting, Step};
use crate::offline::dataset::DatasetError;
use crate::offline::dataset::cameras::pose;
use crate::offline::dataset::formats::colmap::largest;
use crate::offline::dataset::formats::footage::{Calibration, RigCamera, listed};
use crate::offline::work::Progress;
use std::env;
use std::path::{Path, PathBuf};

/// The name of the task.
const TASK: &str = "COLMAP";
/// The calibration, in messages.
const SOURCE: &str = "poses by COLMAP";
/// Start of the names of folders of temporary files.
const PREFIX: &str = "gs4d-colmap-";
/// A lens with one focal length and one coefficient of distortion: few pictures tell no more.
const LENS: &str = "SIMPLE_RADIAL";
/// The folder in which models are found.
const MODELS: &str = "sparse";
/// Fewest cameras that are placed, unless there are fewer.
const FEWEST: usize = 3;
/// The options of the two searches for poses: the usual ones, and those for few matches and small angles.
const USUAL: &[Setting<'static>] = &[(&["Mapper.min_model_size"], "3")];
const LENIENT: &[Setting<'static>] = &[
    (&["Mapper.min_model_size"], "3"),
    (&["Mapper.init_min_tri_angle"], "4"),
    (&["Mapper.init_min_num_inliers"], "30"),
    (&["Mapper.abs_pose_min_num_inliers"], "15"),
];

/// Returns the cameras that the installed program places. Begins and finishes a task for each moment that is tried.
///
/// # Errors
/// The program is not installed, or fails; fewer than two cameras have pictures; less than half of the cameras, or
/// fewer than three of several, can be placed; a folder of temporary files that cannot be written to; the interruption
/// of the work.
pub(crate) fn calibrate(
    pictures: &[(String, Vec<PathBuf>)],
    progress: &mut dyn Progress,
) -> Result<Calibration, ColmapError> {
    calibrate_by(&Program::find()?, pictures, progress)
}

/// Does as [`calibrate`] by a program that has been found.
///
/// # Errors
/// As [`calibrate`].
pub(crate) fn calibrate_by(
    program: &Program,
    pictures: &[(String, Vec<PathBuf>)],
    progress: &mut dyn Progress,
) -> Result<Calibration, ColmapError> {
    let shown = pictures.iter().filter(|(_, pictures)| !pictures.is_empty()).count();
    if shown < 2 {
        return Err(ColmapError::Few { cameras: shown });
    }
    let scratch = |reason| ColmapError::Scratch { path: env::temp_dir(), reason };
    let folder = tempfile::Builder::new().prefix(PREFIX).tempdir().map_err(scratch)?;
    progress.note(&format!("the poses of {shown} cameras are found by {}", program.name));
    let rig = Rig { program, pictures, folder: folder.path(), shown };
    let mut best = Found::default();
    for moment in from_the_middle(pictures) {
        best = best.or(rig.tried(moment, Care::Usual, progress)?);
        if best.placed.len() == shown {
            break;
        }
    }
    if best.placed.len() < shown {
        let moment = best.moment;
        best = best.or(rig.tried(moment, Care::Great, progress)?);
    }
    rig.calibration(best)
}

/// Returns the numbers of the moments, from 0, the one in the middle first.
fn from_the_middle(pictures: &[(String, Vec<PathBuf>)]) -> impl Iterator<Item = usize> {
    let count = pictures.iter().map(|(_, pictures)| pictures.len()).max().unwrap_or(0);
    let middle = count / 2;
    std::iter::once(middle).chain((0..count).filter(move |moment| *moment != middle))
}

/// The cameras of which poses are to be found.
struct Rig<'a> {
    program: &'a Program,
    /// Names, and the pictures of some moments.
    pictures: &'a [(String, Vec<PathBuf>)],
    /// The folder of temporary files.
    folder: &'a Path,
    /// Number of cameras with pictures.
    shown: usize,
}

/// The poses of a moment.
#[derive(Default)]
struct Found {
    /// The moment, from 0.
    moment: usize,
    /// The cameras, with their numbers.
    placed: Vec<(usize, RigCamera)>,
    /// What the program has said if it found no poses.
    said: Option<String>,
}

impl Found {
    /// Returns that of two results which has more cameras, the first of equals, unless it has none.
    fn or(self, other: Self) -> Self {
        if other.placed.len() > self.placed.len() || self.placed.is_empty() { other } else { self }
    }
}

impl Rig<'_> {
    /// Finds the poses of a moment.
    fn tried(&self, number: usize, care: Care, progress: &mut dyn Progress) -> Result<Found, ColmapError> {
        progress.begin(TASK, 2);
        let moment = Moment::in_folder(self.folder.join(format!("{number}{care:?}")));
        for (camera, (_, pictures)) in self.pictures.iter().enumerate() {
            if let Some(picture) = pictures.get(number) {
                moment.add(camera, picture)?;
            }
        }
        let mut best = Found { moment: number, ..Found::default() };
        moment.matched(self.program, LENS, care, progress)?;
        progress.advance();
        for (name, settings) in [("usual", USUAL), ("lenient", LENIENT)] {
            let found = self.mapped(&moment, name, settings, progress)?;
            best = best.or(Found { moment: number, ..found });
            if best.placed.len() == self.shown {
                break;
            }
        }
        progress.advance();
        progress.finish();
        Ok(best)
    }

    /// Finds poses by the matches of a moment, with some options. Models are written to a folder of this name.
    fn mapped(
        &self,
        moment: &Moment,
        name: &str,
        settings: &[Setting<'_>],
        progress: &dyn Progress,
    ) -> Result<Found, ColmapError> {
        let folder = moment.new_folder(name)?;
        let output = moment.new_folder(&format!("{name}/{MODELS}"))?;
        let paths = [
            ("database_path", moment.database.as_path()),
            ("image_path", moment.images.as_path()),
            ("output_path", output.as_path()),
        ];
        match moment.run(self.program, &Step { name: "mapper", paths: &paths, settings }, progress) {
            Ok(_) => Ok(Found { placed: self.placed(&folder)?, ..Found::default() }),
            // The program also fails if there is nothing wrong but the pictures.
            Err(ColmapError::Step { said, .. }) => Ok(Found { said: Some(said), ..Found::default() }),
            Err(other) => Err(other),
        }
    }

    /// Reads the cameras of the largest model in a folder.
    fn placed(&self, folder: &Path) -> Result<Vec<(usize, RigCamera)>, DatasetError> {
        let Some(model) = largest(folder)? else { return Ok(Vec::new()) };
        let mut placed = Vec::new();
        for image in &model.images {
            let Some(index) = camera_of(&image.name) else { continue };
            let Some((name, _)) = self.pictures.get(index) else { continue };
            let (rotation, translation) = image.pose;
            let world_to_camera = pose::of_rotation(rotation, translation).map_err(model.failed(image))?;
            let camera = model.camera_of(image)?;
            let (size, lens, distortion) = (Some(camera.size), camera.lens, camera.distortion);
            placed.push((index, RigCamera { name: name.clone(), size, world_to_camera, lens, distortion }));
        }
        placed.sort_by_key(|(index, _)| *index);
        placed.dedup_by_key(|(index, _)| *index);
        Ok(placed)
    }

    /// Returns the cameras that are placed, if these are enough.
    fn calibration(&self, found: Found) -> Result<Calibration, ColmapError> {
        let (program, placed) = (&self.program.name, found.placed.len());
        let is_placed = |index: usize| found.placed.iter().any(|(other, _)| *other == index);
        let others = (0..self.pictures.len()).filter(|&index| !is_placed(index));
        let others: Vec<String> = others.map(|index| self.pictures[index].0.clone()).collect();
        let (count, names) = (others.len(), listed(others.into_iter()));
        if !is_enough(placed, self.shown) {
            let said = found.said.unwrap_or_else(|| "no pair of pictures has more in common".to_owned());
            return Err(ColmapError::Unplaced { program: program.clone(), names, placed, cameras: self.shown, said });
        }
        let mut notes = vec![format!("poses are by {program}, whose unit of length is arbitrary, no meter")];
        if count > 0 {
            notes.push(left_out(program, &names, count));
        }
        let cameras = found.placed.into_iter().map(|(_, camera)| camera).collect();
        Ok(Calibration { source: PathBuf::from(SOURCE), cameras, notes })
    }
}

/// Returns whether so many of the cameras are enough: half of them, and three, or two of two.
fn is_enough(placed: usize, cameras: usize) -> bool {
    placed >= FEWEST.min(cameras) && 2 * placed >= cameras
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_of_the_cameras_are_enough_if_these_are_three() {
        for (placed, cameras) in [(2, 2), (3, 3), (3, 4), (3, 6), (6, 6)] {
            assert!(is_enough(placed, cameras), "{placed} of {cameras} are enough");
        }
        for (placed, cameras) in [(0, 2), (2, 3), (2, 4), (3, 7), (0, 6)] {
            assert!(!is_enough(placed, cameras), "{placed} of {cameras} are too few");
        }
    }

    #[test]
    fn the_moment_in_the_middle_is_the_first() {
        let pictures = |count| vec![("a".to_owned(), vec![PathBuf::new(); count]), ("b".to_owned(), Vec::new())];
        assert_eq!(from_the_middle(&pictures(3)).collect::<Vec<_>>(), [1, 0, 2], "then the others");
        assert_eq!(from_the_middle(&pictures(1)).collect::<Vec<_>>(), [0], "the only one");
    }
}
