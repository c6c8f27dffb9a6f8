//! Synchronization: the clocks of cameras against each other.
//!
//! In: the videos of a take, or its cameras with their pictures. Out: the [`Offset`] of each camera.
//!
//! An offset says how late a clock is: the times of the frames of the camera are too large by so much, and it is to be
//! subtracted from them. An event has a larger time in a camera that is late. The median of all cameras is 0.
//!
//! Sound takes 2.9 ms for each meter, so that a camera that is further from the source is later by sound than it is.

mod correlation;
mod epipolar;
mod motion;
mod offsets;
mod sound;

pub(crate) use epipolar::{Changes, MOST, SIDE};
pub(crate) use offsets::Offset;

use crate::offline::dataset::DatasetError;
use crate::offline::work::{Interrupted, Progress, proceed};
use offsets::Pair;
use rayon::prelude::*;
use std::path::Path;

/// Largest offset between two videos that sound shows, seconds.
const LONGEST: f64 = 30.0;
/// Confidence from which the delay of two sounds is used.
const TRUSTED: f64 = 1.3;
/// Largest error of a pair of sounds, seconds: sources at several places.
const SOUND_ERROR: f64 = 0.005;
/// Largest error of a pair by motion, frames.
const MOTION_ERROR: f64 = 1.5;
/// Pairs that are compared between two looks at whether to go on.
const AT_ONCE: usize = 32;

/// Returns the offsets of videos by their sound, seconds; `None` for a video without sound, or whose sound is not that
/// of the others.
///
/// # Errors
/// No ffmpeg; a video that it cannot read; [`Interrupted`].
pub(crate) fn by_sound<P: AsRef<Path>>(
    videos: &[P],
    progress: &mut dyn Progress,
) -> Result<Vec<Option<Offset>>, DatasetError> {
    let mut sounds = Vec::new();
    progress.begin("sound", videos.len());
    for video in videos {
        proceed(progress)?;
        sounds.push(sound::sound(video.as_ref())?);
        progress.advance();
    }
    progress.finish();
    let pair = |(a, b): (usize, usize)| {
        let found = correlation::delay(sounds[a].as_ref()?, sounds[b].as_ref()?, LONGEST)?;
        let weight = found.confidence - 1.0;
        (found.confidence >= TRUSTED).then_some(Pair { a, b, seconds: found.seconds, weight })
    };
    Ok(offsets::offsets(videos.len(), &pairs(videos.len(), pair, progress)?, SOUND_ERROR))
}

/// Returns the offsets of cameras by what moves in their pictures, in frames (the usual time between two pictures):
/// found up to 12 frames, to about half a frame. `None` for a camera whose motion is not like that of the others.
///
/// # Errors
/// [`Interrupted`].
pub(crate) fn by_motion(cameras: &[Changes], progress: &mut dyn Progress) -> Result<Vec<Option<Offset>>, Interrupted> {
    let Some(frame) = motion::frame(cameras.iter().map(|camera| &*camera.times)) else {
        return Ok(vec![None; cameras.len()]);
    };
    let pair = |(a, b): (usize, usize)| {
        let [first, second] = epipolar::motions(&cameras[a], &cameras[b])?;
        let found = motion::lag(&first, &second, frame)?;
        Some(Pair { a, b, seconds: found.frames, weight: found.correlation })
    };
    Ok(offsets::offsets(cameras.len(), &pairs(cameras.len(), pair, progress)?, MOTION_ERROR))
}

/// Compares pairs of so many cameras. Returns those that could be compared.
fn pairs(
    count: usize,
    pair: impl Fn((usize, usize)) -> Option<Pair> + Sync,
    progress: &mut dyn Progress,
) -> Result<Vec<Pair>, Interrupted> {
    let (compared, mut found) = (offsets::compared(count), Vec::new());
    progress.begin("clocks", compared.len().div_ceil(AT_ONCE));
    for some in compared.chunks(AT_ONCE) {
        proceed(progress)?;
        found.par_extend(some.par_iter().filter_map(|&places| pair(places)));
        progress.advance();
    }
    progress.finish();
    Ok(found)
}
