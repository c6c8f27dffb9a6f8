//! The slice: from the trained form to the runtime form, once, when a scene is loaded or packed.
//!
//! In: raw [`Parameters`]. Out: one [`Gaussian`] each, activated, in capture space, computed in double precision.

use super::lifespan::Lifespan;
use super::outer::outer;
use super::parameters::{Model, Parameters};
use glam::{DMat3, DMat4, DQuat, DVec3, DVec4, Vec3};
use rayon::prelude::*;
use std::ops::Range;

/// One Gaussian in the runtime form: activated, sliced, capture space. 64 bytes; the record on the GPU is the same,
/// except that it holds `1/σ_t` in place of `σ_t`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Gaussian {
    /// Mean at time `mean_t`, capture units.
    pub mean: [f32; 3],
    /// Temporal mean μ_t, timestamp units.
    pub mean_t: f32,
    /// Velocity c/v, capture units per timestamp unit.
    pub velocity: [f32; 3],
    /// Temporal standard deviation σ_t of the marginal, timestamp units; infinite if the Gaussian is present at every
    /// time.
    pub sigma_t: f32,
    /// Conditional covariance, upper triangle xx, xy, xz, yy, yz, zz, capture units squared.
    pub covariance: [f32; 6],
    /// Peak opacity, 0 to 1; 0 of the fillers of packed blocks alone.
    pub opacity: f32,
    /// Unused; zero.
    pub padding: f32,
}

impl Gaussian {
    /// Returns its opacity envelope in time.
    pub fn lifespan(&self) -> Lifespan {
        Lifespan { mean_t: self.mean_t, sigma_t: self.sigma_t }
    }

    /// Returns the unnormalized marginal at `time`, in (0, 1]: the factor on the opacity.
    pub fn marginal(&self, time: f32) -> f32 {
        self.lifespan().marginal(time)
    }

    /// Returns the conditional mean at `time`, capture space.
    pub fn mean_at(&self, time: f32) -> Vec3 {
        Vec3::from(self.mean) + Vec3::from(self.velocity) * (time - self.mean_t)
    }
}

/// Settings of the slice.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SliceSettings {
    /// Factor on all four scales. Default: 1, as in training.
    pub scale_modifier: f32,
    /// Added to the temporal variance in the marginal only, if positive (the original's `prefilter_var`). Default: −1,
    /// nothing is added.
    pub prefilter_var: f32,
}

impl Default for SliceSettings {
    fn default() -> Self {
        Self { scale_modifier: 1.0, prefilter_var: -1.0 }
    }
}

/// A Gaussian that cannot be drawn: the file is damaged or was not meant for this reader.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("Gaussian {index}: {reason}")]
pub struct InvalidGaussian {
    /// Its index in the file, from 0.
    pub index: usize,
    /// Why it cannot be drawn.
    pub reason: &'static str,
}

impl Parameters {
    /// Slices every Gaussian: `cov3 = A − c cᵀ/v`, velocity `c/v`, marginal variance `v + prefilter_var`.
    ///
    /// # Errors
    /// The first Gaussian with a value that is not finite, a quaternion of length zero, or scales so extreme that the
    /// result is not finite.
    ///
    /// # Panics
    /// If an attribute of the model has fewer entries than there are means.
    pub fn slice(&self, settings: &SliceSettings) -> Result<Vec<Gaussian>, InvalidGaussian> {
        self.slice_some(0..self.len(), settings)
    }

    /// Slices some Gaussians, as [`slice`](Self::slice) does.
    pub(crate) fn slice_some(
        &self,
        range: Range<usize>,
        settings: &SliceSettings,
    ) -> Result<Vec<Gaussian>, InvalidGaussian> {
        let model = self.model();
        let some: Vec<_> = range.into_par_iter().map(|i| self.slice_one(i, model, settings)).collect();
        // Collected in order, so that the error names the first invalid Gaussian.
        some.into_iter().collect()
    }

    /// Returns the factor `L = R S` of the 4D covariance `L Lᵀ` of one Gaussian, axes x, y, z, t; the last is zero in a
    /// static model.
    ///
    /// # Errors
    /// A quaternion of length zero or not finite.
    ///
    /// # Panics
    /// As [`slice`](Self::slice).
    pub fn factor(&self, index: usize) -> Result<DMat4, InvalidGaussian> {
        let invalid = |reason| InvalidGaussian { index, reason };
        let scale = DVec3::from(self.log_scale[index].map(|s| f64::from(s).exp()));
        let l = unit(self.rotation_l[index]).ok_or(invalid("a rotation of length zero or not finite"))?;
        let around = || DMat4::from_quat(DQuat::from_xyzw(l.y, l.z, l.w, l.x));
        let temporal = || f64::from(self.log_scale_t[index]).exp();
        let (rotation, scale_t) = match self.model() {
            Model::Rotated4d => {
                let r = unit(self.rotation_r[index]);
                (rotation_4d(l, r.ok_or(invalid("a right rotation of length zero or not finite"))?), temporal())
            }
            Model::Unrotated4d => (around(), temporal().sqrt()),
            Model::Static3d => (around(), 0.0),
        };
        Ok(rotation * DMat4::from_diagonal(scale.extend(scale_t)))
    }

    fn slice_one(&self, index: usize, model: Model, settings: &SliceSettings) -> Result<Gaussian, InvalidGaussian> {
        let invalid = |reason| InvalidGaussian { index, reason };
        let modifier = f64::from(settings.scale_modifier);
        let scale = DVec3::from(self.log_scale[index].map(|s| f64::from(s).exp())) * modifier;
        let rotation_l = unit(self.rotation_l[index]).ok_or(invalid("a rotation of length zero or not finite"))?;
        let prefilter = f64::from(settings.prefilter_var.max(0.0));
        let (covariance, velocity, variance_t) = match model {
            Model::Rotated4d => {
                let rotation_r =
                    unit(self.rotation_r[index]).ok_or(invalid("a right rotation of length zero or not finite"))?;
                let q = rotation_4d(rotation_l, rotation_r);
                let scale_t = f64::from(self.log_scale_t[index]).exp() * modifier;
                let s = scale.extend(scale_t);
                let m = q * DMat4::from_diagonal(s);
                let sigma = m * m.transpose();
                let (a, c, v) = (DMat3::from_mat4(sigma), sigma.w_axis.truncate(), sigma.w_axis.w);
                // Equal quaternions give a Gaussian at rest: what rounding leaves of its velocity costs bits in a package.
                let is_at_rest = self.rotation_l[index] == self.rotation_r[index];
                (a - outer(c, c) * v.recip(), if is_at_rest { DVec3::ZERO } else { c / v }, v + prefilter)
            }
            Model::Unrotated4d => {
                // The original uses the temporal scale as the variance here, not squared.
                let v = f64::from(self.log_scale_t[index]).exp() * modifier;
                (covariance_3d(rotation_l, scale), DVec3::ZERO, v + prefilter)
            }
            Model::Static3d => (covariance_3d(rotation_l, scale), DVec3::ZERO, f64::INFINITY),
        };
        let gaussian = Gaussian {
            mean: self.mean[index],
            mean_t: if model == Model::Static3d { 0.0 } else { self.mean_t[index] },
            velocity: velocity.as_vec3().to_array(),
            sigma_t: variance_t.sqrt() as f32,
            covariance: upper_triangle(covariance).map(|c| c as f32),
            opacity: (1.0 / (1.0 + (-f64::from(self.opacity_logit[index])).exp())) as f32,
            padding: 0.0,
        };
        gaussian.check().map_err(invalid)?;
        Ok(gaussian)
    }
}

impl Gaussian {
    /// Checks that every value is finite (σ_t may be infinite), the temporal deviation positive and the opacity from 0
    /// to 1.
    ///
    /// # Errors
    /// A description of the problem.
    pub fn check(&self) -> Result<(), &'static str> {
        let finite = |values: &[f32]| values.iter().all(|v| v.is_finite());
        if !finite(&self.mean) {
            Err("a mean that is not finite")
        } else if !self.mean_t.is_finite() {
            Err("a temporal mean that is not finite")
        } else if self.sigma_t.is_nan() || self.sigma_t < f32::MIN_POSITIVE {
            Err("a temporal scale that is zero or not a number")
        } else if !finite(&self.velocity) {
            Err("a velocity that is not finite (temporal scale too small)")
        } else if !finite(&self.covariance) {
            Err("a scale that is not finite or too large")
        } else if !self.has_covariance() {
            Err("a covariance that is not positive semidefinite")
        } else if !(0.0..=1.0).contains(&self.opacity) {
            Err("an opacity that is not a number between 0 and 1")
        } else {
            Ok(())
        }
    }

    /// Returns whether no variance is negative and `σ_ij² ≤ σ_ii σ_jj`, up to rounding in single precision.
    fn has_covariance(&self) -> bool {
        let [xx, xy, xz, yy, yz, zz] = self.covariance.map(f64::from);
        let rounding = (xx + yy + zz) * 1e-5 + f64::from(f32::MIN_POSITIVE);
        let [x, y, z] = [xx, yy, zz].map(|variance| variance + rounding);
        x >= 0.0 && y >= 0.0 && z >= 0.0 && xy * xy <= x * y && xz * xz <= x * z && yz * yz <= y * z
    }
}

/// Returns xx, xy, xz, yy, yz, zz of a covariance. Rounding of a difference of larger numbers can leave entries that
/// are not those of a covariance; these are moved to the nearest value that `0 ≤ σ_ii` and `σ_ij² ≤ σ_ii σ_jj` allow.
fn upper_triangle(covariance: DMat3) -> [f64; 6] {
    let [x, y, z] = covariance.to_cols_array_2d();
    // Numbers that are not finite stay so, and are refused later.
    let [xx, yy, zz] = [x[0], y[1], z[2]].map(|variance| if variance < 0.0 { 0.0 } else { variance });
    let within = |entry: f64, a: f64, b: f64| {
        let most = a.sqrt() * b.sqrt();
        if entry.abs() > most { most.copysign(entry) } else { entry }
    };
    [xx, within(x[1], xx, yy), within(x[2], xx, zz), yy, within(y[2], yy, zz), zz]
}

/// Returns the unit quaternion (w, x, y, z); `None` if the length is zero or not finite.
fn unit(q: [f32; 4]) -> Option<DVec4> {
    let q = DVec4::from(q.map(f64::from));
    let length = q.length();
    (length.is_finite() && length > 1e-12).then(|| q / length)
}

/// Returns `R diag(s)² Rᵀ` with the ordinary rotation matrix of the quaternion (w, x, y, z).
fn covariance_3d(q: DVec4, scale: DVec3) -> DMat3 {
    let m = DMat3::from_quat(DQuat::from_xyzw(q.y, q.z, q.w, q.x)) * DMat3::from_diagonal(scale);
    m * m.transpose()
}

/// Returns the 4D rotation `Q = L(l) R(r)` of a pair of unit quaternions (a, b, c, d) and (p, q, r, s), acting on
/// column vectors (x, y, z, t); flipped convention.
pub fn rotation_4d(l: DVec4, r: DVec4) -> DMat4 {
    let [a, b, c, d] = l.to_array();
    let [p, q, r, s] = r.to_array();
    let left = DMat4::from_cols_array(&[a, -b, c, -d, b, a, -d, -c, -c, d, a, -b, d, c, b, a]);
    let right = DMat4::from_cols_array(&[p, -q, r, s, q, p, -s, r, -r, s, p, q, -s, -r, -q, p]);
    left * right
}

#[cfg(test)]
mod tests {
    use super::*;

    fn one(l: [f32; 4], r: [f32; 4]) -> Parameters {
        Parameters {
            mean: vec![[0.1, 0.2, 0.3]],
            mean_t: vec![0.5],
            log_scale: vec![[-1.0, -2.0, -3.0]],
            log_scale_t: vec![-1.5],
            rotation_l: vec![l],
            rotation_r: vec![r],
            opacity_logit: vec![0.3],
        }
    }

    #[test]
    fn rotation_is_orthogonal() {
        let q = rotation_4d(DVec4::new(0.1, 0.7, -0.3, 0.2).normalize(), DVec4::new(-0.4, 0.2, 0.6, 0.9).normalize());
        assert!((q * q.transpose()).abs_diff_eq(DMat4::IDENTITY, 1e-12), "Q Qᵀ is the identity");
        assert!((q.determinant() - 1.0).abs() < 1e-12, "Q is a proper rotation");
    }

    #[test]
    fn equal_quaternions_give_a_gaussian_at_rest() {
        let q = [0.3, -0.5, 0.2, 0.8];
        let still = one(q, q).slice(&SliceSettings::default()).expect("valid")[0];
        assert!(Vec3::from(still.velocity).length() < 1e-6, "no coupling of space and time");
        let spun = Parameters { rotation_l: vec![[q[0], -q[3], -q[2], -q[1]]], rotation_r: vec![], ..one(q, q) };
        let plain = spun.slice(&SliceSettings::default()).expect("valid")[0];
        for (a, b) in still.covariance.iter().zip(plain.covariance) {
            assert!((a - b).abs() < 1e-6, "the 3D block is the rotation of (a, -d, -c, -b)");
        }
    }

    #[test]
    fn a_matrix_that_is_not_a_covariance_is_refused() {
        let good =
            one([0.1, 0.7, -0.3, 0.2], [-0.4, 0.2, 0.6, 0.9]).slice(&SliceSettings::default()).expect("valid")[0];
        let needle = Gaussian { covariance: [1.0, 1.0, 1.0, 1.0, 1.0, 1.0], ..good };
        assert_eq!(needle.check(), Ok(()), "a needle along the diagonal has a covariance without volume");
        for covariance in
            [[-1e-3, 0.0, 0.0, 1.0, 0.0, 1.0], [1.0, 1.1, 0.0, 1.0, 0.0, 1.0], [1.0, 0.0, 0.0, 1.0, -3e38, 1.0]]
        {
            let found = Gaussian { covariance, ..good }.check();
            assert!(found.is_err_and(|reason| reason.contains("covariance")), "{covariance:?} is not a covariance");
        }
    }

    #[test]
    fn rounding_never_makes_a_slice_invalid() {
        for log_scale in [-4.0, -12.0, -18.0, -24.0, -40.0] {
            let parameters = Parameters {
                log_scale: vec![[log_scale, log_scale - 1.0, log_scale - 2.0]],
                log_scale_t: vec![0.0],
                ..one([0.1, 0.7, -0.3, 0.2], [-0.4, 0.2, 0.6, 0.9])
            };
            let sliced = parameters.slice(&SliceSettings::default());
            assert!(sliced.is_ok(), "log scales from {log_scale} beside a temporal scale of 1: {sliced:?}");
        }
    }

    #[test]
    fn invalid_parameters_are_refused_with_the_attribute_named() {
        let good = one([1.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]);
        let reason = |p: Parameters| p.slice(&SliceSettings::default()).expect_err("must be refused").reason;
        assert!(
            reason(Parameters { mean: vec![[f32::NAN, 0.0, 0.0]], ..good.clone() }).contains("mean"),
            "a NaN mean is refused"
        );
        assert!(
            reason(Parameters { rotation_l: vec![[0.0; 4]], ..good.clone() }).contains("length zero"),
            "a quaternion of length zero is refused"
        );
        for huge in [200.0, 400.0] {
            let found = reason(Parameters { log_scale: vec![[huge, 0.0, 0.0]], ..good.clone() });
            assert!(found.contains("scale") || found.contains("velocity"), "a log scale of {huge} is refused: {found}");
        }
        assert!(
            reason(Parameters { opacity_logit: vec![f32::NAN], ..good }).contains("opacity"),
            "a NaN opacity is refused"
        );
    }
}
