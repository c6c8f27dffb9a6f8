//! The component that places a capture in the world.
//!
//! In: the handle of a [`GaussianCapture`]. Out: an entity that each `Camera3d` draws once the asset is loaded.

use super::capture::GaussianCapture;
use bevy::asset::{AssetId, Handle};
use bevy::camera::visibility::{Visibility, VisibilityClass, add_visibility_class};
use bevy::ecs::component::Component;
use bevy::ecs::lifecycle::HookContext;
use bevy::ecs::reflect::ReflectComponent;
use bevy::ecs::template::FromTemplate;
use bevy::ecs::world::DeferredWorld;
use bevy::reflect::Reflect;
use bevy::reflect::std_traits::ReflectDefault;
use bevy::transform::components::Transform;
use std::any::TypeId;

/// Places a capture in the world.
///
/// The entity's transform (translation, rotation, any scale) maps capture space to the world. Most captures have +z up:
/// [`Upright`](super::Upright) stands them upright. A perspective camera draws no Gaussian nearer than 0.2 units *of
/// the capture*, as in training; an orthographic camera draws from its near plane on.
///
/// [`Visibility`], `RenderLayers` and frustum culling decide which cameras draw the capture, as they do for meshes. The
/// entity's `Aabb` encloses the Gaussians drawn at the current time. A capture with an environment map surrounds every
/// camera: it has no `Aabb` and is never culled.
///
/// [`GaussianCapturePlugins`](crate::GaussianCapturePlugins) also require [`CaptureState`](crate::asset::CaptureState),
/// [`Playback`](crate::playback::Playback) and [`CaptureSettings`](crate::render::CaptureSettings): they are inserted
/// with their defaults unless the game spawns them together with this component.
///
/// Default: a handle of no asset, with which nothing is drawn. The log has one warning for an entity with this handle.
///
/// # Examples
///
/// ```
/// use bevy::prelude::*;
/// use bevy_gs4d::prelude::*;
///
/// fn setup(mut commands: Commands, assets: Res<AssetServer>) {
///     commands.spawn((GaussianCapture3d(assets.load("toybox.gs4d")), Upright, Transform::from_xyz(0.0, 0.0, -2.0)));
/// }
/// # bevy::ecs::system::assert_is_system(setup);
/// ```
///
/// In Bevy's scene notation the path of the file takes the place of the handle:
///
/// ```
/// # #[cfg(feature = "viewer")]
/// # mod shown {
/// use bevy::prelude::*;
/// use bevy_gs4d::prelude::*;
///
/// fn dancer() -> impl Scene {
///     bsn! {
///         GaussianCapture3d("toybox.gs4d")
///         Upright
///         Playback { speed: 0.5 }
///     }
/// }
/// # }
/// ```
#[derive(Component, FromTemplate, Reflect, Debug, Default, Clone, PartialEq, Eq)]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
#[type_path = "bevy_gs4d"]
#[require(Transform, Visibility, VisibilityClass)]
#[component(on_add = add_visibility_class::<GaussianCapture3d>, on_remove = remove_visibility_class)]
pub struct GaussianCapture3d(pub Handle<GaussianCapture>);

/// Takes back what the hook of an added component has listed: the class stays on the entity, and an entity that has it
/// twice is drawn twice.
fn remove_visibility_class(mut world: DeferredWorld<'_>, context: HookContext) {
    if let Some(mut classes) = world.get_mut::<VisibilityClass>(context.entity) {
        classes.retain(|class| *class != TypeId::of::<GaussianCapture3d>());
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

#[cfg(test)]
mod tests {
    use super::*;
    use bevy::ecs::world::World;

    #[test]
    fn a_capture_that_is_removed_and_inserted_again_is_seen_once() {
        let mut world = World::new();
        let entity = world.spawn(GaussianCapture3d::default()).id();
        let classes = |world: &World| world.get::<VisibilityClass>(entity).map_or(0, |classes| classes.len());
        assert_eq!(classes(&world), 1, "the classes by which views find a capture");
        world.entity_mut(entity).remove::<GaussianCapture3d>();
        assert_eq!(classes(&world), 0, "without its component");
        world.entity_mut(entity).insert(GaussianCapture3d::default());
        assert_eq!(classes(&world), 1, "with its component again");
    }
}
