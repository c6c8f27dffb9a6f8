//! The plugin of playback: which system runs when.
//!
//! In: an app with Bevy's `AssetPlugin` and `TimePlugin`. Out: the same app, in which clocks, timelines and captures advance.

use super::component::Playback;
use super::messages::{
    MarkerReached, PlaybackEnded, PlaybackLooped, PlaybackPaused, PlaybackSeeked, PlaybackStarted, SegmentBoundCrossed,
};
use super::systems::{PlaybackSystems, advance_captures, run_clocks, warn_of_missing_handles};
use super::timeline::{Timeline, TimelineLoader, advance_timelines, bind_tracks, direct_tracks};
use crate::plugin::component::GaussianCapture3d;
use bevy::app::{App, Last, Plugin, Update};
use bevy::asset::AssetApp;
use bevy::ecs::schedule::IntoScheduleConfigs;

/// Plays captures and timelines. Part of [`GaussianCapturePlugin`](crate::GaussianCapturePlugin).
#[derive(Debug, Default, Clone, Copy)]
pub(crate) struct PlaybackPlugin;

impl Plugin for PlaybackPlugin {
    fn build(&self, app: &mut App) {
        use PlaybackSystems::{Advance, Clocks, Timelines};
        app.init_asset::<Timeline>()
            .register_required_components::<GaussianCapture3d, Playback>()
            .init_asset_loader::<TimelineLoader>()
            .add_message::<PlaybackStarted>()
            .add_message::<PlaybackPaused>()
            .add_message::<PlaybackSeeked>()
            .add_message::<SegmentBoundCrossed>()
            .add_message::<MarkerReached>()
            .add_message::<PlaybackLooped>()
            .add_message::<PlaybackEnded>()
            .configure_sets(Update, (Clocks, Timelines, Advance).chain())
            .add_systems(
                Update,
                (
                    run_clocks.in_set(Clocks),
                    (bind_tracks, advance_timelines, direct_tracks).chain().in_set(Timelines),
                    advance_captures.in_set(Advance),
                ),
            )
            // A handle may follow in the same frame.
            .add_systems(Last, warn_of_missing_handles);
    }
}
