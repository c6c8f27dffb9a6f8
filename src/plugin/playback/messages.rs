//! What playback tells the game.
//!
//! In: what happened to an entity. Out: each of these both as a message, to be read by a system with a
//! `MessageReader`, and as an event on that entity, to be observed: `commands.entity(capture).observe(|ended: On<PlaybackEnded>| ..)`.
//!
//! The entity has a [`Playback`](super::Playback): a capture or a [`TimelinePlayer`](super::TimelinePlayer). Those of one entity
//! and frame come in the order of this file.

use super::span::Leg;
use super::state::Progress;
use crate::plugin::asset::{KeyFrames, send};
use bevy::ecs::entity::Entity;
use bevy::ecs::event::EntityEvent;
use bevy::ecs::message::{Message, MessageWriter};
use bevy::ecs::system::{Commands, SystemParam};

/// It plays, and did not before: it has been loaded, or `playing` was set.
#[derive(Message, EntityEvent, Debug, Clone, PartialEq)]
pub struct PlaybackStarted {
    /// What plays.
    pub entity: Entity,
}

/// It no longer plays because `playing` was cleared. Coming to an end is [`PlaybackEnded`].
#[derive(Message, EntityEvent, Debug, Clone, PartialEq)]
pub struct PlaybackPaused {
    /// What was paused.
    pub entity: Entity,
}

/// Time jumped: `time` was set, or the clock that it follows jumped.
#[derive(Message, EntityEvent, Debug, Clone, PartialEq)]
pub struct PlaybackSeeked {
    /// What was sent elsewhere.
    pub entity: Entity,
    /// Where it was, seconds since the start.
    pub from: f32,
    /// Where it went.
    pub to: f32,
}

/// A key-frame of a capture's temporal filter was crossed, or arrived at, while playing.
///
/// A moment that was sought counts when it is played from. A step that is longer than four passes of a loop tells of the last few.
#[derive(Message, EntityEvent, Debug, Clone, PartialEq)]
pub struct KeyFrameCrossed {
    /// The capture.
    pub entity: Entity,
    /// Which key-frame, counted from 0.
    pub index: u32,
    /// When it is, seconds since the capture's start.
    pub time: f32,
}

/// A marker of a timeline was crossed, or arrived at, while playing, like [`KeyFrameCrossed`].
#[derive(Message, EntityEvent, Debug, Clone, PartialEq)]
pub struct MarkerReached {
    /// The timeline's player.
    pub entity: Entity,
    /// The marker's name.
    pub name: String,
    /// When it is, seconds since the timeline's start.
    pub time: f32,
}

/// It came to an end of its range and starts over, or turns round.
#[derive(Message, EntityEvent, Debug, Clone, PartialEq)]
pub struct PlaybackLooped {
    /// What loops.
    pub entity: Entity,
    /// How often within the step: 1 unless the step is longer than the range.
    pub turns: u32,
}

/// It has been played once and stopped, or has been carried to its end by the clock that it follows.
#[derive(Message, EntityEvent, Debug, Clone, PartialEq)]
pub struct PlaybackEnded {
    /// What ended.
    pub entity: Entity,
}

/// Tells the game.
#[derive(SystemParam)]
pub(super) struct Announcer<'w, 's> {
    commands: Commands<'w, 's>,
    started: MessageWriter<'w, PlaybackStarted>,
    paused: MessageWriter<'w, PlaybackPaused>,
    seeked: MessageWriter<'w, PlaybackSeeked>,
    key_frames: MessageWriter<'w, KeyFrameCrossed>,
    markers: MessageWriter<'w, MarkerReached>,
    looped: MessageWriter<'w, PlaybackLooped>,
    ended: MessageWriter<'w, PlaybackEnded>,
}

impl Announcer<'_, '_> {
    /// What happened in a step; `crossed` tells what was on the way.
    pub(super) fn tell(&mut self, entity: Entity, progress: &Progress, mut crossed: impl FnMut(&mut Self, &Leg)) {
        if let Some([from, to]) = progress.seeked {
            send(&mut self.commands, &mut self.seeked, PlaybackSeeked { entity, from, to });
        }
        if progress.started {
            send(&mut self.commands, &mut self.started, PlaybackStarted { entity });
        }
        if progress.paused {
            send(&mut self.commands, &mut self.paused, PlaybackPaused { entity });
        }
        if let Some(travel) = &progress.travel {
            travel.legs().for_each(|leg| crossed(self, &leg));
            if travel.turns > 0 {
                send(&mut self.commands, &mut self.looped, PlaybackLooped { entity, turns: travel.turns });
            }
        }
        if progress.ended {
            send(&mut self.commands, &mut self.ended, PlaybackEnded { entity });
        }
    }

    /// Key-frames that were crossed.
    pub(super) fn key_frames(&mut self, entity: Entity, key_frames: &KeyFrames, leg: &Leg) {
        for index in key_frames.within(leg.from, leg.to, leg.inclusive) {
            let crossed = KeyFrameCrossed { entity, index, time: key_frames.time(index) };
            send(&mut self.commands, &mut self.key_frames, crossed);
        }
    }

    /// A marker that was crossed.
    pub(super) fn marker(&mut self, entity: Entity, name: &str, time: f32) {
        send(&mut self.commands, &mut self.markers, MarkerReached { entity, name: name.to_owned(), time });
    }
}
