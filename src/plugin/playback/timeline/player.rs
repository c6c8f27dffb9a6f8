//! The components of a timeline in the world.
//!
//! In: a handle to a [`Timeline`] on an entity. Out: that entity as the clock and the parent of one child for each track.

use super::asset::Timeline;
use super::clip::Clip;
use crate::plugin::component::GaussianCapture3d;
use crate::plugin::playback::clock::PlaybackClock;
use crate::plugin::playback::component::Playback;
use bevy::asset::Handle;
use bevy::camera::visibility::Visibility;
use bevy::ecs::component::Component;
use bevy::ecs::reflect::ReflectComponent;
use bevy::reflect::Reflect;
use bevy::reflect::std_traits::ReflectDefault;
use bevy::transform::components::Transform;

/// Plays a timeline.
///
/// Its [`Playback`] is the playhead: play, pause, seek, reverse and loop it like that of a capture, or let it
/// [follow a clock](crate::playback::FollowsClock). Its own [`PlaybackClock`] shows the time of the playhead to its tracks. Other captures
/// and timelines can follow the player, too. It begins to play once the captures of all clips can be drawn; one that has failed is not waited
/// for.
///
/// Each track is played by the child with the [`TimelineTrack`] of its name. For a track without such a child, one is spawned.
///
/// Default: a handle of no asset, with which nothing plays.
///
/// # Examples
///
/// ```
/// use bevy::prelude::*;
/// use bevy_gs4d::prelude::*;
///
/// fn setup(mut commands: Commands, assets: Res<AssetServer>) {
///     commands.spawn((TimelinePlayer(assets.load("demo.timeline.ron")), Playback::once()));
/// }
/// # bevy::ecs::system::assert_is_system(setup);
/// ```
#[derive(Component, Reflect, Debug, Default, Clone, PartialEq, Eq)]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
#[require(Playback, PlaybackClock = PlaybackClock::manual(), Transform, Visibility)]
pub struct TimelinePlayer(pub Handle<Timeline>);

/// Names the track that sets this entity's capture, playback, fade and visibility: a track of the timeline on the parent entity.
///
/// Spawn it yourself, as a child of the [`TimelinePlayer`], to choose its transform and its other components. Default: the empty name.
///
/// # Examples
///
/// ```
/// use bevy::prelude::*;
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
#[require(GaussianCapture3d, ClipFade, Directed)]
pub struct TimelineTrack(pub String);

/// A factor on a capture's opacity, from 0 to 1, beside that of its [`CaptureSettings`](crate::render::CaptureSettings): a timeline's fades
/// set it. Default: 1.
#[derive(Component, Reflect, Debug, Clone, Copy, PartialEq)]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
pub struct ClipFade(pub f32);

impl Default for ClipFade {
    fn default() -> Self {
        Self(1.0)
    }
}

/// The clip that a track's entity plays; `None` before its first.
#[derive(Component, Debug, Default)]
pub(in crate::plugin::playback) struct Directed(pub(super) Option<Clip>);
