//! The plugin of the picking backend.
//!
//! In: an app in which captures play, with Bevy's `PickingPlugin`. Out: the same app, in which pointers hit captures.

use super::backend::{any_ray, update_hits};
use super::searches::{Searches, any_search};
use super::settings::CapturePickingSettings;
use bevy::app::{App, Plugin, PreUpdate};
use bevy::ecs::schedule::{IntoScheduleConfigs, SystemCondition};
use bevy::picking::PickingSystems;

/// Sends the hits of pointers on captures in apps with Bevy's `PickingPlugin`, which may be added before or after. Part of
/// [`GaussianCapturePlugin`](crate::GaussianCapturePlugin).
#[derive(Debug, Default, Clone, Copy)]
pub(crate) struct CapturePickingPlugin;

impl Plugin for CapturePickingPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<CapturePickingSettings>()
            .init_resource::<Searches>()
            .add_systems(PreUpdate, update_hits.run_if(any_ray.or_else(any_search)).in_set(PickingSystems::Backend));
    }
}
