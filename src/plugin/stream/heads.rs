//! Playheads: the playback of an entity as the schedule of files sees it.
//!
//! In: a [`Playback`], the duration of its capture. Out: a [`Playhead`].

use crate::codec::stream::{Playhead, Turn};
use crate::plugin::playback::{Playback, Repeat};

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
