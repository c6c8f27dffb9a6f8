//! What a file of another make does not hold, whatever the format.
//!
//! In: a scene. Out: a sentence about each of its parts that other players do not know.

use crate::gaussian::{Model, ShDirection};
use crate::scene::GaussianScene;

/// Returns a sentence about each part of the scene that is not exported.
pub(crate) fn of(scene: &GaussianScene) -> Vec<String> {
    let mut lost = Vec::new();
    if scene.environment.is_some() {
        lost.push("The environment map is not exported.".to_owned());
    }
    if !scene.levels.is_empty() {
        lost.push(format!("The {} levels of detail are not exported.", scene.levels.len()));
    }
    if scene.trained_with.uses_fov_sentinel() {
        lost.push(
            "The footprints of this capture were shaped by a wider field of view, which other players do not know: theirs differ \
             slightly."
                .to_owned(),
        );
    }
    let (moves, degree) = (scene.model() != Some(Model::Static3d), scene.form.color_degrees().degree);
    if moves && scene.trained_with.sh_direction == ShDirection::Canonical && degree > 0 {
        lost.push(
            "View-dependent color of a moving Gaussian is that of the direction to its undisplaced mean; other players use the \
             direction to where it is."
                .to_owned(),
        );
    }
    lost
}
