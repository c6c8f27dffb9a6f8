//! The capture asset and the component that puts it into the world: what every other module of the plugin builds on.
//!
//! In: a scene in memory, a handle. Out: a [`GaussianCapture`] that entities share, and an entity that is drawn by every `Camera3d` that
//! sees it, as soon as the asset has been loaded. What else such an entity carries (its state of loading, its playback, its settings)
//! is registered as a required component by the plugin that owns it.

mod capture;
mod key_frames;

pub use capture::GaussianCapture;
pub use key_frames::KeyFrames;

use bevy::asset::{AssetId, Handle};
use bevy::camera::visibility::{Visibility, VisibilityClass, add_visibility_class};
use bevy::ecs::component::Component;
use bevy::ecs::reflect::ReflectComponent;
use bevy::reflect::Reflect;
use bevy::reflect::std_traits::ReflectDefault;
use bevy::transform::components::Transform;

/// A capture in the world: `commands.spawn(GaussianCapture3d(asset_server.load("toybox.gs4d")))`.
///
/// The entity's transform (translation, rotation, any scale) places it. Most captures have +z up: stand them upright with
/// `Transform::from_rotation(Quat::from_rotation_x(-FRAC_PI_2))` or [`GaussianCapture::upright`]. What is nearer to a perspective
/// camera than 0.2 units *of the capture* is not drawn, as in training; an orthographic camera draws from its near plane on.
///
/// [`Visibility`], `RenderLayers` and frustum culling decide which cameras draw it, as they do for meshes. The entity's `Aabb` is
/// kept about what shows at the moment; a capture with an environment map, which is all around, has none and is never culled.
///
/// [`GaussianCapturePlugin`](crate::GaussianCapturePlugin) also requires [`CaptureState`](crate::asset::CaptureState),
/// [`Playback`](crate::playback::Playback) and [`CaptureSettings`](crate::render::CaptureSettings): they are inserted with their defaults
/// unless they are spawned along.
#[derive(Component, Reflect, Debug, Default, Clone, PartialEq, Eq)]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
#[require(Transform, Visibility, VisibilityClass)]
#[component(on_add = add_visibility_class::<GaussianCapture3d>)]
pub struct GaussianCapture3d(pub Handle<GaussianCapture>);

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
