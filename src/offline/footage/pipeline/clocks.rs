//! The clocks of cameras, compared.
//!
//! In: footage, the offsets that are given, the videos of its cameras. Out: [`Clocks`]: by how many seconds the times
//! of each camera are too late, and what the motion in the pictures says of the times that follow.

use super::source::Source;
use super::timing::timed;
use crate::offline::dataset::formats::numbered::{entries, is_video};
use crate::offline::dataset::formats::video::VIDEOS;
use crate::offline::dataset::{DatasetError, Split};
use crate::offline::footage::sync::{Changes, MOST, Offset, SIDE, by_motion, by_sound};
use crate::offline::footage::take::{Filmed, Frame, Take};
use crate::offline::footage::working::WorkingPictures;
use crate::offline::footage::{FootageError, FootageSettings, Synchronization};
use crate::offline::work::{Progress, proceed};
use image::RgbImage;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::iter::zip;
use std::path::{Path, PathBuf};

/// Least number of frames of cameras whose motion is compared.
const FEWEST: usize = 13;
/// Pictures that are in memory at once.
const AT_ONCE: usize = 32;

/// The clocks of cameras.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Clocks {
    /// How they were compared, in words.
    pub way: String,
    /// The seconds by which the times of each camera are too late.
    pub offsets: Vec<f64>,
    /// Of clocks that were compared by sound, the root of the mean squared error of each camera, seconds; `None` of
    /// cameras that could not be compared.
    pub residuals: Vec<Option<f64>>,
    /// By how many frames each camera is still too late, by the motion in its pictures; `None` where that does not
    /// tell, and for cameras for the test.
    pub left: Vec<Option<f64>>,
    /// Whether a comparison failed that another run may be able to make, as with a program that is installed by then.
    pub is_provisional: bool,
}

impl Clocks {
    /// Compares the clocks of cameras as the settings say. Begins the tasks "sound" and "motion".
    ///
    /// # Errors
    /// An offset for no camera, pictures that cannot be read, an interruption.
    pub(super) fn of(
        source: &Source,
        settings: &FootageSettings,
        working: &WorkingPictures,
        progress: &mut dyn Progress,
    ) -> Result<Self, FootageError> {
        let mut clocks = match settings.sync {
            _ if !settings.offsets.is_empty() => Self::given(source, &settings.offsets)?,
            Synchronization::No => Self::right(source, "not compared"),
            Synchronization::Auto => Self::heard(source, &settings.folder, progress)?,
            Synchronization::Motion => {
                let (found, seconds) = moved((source, working), |_| true, progress)?;
                let offsets = found.iter().map(|offset| offset.map(|offset| in_seconds(offset, seconds))).collect();
                return Ok(Self::compared(source, "by the motion in the pictures", offsets, progress));
            }
        };
        let trained = |camera| is_trained(source, camera);
        let (found, _) = moved((&timed(source.clone(), &clocks.offsets), working), trained, progress)?;
        clocks.left = found.into_iter().map(|offset| offset.map(|offset| offset.seconds)).collect();
        Ok(clocks)
    }

    /// Returns clocks that are right.
    fn right(source: &Source, way: &str) -> Self {
        let offsets = vec![0.0; source.cameras.len()];
        Self { way: way.to_owned(), offsets, residuals: Vec::new(), left: Vec::new(), is_provisional: false }
    }

    /// Returns the offsets that are given, 0 for other cameras.
    fn given(source: &Source, given: &[(String, f64)]) -> Result<Self, FootageError> {
        let mut clocks = Self::right(source, "given");
        for (name, seconds) in given {
            clocks.offsets[source.camera(name)?] = *seconds;
        }
        Ok(clocks)
    }

    /// Returns the clocks by these offsets, of the cameras that could be compared, seconds. A note names the others.
    fn compared(source: &Source, way: &str, found: Vec<Option<Offset>>, progress: &mut dyn Progress) -> Self {
        if found.iter().flatten().count() < 2 {
            return Self::right(source, "not compared");
        }
        let unknown = zip(&source.cameras, &found).filter(|(_, offset)| offset.is_none());
        let unknown: Vec<&str> = unknown.map(|(name, _)| name.as_str()).collect();
        if !unknown.is_empty() {
            let names = unknown.join(", ");
            progress.note(&format!("note: clocks that cannot be compared {way} are taken to be right: {names}"));
        }
        let offsets = found.into_iter().map(|offset| offset.map_or(0.0, |offset| offset.seconds)).collect();
        Self { offsets, ..Self::right(source, way) }
    }

    /// Compares the clocks by the sound of the videos of the cameras, as far as there are videos.
    fn heard(source: &Source, folder: &Path, progress: &mut dyn Progress) -> Result<Self, FootageError> {
        let videos = videos(source, folder)?;
        let there: Vec<&PathBuf> = videos.iter().flatten().collect();
        if there.len() < 2 {
            return Ok(Self::right(source, "not compared"));
        }
        let mut found = match by_sound(&there, progress) {
            Ok(found) => found.into_iter(),
            Err(DatasetError::Interrupted(interrupted)) => return Err(interrupted.into()),
            Err(error) => {
                progress.note(&format!("note: clocks are not compared by sound: {error}"));
                return Ok(Self { is_provisional: true, ..Self::right(source, "not compared") });
            }
        };
        let of = |video: &Option<PathBuf>| video.as_ref().and_then(|_| found.next().flatten());
        let offsets: Vec<Option<Offset>> = videos.iter().map(of).collect();
        let residuals = offsets.iter().map(|offset| offset.map(|offset: Offset| offset.residual)).collect();
        Ok(Self { residuals, ..Self::compared(source, "by sound", offsets, progress) })
    }
}

/// Returns the video of each camera.
pub(super) fn videos(source: &Source, folder: &Path) -> Result<Vec<Option<PathBuf>>, DatasetError> {
    let mut all = entries(folder)?;
    all.extend(entries(&folder.join(VIDEOS))?);
    let of = |camera: &String| {
        let is_its = |path: &&PathBuf| is_video(path) && path.file_stem().is_some_and(|stem| *stem == **camera);
        all.iter().find(is_its).cloned()
    };
    Ok(source.cameras.iter().map(of).collect())
}

/// Returns whether a camera is one to train on.
fn is_trained(source: &Source, camera: usize) -> bool {
    source.shots.iter().any(|shot| shot.camera == camera && shot.split == Split::Train)
}

/// Compares the clocks of some cameras by the motion in their pictures. Returns by how many frames each is too late,
/// and the seconds of a frame.
fn moved(
    (source, working): (&Source, &WorkingPictures),
    is_compared: impl Fn(usize) -> bool,
    progress: &mut dyn Progress,
) -> Result<(Vec<Option<Offset>>, f64), FootageError> {
    let mut found = vec![None; source.cameras.len()];
    // A take numbers the cameras in the order of their first views, as the footage does.
    let take = Take::of(&source.views(), SIDE);
    let is_long = |(index, camera): &(usize, &Filmed)| is_compared(*index) && camera.frames.len() >= FEWEST;
    let long: Vec<(usize, &Filmed)> = zip(0.., &take.cameras).filter(is_long).collect();
    let seconds = step(&take) * f64::from(source.clock.unit_seconds);
    if long.len() < 2 {
        return Ok((found, seconds));
    }
    let mut changes = Vec::new();
    progress.begin("motion", long.len());
    for (_, camera) in &long {
        changes.push(changes_of(camera, working, progress)?);
        progress.advance();
    }
    progress.finish();
    for ((index, _), offset) in zip(long, by_motion(&changes, progress)?) {
        found[index] = offset;
    }
    Ok((found, seconds))
}

/// Returns what changes in the pictures of a camera.
fn changes_of(camera: &Filmed, working: &WorkingPictures, progress: &dyn Progress) -> Result<Changes, FootageError> {
    let mut pictures = Vec::new();
    let frames = &camera.frames[..camera.frames.len().min(MOST)];
    for some in frames.chunks(AT_ONCE) {
        proceed(progress)?;
        let load = |frame: &Frame| -> Result<(f32, RgbImage), DatasetError> {
            Ok((frame.view.time, working.picture(&frame.view)?))
        };
        pictures.extend(some.par_iter().map(load).collect::<Vec<_>>());
    }
    Ok(Changes::of(camera.camera, pictures.into_iter())?)
}

/// Returns the usual time between two frames of a camera; 0 if no camera has two.
pub(super) fn step(take: &Take) -> f64 {
    let of = |camera: &Filmed| -> Vec<f32> {
        camera.frames.windows(2).map(|pair| pair[1].view.time - pair[0].view.time).filter(|step| *step > 0.0).collect()
    };
    let mut steps: Vec<f32> = take.cameras.iter().flat_map(of).collect();
    steps.sort_unstable_by(f32::total_cmp);
    steps.get(steps.len() / 2).copied().map_or(0.0, f64::from)
}

/// Returns an offset in frames as one in seconds.
fn in_seconds(Offset { seconds, residual }: Offset, frame: f64) -> Offset {
    Offset { seconds: seconds * frame, residual: residual * frame }
}
