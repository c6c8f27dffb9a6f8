//! The picture of a capture in chunk files.
//!
//! In: the files of the capture that are there. Out: [`StreamedPicture`] on its entity, whose asset has no Gaussians
//! itself.

use crate::scene::Bounds;
use bevy::ecs::component::Component;

/// What is drawn of a capture in chunk files. The plugins insert it.
#[derive(Component, Debug, Default, Clone, Copy, PartialEq)]
pub(crate) struct StreamedPicture {
    /// The time that is drawn, seconds since the capture's start. `None` before the first picture: nothing is drawn.
    pub(crate) seconds: Option<f32>,
    /// The box around the Gaussians of that time, capture space.
    pub(crate) bounds: Option<Bounds>,
    /// The typical extent of the Gaussians, the mean of the files, capture units.
    pub(crate) extent: f32,
}
