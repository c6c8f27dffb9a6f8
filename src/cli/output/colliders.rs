//! The note of verbs that remove Gaussians and leave the colliders as they are.
//!
//! In: a scene from which Gaussians have been removed, their numbers. Out: the note on standard error, if a game would
//! meet what its picture no longer shows.

use super::note::note;
use crate::scene::GaussianScene;

/// Writes the note if the scene has colliders and `kept` is fewer than all of the `total` Gaussians before.
pub(crate) fn note_colliders(scene: &GaussianScene, kept: usize, total: usize) {
    if kept < total && scene.colliders.is_some() {
        note("note: colliders stay as they were, also of what is removed: gs4d collide makes new ones");
    }
}
