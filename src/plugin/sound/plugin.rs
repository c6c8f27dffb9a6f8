//! The plugin of sounds.
//!
//! In: an app in which captures and timelines play. Out: the same app, in which every sound has a
//! [`SoundState`](super::SoundState); with the feature `bevy_audio` sounds are heard.

use super::component::{SoundState, TimelineSound};
use super::decoding::{DecodedSounds, has_decoded_sounds};
use super::systems::{CaptureSoundSystems, bind_sounds, follow_captures, follow_timelines, rest_removed};
use crate::plugin::asset::{set_up, set_up_late};
use crate::plugin::playback::{PlaybackSystems, Timeline, TimelinePlayer};
use bevy::app::{App, Plugin, Update};
use bevy::asset::Assets;
use bevy::ecs::schedule::common_conditions::{any_with_component, resource_exists};
use bevy::ecs::schedule::{IntoScheduleConfigs, SystemCondition};
use bevy::time::{Real, Time};

/// Plays sounds beside captures. Part of [`GaussianCapturePlugins`](crate::GaussianCapturePlugins). With the feature
/// `bevy_audio` it needs Bevy's `AudioPlugin`, one of the `DefaultPlugins`.
#[derive(Debug, Default, Clone, Copy)]
pub struct CaptureSoundPlugin;

impl Plugin for CaptureSoundPlugin {
    fn build(&self, app: &mut App) {
        set_up::<Self>(app, add);
    }

    fn finish(&self, app: &mut App) {
        set_up_late::<Self>(app, "CaptureSoundPlugin", add);
        #[cfg(feature = "bevy_audio")]
        super::output::add(app);
    }
}

fn add(app: &mut App) {
    app.init_resource::<DecodedSounds>()
        .configure_sets(Update, CaptureSoundSystems.after(PlaybackSystems::Advance))
        .add_systems(
            Update,
            (
                (
                    bind_sounds.run_if(any_with_component::<TimelinePlayer>),
                    follow_timelines.run_if(any_with_component::<TimelineSound>),
                )
                    .chain()
                    // Without the plugin of playback there are no timelines.
                    .run_if(resource_exists::<Assets<Timeline>>),
                (follow_captures, rest_removed),
            )
                .chain()
                .run_if(resource_exists::<Time<Real>>)
                .run_if(
                    any_with_component::<SoundState>
                        .or_else(any_with_component::<TimelinePlayer>)
                        .or_else(has_decoded_sounds),
                )
                .in_set(CaptureSoundSystems),
        );
}
