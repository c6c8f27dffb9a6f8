//! The points of footage, as a file.
//!
//! In: pictures, masks and plates of the cameras to train on. Out: `points3d.ply`: points of what moves, at every
//! moment, with velocities, and points of what stands still.

use super::masking::{Names, read_mask, read_plate};
use crate::offline::dataset::point_cloud::{CloudPoint, PointCloud};
use crate::offline::footage::colmap::{ColmapError, Program, triangulated};
use crate::offline::footage::points::{Backdrop, Masked, Plate, Standing, TakePoints, moving_points, standing, write};
use crate::offline::footage::take::{Filmed, Take};
use crate::offline::footage::working::WorkingPictures;
use crate::offline::footage::{FootageError, FootageSettings};
use crate::offline::store::results::Key;
use crate::offline::work::{FileError, Progress};
use crate::scene::Origin;
use crate::view::Camera;
use image::{GrayImage, Luma, RgbImage};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// The file.
const FILE: &str = "points3d.ply";
/// Most points of what moves, and of what stands.
const MOST_MOVING: usize = 400_000;
const MOST_STANDING: usize = 100_000;
/// Number of points of what stands below which more are looked for by matches.
const FEW: usize = 500;
/// Most pictures that show what stands, if there are no plates.
const MOST_PICTURES: usize = 64;

/// The file of points.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Cloud {
    /// Number of points.
    pub points: usize,
    /// The hash of the file; `None` if there are no points.
    hash: Option<Vec<u8>>,
    /// Whether few points stand still, and COLMAP was not there to find more.
    lacks_matches: bool,
}

impl Cloud {
    /// Finds points, and writes them into the folder of the dataset. `known` are those that the footage comes with: if
    /// there are no plates, they stand.
    ///
    /// # Errors
    /// A picture or a file that cannot be read, a folder that cannot be written to, an interruption.
    pub(super) fn write(
        seen: (&Take, &Names<'_>),
        working: &WorkingPictures,
        known: Option<&(PathBuf, Origin)>,
        settings: &FootageSettings,
        progress: &mut dyn Progress,
    ) -> Result<Self, FootageError> {
        let out = &settings.out;
        let (take, path) = (seen.0, out.join(FILE));
        let (Standing { points, backdrops }, lacks_matches) = what_stands((take, working), known, out, progress)?;
        let moving = moving((seen, &backdrops), working, settings, progress)?;
        let TakePoints { points } = TakePoints::joined(moving, points);
        if points.is_empty() {
            return Ok(Self { lacks_matches, ..Self::none(out)? });
        }
        let middle = take.moments.first().zip(take.moments.last()).map_or(0.0, |(first, last)| first.midpoint(*last));
        write(&path, &points, &Origin::default(), middle)?;
        Ok(Self { points: points.len(), hash: Some(Key::of_file(&path)?.bytes().to_vec()), lacks_matches })
    }

    /// Removes the file of an earlier run, if there is one.
    ///
    /// # Errors
    /// A file that cannot be removed.
    pub(super) fn none(out: &Path) -> Result<Self, FootageError> {
        let path = out.join(FILE);
        match fs::remove_file(&path) {
            Err(error) if error.kind() != ErrorKind::NotFound => Err(FileError::at(&path, error).into()),
            _ => Ok(Self { points: 0, hash: None, lacks_matches: false }),
        }
    }

    /// Returns whether the file is in the folder of the dataset, if there is to be one.
    pub(super) fn is_in(&self, out: &Path) -> bool {
        let found = Key::of_file(&out.join(FILE)).ok().map(|key| key.bytes().to_vec());
        found == self.hash
    }

    /// Returns whether COLMAP was not there to find more points, and is now.
    pub(super) fn can_be_completed(&self) -> bool {
        self.lacks_matches && Program::find().is_ok()
    }

    /// Returns the name of the file, if there are points.
    pub(super) fn file(&self) -> Option<&'static str> {
        self.hash.as_ref().map(|_| FILE)
    }
}

/// Returns the points of what moves. `backdrops` are what stands before the cameras.
fn moving(
    ((take, names), backdrops): ((&Take, &Names<'_>), &[Backdrop]),
    working: &WorkingPictures,
    settings: &FootageSettings,
    progress: &mut dyn Progress,
) -> Result<Vec<CloudPoint>, FootageError> {
    let cameras: Vec<Camera> = take.cameras.iter().map(|camera| camera.camera).collect();
    let masked = |camera: usize, moment: usize| -> Result<Option<Masked>, FootageError> {
        let Some(frame) = take.frame(camera, moment) else { return Ok(None) };
        let Some(mask) = read_mask(&settings.out, &take.cameras[camera], frame, names)? else { return Ok(None) };
        Ok(Some(Masked { camera, picture: working.picture(&frame.view)?, mask }))
    };
    let mut load = |moment: usize| -> Result<Vec<Masked>, FootageError> {
        (0..take.cameras.len()).into_par_iter().filter_map(|camera| masked(camera, moment).transpose()).collect()
    };
    moving_points((&cameras, backdrops), &take.moments, &mut load, (MOST_MOVING, settings.agreeing as f32), progress)
}

/// Returns what stands still: what the plates show, else the points that are known, else the points that the first
/// pictures of the cameras show, which may also show what moves. If cameras are too far apart for that, by matches. Returns
/// also whether matches would have been needed, and COLMAP is not installed.
fn what_stands(
    (take, working): (&Take, &WorkingPictures),
    known: Option<&(PathBuf, Origin)>,
    out: &Path,
    progress: &mut dyn Progress,
) -> Result<(Standing, bool), FootageError> {
    let plate = |camera: &Filmed| -> Result<Option<Plate>, FootageError> {
        let of = |(picture, confidence)| Plate { camera: camera.camera, picture, confidence };
        Ok(read_plate(out, camera)?.map(of))
    };
    let mut plates: Vec<Plate> =
        take.cameras.par_iter().filter_map(|camera| plate(camera).transpose()).collect::<Result<_, _>>()?;
    let is_of_plates = !plates.is_empty();
    if !is_of_plates {
        if let Some((path, origin)) = known {
            let mut points = PointCloud::load(path, origin)?.0;
            points.retain(|point| point.time.is_none());
            return Ok((Standing { points, backdrops: Vec::new() }, false));
        }
        let step = take.cameras.len().div_ceil(MOST_PICTURES).max(1);
        let cameras: Vec<&Filmed> = take.cameras.iter().step_by(step).collect();
        let first = |camera: &&Filmed| -> Result<Option<Plate>, FootageError> {
            let Some(frame) = camera.frames.first() else { return Ok(None) };
            let picture = working.picture(&frame.view)?;
            let confidence = GrayImage::from_pixel(picture.width(), picture.height(), Luma([u8::MAX]));
            Ok(Some(Plate { camera: camera.camera, picture, confidence }))
        };
        plates = cameras.par_iter().filter_map(|camera| first(camera).transpose()).collect::<Result<_, _>>()?;
    }
    let mut found = standing(&plates, MOST_STANDING, progress)?;
    if !is_of_plates {
        found.backdrops.clear();
    }
    if found.points.len() >= FEW {
        return Ok((found, false));
    }
    let Ok(program) = Program::find() else {
        progress.note("note: few points stand still, and COLMAP, which would find more by matches, is not installed");
        return Ok((found, true));
    };
    found.points.extend(matched(&program, plates, progress)?);
    Ok((found, false))
}

/// Returns the points of matches of pictures that COLMAP finds; none if it fails.
fn matched(
    program: &Program,
    plates: Vec<Plate>,
    progress: &mut dyn Progress,
) -> Result<Vec<CloudPoint>, FootageError> {
    let pictures: Vec<(Camera, RgbImage)> = plates.into_iter().map(|plate| (plate.camera, plate.picture)).collect();
    // Points of plates have no time.
    match triangulated(program, &pictures, 0.0, progress) {
        Ok(points) => Ok(points),
        Err(ColmapError::Interrupted(interrupted)) => Err(interrupted.into()),
        Err(error) => {
            progress.note(&format!("note: no points are found by matches: {error}"));
            Ok(Vec::new())
        }
    }
}
