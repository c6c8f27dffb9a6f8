//! The plugin of contact shadows: which system runs when.
//!
//! In: an app with Bevy's `PbrPlugin`, in which captures have bounds. Out: the same app with contact shadows.

use super::material::ContactShadowMaterial;
use super::place::{place_contact_shadows, spawn_contact_shadows};
use crate::plugin::render::update_bounds;
use bevy::app::{App, Plugin, PostUpdate};
use bevy::camera::visibility::VisibilitySystems;
use bevy::ecs::schedule::IntoScheduleConfigs;
use bevy::pbr::{MaterialPlugin, PbrPlugin};
use bevy::transform::TransformSystems;

/// Draws contact shadows. Part of [`GaussianCapturePlugin`](crate::GaussianCapturePlugin).
#[derive(Debug, Default, Clone, Copy)]
pub(crate) struct ContactShadowPlugin;

impl Plugin for ContactShadowPlugin {
    fn build(&self, app: &mut App) {
        if !app.is_plugin_added::<PbrPlugin>() {
            return;
        }
        app.add_plugins(MaterialPlugin::<ContactShadowMaterial>::default()).add_systems(
            PostUpdate,
            (
                spawn_contact_shadows.before(TransformSystems::Propagate),
                place_contact_shadows
                    .after(TransformSystems::Propagate)
                    .after(update_bounds)
                    .before(VisibilitySystems::VisibilityPropagate),
            ),
        );
    }
}
