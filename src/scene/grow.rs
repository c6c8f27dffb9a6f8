//! A capture grown to any size: each Gaussian split into several inside its own volume.
//!
//! In: Gaussians in the trained form. Out: several times as many Gaussians that look nearly the same, for benchmarks at
//! sizes for which there is no capture.

use super::random::Random;
use super::{GaussianScene, SceneForm, Trained};
use crate::gaussian::{Harmonics, InvalidGaussian, Model, Parameters};
use glam::{Vec3, Vec4};

/// Splits each Gaussian into `times` with the same opacity and color. With `c = times^(-1/3)`, a part has `c` times the
/// scales, and its 4D mean is `(mean, mean_t) + sqrt(1 - c²) L z`, with `L` the [factor](Parameters::factor) of the
/// covariance and `z` standard normal: the mixture has the covariance of the Gaussian. The temporal filter and the
/// levels of detail, which belong to the original Gaussians, are removed. The same seed makes the same scene on every
/// machine.
///
/// # Errors
/// The first Gaussian whose rotation has length zero or is not finite.
pub fn grow(
    scene: &GaussianScene,
    trained: &Trained,
    times: usize,
    seed: u64,
) -> Result<GaussianScene, InvalidGaussian> {
    let mut random = Random::new(seed);
    let Trained { parameters: old, harmonics } = trained;
    let shrink = (times.max(1) as f32).powf(-1.0 / 3.0);
    let spread = (1.0 - shrink * shrink).max(0.0).sqrt();
    let model = old.model();
    let mut new = Parameters::default();
    let each = harmonics.coefficients * 3;
    let mut values = Vec::with_capacity(harmonics.values.len() * times);
    for index in 0..old.len() {
        let factor = old.factor(index)?.as_mat4();
        for _ in 0..times {
            let ([x, y], [z, w]) = (random.normal_pair(), random.normal_pair());
            let offset = factor * Vec4::new(x, y, z, w) * spread;
            new.mean.push((Vec3::from(old.mean[index]) + offset.truncate()).to_array());
            new.log_scale.push(old.log_scale[index].map(|scale| scale + shrink.ln()));
            new.rotation_l.push(old.rotation_l[index]);
            new.opacity_logit.push(old.opacity_logit[index]);
            if model != Model::Static3d {
                new.mean_t.push(old.mean_t[index] + offset.w);
                // Without a 4D rotation the temporal scale is a variance.
                let power = if model == Model::Rotated4d { 1.0 } else { 2.0 };
                new.log_scale_t.push(old.log_scale_t[index] + power * shrink.ln());
            }
            if model == Model::Rotated4d {
                new.rotation_r.push(old.rotation_r[index]);
            }
            values.extend_from_slice(&harmonics.values[index * each..(index + 1) * each]);
        }
    }
    Ok(GaussianScene {
        form: SceneForm::Trained(Trained { parameters: new, harmonics: Harmonics { values, ..*harmonics } }),
        environment: scene.environment.clone(),
        filter: None,
        trained_with: scene.trained_with.clone(),
        playback: scene.playback,
        levels: Vec::new(),
        sockets: scene.sockets.clone(),
        colliders: scene.colliders.clone(),
        sound: scene.sound.clone(),
        chunks: None,
    })
}
