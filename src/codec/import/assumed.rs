//! Sentences about times that a file does not have, so that they are assumed.
//!
//! In: the frames or the seconds of a clip, and [`ReadOptions`]. Out: a sentence with the assumed value and the option
//! that sets another one, unless an option is given.

use crate::codec::options::{FPS, ReadOptions};
use std::fmt::Display;

/// Returns the sentence about frames that are played at [`FPS`] frames a second.
pub(crate) fn speed(frames: impl Display, options: &ReadOptions) -> Option<String> {
    (options.fps.is_none() && options.duration_seconds.is_none()).then(|| {
        format!(
            "It does not have its speed: its {frames} frames are played at {FPS} a second; --fps sets another speed."
        )
    })
}

/// Returns the sentence about a clip of so many seconds.
pub(crate) fn duration(seconds: f32, options: &ReadOptions) -> Option<String> {
    options.duration_seconds.is_none().then(|| {
        format!("It does not have its duration: {seconds:.2} seconds are assumed; --duration sets another one.")
    })
}
