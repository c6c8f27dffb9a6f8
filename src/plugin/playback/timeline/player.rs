//! The components of a timeline in the world.
//!
//! In: a handle to a [`Timeline`] on an entity. Out: that entity as the timeline's clock and parent, one child for each track.

use super::asset::{Clip, Timeline};
use crate::plugin::component::GaussianCapture3d;
use crate::plugin::playback::{Playback, PlaybackClock};
use bevy::asset::Handle;
use bevy::camera::visibility::Visibility;
use bevy::ecs::component::Component;
use bevy::ecs::reflect::ReflectComponent;
use bevy::reflect::Reflect;
use bevy::reflect::std_traits::ReflectDefault;
use bevy::transform::components::Transform;

/// Plays a timeline: `commands.spawn(TimelinePlayer(asset_server.load("demo.timeline.ron")))`.
///
/// Its [`Playback`] is the playhead: play, pause, seek, reverse and loop it like that of a capture, or let it
/// [follow a clock](crate::plugin::playback::FollowsClock). Its own [`PlaybackClock`] shows the same time to the tracks, so that anything
/// else can follow it, too, except other timelines: of two that are to keep together, both follow a third clock.
///
/// Each track is played by the child that has the [`TimelineTrack`] of its name; for a track without one, a child is spawned.
#[derive(Component, Reflect, Debug, Default, Clone, PartialEq, Eq)]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
#[require(Playback, PlaybackClock = PlaybackClock::manual(), Transform, Visibility)]
pub struct TimelinePlayer(pub Handle<Timeline>);

/// Lets the timeline on the parent entity decide what this entity shows: its capture, playback, fade and visibility. Spawn it
/// yourself, as a child of the [`TimelinePlayer`], to choose its transform and what else is on it.
#[derive(Component, Reflect, Debug, Default, Clone, PartialEq, Eq)]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
#[require(GaussianCapture3d, ClipFade, Directed)]
pub struct TimelineTrack(pub String);

/// How much of a capture shows, from 0 (nothing) to 1 (all of it, as by default): a timeline's fades set it.
#[derive(Component, Reflect, Debug, Clone, Copy, PartialEq)]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
pub struct ClipFade(pub f32);

impl Default for ClipFade {
    fn default() -> Self {
        Self(1.0)
    }
}

/// The clip that a track's entity has been given.
#[derive(Component, Debug, Default)]
pub(in crate::plugin::playback) struct Directed(pub(super) Option<Clip>);
