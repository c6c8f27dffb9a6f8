//! What a file of another make does not hold, whatever the format.
//!
//! In: a scene and a format. Out: a sentence about each of its parts that other players do not support.

use super::table::Export;
use crate::gaussian::{Model, ShDirection};
use crate::scene::{GaussianScene, Origin, UpAxis};

/// Returns a sentence about each part of the scene that is not exported.
pub(crate) fn of(scene: &GaussianScene, format: &Export) -> Vec<String> {
    let mut lost = Vec::new();
    if scene.environment.is_some() {
        lost.push("The environment map is not exported.".to_owned());
    }
    if !scene.levels.is_empty() {
        lost.push(format!("The {} levels of detail are not exported.", scene.levels.len()));
    }
    if !scene.sockets.is_empty() {
        lost.push(format!("The {} sockets are not exported.", scene.sockets.len()));
    }
    if scene.colliders.is_some() {
        lost.push("The colliders are not exported.".to_owned());
    }
    if scene.sound.is_some() {
        lost.push("The sound is not exported.".to_owned());
    }
    if let Some(chunks) = &scene.chunks {
        lost.push(format!("The Gaussians in {} chunk files are not exported.", chunks.files.len()));
    }
    if scene.trained_with.uses_fov_sentinel() {
        lost.push(
            "The footprints of this capture were shaped by a wider field of view, which other players do not have: their footprints differ \
             slightly."
                .to_owned(),
        );
    }
    let (moves, degree) = (scene.model() != Some(Model::Static3d), scene.form.color_degrees().degree);
    if moves && scene.trained_with.sh_direction == ShDirection::Canonical && degree > 0 {
        lost.push(
            "View-dependent color of a moving Gaussian is that of the direction to its undisplaced mean; other players use the \
             direction to its position."
                .to_owned(),
        );
    }
    if scene.trained_with.mip_filter && !format.has_mip_filter {
        lost.push(
            "The capture was trained with the filter of Mip-Splatting, which the files cannot state: other programs draw its fine detail \
             slightly thicker."
                .to_owned(),
        );
    }
    lost.extend(of_space(scene, format));
    lost
}

/// Returns a sentence about the axis that points up, and one about the origin, if the files do not state them.
fn of_space(scene: &GaussianScene, format: &Export) -> Vec<String> {
    let (up, Origin { place, time }) = (scene.playback.up, scene.trained_with.origin);
    let mut lost = Vec::new();
    if format.has_space && up != UpAxis::NegY {
        let up = up.name();
        lost.push(format!(
            "{up} points up, which a comment of the file states: programs other than gs4d take -y as up."
        ));
    }
    if !format.has_space && place != [0.0; 3] {
        let [x, y, z] = place;
        lost.push(format!(
            "The origin of the capture, ({x}, {y}, {z}) in the coordinates of its files, is left out: positions are relative to it."
        ));
    }
    if format.is_moving() && time != 0.0 {
        lost.push(format!("The time {time} at which timestamps of the capture begin is left out."));
    }
    lost
}
