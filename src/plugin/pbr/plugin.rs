//! The plugin that combines captures with lit meshes.
//!
//! In: an app in which captures are drawn. Out: the same app with the order among lit meshes, shading, cast shadows and contact shadows.

use super::contact_shadow::ContactShadowPlugin;
use super::order;
use super::shade::ShadePlugin;
use super::shadow::CaptureShadowPlugin;
use bevy::app::{App, Plugin};

/// Combines captures with lit meshes. Part of [`GaussianCapturePlugin`](crate::GaussianCapturePlugin).
#[derive(Debug, Default, Clone, Copy)]
pub(crate) struct CapturePbrPlugin;

impl Plugin for CapturePbrPlugin {
    fn build(&self, app: &mut App) {
        order::build(app);
        app.add_plugins((ShadePlugin, CaptureShadowPlugin, ContactShadowPlugin));
    }
}
