//! Playheads: the playback of an entity as the schedule of files sees it.
//!
//! In: a [`Playback`], the duration of its capture. Out: a [`Playhead`].

use crate::codec::stream::{Playhead, Turn};
use crate::plugin::playback::{Playback, Repeat};

/// Seconds by which what is played now comes before times at which nothing plays.
const STILL_DELAY: f64 = 1e-3;

/// Returns where a playback is and where it goes.
pub(super) fn playhead(playback: &Playback, duration: f32) -> Playhead {
    let direction = if playback.returning { -1.0 } else { 1.0 };
    let velocity = if playback.playing { direction * f64::from(playback.speed) } else { 0.0 };
    let turn = match playback.repeat {
        Repeat::Once => Turn::Stop,
        Repeat::Loop => Turn::Loop,
        Repeat::PingPong => Turn::Return,
    };
    let range = [playback.start, playback.end.min(duration)].map(f64::from);
    Playhead { seconds: playback.time.into(), velocity, range, turn, delay: 0.0 }
}

/// Returns a time at which nothing plays: that of a picture that stays, or one to which the game may jump.
pub(super) fn still(seconds: f32) -> Playhead {
    let range = [seconds; 2].map(f64::from);
    Playhead { seconds: seconds.into(), velocity: 0.0, range, turn: Turn::Stop, delay: STILL_DELAY }
}
