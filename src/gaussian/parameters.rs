//! The trained form: the raw parameters as an optimizer stores them, without color.
//!
//! In: tensors of a checkpoint. Out: [`Parameters`], which [`slice`](Parameters::slice) turns into the runtime form.

/// Raw parameters of `N` Gaussians, one entry per Gaussian and attribute, in capture space.
///
/// *Raw* means before activation: scales are logarithms, opacity is a logit, quaternions need not be unit length. Color
/// coefficients are separate, in [`Harmonics`](super::Harmonics). Rotations are in the *flipped* convention (the axis
/// order of the 4D vector is x, y, z, t; loaders convert).
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Parameters {
    /// Mean μ, capture units.
    pub mean: Vec<[f32; 3]>,
    /// Temporal mean μ_t in the unit of the camera timestamps. Empty for a static (3D) model.
    pub mean_t: Vec<f32>,
    /// Logarithm of the scale, a standard deviation along each unrotated axis, capture units.
    pub log_scale: Vec<[f32; 3]>,
    /// Logarithm of the temporal scale. Empty for a static (3D) model.
    pub log_scale_t: Vec<f32>,
    /// Left quaternion (w, x, y, z); the only rotation of models without a 4D rotation.
    pub rotation_l: Vec<[f32; 4]>,
    /// Right quaternion (w, x, y, z). Empty unless the model rotates in 4D.
    pub rotation_r: Vec<[f32; 4]>,
    /// Logit of the opacity.
    pub opacity_logit: Vec<f32>,
}

/// The model of the original code that the parameters belong to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum Model {
    /// Plain 3D Gaussians (`gaussian_dim` 3): present at every time, at rest.
    Static3d,
    /// `gaussian_dim` 4 without `rot_4d`: at rest, with an opacity envelope whose *variance* is the temporal scale.
    Unrotated4d,
    /// `gaussian_dim` 4 with `rot_4d`: the native 4D Gaussian.
    Rotated4d,
}

impl Parameters {
    /// Returns the number of Gaussians.
    pub fn len(&self) -> usize {
        self.mean.len()
    }

    /// Returns whether there is no Gaussian.
    pub fn is_empty(&self) -> bool {
        self.mean.is_empty()
    }

    /// Returns the model, which follows from the attributes that are present.
    pub fn model(&self) -> Model {
        if self.mean_t.is_empty() {
            Model::Static3d
        } else if self.rotation_r.is_empty() {
            Model::Unrotated4d
        } else {
            Model::Rotated4d
        }
    }

    /// Converts rotations of the *unflipped* convention (original code before 2024-09-15) to the flipped one:
    /// `l' = (a, −b, c, −d)`, `r' = (p, q, −r, −s)`. Exact, also for raw quaternions. Changes 4D rotations only.
    pub fn flip_rotations(&mut self) {
        if self.model() != Model::Rotated4d {
            return;
        }
        for l in &mut self.rotation_l {
            *l = [l[0], -l[1], l[2], -l[3]];
        }
        for r in &mut self.rotation_r {
            *r = [r[0], r[1], -r[2], -r[3]];
        }
    }
}
