//! Splits of datasets whose views are in one file.
//!
//! In: all views of a folder. Out: the views of one split. Without splits in the dataset, every eighth camera is for
//! the test, the first one included; if there is one camera, every eighth view.

use super::formats::undivided::Undivided;
use super::selection::{distinct_cameras, distinct_times, identity};
use super::{CameraOptions, DatasetError, Split, TrainingView};
use crate::view::Camera;
use std::collections::HashSet;

/// One of this many cameras is for the test.
const TEST: usize = 8;
/// Cameras closer than this fraction of their distance to the origin are at one place.
const SAME: f32 = 1e-5;

/// Returns the views of a split inside the time interval of the options.
pub(super) fn divide(split: Split, options: &CameraOptions, all: Undivided) -> Result<Vec<TrainingView>, DatasetError> {
    let Undivided { source, views, splits, origin, .. } = all;
    let cameras = distinct_cameras(&views);
    match &views[..] {
        [] => return Err(DatasetError::NoFrames { path: source }),
        [_] => return Err(DatasetError::OneView { path: source }),
        _ => {}
    }
    let center = |camera: &Camera| camera.world_to_camera.inverse().w_axis;
    let first = center(&cameras[0]);
    let is_at_first = |camera: &Camera| center(camera).distance(first) <= SAME * first.length();
    // One camera may have several times, as it may stand still in front of what moves.
    let varies = cameras.len() == 1 && distinct_times(&views) > 1;
    if !varies && cameras.iter().all(is_at_first) {
        return Err(DatasetError::SamePlace { path: source, views: views.len() });
    }
    let splits = splits.unwrap_or_else(|| {
        let test: HashSet<_> = cameras.iter().step_by(TEST).map(identity).collect();
        let is_test = |index: usize| match cameras.len() {
            1 => index.is_multiple_of(TEST),
            _ => test.contains(&identity(&views[index].camera)),
        };
        (0..views.len()).map(|index| Some(if is_test(index) { Split::Test } else { Split::Train })).collect()
    });
    let mut of_split: Vec<_> =
        views.into_iter().zip(splits).filter(|(_, of)| *of == Some(split)).map(|(view, _)| view).collect();
    let times = || of_split.iter().map(|view| view.time);
    let (Some(first), Some(last)) = (times().reduce(f32::min), times().reduce(f32::max)) else {
        return Err(DatasetError::EmptySplit { path: source, split });
    };
    if let Some(interval @ [start, end]) = options.time_interval {
        of_split.retain(|view| (start..=end).contains(&view.time));
        if of_split.is_empty() {
            let (times, origin) = ([first, last], origin.time);
            return Err(DatasetError::NoFramesInInterval { path: source, interval, times, origin });
        }
    }
    Ok(of_split)
}
