//! The components of a timeline in the world.
//!
//! In: a handle to a [`Timeline`] on an entity. Out: this entity as a clock, and as the parent of a child per track.

use super::asset::Timeline;
use super::clip::Clip;
use super::next::NextClip;
use crate::plugin::component::GaussianCapture3d;
use crate::plugin::playback::clock::PlaybackClock;
use crate::plugin::playback::component::Playback;
use bevy::asset::Handle;
use bevy::camera::visibility::Visibility;
use bevy::ecs::component::Component;
use bevy::ecs::reflect::ReflectComponent;
use bevy::ecs::template::FromTemplate;
use bevy::reflect::Reflect;
use bevy::reflect::std_traits::ReflectDefault;
use bevy::transform::components::Transform;

/// Plays a timeline.
///
/// The player's [`Playback`] is the playhead: play, pause, seek, reverse and loop it like the playback of a capture, or
/// let it [follow a clock](crate::playback::FollowsClock). The player's [`PlaybackClock`] has the time of the playhead,
/// for its tracks. Other captures and timelines can also follow the player. It begins to play once the captures of all
/// clips can be drawn and its sounds are loaded; those that fail are not awaited.
///
/// Each track is played by the child with the [`TimelineTrack`] of its name. Missing children are spawned.
///
/// Default: a handle without an asset; nothing plays.
///
/// # Examples
///
/// ```
/// use bevy::prelude::*;
/// use bevy_gs4d::playback::TimelinePlayer;
/// use bevy_gs4d::prelude::*;
///
/// fn setup(mut commands: Commands, assets: Res<AssetServer>) {
///     commands.spawn((TimelinePlayer(assets.load("demo.timeline.ron")), Playback::once()));
/// }
/// # bevy::ecs::system::assert_is_system(setup);
/// ```
#[derive(Component, FromTemplate, Reflect, Debug, Default, Clone, PartialEq, Eq)]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
#[type_path = "bevy_gs4d::playback"]
#[require(Playback, PlaybackClock = PlaybackClock::manual(), Transform, Visibility)]
pub struct TimelinePlayer(pub Handle<Timeline>);

/// Names the track of the parent's timeline that sets this entity's capture, playback, fade and visibility.
///
/// To choose the transform and other components of a track's entity, spawn it as a child of the [`TimelinePlayer`].
/// Default: the empty name.
///
/// # Examples
///
/// ```
/// use bevy::prelude::*;
/// use bevy_gs4d::playback::{TimelinePlayer, TimelineTrack};
/// use bevy_gs4d::prelude::*;
///
/// fn setup(mut commands: Commands, assets: Res<AssetServer>) {
///     let left = (TimelineTrack("left".into()), Transform::from_xyz(-1.0, 0.0, 0.0));
///     commands.spawn((TimelinePlayer(assets.load("demo.timeline.ron")), children![left]));
/// }
/// # bevy::ecs::system::assert_is_system(setup);
/// ```
#[derive(Component, Reflect, Debug, Default, Clone, PartialEq, Eq)]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
#[type_path = "bevy_gs4d::playback"]
#[require(GaussianCapture3d, ClipFade, PlayedClip, NextClip)]
pub struct TimelineTrack(pub String);

/// A factor on a capture's opacity, from 0 to 1, in addition to the opacity of its
/// [`CaptureSettings`](crate::render::CaptureSettings). A timeline's fades set it. Default: 1.
#[derive(Component, Reflect, Debug, Clone, Copy, PartialEq)]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
#[type_path = "bevy_gs4d::playback"]
pub struct ClipFade(pub f32);

impl Default for ClipFade {
    fn default() -> Self {
        Self(1.0)
    }
}

/// The clip that a track's entity plays; `None` before its first clip.
#[derive(Component, Debug, Default)]
pub(in crate::plugin::playback) struct PlayedClip(pub(super) Option<Clip>);
