//! The result of reading a file of another make.
//!
//! In: a scene and what of the file it does not show. Out: [`Imported`].

use crate::scene::GaussianScene;

/// A scene of a file of another make.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Imported {
    /// The scene.
    pub scene: GaussianScene,
    /// What the file has that the scene does not show, or shows approximately: one sentence each, with numbers where there are any.
    pub lost: Vec<String>,
}
