//! Settings of the picking backend: which cameras and captures take part in pointer events.
//!
//! In: fields and markers that a game sets. Out: [`CapturePickingSettings`] and [`CapturePickingCamera`].

use bevy::ecs::component::Component;
use bevy::ecs::reflect::{ReflectComponent, ReflectResource};
use bevy::ecs::resource::Resource;
use bevy::reflect::Reflect;
use bevy::reflect::std_traits::ReflectDefault;

/// Settings of pointer events on captures: a resource.
///
/// # Examples
///
/// ```
/// use bevy::prelude::*;
/// use bevy_gs4d::prelude::*;
///
/// fn setup(mut commands: Commands, assets: Res<AssetServer>) {
///     commands.spawn((Camera3d::default(), CapturePickingCamera));
///     commands.spawn((GaussianCapture3d(assets.load("button.gs4d")), Pickable::default()));
///     // No ray is cast at this capture.
///     commands.spawn(GaussianCapture3d(assets.load("stage.gs4d")));
/// }
///
/// App::new().insert_resource(CapturePickingSettings { require_markers: true }).add_systems(Startup, setup);
/// ```
#[derive(Resource, Reflect, Debug, Default, Clone, Copy, PartialEq, Eq)]
#[reflect(Resource, Default, Debug, Clone, PartialEq)]
#[type_path = "bevy_gs4d::picking_backend"]
pub struct CapturePickingSettings {
    /// Whether rays are cast only through cameras with a [`CapturePickingCamera`] and only at captures with Bevy's
    /// `Pickable`. Default: false.
    pub require_markers: bool,
}

/// Marks a camera through which pointers hit captures, if [`CapturePickingSettings::require_markers`] is set.
#[derive(Component, Reflect, Debug, Default, Clone, Copy, PartialEq, Eq)]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
#[type_path = "bevy_gs4d::picking_backend"]
pub struct CapturePickingCamera;
