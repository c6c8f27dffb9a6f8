//! The component that puts a capture into the world.
//!
//! In: a handle. Out: an entity that is drawn by every perspective `Camera3d` as soon as the asset has been loaded.

use crate::asset::GaussianCapture;
use crate::playback::Playback;
use bevy::asset::{AssetId, Handle};
use bevy::camera::visibility::Visibility;
use bevy::ecs::component::Component;
use bevy::ecs::reflect::ReflectComponent;
use bevy::reflect::{Reflect, std_traits::ReflectDefault};
use bevy::transform::components::Transform;

/// A capture in the world: `commands.spawn(GaussianCapture3d(asset_server.load("toybox.gs4d")))`.
///
/// The entity's transform (translation, rotation, any scale) places it. Most captures have +z up: stand them upright with
/// `Transform::from_rotation(Quat::from_rotation_x(-FRAC_PI_2))` or [`GaussianCapture::upright`]. What is nearer to a camera than
/// 0.2 units *of the capture* is not drawn, as in training.
#[derive(Component, Reflect, Debug, Default, Clone, PartialEq, Eq)]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
#[require(Transform, Visibility, Playback, CaptureSettings)]
pub struct GaussianCapture3d(pub Handle<GaussianCapture>);

/// How a capture is drawn.
#[derive(Component, Reflect, Debug, Clone, Copy, PartialEq, Eq)]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
pub struct CaptureSettings {
    /// Whether the capture's temporal filter is used, if it has one: what is not active at a time is then not even looked at.
    pub filter: bool,
}

impl Default for CaptureSettings {
    fn default() -> Self {
        Self { filter: true }
    }
}

impl From<Handle<GaussianCapture>> for GaussianCapture3d {
    fn from(handle: Handle<GaussianCapture>) -> Self {
        Self(handle)
    }
}

impl From<&GaussianCapture3d> for AssetId<GaussianCapture> {
    fn from(capture: &GaussianCapture3d) -> Self {
        capture.0.id()
    }
}
