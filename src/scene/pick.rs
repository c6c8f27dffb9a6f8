//! Picking: the Gaussian that a ray hits.
//!
//! In: a ray in capture space, and [`PickSettings`] with the time and the Gaussians that can be hit. Out: a [`Pick`];
//! `None` if the ray hits nothing.
//!
//! Along a ray every Gaussian is a Gaussian of one dimension. With the conditional mean `m` and covariance `Σ` at time
//! `t`, the ray's origin `o`, its unit direction `w` and two unit vectors `u`, `v` across it:
//!
//! ```text
//! q     = [u v]ᵀ (m − o)                     offset of the mean across the ray
//! S     = [u v]ᵀ Σ [u v] + ε 1               the covariance across the ray
//! D²    = qᵀ S⁻¹ q                           smallest squared Mahalanobis distance of the ray to the mean
//! depth = wᵀ (m − o) − wᵀ Σ [u v] S⁻¹ q      position of that point on the ray: the densest point
//! alpha = min(0.99, opacity · marginal(t) · exp(−½ D²))
//! ```
//!
//! The values are those of `blend` at a pixel, without the perspective within a splat and the low-pass on the screen.
//! As in `blend`, a Gaussian whose marginal is not above the cut-off, or an alpha below 1/255, is skipped. Front to
//! back by depth, the transmittance is multiplied by `1 − alpha`; the Gaussian at which it falls to `1 − threshold` or
//! below is hit. With a threshold of one half, this is the Gaussian whose depth is the median depth.
//!
//! `S` is the projection of `Σ` and does not need its inverse, so that flat Gaussians, whose `Σ` has no inverse, are
//! not a special case. `S` has no inverse only for a disk seen exactly edge-on or a needle seen exactly end-on.
//! Therefore `ε = 2⁻²² tr Σ` is added, which is as small as possible: the rounding of covariances to `f32` can turn a
//! variance of 0 into −¾ ε. With ε a disk is about 1/2000 as thick as it is wide. A Gaussian without any extent is
//! never hit.

use super::{RuntimeScene, TemporalFilter};
use crate::gaussian::Gaussian;
use crate::gaussian::alpha::{ALPHA_MIN, visible};
use glam::{Affine3A, DMat3, DVec2, DVec3, Vec3, Vec4};
use rayon::prelude::*;

/// ε in parts of the trace of Σ: 2⁻²².
const LEAST_VARIANCE: f64 = 1.0 / (1u32 << 22) as f64;

/// The time at which a ray is cast, and the Gaussians that it can hit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PickSettings {
    /// Timestamp, in the capture's unit. Default: 0.
    pub time: f32,
    /// Whether Gaussians that the capture's temporal filter leaves inactive are ignored. Default: `true`.
    pub use_filter: bool,
    /// Opacity that must accumulate along the ray for a hit, 0 to 1. Default: 0.5.
    pub threshold: f32,
    /// Factor on the opacity of every Gaussian. Default: 1.
    pub opacity: f32,
    /// Transforms capture space to the cube from −1 to 1; Gaussians whose mean is outside are ignored. Default: `None`,
    /// no crop.
    pub crop: Option<Affine3A>,
    /// A plane `p` in capture space, such as the near plane of a camera; Gaussians whose mean `m` is not in front of it,
    /// `p.xyz · m + p.w > 0`, are ignored. Default: `None`, no plane.
    pub near_plane: Option<Vec4>,
    /// Largest distance of a hit, in lengths of the ray's direction. Default: infinite.
    pub max_distance: f32,
}

impl Default for PickSettings {
    fn default() -> Self {
        Self {
            time: 0.0,
            use_filter: true,
            threshold: 0.5,
            opacity: 1.0,
            crop: None,
            near_plane: None,
            max_distance: f32::INFINITY,
        }
    }
}

/// The Gaussian that a ray hits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pick {
    /// Index of the Gaussian.
    pub gaussian: usize,
    /// Distance to the densest point of that Gaussian on the ray, in lengths of the ray's direction.
    pub distance: f32,
    /// That point, in capture space.
    pub point: Vec3,
}

impl RuntimeScene {
    /// Returns the Gaussian that the ray from `origin` along `direction` (of any length), both in capture space, hits.
    /// The formula is in `scene::pick`.
    ///
    /// `None` if the ray hits nothing, and for an invalid ray: a direction of length zero, or numbers that are not
    /// finite. A Gaussian whose densest point on the ray lies behind the origin is not hit.
    pub fn pick(&self, origin: Vec3, direction: Vec3, settings: &PickSettings) -> Option<Pick> {
        let ray = Ray::new(origin, direction)?;
        let fits = |filter: &&TemporalFilter| settings.use_filter && filter.count == self.len();
        let filter = self.filter.as_ref().filter(fits);
        let active = filter.map(|f| (f, f.segment_of(settings.time, self.trained_with.time_interval)));
        let is_active = |index| active.is_none_or(|(filter, segment)| filter.is_active(segment, index));
        let cutoff = self.trained_with.marginal_cutoff;
        // Most Gaussians are absent at any one time: decoding all of them would take most of the time of a pick.
        let is_present = |index| self.form.lifespan(index).marginal(settings.time) > cutoff;
        let mut crossed: Vec<(Crossing, usize)> = (0..self.len())
            .into_par_iter()
            .filter(|&index| is_active(index) && is_present(index))
            .filter_map(|index| Some((ray.cross(&self.gaussian(index), cutoff, settings)?, index)))
            .collect();
        crossed.sort_unstable_by(|(a, i), (b, k)| a.depth.total_cmp(&b.depth).then(i.cmp(k)));
        let mut transmittance = 1.0;
        let (crossing, gaussian) = crossed.into_iter().find(|(crossing, _)| {
            transmittance *= 1.0 - crossing.alpha;
            transmittance <= 1.0 - settings.threshold
        })?;
        let distance = (crossing.depth / ray.length) as f32;
        Some(Pick { gaussian, distance, point: origin + direction * distance })
    }
}

/// A ray with two unit vectors perpendicular to it.
struct Ray {
    origin: DVec3,
    along: DVec3,
    across: [DVec3; 2],
    /// Length of the direction that was given; `along` is a unit vector.
    length: f64,
}

/// A Gaussian on a ray.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Crossing {
    /// Depth of its densest point, capture units from the origin.
    depth: f64,
    alpha: f32,
}

impl Ray {
    fn new(origin: Vec3, direction: Vec3) -> Option<Self> {
        let (origin, direction) = (origin.as_dvec3(), direction.as_dvec3());
        let length = direction.length();
        if !origin.is_finite() || !length.is_finite() || length == 0.0 {
            return None;
        }
        let along = direction / length;
        let (u, v) = along.any_orthonormal_pair();
        Some(Self { origin, along, across: [u, v], length })
    }

    /// Returns the depth and alpha of a Gaussian on the ray; `None` if it is not visible there, for example because its
    /// marginal is not above `cutoff`. The comparisons treat NaN as not visible.
    fn cross(&self, gaussian: &Gaussian, cutoff: f32, settings: &PickSettings) -> Option<Crossing> {
        let marginal = gaussian.marginal(settings.time);
        let mean = gaussian.mean_at(settings.time);
        let peak = gaussian.opacity * marginal * settings.opacity;
        let is_inside = |crop: Affine3A| crop.transform_point3(mean).abs().cmple(Vec3::ONE).all();
        let is_in_front = |plane: Vec4| plane.dot(mean.extend(1.0)) > 0.0;
        let is_kept = settings.crop.is_none_or(is_inside) && settings.near_plane.is_none_or(is_in_front);
        let is_there = marginal > cutoff && peak >= ALPHA_MIN;
        if !(is_there && is_kept) {
            return None;
        }
        let [xx, xy, xz, yy, yz, zz] = gaussian.covariance.map(f64::from);
        let covariance = DMat3::from_cols(DVec3::new(xx, xy, xz), DVec3::new(xy, yy, yz), DVec3::new(xz, yz, zz));
        let [u, v] = self.across;
        let (with_u, with_v) = (covariance * u, covariance * v);
        let least = LEAST_VARIANCE * (xx + yy + zz);
        let (a, b, c) = (u.dot(with_u) + least, u.dot(with_v), v.dot(with_v) + least);
        let determinant = a * c - b * b;

        let to_mean = mean.as_dvec3() - self.origin;
        let q = DVec2::new(u.dot(to_mean), v.dot(to_mean));
        let solved = DVec2::new(c * q.x - b * q.y, a * q.y - b * q.x) / determinant;
        let depth = self.along.dot(to_mean) - solved.dot(DVec2::new(self.along.dot(with_u), self.along.dot(with_v)));
        let alpha = visible(peak * (-0.5 * q.dot(solved)).exp() as f32)?;
        let is_hit = a > 0.0 && determinant > 0.0;
        let is_near = depth > 0.0 && depth / self.length <= f64::from(settings.max_distance);
        (is_hit && is_near).then_some(Crossing { depth, alpha })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::array::uniform3;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig { cases: 256, failure_persistence: None, ..ProptestConfig::default() })]

        /// Computes the same numbers independently: by the inverse of the covariance and a search along the ray.
        #[test]
        fn depth_and_alpha_match_a_search_for_the_densest_point(
            factors in prop::array::uniform9(-0.5f64..0.5),
            mean in uniform3(-1.0f32..1.0),
            target in uniform3(-0.5f32..0.5),
        ) {
            let factor = DMat3::from_cols_array(&factors);
            let covariance = factor * factor.transpose() + DMat3::from_diagonal(DVec3::splat(0.02));
            let upper = [
                covariance.x_axis.x, covariance.x_axis.y, covariance.x_axis.z,
                covariance.y_axis.y, covariance.y_axis.z, covariance.z_axis.z,
            ];
            let gaussian = Gaussian {
                mean,
                mean_t: 0.5,
                velocity: [0.0; 3],
                sigma_t: f32::INFINITY,
                covariance: upper.map(|value| value as f32),
                opacity: 0.9,
                padding: 0.0,
            };
            let (origin, target) = (Vec3::new(0.0, 0.0, -9.0), Vec3::from(mean) + Vec3::from(target));
            let ray = Ray::new(origin, target - origin).expect("a ray");

            let inverse = covariance.inverse();
            let energy = |depth: f64| {
                let apart = ray.origin + ray.along * depth - gaussian.mean_at(0.5).as_dvec3();
                apart.dot(inverse * apart)
            };
            let (mut low, mut high) = (0.0, 30.0);
            while high - low > 1e-7 {
                let third = (high - low) / 3.0;
                [low, high] = if energy(low + third) < energy(high - third) { [low, high - third] } else { [low + third, high] };
            }
            let alpha = 0.9 * (-0.5 * energy(low)).exp();
            match ray.cross(&gaussian, 0.05, &PickSettings { time: 0.5, ..PickSettings::default() }) {
                // Rounding of the covariance to f32 and ε are some 1e-6 of it, and its condition is below 200.
                Some(crossing) => {
                    prop_assert!((crossing.depth - low).abs() < 1e-3, "depth {}, expected {low}", crossing.depth);
                    prop_assert!((f64::from(crossing.alpha) - alpha).abs() < 1e-3, "alpha {}, expected {alpha}", crossing.alpha);
                }
                None => prop_assert!(alpha < f64::from(ALPHA_MIN) + 1e-5, "an alpha of {alpha} is visible"),
            }
        }
    }
}
