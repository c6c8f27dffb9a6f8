//! The plugin of everything that joins captures and lit meshes.
//!
//! In: an app in which captures are drawn. Out: the same app with the parts of this folder.

use super::contact_shadow::ContactShadowPlugin;
use super::order;
use super::shade::ShadePlugin;
use super::shadow::CaptureShadowPlugin;
use bevy::app::{App, Plugin};

/// Joins captures and lit meshes. Part of [`GaussianCapturePlugin`](crate::GaussianCapturePlugin).
#[derive(Debug, Default, Clone, Copy)]
pub(crate) struct CapturePbrPlugin;

impl Plugin for CapturePbrPlugin {
    fn build(&self, app: &mut App) {
        order::build(app);
        app.add_plugins((ShadePlugin, CaptureShadowPlugin, ContactShadowPlugin));
    }
}
