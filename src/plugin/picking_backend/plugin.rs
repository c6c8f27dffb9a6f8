//! The plugin of the picking backend.
//!
//! In: an app in which captures play, with Bevy's `PickingPlugin`. Out: the same app, in which pointers hit captures.

use super::backend::{any_ray, update_hits};
use super::searches::{Searches, any_search};
use super::settings::CapturePickingSettings;
use crate::plugin::asset::{set_up, set_up_late};
use bevy::app::{App, Plugin, PreUpdate};
use bevy::ecs::schedule::{IntoScheduleConfigs, SystemCondition};
use bevy::picking::PickingSystems;

/// Sends the hits of pointers on captures in apps with Bevy's `PickingPlugin`, which may be added before or after. Part
/// of [`GaussianCapturePlugins`](crate::GaussianCapturePlugins).
#[derive(Debug, Default, Clone, Copy)]
pub struct CapturePickingPlugin;

impl Plugin for CapturePickingPlugin {
    fn build(&self, app: &mut App) {
        set_up::<Self>(app, add);
    }

    fn finish(&self, app: &mut App) {
        set_up_late::<Self>(app, "CapturePickingPlugin", add);
    }
}

fn add(app: &mut App) {
    app.init_resource::<CapturePickingSettings>()
        .init_resource::<Searches>()
        .add_systems(PreUpdate, update_hits.run_if(any_ray.or_else(any_search)).in_set(PickingSystems::Backend));
}
