//! Shade requests: the cameras and captures whose picture other systems change before it reaches the target.
//!
//! In: requests of systems of the extract schedule, in every frame. Out: [`ShadeRequests`], from which
//! [`prepare`](super::prepare) decides for each camera whether [`CaptureSystems::Shade`](crate::plugin::render::CaptureSystems) needs a
//! separate picture and depths.

use super::capture_views::Drawn;
use bevy::ecs::resource::Resource;
use bevy::render::sync_world::{MainEntity, MainEntityHashSet};

/// The requests for a shaded picture, by entity of the main world. Written by systems of the extract schedule.
#[derive(Resource, Default)]
pub(crate) struct ShadeRequests {
    /// Cameras whose picture is shaded for any capture.
    pub(crate) cameras: MainEntityHashSet,
    /// Captures that are shaded in any camera.
    pub(crate) captures: MainEntityHashSet,
}

impl ShadeRequests {
    /// Returns whether the picture of a camera that draws these captures is shaded.
    pub(in crate::plugin::render) fn want(&self, camera: MainEntity, drawn: &[Drawn]) -> bool {
        self.cameras.contains(&camera) || drawn.iter().any(|drawn| self.captures.contains(&drawn.entity))
    }
}
