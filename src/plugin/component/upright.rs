//! Captures that stand upright.
//!
//! In: an entity with [`Upright`], the up direction of its capture. Out: the same entity with its transform turned,
//! once the capture is loaded.

use super::capture::GaussianCapture;
use super::capture_3d::GaussianCapture3d;
use bevy::asset::Assets;
use bevy::ecs::component::Component;
use bevy::ecs::query::With;
use bevy::ecs::reflect::ReflectComponent;
use bevy::ecs::system::{Query, Res};
use bevy::reflect::Reflect;
use bevy::reflect::std_traits::ReflectDefault;
use bevy::transform::components::Transform;
use glam::Quat;

/// Stands a capture upright, whichever axis its dataset has as up. Add it to an entity with a [`GaussianCapture3d`].
///
/// When the capture has been loaded, and before it is first drawn, the entity's [`Transform`] is turned once by
/// [`GaussianCapture::upright`]: `rotation` becomes the rotation set by the game, multiplied by `upright`. The game's
/// rotation therefore acts on the upright capture: `Transform::from_rotation(Quat::from_rotation_y(..))` turns it about
/// the vertical. When the entity's handle or the capture's file changes, only the difference between the old and the
/// new up direction is applied.
///
/// Rendering, picking, bounds and children use the transform as usual. A game that sets `rotation` again later replaces
/// all of it: turn the entity by `rotate`, or turn a parent.
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
#[derive(Component, Reflect, Debug, Default, Clone, Copy, PartialEq, Eq)]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
#[type_path = "bevy_gs4d"]
#[require(Transform, UprightTurn)]
pub struct Upright;

/// The rotation by which [`Upright`] has turned an entity's transform. Scene files contain it, so that an entity that
/// is loaded with its transform is not turned again. Games neither insert nor change it. Default: none.
#[derive(Component, Reflect, Debug, Default, Clone, Copy, PartialEq)]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
#[type_path = "bevy_gs4d"]
pub struct UprightTurn(Quat);

/// Turns each entity whose capture has been loaded, or whose capture has another up direction than before.
pub(crate) fn stand_upright(
    captures: Res<Assets<GaussianCapture>>,
    mut placed: Query<(&GaussianCapture3d, &mut Transform, &mut UprightTurn), With<Upright>>,
) {
    for (handle, mut transform, mut turned) in &mut placed {
        let Some(capture) = captures.get(&handle.0) else { continue };
        let upright = capture.upright();
        if turned.0 != upright {
            transform.rotation = (transform.rotation * turned.0.inverse() * upright).normalize();
            turned.0 = upright;
        }
    }
}
