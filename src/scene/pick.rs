//! Picking: the Gaussian that a ray hits.
//!
//! In: a ray in capture space, a moment and what is to be seen of the capture ([`PickSettings`]). Out: a [`Pick`], or nothing.
//!
//! Along a ray every Gaussian is a Gaussian of one dimension. With the conditional mean `m` and covariance `Σ` at time `t`, the
//! ray's origin `o`, its unit direction `w` and two unit vectors `u`, `v` across it:
//!
//! ```text
//! q     = [u v]ᵀ (m − o)                     where the mean is, across the ray
//! S     = [u v]ᵀ Σ [u v] + ε 1               the covariance across the ray
//! D²    = qᵀ S⁻¹ q                           smallest squared Mahalanobis distance of the ray to the mean
//! depth = wᵀ (m − o) − wᵀ Σ [u v] S⁻¹ q      where on the ray that is: its densest point
//! alpha = min(0.99, opacity · marginal(t) · exp(−½ D²))
//! ```
//!
//! This is what `blend` does to a pixel, but for the perspective within a splat and the low-pass of the screen. As there, a marginal
//! of 0.05 or less is not there, and an alpha below 1/255 is skipped. Front to back by depth, what is left of the light is
//! multiplied by `1 − alpha`; the Gaussian at which it falls to `1 − threshold` or below is hit: with a threshold of one half, the one
//! whose depth is the median.
//!
//! `S` is the projection of `Σ` and needs no inverse of it, so that flat Gaussians, whose `Σ` has none, are no special case. Only a
//! disc seen exactly from its edge, or a needle from its tip, leaves `S` without an inverse. Therefore `ε = 2⁻²² tr Σ`, which is as
//! small as it can be: the rounding of covariances to `f32` can make a variance of 0 appear as −¾ of that. It makes a disc about
//! 1/2000 as thick as it is wide. A Gaussian without any extent is never hit.

use super::{RuntimeScene, TemporalFilter};
use crate::gaussian::projection::{ALPHA_MAX, ALPHA_MIN};
use crate::gaussian::{Gaussian, MARGINAL_CUTOFF};
use glam::{Affine3A, DMat3, DVec2, DVec3, Vec3};
use rayon::prelude::*;

/// ε in parts of the trace of Σ: 2⁻²².
const LEAST_VARIANCE: f64 = 1.0 / (1u32 << 22) as f64;

/// What is to be seen of a capture, and when.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PickSettings {
    /// Timestamp, in the capture's unit.
    pub time: f32,
    /// Whether what the capture's temporal filter, if it has one, does not leave active is not there.
    pub use_filter: bool,
    /// Opacity that has to add up along the ray, 0 to 1, for something to be hit.
    pub threshold: f32,
    /// Factor on the opacity of every Gaussian.
    pub opacity: f32,
    /// Capture space to the cube from −1 to 1: Gaussians whose mean lies outside are not there.
    pub crop: Option<Affine3A>,
    /// Gaussians beyond are not there; in lengths of the ray's direction.
    pub max_distance: f32,
}

impl Default for PickSettings {
    fn default() -> Self {
        Self { time: 0.0, use_filter: true, threshold: 0.5, opacity: 1.0, crop: None, max_distance: f32::INFINITY }
    }
}

/// What a ray hits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pick {
    /// Index of the Gaussian.
    pub gaussian: usize,
    /// Where on the ray that Gaussian is densest, in lengths of the ray's direction.
    pub distance: f32,
    /// The same as a point in capture space.
    pub point: Vec3,
}

impl RuntimeScene {
    /// What the ray from `origin` along `direction` (of any length), both in capture space, hits. The page of
    /// [`scene::pick`](crate::scene::pick) has the formula.
    ///
    /// Nothing if the ray passes through or by, and for a ray that is none: a direction without a length, numbers that are not finite.
    /// A Gaussian whose densest point on the ray lies behind the origin is not hit.
    pub fn pick(&self, origin: Vec3, direction: Vec3, settings: &PickSettings) -> Option<Pick> {
        let ray = Ray::new(origin, direction)?;
        let fits = |filter: &&TemporalFilter| settings.use_filter && filter.count == self.len();
        let filter = self.filter.as_ref().filter(fits);
        let active = filter.map(|f| (f, f.segment_of(settings.time, self.trained_with.time_interval)));
        let is_active = |index| active.is_none_or(|(filter, segment)| filter.is_active(segment, index));
        let mut crossed: Vec<(Crossing, usize)> = (0..self.len())
            .into_par_iter()
            .filter(|&index| is_active(index))
            .filter_map(|index| Some((ray.cross(&self.gaussian(index), settings)?, index)))
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

/// A ray with the two directions across it.
struct Ray {
    origin: DVec3,
    along: DVec3,
    across: [DVec3; 2],
    /// Of the direction that was given; the three above are unit vectors.
    length: f64,
}

/// A Gaussian on a ray.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Crossing {
    /// Of its densest point, capture units from the origin.
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

    /// Where and how much of a Gaussian is on the ray, if any of it is. Comparisons are such that what is no number is not there.
    fn cross(&self, gaussian: &Gaussian, settings: &PickSettings) -> Option<Crossing> {
        let marginal = gaussian.marginal(settings.time);
        let mean = gaussian.mean_at(settings.time);
        let peak = gaussian.opacity * marginal * settings.opacity;
        let is_inside = |crop: Affine3A| crop.transform_point3(mean).abs().cmple(Vec3::ONE).all();
        let is_there = marginal > MARGINAL_CUTOFF && peak >= ALPHA_MIN && settings.crop.is_none_or(is_inside);
        if !is_there {
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
        let alpha = (peak * (-0.5 * q.dot(solved)).exp() as f32).min(ALPHA_MAX);
        let is_hit = a > 0.0 && determinant > 0.0 && alpha >= ALPHA_MIN;
        let is_near = depth > 0.0 && depth / self.length <= f64::from(settings.max_distance);
        (is_hit && is_near).then_some(Crossing { depth, alpha })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gaussian::Harmonics;
    use crate::reference::{self, Layer, Splat};
    use crate::scene::{FilterKind, PlaybackHints, TemporalFilter, TrainedWith};
    use crate::view::{Appearance, Background, BlendSpace, Camera, RasterFov};
    use glam::{Mat4, Quat, UVec2};
    use proptest::array::uniform3;
    use proptest::prelude::*;

    /// A Gaussian at rest, always there.
    fn still(mean: Vec3, covariance: [f32; 6], opacity: f32) -> Gaussian {
        Gaussian {
            mean: mean.to_array(),
            mean_t: 0.5,
            velocity: [0.0; 3],
            sigma_t: f32::INFINITY,
            covariance,
            opacity,
            padding: 0.0,
        }
    }

    /// A round one on the z axis.
    fn ball(z: f32, opacity: f32) -> Gaussian {
        still(Vec3::new(0.0, 0.0, z), [0.01, 0.0, 0.0, 0.01, 0.0, 0.01], opacity)
    }

    fn scene(gaussians: &[Gaussian]) -> RuntimeScene {
        RuntimeScene {
            gaussians: gaussians.to_vec(),
            packed: None,
            harmonics: Harmonics { coefficients: 1, values: vec![0.0; gaussians.len() * 3], ..Harmonics::default() },
            environment: None,
            filter: None,
            trained_with: TrainedWith::default(),
            playback: PlaybackHints::default(),
        }
    }

    /// Along +z from the origin.
    fn pick(gaussians: &[Gaussian], settings: &PickSettings) -> Option<Pick> {
        scene(gaussians).pick(Vec3::ZERO, Vec3::Z, settings)
    }

    fn hit(gaussians: &[Gaussian]) -> Option<(usize, f32)> {
        pick(gaussians, &PickSettings::default()).map(|pick| (pick.gaussian, pick.distance))
    }

    #[test]
    fn a_ray_hits_a_gaussian_where_it_is_densest() {
        let scene = scene(&[ball(5.0, 0.9)]);
        let pick = scene.pick(Vec3::ZERO, Vec3::Z * 2.0, &PickSettings::default()).expect("through the middle");
        assert_eq!(
            pick,
            Pick { gaussian: 0, distance: 2.5, point: Vec3::new(0.0, 0.0, 5.0) },
            "in the direction's lengths"
        );
        let beside = scene.pick(Vec3::new(0.05, 0.0, 0.0), Vec3::Z, &PickSettings::default()).expect("near the middle");
        assert!(
            (beside.distance - 5.0).abs() < 1e-5,
            "a round one is densest beside its mean, not at {}",
            beside.distance
        );
    }

    #[test]
    fn rays_that_hit_nothing_say_so() {
        let scene = scene(&[ball(5.0, 0.9)]);
        let misses = [
            (Vec3::new(1.0, 0.0, 0.0), Vec3::Z, "beside"),
            (Vec3::ZERO, Vec3::NEG_Z, "the other way"),
            (Vec3::new(0.0, 0.0, 5.01), Vec3::Z, "from just behind its middle"),
            (Vec3::ZERO, Vec3::ZERO, "no direction"),
            (Vec3::ZERO, Vec3::NAN, "no number for a direction"),
            (Vec3::new(f32::INFINITY, 0.0, 0.0), Vec3::Z, "from nowhere"),
        ];
        for (origin, direction, what) in misses {
            assert_eq!(scene.pick(origin, direction, &PickSettings::default()), None, "{what}");
        }
        assert_eq!(hit(&[]), None, "an empty scene");
        assert_eq!(hit(&[ball(5.0, 0.49)]), None, "too faint to be hit");
    }

    #[test]
    fn the_first_that_leaves_less_than_half_is_hit() {
        assert_eq!(hit(&[ball(7.0, 0.9), ball(5.0, 0.9)]), Some((1, 5.0)), "the one in front, whatever its index");
        assert_eq!(hit(&[ball(7.0, 0.9), ball(5.0, 0.4)]), Some((0, 7.0)), "through a faint one");
        assert_eq!(
            hit(&[ball(7.0, 0.3), ball(5.0, 0.3), ball(6.0, 0.3)]),
            Some((2, 6.0)),
            "the second leaves 0.49 of 1"
        );
        let settings = PickSettings { threshold: 0.05, ..PickSettings::default() };
        let first = pick(&[ball(7.0, 0.9), ball(5.0, 0.1)], &settings).map(|pick| pick.gaussian);
        assert_eq!(first, Some(1), "with a lower threshold, the faint one");
        assert_eq!(hit(&[ball(5.0, 0.9), ball(5.0, 0.9)]), Some((0, 5.0)), "equal ones keep their order");
    }

    #[test]
    fn what_is_set_is_respected() {
        let pair = [ball(5.0, 0.9), ball(7.0, 0.9)];
        let hit = |settings: PickSettings| pick(&pair, &settings).map(|pick| pick.gaussian);
        let base = PickSettings::default();
        assert_eq!(hit(PickSettings { max_distance: 4.0, ..base }), None, "both are farther");
        assert_eq!(hit(PickSettings { opacity: 0.5, ..base }), Some(1), "half as opaque, both are needed");
        assert_eq!(hit(PickSettings { opacity: 0.0, ..base }), None, "faded out");
        let far = Affine3A::from_scale_rotation_translation(Vec3::ONE, Quat::IDENTITY, Vec3::new(0.0, 0.0, 7.5));
        assert_eq!(hit(PickSettings { crop: Some(far.inverse()), ..base }), Some(1), "the first is cropped");
        let nowhere = Affine3A::from_scale(Vec3::NAN);
        assert_eq!(hit(PickSettings { crop: Some(nowhere), ..base }), None, "no box holds nothing");
        assert_eq!(hit(PickSettings { time: f32::NAN, ..base }), None, "at no time nothing is there");
    }

    #[test]
    fn a_moving_gaussian_is_hit_where_it_is() {
        let mover = Gaussian { velocity: [0.0, 0.0, 4.0], sigma_t: 0.3, ..ball(5.0, 0.9) };
        let distance =
            |time| pick(&[mover], &PickSettings { time, ..PickSettings::default() }).map(|pick| pick.distance);
        assert_eq!(distance(0.5), Some(5.0), "at its own time");
        assert_eq!(distance(0.75), Some(6.0), "a quarter later");
        assert_eq!(distance(0.1), None, "its marginal of 0.41 leaves too little of it");
        let crosser = Gaussian { velocity: [4.0, 0.0, 0.0], sigma_t: f32::INFINITY, ..ball(5.0, 0.9) };
        let hits = |time| pick(&[crosser], &PickSettings { time, ..PickSettings::default() }).is_some();
        assert!(hits(0.5) && !hits(0.75), "it has moved out of the ray");
        let opaque = Gaussian { sigma_t: 0.1, opacity: 1.0, ..mover };
        let settings = PickSettings { threshold: 0.04, ..PickSettings::default() };
        let there = |time| pick(&[opaque], &PickSettings { time, ..settings }).is_some();
        assert!(there(0.5 + 0.244) && !there(0.5 + 0.246), "a marginal of 0.05 is not there, though 0.04 would do");
    }

    #[test]
    fn the_filter_is_respected() {
        let mut scene = scene(&[ball(5.0, 0.9), ball(7.0, 0.9)]);
        // In the first half of the time both, then only the second.
        scene.filter = Some(TemporalFilter::from_bits(FilterKind::Support, 2, 2, vec![0b11, 0b10]));
        let hit = |time, use_filter| {
            let settings = PickSettings { time, use_filter, ..PickSettings::default() };
            scene.pick(Vec3::ZERO, Vec3::Z, &settings).map(|pick| pick.gaussian)
        };
        assert_eq!((hit(0.25, true), hit(0.75, true)), (Some(0), Some(1)), "what is not active is not there");
        assert_eq!(hit(0.75, false), Some(0), "unless the filter is not used");
    }

    #[test]
    fn flat_gaussians_are_hit() {
        let disc = still(Vec3::new(0.0, 0.0, 5.0), [0.04, 0.0, 0.0, 0.04, 0.0, 0.0], 0.9);
        assert_eq!(hit(&[disc]), Some((0, 5.0)), "face on");
        let scene = scene(&[disc]);
        let pick = |origin: Vec3, direction| scene.pick(origin, direction, &PickSettings::default());
        let slanted = pick(Vec3::new(-5.0, 0.0, 0.1), Vec3::new(1.0, 0.0, 1.0)).expect("at an angle");
        assert!((slanted.point.z - 5.0).abs() < 1e-4, "on the disc, not at {}", slanted.point);
        let edge = pick(Vec3::new(-3.0, 0.0, 5.0), Vec3::X).expect("exactly from its edge");
        assert!((edge.distance - 3.0).abs() < 1e-4, "at its middle, not at {}", edge.distance);
        assert_eq!(
            pick(Vec3::new(-3.0, 0.0, 5.002), Vec3::X),
            None,
            "a hundredth of its width above, there is nothing"
        );
        let needle = still(Vec3::new(0.0, 0.0, 5.0), [0.0, 0.0, 0.0, 0.0, 0.0, 0.04], 0.9);
        assert_eq!(hit(&[needle]), Some((0, 5.0)), "a needle, exactly from its tip");
        assert_eq!(hit(&[still(Vec3::new(0.0, 0.0, 5.0), [0.0; 6], 0.9)]), None, "a point has no extent");
    }

    #[test]
    fn what_is_no_covariance_or_no_number_is_not_hit() {
        let good = ball(7.0, 0.9);
        for covariance in [
            [f32::NAN; 6],
            [f32::INFINITY; 6],
            [-0.01, 0.0, 0.0, -0.01, 0.0, -0.01],
            [0.01, 0.05, 0.0, 0.01, 0.0, 0.01],
        ] {
            let bad = Gaussian { covariance, ..ball(5.0, 0.9) };
            assert_eq!(hit(&[bad, good]), Some((1, 7.0)), "{covariance:?} is passed");
        }
        let nowhere = Gaussian { mean: [f32::NAN; 3], ..ball(5.0, 0.9) };
        assert_eq!(hit(&[nowhere, good]), Some((1, 7.0)), "a mean that is no number is passed");
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 256, failure_persistence: None, ..ProptestConfig::default() })]

        /// The other way to the same numbers: the inverse of the covariance, and a search along the ray.
        #[test]
        fn depth_and_alpha_are_those_of_the_densest_point(
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
            let gaussian = still(mean.into(), upper.map(|value| value as f32), 0.9);
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
            match ray.cross(&gaussian, &PickSettings { time: 0.5, ..PickSettings::default() }) {
                // Rounding of the covariance to f32 and ε are some 1e-6 of it, and its condition is below 200.
                Some(crossing) => {
                    prop_assert!((crossing.depth - low).abs() < 1e-3, "depth {} is {low}", crossing.depth);
                    prop_assert!((f64::from(crossing.alpha) - alpha).abs() < 1e-3, "alpha {} is {alpha}", crossing.alpha);
                }
                None => prop_assert!(alpha < f64::from(ALPHA_MIN) + 1e-5, "an alpha of {alpha} is not nothing"),
            }
        }
    }

    /// Ten Gaussians one behind the other, of about the same size on the screen, spread over it.
    fn column() -> Vec<Gaussian> {
        (0..10)
            .map(|index| {
                let z = 3.0 * 1.25f32.powi(index);
                let (angle, radius) = (2.4 * index as f32, 0.13 * z);
                let mean = Vec3::new(radius * angle.cos(), 0.6 * radius * angle.sin(), z);
                let turn = if index % 2 == 1 { 1.0 } else { -1.0 };
                let covariance =
                    [1.5, 0.3 * turn, 0.2, 1.0, -0.2 * turn, 0.8].map(|part: f32| part * (0.06 * z).powi(2));
                still(mean, covariance, 0.5 + 0.045 * index as f32)
            })
            .collect()
    }

    /// Whether a transmittance at the pixel is within 0.04 of one half; splats are in order of depth.
    fn is_close(splats: &[Splat], x: u32, y: u32) -> bool {
        let mut transmittance = 1.0f32;
        splats.iter().filter(|splat| splat.is_visible()).any(|splat| {
            let (dx, dy) = (splat.center.x - x as f32, splat.center.y - y as f32);
            let power = -0.5 * (splat.conic.x * dx * dx + splat.conic.z * dy * dy) - splat.conic.y * dx * dy;
            let alpha = (splat.opacity * power.exp()).min(ALPHA_MAX);
            transmittance *= if alpha < ALPHA_MIN { 1.0 } else { 1.0 - alpha };
            (transmittance - 0.5).abs() < 0.04
        })
    }

    /// Splats are affine approximations and have a low-pass, so that their alphas are not exactly those along the ray: for this scene,
    /// transmittances are up to 0.032 apart. Pixels where one of them is within 0.04 of one half could go either way and do not count;
    /// everywhere else both must say the same. Depths are those of different points (the splat's mean, the densest point).
    #[test]
    fn the_median_of_the_reference_render_is_hit() {
        let scene = scene(&column());
        let size = UVec2::new(48, 32);
        let camera = Camera { world_to_camera: Mat4::IDENTITY, size, lens: Camera::fov_lens(0.5, size) };
        let view = camera.view(0.5, RasterFov::Corrected);
        let layer = Layer { scene: &scene, view, appearance: Appearance::default() };
        let splats = reference::project(&layer, BlendSpace::Encoded);
        let medians = reference::render(&scene, &view, Background::None).median_depth;
        let pixels = (0..size.y).flat_map(|y| (0..size.x).map(move |x| (x, y)));
        let (mut compared, mut hits) = (0, 0);
        for ((x, y), median) in pixels.zip(medians).filter(|&((x, y), _)| !is_close(&splats, x, y)) {
            let settings = PickSettings { time: 0.5, ..PickSettings::default() };
            let pick = scene.pick(view.camera_position, view.ray(x, y), &settings);
            let expected = splats.iter().position(|splat| splat.depth == median);
            assert_eq!(pick.map(|pick| pick.gaussian), expected, "at pixel {x}, {y}");
            if let Some(pick) = pick {
                let apart = (pick.point.z - median).abs() / median;
                assert!(apart < 0.05, "at pixel {x}, {y} the depth {} is about {median}", pick.point.z);
                hits += 1;
            }
            compared += 1;
        }
        assert!(compared > 900 && hits > 400, "a test of {compared} pixels with {hits} hits says little");
    }
}
