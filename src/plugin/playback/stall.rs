//! Playbacks that wait for another module of the plugin.
//!
//! In: captures in chunk files whose most important Gaussians are not there. Out: [`Stall`], which stops their time.

use bevy::ecs::component::Component;

/// Whether no time passes for a playback, because what it would draw is not there. A followed clock does not wait.
#[derive(Component, Debug, Default, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Stall(pub(crate) bool);
