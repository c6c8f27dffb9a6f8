//! The messages about playing.
//!
//! In: the events of a step of an entity. Out: each message in two ways: as a message for a `MessageReader`, and as an
//! event on the entity for observers: `commands.entity(capture).observe(|ended: On<PlaybackEnded>| ..)`.
//!
//! The entity is a capture or a [`TimelinePlayer`](super::TimelinePlayer). The events of one entity in one frame are
//! triggered in this order: seeked, started, paused; of each stretch that was played, its segment bounds and then its
//! markers; looped, ended.

use super::advance::Progress;
use super::markers::{Marker, crossed};
use super::span::Leg;
use crate::plugin::asset::send;
use crate::plugin::component::KeyFrames;
use bevy::ecs::entity::Entity;
use bevy::ecs::event::EntityEvent;
use bevy::ecs::message::{Message, MessageWriter};
use bevy::ecs::system::{Commands, SystemParam};

/// An entity starts to play: its first or another capture or timeline has been loaded, or
/// [`playing`](super::Playback::playing) was set.
///
/// # Examples
///
/// ```
/// use bevy::prelude::*;
/// use bevy_gs4d::prelude::*;
///
/// App::new().add_observer(|started: On<PlaybackStarted>| info!("{} plays", started.entity));
/// ```
#[derive(Message, EntityEvent, Debug, Clone, PartialEq)]
pub struct PlaybackStarted {
    /// The entity that plays.
    pub entity: Entity,
}

/// An entity was paused: [`playing`](super::Playback::playing) was cleared. Reaching the end is [`PlaybackEnded`].
///
/// # Examples
///
/// ```
/// use bevy::prelude::*;
/// use bevy_gs4d::prelude::*;
///
/// App::new().add_observer(|paused: On<PlaybackPaused>| info!("{} is paused", paused.entity));
/// ```
#[derive(Message, EntityEvent, Debug, Clone, PartialEq)]
pub struct PlaybackPaused {
    /// The entity that was paused.
    pub entity: Entity,
}

/// Time jumped: [`time`](super::Playback::time) was set, or the clock that the entity follows jumped.
///
/// # Examples
///
/// ```
/// use bevy::prelude::*;
/// use bevy_gs4d::prelude::*;
///
/// App::new().add_observer(|seeked: On<PlaybackSeeked>| info!("from {} s to {} s", seeked.from, seeked.to));
/// ```
#[derive(Message, EntityEvent, Debug, Clone, PartialEq)]
pub struct PlaybackSeeked {
    /// The entity whose time jumped.
    pub entity: Entity,
    /// The time before, in seconds since the start.
    pub from: f32,
    /// The time after, in seconds since the start.
    pub to: f32,
}

/// A bound between two segments of a capture's temporal filter, the start of the first segment or the end of the last
/// one was crossed or reached while playing. These bounds are the filter's key-frames
/// ([`GaussianCapture::key_frames`]); they are independent of the keyframes of an animation. For times that the game
/// defines, put [`Markers`] on the capture.
///
/// A bound at the time of a seek is crossed once playback continues. A step that is longer than four passes of a loop
/// sends the bounds of two to four passes.
///
/// [`GaussianCapture::key_frames`]: crate::asset::GaussianCapture::key_frames
/// [`Markers`]: super::Markers
///
/// # Examples
///
/// ```
/// use bevy::prelude::*;
/// use bevy_gs4d::playback::SegmentBoundCrossed;
/// use bevy_gs4d::prelude::*;
///
/// fn report(mut crossed: MessageReader<SegmentBoundCrossed>) {
///     for SegmentBoundCrossed { entity, index, time } in crossed.read() {
///         info!("{entity}: bound {index} at {time} s");
///     }
/// }
/// # bevy::ecs::system::assert_is_system(report);
/// ```
#[derive(Message, EntityEvent, Debug, Clone, PartialEq)]
pub struct SegmentBoundCrossed {
    /// The capture.
    pub entity: Entity,
    /// The bound, counted from 0: segment `index` begins there, and segment `index - 1` ends.
    pub index: u32,
    /// The bound's time, in seconds since the capture's start.
    pub time: f32,
}

/// A marker of a timeline, or of a capture with [`Markers`](super::Markers), was crossed or reached while playing.
/// Seeks and long steps are treated as for [`SegmentBoundCrossed`].
///
/// # Examples
///
/// ```
/// use bevy::prelude::*;
/// use bevy_gs4d::playback::MarkerReached;
/// use bevy_gs4d::prelude::*;
///
/// fn cue(mut markers: MessageReader<MarkerReached>) {
///     for marker in markers.read().filter(|marker| marker.name == "applause") {
///         info!("applause at {} s", marker.time);
///     }
/// }
/// # bevy::ecs::system::assert_is_system(cue);
/// ```
#[derive(Message, EntityEvent, Debug, Clone, PartialEq)]
pub struct MarkerReached {
    /// The timeline's player, or the capture.
    pub entity: Entity,
    /// The marker's name.
    pub name: String,
    /// The marker's time, in seconds since the start of the timeline or the capture.
    pub time: f32,
}

/// An entity reached an end of its range and starts over or reverses.
///
/// # Examples
///
/// ```
/// use bevy::prelude::*;
/// use bevy_gs4d::prelude::*;
///
/// /// Plays every pass of a loop at another speed.
/// fn vary(looped: On<PlaybackLooped>, mut players: Query<&mut Playback>) {
///     if let Ok(mut playback) = players.get_mut(looped.entity) {
///         playback.speed = if playback.speed == 1.0 { 0.5 } else { 1.0 };
///     }
/// }
///
/// App::new().add_observer(vary);
/// ```
#[derive(Message, EntityEvent, Debug, Clone, PartialEq)]
pub struct PlaybackLooped {
    /// The entity that loops.
    pub entity: Entity,
    /// Number of times that an end was reached in this step: 1 unless the step is longer than the range.
    pub turns: u32,
}

/// An entity has played once and stopped, or a follower has reached its end.
///
/// # Examples
///
/// ```
/// use bevy::prelude::*;
/// use bevy_gs4d::prelude::*;
///
/// fn remove(ended: On<PlaybackEnded>, mut commands: Commands) {
///     commands.entity(ended.entity).despawn();
/// }
///
/// App::new().add_observer(remove);
/// ```
#[derive(Message, EntityEvent, Debug, Clone, PartialEq)]
pub struct PlaybackEnded {
    /// The entity that ended.
    pub entity: Entity,
}

/// Sends the messages about playing.
#[derive(SystemParam)]
pub(super) struct Announcer<'w, 's> {
    commands: Commands<'w, 's>,
    started: MessageWriter<'w, PlaybackStarted>,
    paused: MessageWriter<'w, PlaybackPaused>,
    seeked: MessageWriter<'w, PlaybackSeeked>,
    bounds: MessageWriter<'w, SegmentBoundCrossed>,
    markers: MessageWriter<'w, MarkerReached>,
    looped: MessageWriter<'w, PlaybackLooped>,
    ended: MessageWriter<'w, PlaybackEnded>,
}

impl Announcer<'_, '_> {
    /// Sends the messages about a step. `crossed` sends the segment bounds and the markers on a played stretch.
    pub(super) fn report(&mut self, entity: Entity, progress: &Progress, mut crossed: impl FnMut(&mut Self, &Leg)) {
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

    /// Sends the segment bounds on a played stretch.
    pub(super) fn bounds(&mut self, entity: Entity, key_frames: &KeyFrames, leg: &Leg) {
        for index in key_frames.within(leg.from, leg.to, leg.inclusive) {
            let crossed = SegmentBoundCrossed { entity, index, time: key_frames.time(index) };
            send(&mut self.commands, &mut self.bounds, crossed);
        }
    }

    /// Sends the markers on a played stretch.
    pub(super) fn markers(&mut self, entity: Entity, markers: &[Marker], leg: &Leg) {
        for Marker { time, name } in crossed(markers, leg) {
            let reached = MarkerReached { entity, name: name.clone(), time: *time };
            send(&mut self.commands, &mut self.markers, reached);
        }
    }
}
