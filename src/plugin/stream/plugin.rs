//! The plugin of streaming.
//!
//! In: an app in which captures load and play. Out: the same app, in which captures in chunk files are streamed.

use super::messages::{CaptureBuffered, CaptureBuffering, CaptureStalled};
use super::pictures::{begin_pictures, show_pictures};
use super::settings::StreamBudget;
use super::streams::{Streams, fetch_files};
use crate::plugin::asset::{set_up, set_up_late};
use crate::plugin::playback::PlaybackSystems;
use bevy::app::{App, Plugin, Update};
use bevy::ecs::schedule::{IntoScheduleConfigs, SystemSet};

/// Streams captures in chunk files. Part of [`GaussianCapturePlugins`](crate::GaussianCapturePlugins). Without it such
/// captures stay at [`CaptureState::Loading`](crate::asset::CaptureState::Loading).
#[derive(Debug, Default, Clone, Copy)]
pub struct CaptureStreamPlugin;

/// The set of the systems that stream captures: in `Update`, after
/// [`PlaybackSystems::Advance`](crate::playback::PlaybackSystems::Advance).
#[derive(SystemSet, Debug, Clone, PartialEq, Eq, Hash)]
pub struct CaptureStreamSystems;

impl Plugin for CaptureStreamPlugin {
    fn build(&self, app: &mut App) {
        set_up::<Self>(app, add);
    }

    fn finish(&self, app: &mut App) {
        set_up_late::<Self>(app, "CaptureStreamPlugin", add);
    }
}

fn add(app: &mut App) {
    app.init_resource::<Streams>()
        .init_resource::<StreamBudget>()
        .add_message::<CaptureBuffering>()
        .add_message::<CaptureBuffered>()
        .add_message::<CaptureStalled>()
        .configure_sets(Update, CaptureStreamSystems.after(PlaybackSystems::Advance).before(PlaybackSystems::Colliders))
        .add_systems(Update, begin_pictures.before(PlaybackSystems::Advance))
        .add_systems(Update, (fetch_files, show_pictures).chain().in_set(CaptureStreamSystems));
}
