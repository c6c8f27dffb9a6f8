//! The result of reading a file of another make.
//!
//! In: a scene and what of the file it does not show. Out: [`Imported`].

use crate::scene::GaussianScene;

/// A scene of a file of another make.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Imported {
    pub scene: GaussianScene,
    /// A sentence, with numbers, for each thing of the file that the scene does not show, or shows approximately.
    pub lost: Vec<String>,
}
