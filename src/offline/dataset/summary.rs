//! A summary of a dataset folder.
//!
//! In: a folder, how it is read. Out: its format, its splits with cameras, times and sizes, missing files, and
//! assumptions. No image and no video is decoded, except for the size of one image where the camera files have no size.

use super::dataset_split::not_a_dataset;
use super::error::LOOKED_FOR;
use super::formats::numbered::is_video;
use super::selection::distinct_cameras;
use super::{CameraOptions, Dataset, DatasetError, Split, TrainingView};
use crate::view::Camera;
use glam::UVec2;
use std::collections::{BTreeSet, HashSet};
use std::path::{Path, PathBuf};

/// Most files that a message names.
const NAMED: usize = 3;

/// The contents of a dataset folder.
pub struct Summary {
    /// Name of the format.
    pub format: &'static str,
    /// The splits that can be opened.
    pub splits: Vec<SplitSummary>,
    /// The distinct cameras of all splits.
    pub cameras: Vec<Camera>,
    /// Number of distinct times of all splits.
    pub times: usize,
    /// First and last time.
    pub interval: [f32; 2],
    /// The distinct sizes of the pictures, width and height, pixels.
    pub sizes: Vec<UVec2>,
    /// Number of views with a mask.
    pub masks: usize,
    /// File of points to begin training with.
    pub points: Option<PathBuf>,
    /// Missing files and unusual properties, a sentence each.
    pub missing: Vec<String>,
    /// Assumptions and omissions, a sentence each.
    pub notes: Vec<String>,
}

/// One split.
pub struct SplitSummary {
    /// The split.
    pub split: Split,
    /// Number of views.
    pub views: usize,
    /// Number of distinct cameras.
    pub cameras: usize,
    /// Number of distinct times.
    pub times: usize,
}

impl Summary {
    /// Describes a folder.
    ///
    /// # Errors
    /// The folder is no dataset, or neither its training nor its test split can be opened.
    pub fn of(folder: &Path, options: &CameraOptions) -> Result<Self, DatasetError> {
        let format = Dataset::format(folder).ok_or_else(|| not_a_dataset(folder, Split::Train))?;
        let (mut splits, mut views, mut missing, mut points) = (Vec::new(), Vec::new(), Vec::new(), None);
        let (mut failed, mut notes): (_, Vec<String>) = (None, Vec::new());
        for split in Split::ALL {
            let found = Dataset::open_undecoded(folder, split, options);
            let of_split = found.iter().flat_map(|dataset| &dataset.notes);
            let new: Vec<String> = of_split.filter(|note| !notes.contains(note)).cloned().collect();
            notes.extend(new);
            match found {
                // The test split of a folder may be its validation split.
                Ok(dataset) if dataset.split == split => {
                    splits.push(SplitSummary::of(&dataset));
                    views.extend(dataset.views);
                    points = points.or(dataset.points);
                }
                Ok(_) => {}
                Err(DatasetError::NoSplit { .. } | DatasetError::EmptySplit { .. }) if split == Split::Val => {}
                Err(error) => {
                    missing.push(error.to_string());
                    failed = failed.or(Some(error));
                }
            }
        }
        if let Some(error) = failed.filter(|_| views.is_empty()) {
            return Err(error);
        }
        let (all, cameras) = (times(&views), distinct_cameras(&views));
        missing.extend(unusual(&views, points.as_deref(), all.len(), cameras.len()));
        let interval = [all.first(), all.last()].map(|time| time.map_or(0.0, |bits| from_order(*bits)));
        let mut seen = HashSet::new();
        let sizes = views.iter().map(|view| view.camera.size).filter(|size| seen.insert(*size)).collect();
        Ok(Self {
            format,
            splits,
            times: all.len(),
            interval,
            cameras,
            sizes,
            masks: views.iter().filter(|view| view.mask.is_some()).count(),
            points,
            missing,
            notes,
        })
    }
}

impl SplitSummary {
    /// Describes an opened split.
    fn of(dataset: &Dataset) -> Self {
        let Dataset { split, views, .. } = dataset;
        let (cameras, times) = (distinct_cameras(views).len(), times(views).len());
        Self { split: *split, views: views.len(), cameras, times }
    }
}

/// Returns missing files and unusual properties of the views and the file of points, a sentence each. `times` and
/// `cameras` are numbers of distinct ones.
fn unusual(views: &[TrainingView], points: Option<&Path>, times: usize, cameras: usize) -> Vec<String> {
    let mut sentences = absent(views);
    let no_points = points.filter(|path| !path.is_file());
    sentences.extend(no_points.map(|path| format!("{}: no such file of points", path.display())));
    // The times of videos that have not been decoded are not known.
    if times < 2 && !views.iter().any(|view| is_video(&view.image)) {
        sentences.push("all views have one time: the scene is static".to_owned());
    }
    if cameras < 2 {
        sentences.push("all views have one camera, from which no depth can be found".to_owned());
    }
    sentences
}

/// Returns the distinct times, ascending, as integers of the same order.
fn times(views: &[TrainingView]) -> BTreeSet<i32> {
    views.iter().map(|view| to_order(view.time)).collect()
}

/// Returns an integer of the order of `f32::total_cmp`. Minus 0 is 0.
fn to_order(time: f32) -> i32 {
    let bits = (time + 0.0).to_bits().cast_signed();
    if bits < 0 { bits ^ i32::MAX } else { bits }
}

fn from_order(order: i32) -> f32 {
    let bits = if order < 0 { order ^ i32::MAX } else { order };
    f32::from_bits(bits.cast_unsigned())
}

/// Returns a sentence for the images, masks and decoded videos that are not on disk.
fn absent(views: &[TrainingView]) -> Vec<String> {
    let files: BTreeSet<&Path> =
        views.iter().flat_map(|view| [Some(view.image.as_path()), view.mask.as_deref()]).flatten().collect();
    let listed = |files: &[&Path], what: &str| {
        let named: Vec<String> = files.iter().take(NAMED).map(|path| path.display().to_string()).collect();
        let more = if files.len() > NAMED { ", ..." } else { "" };
        (!files.is_empty()).then(|| format!("{} {what}: {}{more}", files.len(), named.join(", ")))
    };
    let gone: Vec<&Path> = files.iter().copied().filter(|path| !path.is_file()).collect();
    let videos: Vec<&Path> = files.iter().copied().filter(|path| is_video(path)).collect();
    let gone = listed(&gone, "images or masks are not on disk").map(|sentence| format!("{sentence} ({LOOKED_FOR})"));
    let videos = listed(&videos, "videos have not been decoded, which needs ffmpeg; each counts as one view here");
    [gone, videos].into_iter().flatten().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn integers_of_times_have_their_order() {
        let times = [-2.5f32, -0.5, 0.0, 1e-9, 0.5, 3.0];
        let orders = times.map(to_order);
        assert!(orders.is_sorted_by(|a, b| a < b), "the order is kept: {orders:?}");
        assert_eq!(orders.map(from_order), times, "the times are found again");
        assert_eq!(to_order(-0.0), to_order(0.0), "there is one 0");
    }
}
