//! The parts of a capture in chunk files.
//!
//! In: a chunk file that is drawn. Out: [`CapturePart`], which tells its entity from those of the game.

use bevy::ecs::component::Component;
use bevy::ecs::reflect::ReflectComponent;
use bevy::reflect::Reflect;
use bevy::reflect::std_traits::ReflectDefault;

/// A chunk file of the capture of its parent, while it is drawn: on child entities that the plugins spawn and despawn.
///
/// They have a [`GaussianCapture3d`](crate::GaussianCapture3d) and a [`Playback`](crate::playback::Playback), whose time
/// is that of their parent; no message names them, and rays do not hit them, since their Gaussians are on the GPU only.
/// Queries of a game leave them out by `Without<CapturePart>`.
#[derive(Component, Reflect, Debug, Default, Clone, Copy, PartialEq, Eq)]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
#[type_path = "bevy_gs4d::stream"]
pub struct CapturePart {
    /// The number of the file, from 0.
    pub file: u32,
}
