//! The plugin that combines captures with lit meshes.
//!
//! In: an app in which captures are drawn. Out: order among lit meshes, shading, cast shadows and contact shadows.

use super::{contact_shadow, order, shade, shadow};
use crate::plugin::render::has_captures;
use bevy::app::{App, Plugin};
use bevy::render::RenderApp;

/// Combines captures with lit meshes: fog, shadows, light of the scene. Part of
/// [`GaussianCapturePlugins`](crate::GaussianCapturePlugins).
#[derive(Debug, Default, Clone, Copy)]
pub struct CapturePbrPlugin;

impl Plugin for CapturePbrPlugin {
    fn build(&self, app: &mut App) {
        add_once(app);
    }

    /// Bevy's plugins may have been added later than this plugin.
    fn finish(&self, app: &mut App) {
        add_once(app);
    }
}

/// Adds the systems, unless they have been added, to a render world in which captures are drawn.
fn add_once(app: &mut App) {
    if app.get_sub_app(RenderApp).is_some_and(|render_app| has_captures(render_app) && !order::is_built(render_app)) {
        order::build(app);
        shade::build(app);
        shadow::build(app);
        contact_shadow::build(app);
    }
}
