//! The plugin of pointer events.
//!
//! In: an app in which captures play, Bevy's `PickingPlugin`. Out: the same app, in which pointers hit captures.

use super::backend::{any_ray, update_hits};
use super::settings::CapturePickingSettings;
use bevy::app::{App, Plugin, PreUpdate};
use bevy::ecs::schedule::IntoScheduleConfigs;
use bevy::picking::PickingSystems;

/// Sends pointers' hits on captures, in apps with Bevy's `PickingPlugin`, whenever that is added. Part of
/// [`GaussianCapturePlugin`](crate::GaussianCapturePlugin).
#[derive(Debug, Default, Clone, Copy)]
pub(crate) struct CapturePickingPlugin;

impl Plugin for CapturePickingPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<CapturePickingSettings>()
            .add_systems(PreUpdate, update_hits.run_if(any_ray).in_set(PickingSystems::Backend));
    }
}
