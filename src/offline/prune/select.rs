//! Pruning: the scene with the Gaussians of the highest scores.
//!
//! In: a scene of any form and a score for each Gaussian. Out: the scene with some of the Gaussians, in their original
//! order, with their color and their part of the temporal filter.

use crate::scene::{Form, GaussianScene, SceneForm};

/// Returns how many of `count` Gaussians remain when this fraction (0 to 1) is removed: `round((1 − ratio) count)`.
pub fn kept_count(count: usize, ratio: f64) -> usize {
    (((1.0 - ratio) * count as f64).round() as usize).min(count)
}

/// Returns the indices of the `count` highest scores, ascending; of equal scores, the earlier Gaussians.
pub fn highest(scores: &[f32], count: usize) -> Vec<u32> {
    let mut order: Vec<u32> = (0..scores.len() as u32).collect();
    // A stable sort: equal scores stay in the order of the scene.
    order.sort_by(|&a, &b| scores[b as usize].total_cmp(&scores[a as usize]));
    order.truncate(count);
    order.sort_unstable();
    order
}

/// Returns the scene with only the Gaussians at these indices, in this order. A packed scene is returned in the runtime
/// form.
///
/// # Panics
/// If an index is not below the length of the scene.
pub fn select(scene: &GaussianScene, keep: &[u32]) -> GaussianScene {
    match &scene.form {
        SceneForm::Trained(_) | SceneForm::Ready(Form::Sliced(_)) => scene.select(keep),
        SceneForm::Ready(Form::Packed(_)) => scene.clone().unpacked().select(keep),
    }
}
