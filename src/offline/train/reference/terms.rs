//! Further terms of the loss; CPU reference of `shaders/offline/regularize.wgsl`.
//!
//! In: raw parameters, the neighbors of each Gaussian, weights, the unit of length. Out: the terms that depend on
//! Gaussians alone, and the gradient of their weighted sum. These are, with `u` 0.1 times the velocity c/v (section 6
//! of the 4DGS model; the original has no terms of opacity and scale):
//!
//! | term | value |
//! |---|---|
//! | motion | the mean over Gaussians of `‖u‖` |
//! | rigid | the mean over Gaussians and their [`NEIGHBORS`] of `exp(−100 d) ‖u − u of the neighbor‖`, `d` their distance |
//! | opacity | the mean over Gaussians of the peak opacity |
//! | scale | the mean over Gaussians and their three spatial axes of the scale |
//!
//! Lengths are in units of 1, or of less in a small scene ([`TrainedWith::unit_length`](crate::scene::TrainedWith)), so
//! that terms do not depend on the scale of the scene.
//!
//! In the rigid term a Gaussian is drawn to its neighbors as they are: distances and the neighbors' velocities are
//! constant. The original lets the gradient through to the velocities of the neighbors too, which doubles it where two
//! are neighbors of each other.
//!
//! The fifth term, the mask, is of views: see [`opacity_mask`](super::loss::opacity_mask).

use super::neighbors::NEIGHBORS;
use crate::gaussian::gradient::slice_gradient;
use crate::gaussian::{InvalidGaussian, ParameterGradient, Parameters};
use glam::DVec3;

/// Time over which motion is measured, timestamp units.
pub(crate) const MOMENT: f64 = 0.1;
/// The weight of a neighbor is `exp(−FALLOFF d)`.
pub(crate) const FALLOFF: f64 = 100.0;
/// A shorter vector counts as zero, which has no direction.
const LEAST_LENGTH: f64 = 1e-15;

/// Weights of further terms of the loss. Default: 0, no further terms.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Terms {
    /// Of opacity where an image covers nothing: the mean over the pixels of a view of `−(1 − coverage) ln(1 −
    /// opacity)`.
    pub mask: f64,
    /// Of motion: the mean over Gaussians of the length of 0.1 times the velocity.
    pub motion: f64,
    /// Of motion unlike that of neighbors: the mean over Gaussians and their [`NEIGHBORS`] of the length of the
    /// difference of this, which counts less with distance.
    pub rigid: f64,
    /// Of opacity: its mean over Gaussians. Gaussians that no image needs fade, and are relocated (3DGS-MCMC) or
    /// pruned.
    pub opacity: f64,
    /// Of scale: the mean over Gaussians of their spatial scales. Gaussians leave space that no image needs them in
    /// (3DGS-MCMC).
    pub scale: f64,
    /// Steps between two searches for neighbors. Default: 500.
    pub search_every: usize,
}

impl Default for Terms {
    fn default() -> Self {
        Self { mask: 0.0, motion: 0.0, rigid: 0.0, opacity: 0.0, scale: 0.0, search_every: 500 }
    }
}

impl Terms {
    /// Returns the first term with a weight that is negative, too large or not a number.
    pub(crate) fn wrong(&self) -> Option<(&'static str, f64)> {
        let weights = [
            ("mask", self.mask),
            ("motion", self.motion),
            ("rigid", self.rigid),
            ("opacity", self.opacity),
            ("scale", self.scale),
        ];
        weights.into_iter().find(|(_, weight)| !(0.0..=f64::from(f32::MAX)).contains(weight))
    }

    /// Returns whether a term that depends on Gaussians alone has a weight.
    pub(crate) fn is_regularizing(&self) -> bool {
        self.motion > 0.0 || self.rigid > 0.0 || self.opacity > 0.0 || self.scale > 0.0
    }
}

/// The terms that depend on Gaussians alone.
#[derive(Debug, Clone, PartialEq)]
pub struct Regularization {
    /// Motion, without its weight.
    pub motion: f64,
    /// Motion unlike that of neighbors, without its weight.
    pub rigid: f64,
    /// Opacity, without its weight.
    pub opacity: f64,
    /// Scale, without its weight.
    pub scale: f64,
    /// The gradient of the weighted sum with respect to the raw parameters of each Gaussian, coefficients of color left
    /// out.
    pub gradients: Vec<ParameterGradient>,
}

/// Computes the terms. `neighbors` are those of [`neighbors`](super::neighbors::neighbors); without any the rigid term
/// is 0. `unit` is the unit of length, capture units.
///
/// # Errors
/// A Gaussian that cannot be drawn.
///
/// # Panics
/// If a neighbor is out of range.
pub fn regularization(
    parameters: &Parameters,
    neighbors: &[u32],
    terms: &Terms,
    unit: f64,
) -> Result<Regularization, InvalidGaussian> {
    let count = parameters.len();
    let moved = |index| movement(parameters, index).map(|moved| moved / unit);
    let moves: Vec<DVec3> = (0..count).map(moved).collect::<Result<_, _>>()?;
    let place = |index: usize| DVec3::from(parameters.mean[index].map(f64::from));
    let share = 1.0 / count.max(1) as f64;
    let mut all =
        Regularization { motion: 0.0, rigid: 0.0, opacity: 0.0, scale: 0.0, gradients: Vec::with_capacity(count) };
    for (index, &own) in moves.iter().enumerate() {
        all.motion += share * own.length();
        let mut by_move = terms.motion * slope_of_length(own);
        let around = neighbors.get(NEIGHBORS * index..NEIGHBORS * (index + 1)).unwrap_or_default();
        for other in around.iter().map(|&other| other as usize) {
            let near = (-FALLOFF * place(index).distance(place(other)) / unit).exp() / NEIGHBORS as f64;
            let difference = own - moves[other];
            all.rigid += share * near * difference.length();
            by_move += terms.rigid * near * slope_of_length(difference);
        }
        all.opacity += share / (1.0 + (-f64::from(parameters.opacity_logit[index])).exp());
        let mut gradient = slice_gradient(parameters, index, share * MOMENT / unit * by_move, share * terms.opacity);
        for (slope, log_scale) in gradient.log_scale.iter_mut().zip(parameters.log_scale[index]) {
            let scale = share / 3.0 * f64::from(log_scale).exp() / unit;
            all.scale += scale;
            *slope += terms.scale * scale;
        }
        all.gradients.push(gradient);
    }
    Ok(all)
}

/// Returns how far a Gaussian moves in a [`MOMENT`].
fn movement(parameters: &Parameters, index: usize) -> Result<DVec3, InvalidGaussian> {
    let factor = parameters.factor(index)?;
    let [.., c] = (factor * factor.transpose()).to_cols_array_2d();
    // A Gaussian of the static model has no variance in time, and is at rest.
    Ok(if c[3] > 0.0 { DVec3::new(c[0], c[1], c[2]) * (MOMENT / c[3]) } else { DVec3::ZERO })
}

/// Returns the derivative of the length of a vector, 0 at 0.
fn slope_of_length(v: DVec3) -> DVec3 {
    let length = v.length();
    if length < LEAST_LENGTH { DVec3::ZERO } else { v / length }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns three Gaussians close to each other that move, each differently.
    fn three() -> Parameters {
        Parameters {
            mean: vec![[0.1, -0.1, 0.2], [0.104, -0.1, 0.2], [0.1, -0.097, 0.201]],
            mean_t: vec![0.2, 0.7, 0.5],
            log_scale: vec![[0.1, 0.4, -0.3], [-0.2, 0.3, 0.5], [0.3, -0.1, 0.2]],
            log_scale_t: vec![-0.5, -0.2, -0.4],
            rotation_l: vec![[0.9, 0.2, -0.3, 0.1], [0.6, -0.5, 0.4, 0.7], [1.1, 0.3, 0.5, -0.4]],
            rotation_r: vec![[1.0, 0.3, -0.2, 0.2], [0.5, -0.6, 0.5, 0.6], [0.9, 0.1, 0.6, -0.3]],
            opacity_logit: vec![-0.4, 0.3, 1.8],
        }
    }

    /// Returns the values of a Gaussian that terms depend on.
    fn values(parameters: &mut Parameters, index: usize) -> Vec<&mut f32> {
        let Parameters { log_scale, log_scale_t, rotation_l, rotation_r, opacity_logit, .. } = parameters;
        let scales = log_scale[index].iter_mut().chain(log_scale_t.get_mut(index));
        let rotations = rotation_l[index].iter_mut().chain(&mut rotation_r[index]);
        scales.chain(rotations).chain(opacity_logit.get_mut(index)).collect()
    }

    /// Returns the gradients of the same.
    fn slopes(gradient: &ParameterGradient) -> Vec<f64> {
        let ParameterGradient { log_scale, log_scale_t, rotation_l, rotation_r, opacity_logit, .. } = gradient;
        [&log_scale[..], &[*log_scale_t], rotation_l, rotation_r, &[*opacity_logit]].concat()
    }

    #[test]
    fn gradients_are_those_of_finite_differences() {
        // The first has the others as neighbors, but is neighbor of none: its effect on the terms of others is left out
        // of its gradient.
        let neighbors: Vec<u32> = [vec![0, 1, 2], vec![0; 17], vec![1; 20], vec![2; 20]].concat();
        let none = Terms::default();
        let motion = Terms { motion: 0.8, ..none };
        let rigid = Terms { rigid: 2.5, ..none };
        let opacity = Terms { opacity: 0.3, ..none };
        let scale = Terms { scale: 0.3, ..none };
        for (name, terms, moved) in
            [("motion", motion, 3), ("rigid", rigid, 1), ("opacity", opacity, 3), ("scale", scale, 3)]
        {
            let of = |parameters: &Parameters| regularization(parameters, &neighbors, &terms, 1.0).expect("valid");
            let loss = |parameters: &Parameters| {
                let found = of(parameters);
                terms.motion * found.motion
                    + terms.rigid * found.rigid
                    + terms.opacity * found.opacity
                    + terms.scale * found.scale
            };
            let gradients = of(&three()).gradients;
            assert!(loss(&three()) > 1e-3, "{name} has a value");
            for (index, gradient) in gradients.iter().enumerate().take(moved) {
                let slopes = slopes(gradient);
                let norm = slopes.iter().map(|slope| slope * slope).sum::<f64>().sqrt();
                assert!(norm > 1e-4, "{name} moves Gaussian {index}: {norm}");
                for (k, slope) in slopes.into_iter().enumerate() {
                    let [before, after] = [-1e-3, 1e-3].map(|step: f32| {
                        let mut parameters = three();
                        *values(&mut parameters, index)[k] += step;
                        (f64::from(*values(&mut parameters, index)[k]), loss(&parameters))
                    });
                    let quotient = (after.1 - before.1) / (after.0 - before.0);
                    assert!((slope - quotient).abs() < 1e-3 * norm, "{name}, {k} of {index}: {slope} is {quotient}");
                }
            }
        }
    }

    #[test]
    fn terms_are_means_over_the_gaussians() {
        let parameters = three();
        let neighbors: Vec<u32> = [vec![0, 1], vec![0; 18], vec![1; 20], vec![2; 20]].concat();
        let found = regularization(&parameters, &neighbors, &Terms::default(), 1.0).expect("they can be drawn");
        let sliced = parameters.slice(&Default::default()).expect("they can be drawn");
        let moves: Vec<DVec3> = sliced.iter().map(|g| 0.1 * DVec3::from(g.velocity.map(f64::from))).collect();
        let motion = moves.iter().map(|own| own.length()).sum::<f64>() / 3.0;
        let opacity = sliced.iter().map(|gaussian| f64::from(gaussian.opacity)).sum::<f64>() / 3.0;
        let rigid = (-100.0f64 * 0.004).exp() * (moves[0] - moves[1]).length() / 60.0;
        for (name, found, expected) in
            [("motion", found.motion, motion), ("rigid", found.rigid, rigid), ("opacity", found.opacity, opacity)]
        {
            assert!((found - expected).abs() < 1e-5 * expected, "{name}: {found} is {expected}");
        }
        let still = found.gradients.iter().all(|gradient| *gradient == ParameterGradient::default());
        assert!(still, "without weights nothing moves");
    }

    #[test]
    fn terms_do_not_depend_on_the_scale_of_the_scene() {
        let neighbors: Vec<u32> = [vec![0, 1], vec![0; 18], vec![1; 20], vec![2; 20]].concat();
        let terms = Terms { motion: 0.8, rigid: 2.5, opacity: 0.3, scale: 0.3, ..Terms::default() };
        let scaled = |scale: f32| {
            let mut parameters = three();
            parameters.mean.as_flattened_mut().iter_mut().for_each(|value| *value *= scale);
            parameters.log_scale.as_flattened_mut().iter_mut().for_each(|value| *value += scale.ln());
            // A rotation mixes lengths and times, so that only Gaussians that are not rotated are the same at every
            // scale.
            let unrotated = vec![[1.0, 0.0, 0.0, 0.0]; 3];
            (parameters.rotation_l, parameters.rotation_r) = (unrotated.clone(), unrotated);
            regularization(&parameters, &neighbors, &terms, scale.into()).expect("they can be drawn")
        };
        let (usual, tiny) = (scaled(1.0), scaled(0.001));
        assert!((tiny.scale / usual.scale - 1.0).abs() < 1e-5, "scale: {} and {}", tiny.scale, usual.scale);
        for (tiny, usual) in tiny.gradients.iter().zip(&usual.gradients) {
            let error = tiny.log_scale.iter().zip(usual.log_scale).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(error < 1e-6, "the gradients of the scales differ by {error}");
        }
    }

    #[test]
    fn gaussians_at_rest_have_no_motion() {
        let unrotated = Parameters { rotation_r: Vec::new(), ..three() };
        let fixed = Parameters { mean_t: Vec::new(), log_scale_t: Vec::new(), ..unrotated.clone() };
        let terms = Terms { motion: 1.0, rigid: 1.0, ..Terms::default() };
        for parameters in [unrotated, fixed] {
            let found = regularization(&parameters, &[0; 60], &terms, 1.0).expect("they can be drawn");
            assert_eq!((found.motion, found.rigid), (0.0, 0.0), "in {:?}", parameters.model());
            let still = |gradient: &ParameterGradient| slopes(gradient).iter().all(|slope| *slope == 0.0);
            assert!(found.gradients.iter().all(still), "and no gradient: {:?}", found.gradients);
        }
    }

    #[test]
    fn a_weight_below_zero_is_named() {
        assert_eq!(Terms::default().wrong(), None, "no weights are right");
        assert_eq!(Terms { rigid: -1.0, ..Terms::default() }.wrong(), Some(("rigid", -1.0)), "negative");
        for weight in [f64::NAN, f64::INFINITY, 1e300] {
            let wrong = Terms { mask: weight, ..Terms::default() }.wrong();
            assert_eq!(wrong.map(|(name, _)| name), Some("mask"), "{weight} is no weight");
        }
    }
}
