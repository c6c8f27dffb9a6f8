//! The input of the passes: a scene and how it is shown.
//!
//! In: a scene, a view, an appearance. Out: a [`Layer`].

use crate::scene::RuntimeScene;
use crate::view::{Appearance, View};

/// A scene, and how it is shown in a view.
#[derive(Debug, Clone, Copy)]
pub struct Layer<'a> {
    /// The scene.
    pub scene: &'a RuntimeScene,
    /// Camera and time, with the transform of the scene.
    pub view: View,
    /// How it is shown.
    pub appearance: Appearance,
}
