//! Pruning: the scene with the Gaussians of the highest scores.
//!
//! In: a scene of any form and a score for each Gaussian. Out: the scene with some of the Gaussians, in their original
//! order, with their color and their part of the temporal filter.

use crate::gaussian::Parameters;
use crate::scene::{Form, GaussianScene, SceneForm, Sliced, Trained};

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
    let form = match &scene.form {
        SceneForm::Trained(Trained { parameters, harmonics }) => SceneForm::Trained(Trained {
            parameters: select_parameters(parameters, keep),
            harmonics: harmonics.select(keep),
        }),
        SceneForm::Ready(Form::Sliced(Sliced { gaussians, harmonics })) => SceneForm::Ready(Form::Sliced(Sliced {
            gaussians: rows(gaussians, keep),
            harmonics: harmonics.select(keep),
        })),
        SceneForm::Ready(Form::Packed(_)) => return select(&scene.clone().unpacked(), keep),
    };
    GaussianScene {
        form,
        environment: scene.environment.clone(),
        filter: scene.filter.as_ref().map(|filter| filter.select(keep)),
        trained_with: scene.trained_with.clone(),
        playback: scene.playback,
        levels: Vec::new(),
    }
}

fn select_parameters(parameters: &Parameters, keep: &[u32]) -> Parameters {
    Parameters {
        mean: rows(&parameters.mean, keep),
        mean_t: rows(&parameters.mean_t, keep),
        log_scale: rows(&parameters.log_scale, keep),
        log_scale_t: rows(&parameters.log_scale_t, keep),
        rotation_l: rows(&parameters.rotation_l, keep),
        rotation_r: rows(&parameters.rotation_r, keep),
        opacity_logit: rows(&parameters.opacity_logit, keep),
    }
}

/// Returns these rows of an attribute; an attribute that the model does not have stays empty.
fn rows<T: Copy>(values: &[T], keep: &[u32]) -> Vec<T> {
    if values.is_empty() { Vec::new() } else { keep.iter().map(|&index| values[index as usize]).collect() }
}
