//! Shade requests: the cameras and captures for which others work on the captures' picture before it reaches the target.
//!
//! In: what is found during extraction, in every frame. Out: [`ShadeRequests`], by which [`prepare`](super::prepare) decides for each
//! camera whether there is something between [`CaptureSystems::Record`](super::CaptureSystems) and the composite, and depths for it.

use super::capture_views::Drawn;
use bevy::ecs::resource::Resource;
use bevy::render::sync_world::{MainEntity, MainEntityHashSet};

/// Who asks for a shaded picture, by entity of the main world. Nobody, unless a system of the extract schedule writes it.
#[derive(Resource, Default)]
pub(crate) struct ShadeRequests {
    /// Cameras, whichever captures they see.
    pub(crate) cameras: MainEntityHashSet,
    /// Captures, whichever camera sees them.
    pub(crate) captures: MainEntityHashSet,
}

impl ShadeRequests {
    /// Returns whether the picture of a camera that draws these captures is shaded.
    pub(super) fn want(&self, camera: MainEntity, drawn: &[Drawn]) -> bool {
        self.cameras.contains(&camera) || drawn.iter().any(|drawn| self.captures.contains(&drawn.entity))
    }
}
