//! A sound of a timeline.
//!
//! In: a sound, when it begins, and how loud it is. Out: a [`SoundClip`], which the part `sound` plays.

use super::clip::is_time;
use super::error::InvalidTimeline;
use crate::plugin::component::SoundTrack;
use bevy::asset::{Handle, VisitAssetDependencies};

/// A sound that is played beside the clips of a timeline, at the time of its player: forward, backward, faster, slower,
/// and silent while the player rests. Its pitch changes with the speed.
#[derive(VisitAssetDependencies, Debug, Clone, PartialEq)]
pub struct SoundClip {
    /// The sound.
    #[dependency]
    pub sound: Handle<SoundTrack>,
    /// When its first frame is heard, in seconds of the timeline: 0 or later.
    pub start: f32,
    /// A factor on its samples, 0 to 1.
    pub volume: f32,
}

impl SoundClip {
    /// Checks the numbers of the sound with this number, counted from 1.
    pub(super) fn check(&self, sound: usize) -> Result<(), InvalidTimeline> {
        let refused = |field, value, must| Err(InvalidTimeline::SoundNumber { sound, field, value, must });
        if !is_time(self.start) {
            return refused("start", self.start, "0 or later, in seconds");
        }
        if !(0.0..=1.0).contains(&self.volume) {
            return refused("volume", self.volume, "0 to 1");
        }
        Ok(())
    }
}
