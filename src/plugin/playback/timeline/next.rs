//! What a track plays next, so that captures in chunk files are loaded before they are shown.
//!
//! In: the track, the time of its player, and how the player goes on. Out: [`NextClip`].

use super::asset::Track;
use super::clip::Clip;
use crate::plugin::component::GaussianCapture;
use crate::plugin::playback::component::Playback;
use crate::plugin::playback::repeat::Repeat;
use bevy::asset::Handle;
use bevy::ecs::component::Component;

/// What a track's entity plays next; `None` if no clip follows.
#[derive(Component, Debug, Default, Clone, PartialEq)]
pub(crate) struct NextClip(pub(crate) Option<Cue>);

/// Where a capture begins to play.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Cue {
    pub(crate) capture: Handle<GaussianCapture>,
    /// The first moment that is shown, seconds of the capture.
    pub(crate) seconds: f64,
    /// Seconds of the capture per second, from then on.
    pub(crate) velocity: f64,
    /// The first and the last moment that are played, seconds of the capture.
    pub(crate) range: [f64; 2],
    /// Seconds until then.
    pub(crate) after: f64,
}

impl NextClip {
    /// Returns the clip after that of `time`, in seconds of the timeline, which lasts `duration` seconds. A player at rest
    /// counts as one that plays forwards at speed 1, since it may be started at any time.
    pub(super) fn of(track: &Track, time: f64, playback: &Playback, duration: f32) -> Self {
        let speed = f64::from(playback.speed) * if playback.returning { -1.0 } else { 1.0 };
        let speed = if playback.playing && speed != 0.0 { speed } else { 1.0 };
        let [first, last] = [playback.start, playback.end.min(duration)].map(f64::from);
        let bounds = |clip: &Clip| [f64::from(clip.start), f64::from(clip.end())];
        let is_played = |clip: &&Clip| bounds(clip)[1] > first && bounds(clip)[0] < last;
        let mut clips = track.clips.iter().filter(is_played);
        // Where the player gets into the clip, and after how many seconds of the timeline.
        let loops = playback.repeat == Repeat::Loop;
        let entered = if speed > 0.0 {
            let later = clips.clone().find(|clip| bounds(clip)[0] > time);
            let mut again = || clips.next().filter(|_| loops).map(|clip| (clip, bounds(clip)[0].max(first)));
            let later = later.map(|clip| (clip, bounds(clip)[0], bounds(clip)[0] - time));
            later.or_else(|| again().map(|(clip, at)| (clip, at, last - time + at - first)))
        } else {
            let earlier = clips.clone().rfind(|clip| bounds(clip)[1] < time);
            let mut again = || clips.next_back().filter(|_| loops).map(|clip| (clip, bounds(clip)[1].min(last)));
            let earlier = earlier.map(|clip| (clip, bounds(clip)[1], time - bounds(clip)[1]));
            earlier.or_else(|| again().map(|(clip, at)| (clip, at, time - first + last - at)))
        };
        Self(entered.map(|(clip, at, away)| {
            let own = f64::from(clip.speed);
            let begin = f64::from(clip.range[usize::from(own < 0.0)]);
            Cue {
                capture: clip.capture.clone(),
                seconds: begin + (at - f64::from(clip.start)) * own,
                velocity: own * speed,
                range: clip.range.map(f64::from),
                after: away.max(0.0) / speed.abs(),
            }
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Clips of two captures from 1 to 3 s and from 4 to 5 s, the second backwards at twice the speed, of 6 s.
    fn next(time: f64, playback: &Playback) -> Option<[f64; 3]> {
        let clip = |start, range, speed| Clip { capture: Handle::default(), start, range, speed, fade: [0.0; 2] };
        let clips = vec![clip(1.0, [10.0, 12.0], 1.0), clip(4.0, [20.0, 22.0], -2.0)];
        let track = Track { name: "one".into(), clips };
        NextClip::of(&track, time, playback, 6.0).0.map(|cue| [cue.seconds, cue.velocity, cue.after])
    }

    #[test]
    fn the_next_clip_is_that_ahead_of_the_player() {
        let once = Playback::once();
        assert_eq!(next(0.5, &once), Some([10.0, 1.0, 0.5]), "before the first clip");
        assert_eq!(next(2.0, &once), Some([22.0, -2.0, 2.0]), "in it: the second, from its last moment");
        assert_eq!(next(4.5, &once), None, "nothing follows");
        assert_eq!(next(2.0, &Playback { speed: 4.0, ..once }), Some([22.0, -8.0, 0.5]), "four times as soon");
        assert_eq!(next(2.0, &Playback { playing: false, ..once }), Some([22.0, -2.0, 2.0]), "at rest, as at speed 1");
    }

    #[test]
    fn a_loop_begins_again_with_the_first_clip() {
        let looped = Playback::default();
        assert_eq!(next(4.5, &looped), Some([10.0, 1.0, 2.5]), "1.5 s to the end, and one to the clip");
        let within = Playback { start: 2.0, end: 4.2, ..looped };
        assert_eq!(next(4.1, &within).map(|[seconds, ..]| seconds), Some(11.0), "a loop that begins in the clip");
        assert_eq!(next(4.5, &Playback { end: 0.5, ..looped }), None, "a loop without a clip");
    }

    #[test]
    fn a_player_that_goes_backwards_gets_to_the_ends_of_clips() {
        let back = Playback { speed: -1.0, ..Playback::once() };
        assert_eq!(next(4.5, &back), Some([12.0, -1.0, 1.5]), "the end of the first clip");
        assert_eq!(next(5.5, &back), Some([20.0, 2.0, 0.5]), "the end of the second, which is its first moment");
        assert_eq!(next(2.0, &back), None, "nothing follows");
        let looped = Playback { repeat: Repeat::Loop, ..back };
        assert_eq!(next(2.0, &looped), Some([20.0, 2.0, 3.0]), "2 s to the start, and one from the end");
        let returning = Playback { repeat: Repeat::PingPong, returning: true, ..Playback::default() };
        assert_eq!(next(4.5, &returning), Some([12.0, -1.0, 1.5]), "the returning pass");
    }
}
