//! The gradient of a Gaussian: from its splat back to its raw parameters. The CPU reference of
//! `shaders/offline/project_backward.wgsl`.
//!
//! In: the raw [`Parameters`] and [`Harmonics`] of one Gaussian, a [`View`], and the gradient of a loss with respect to
//! its splat ([`SplatGradient`]). Out: the gradient with respect to each raw parameter ([`ParameterGradient`]), in
//! double precision: back through color, projection, slice and activation, as in sections 7.2 to 7.5 of the 4DGS model.
//!
//! Decisions are held constant: which Gaussians are not drawn, and which rays and colors are clamped. `g_x` is the
//! gradient with respect to `x`.

use super::conic::LOW_PASS;
use super::outer::outer;
use super::projection::FRUSTUM_CLAMP;
use super::{Harmonics, Model, Parameters, ShDirection, SliceSettings, rotation_4d};
use crate::view::View;
use glam::{DMat3, DMat4, DVec2, DVec3, DVec4};
use std::f64::consts::TAU;
use std::ops::AddAssign;

/// The gradient that is computed. Default: [`Exact`](Self::Exact).
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum GradientMode {
    /// The derivative of the picture, with all decisions held fixed.
    #[default]
    Exact,
    /// The gradient of the original's backward pass, with the deviations of section 7.5 of the 4DGS model: only to
    /// repeat its training.
    Compat,
}

/// The settings with which the view was drawn, and the gradient that is computed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GradientSettings {
    /// Settings with which the Gaussians were sliced.
    pub slice: SliceSettings,
    /// The mean toward which the viewing direction of the color points.
    pub sh_direction: ShDirection,
    /// Full length of the capture's time interval, timestamp units.
    pub time_span: f32,
    /// Whether the capture was trained without temporal harmonics although it is 4D. Matters to
    /// [`Compat`](GradientMode::Compat) only.
    pub force_sh_3d: bool,
    /// The gradient that is computed.
    pub mode: GradientMode,
}

impl GradientSettings {
    /// Returns whether the color's gradient is taken in the direction of the conditional mean and flows through the
    /// slice; otherwise it is that of the mean μ alone (deviation 3 of section 7.5).
    fn is_displaced(&self) -> bool {
        self.sh_direction == ShDirection::Displaced || self.mode == GradientMode::Compat
    }
}

/// The gradient of a loss with respect to one splat.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct SplatGradient {
    /// With respect to its center in normalized device coordinates: that in pixels times half the picture's size.
    pub ndc: [f64; 2],
    /// With respect to its conic: xx, xy (as one number), yy.
    pub conic: [f64; 3],
    /// With respect to its opacity, the product of opacity, marginal and the factor of anti-aliasing.
    pub opacity: f64,
    /// With respect to its color after the clamp at 0.
    pub color: [f64; 3],
    /// With respect to its depth.
    pub depth: f64,
}

impl AddAssign for SplatGradient {
    fn add_assign(&mut self, other: Self) {
        let add = |sum: &mut [f64], part: &[f64]| sum.iter_mut().zip(part).for_each(|(sum, part)| *sum += part);
        add(&mut self.ndc, &other.ndc);
        add(&mut self.conic, &other.conic);
        add(&mut self.color, &other.color);
        self.opacity += other.opacity;
        self.depth += other.depth;
    }
}

/// The gradient of a loss with respect to the raw parameters of one Gaussian; zero for parameters that its model lacks.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ParameterGradient {
    /// With respect to the mean μ.
    pub mean: [f64; 3],
    /// With respect to the temporal mean μ_t.
    pub mean_t: f64,
    /// With respect to the logarithm of the scale.
    pub log_scale: [f64; 3],
    /// With respect to the logarithm of the temporal scale.
    pub log_scale_t: f64,
    /// With respect to the left quaternion (w, x, y, z), which need not be of unit length.
    pub rotation_l: [f64; 4],
    /// With respect to the right quaternion (w, x, y, z).
    pub rotation_r: [f64; 4],
    /// With respect to the logit of the opacity.
    pub opacity_logit: f64,
    /// With respect to every coefficient that is stored, in the order of [`Harmonics::of`].
    pub harmonics: Vec<f64>,
}

/// Returns the gradient with respect to the raw parameters of the Gaussian at `index`, from that with respect to its
/// splat in `view`.
///
/// The factor of anti-aliasing on opacity counts as constant and as 1, unless it is that of Mip-Splatting (a training
/// pixel of 0).
///
/// A Gaussian that is not drawn has no pixel, so that `splat` is zero; then the result is zero too. In an orthographic
/// view the direction of the color and the Jacobian of the projection are constant, and the result is as exact as in
/// any other.
///
/// # Panics
/// If `index` is out of range, or an attribute of the model has fewer entries than there are means.
pub fn parameter_gradient(
    parameters: &Parameters,
    harmonics: &Harmonics,
    index: usize,
    view: &View,
    settings: &GradientSettings,
    splat: &SplatGradient,
) -> ParameterGradient {
    if *splat == SplatGradient::default() {
        return ParameterGradient { harmonics: vec![0.0; harmonics.of(index).len()], ..ParameterGradient::default() };
    }
    let gaussian = Moment::new(parameters, index, &settings.slice, f64::from(view.time));
    let color = through_color(&gaussian, harmonics, index, view, settings, DVec3::from(splat.color));
    let (g_covariance, mut g_mean, factor) = through_projection(&gaussian, view, settings.mode, splat);
    if settings.is_displaced() {
        g_mean += color.point;
    }
    let mut gradient = through_slice(&gaussian, settings, g_covariance, g_mean, splat.opacity * factor);
    if !settings.is_displaced() {
        gradient.mean = (DVec3::from(gradient.mean) + color.point).to_array();
    }
    if gaussian.model != Model::Static3d {
        gradient.mean_t += color.mean_t;
    }
    gradient.harmonics = color.harmonics;
    gradient
}

/// Returns the gradient with respect to the raw parameters of the Gaussian at `index`, from that of a loss that does
/// not depend on a view: with respect to its velocity c/v and its peak opacity. Coefficients of color are omitted.
///
/// # Panics
/// As [`parameter_gradient`].
pub fn slice_gradient(parameters: &Parameters, index: usize, velocity: DVec3, opacity: f64) -> ParameterGradient {
    let gaussian = Moment::new(parameters, index, &SliceSettings::default(), 0.0);
    let peak = gaussian.opacity;
    ParameterGradient {
        opacity_logit: opacity * peak * (1.0 - peak),
        ..through_sigma(&gaussian, DMat3::ZERO, velocity, 0.0)
    }
}

/// A Gaussian at the time of a view, activated and sliced in double precision (section 2 of the 4DGS model).
///
/// All models have one form here: a 3D rotation is the 4D rotation by two equal quaternions, which does not change
/// time, and a Gaussian that is present at every time is always at its temporal mean.
struct Moment {
    model: Model,
    /// Mean μ, capture space.
    mean: DVec3,
    /// Temporal mean minus the time of the view; a static Gaussian has the temporal mean 0.
    tau: f64,
    /// Time of the view minus temporal mean; 0 for a static Gaussian.
    dt: f64,
    rotation_l: Quaternion,
    rotation_r: Quaternion,
    /// Rotation Q, axes x, y, z, t.
    rotation: DMat4,
    /// Standard deviations along the axes before the rotation, with the modifier.
    scale: DVec4,
    /// Covariance c of space and time.
    coupling: DVec3,
    /// Temporal variance v.
    variance_t: f64,
    /// Temporal variance v′ of the marginal.
    variance_marginal: f64,
    marginal: f64,
    /// Peak opacity.
    opacity: f64,
    /// Conditional covariance.
    covariance: DMat3,
    /// Conditional mean.
    mean_now: DVec3,
}

impl Moment {
    fn new(parameters: &Parameters, index: usize, settings: &SliceSettings, time: f64) -> Self {
        let model = parameters.model();
        let modifier = f64::from(settings.scale_modifier);
        let around = || at_rest(DVec4::from(parameters.rotation_l[index].map(f64::from)));
        let temporal = || f64::from(parameters.log_scale_t[index]).exp() * modifier;
        let (l, r, scale_t) = match model {
            Model::Rotated4d => {
                let [l, r] = [&parameters.rotation_l, &parameters.rotation_r].map(|q| q[index].map(f64::from));
                (DVec4::from(l), DVec4::from(r), temporal())
            }
            // The original uses the temporal scale as the variance here.
            Model::Unrotated4d => (around(), around(), temporal().sqrt()),
            Model::Static3d => (around(), around(), 1.0),
        };
        let (rotation_l, rotation_r) = (Quaternion::new(l), Quaternion::new(r));
        let rotation = rotation_4d(rotation_l.unit, rotation_r.unit);
        let scale = DVec3::from(parameters.log_scale[index].map(|s| f64::from(s).exp())) * modifier;
        let scale = scale.extend(scale_t);
        let factor = rotation * DMat4::from_diagonal(scale);
        let sigma = factor * factor.transpose();
        let (coupling, variance_t) = (sigma.w_axis.truncate(), sigma.w_axis.w);
        let variance_marginal = variance_t + f64::from(settings.prefilter_var.max(0.0));
        let (tau, dt) = match model {
            Model::Static3d => (-time, 0.0),
            Model::Rotated4d | Model::Unrotated4d => {
                let mean_t = f64::from(parameters.mean_t[index]);
                (mean_t - time, time - mean_t)
            }
        };
        let mean = DVec3::from(parameters.mean[index].map(f64::from));
        Self {
            model,
            mean,
            tau,
            dt,
            rotation_l,
            rotation_r,
            rotation,
            scale,
            coupling,
            variance_t,
            variance_marginal,
            marginal: (-0.5 * dt * dt / variance_marginal).exp(),
            opacity: 1.0 / (1.0 + (-f64::from(parameters.opacity_logit[index])).exp()),
            covariance: DMat3::from_mat4(sigma) - outer(coupling, coupling) * variance_t.recip(),
            mean_now: mean + coupling * (dt / variance_t),
        }
    }
}

/// A raw quaternion: its direction and its length.
struct Quaternion {
    unit: DVec4,
    length: f64,
}

impl Quaternion {
    fn new(raw: DVec4) -> Self {
        let length = raw.length();
        Self { unit: raw / length, length }
    }

    /// Returns the gradient with respect to the raw quaternion, from that with respect to the unit quaternion.
    fn raw_gradient(&self, gradient: DVec4) -> DVec4 {
        (gradient - self.unit * self.unit.dot(gradient)) / self.length
    }
}

/// Returns the quaternion that, as both quaternions of a 4D rotation, rotates space as `q` (w, x, y, z) does: (w, −z,
/// −y, −x). This map is its own inverse, and its own transpose.
fn at_rest(q: DVec4) -> DVec4 {
    DVec4::new(q.x, -q.w, -q.z, -q.y)
}

/// Returns the gradients with respect to the conditional covariance (symmetric) and the conditional mean: section 7.2
/// of the 4DGS model; and the factor of the filter on opacity.
fn through_projection(
    gaussian: &Moment,
    view: &View,
    mode: GradientMode,
    splat: &SplatGradient,
) -> (DMat3, DVec3, f64) {
    let camera = view.world_to_camera.as_dmat4();
    let to_camera = DMat3::from_mat4(camera);
    let to_capture = to_camera.transpose();
    let q = camera.transform_point3(gaussian.mean_now);

    // The conic, from the rows m of the Jacobian in capture space; as in `projection`.
    let focal = view.focal().as_dvec2();
    let unclamped = q.truncate() / q.z;
    let limit = f64::from(FRUSTUM_CLAMP) * view.reach().as_dvec2();
    let ray = limit.min((-limit).max(unclamped));
    let (jx, jy) = if view.orthographic {
        (DVec3::X * focal.x, DVec3::Y * focal.y)
    } else {
        let jx = DVec3::new(focal.x, 0.0, -focal.x * ray.x) / q.z;
        (jx, DVec3::new(0.0, focal.y, -focal.y * ray.y) / q.z)
    };
    let (mx, my) = (to_capture * jx, to_capture * jy);
    let (cx, cy) = (gaussian.covariance * mx, gaussian.covariance * my);
    let low_pass = f64::from(LOW_PASS);
    let (a, b, c) = (mx.dot(cx) + low_pass, mx.dot(cy), my.dot(cy) + low_pass);
    let det = a * c - b * b;

    // The covariance on the screen, then in capture space, and the Jacobian.
    let [g0, g1, g2] = splat.conic;
    let divisor = match mode {
        GradientMode::Exact => det * det,
        GradientMode::Compat => det * det + 1e-7,
    };
    let (factor, filtered) = through_filter(view, [a, b, c], splat.opacity * gaussian.opacity * gaussian.marginal);
    let g_a = (-c * c * g0 + b * c * g1 + (det - a * c) * g2) / divisor + filtered[0];
    let g_b = (2.0 * b * c * g0 - (det + 2.0 * b * b) * g1 + 2.0 * a * b * g2) / divisor + filtered[1];
    let g_c = (-a * a * g2 + a * b * g1 + (det - a * c) * g0) / divisor + filtered[2];
    let g_covariance = outer(mx, mx) * g_a + (outer(mx, my) + outer(my, mx)) * (0.5 * g_b) + outer(my, my) * g_c;
    let g_jx = to_camera * (cx * (2.0 * g_a) + cy * g_b);
    let g_jy = to_camera * (cx * g_b + cy * (2.0 * g_c));

    // The point in camera space: its depth, and through the Jacobian.
    let mut g_q = DVec3::Z * splat.depth;
    if !view.orthographic {
        let squared = q.z * q.z;
        let g_ray = -focal * DVec2::new(g_jx.z, g_jy.z) / squared;
        let free = ray.cmpeq(unclamped);
        g_q += DVec2::select(free, g_ray, DVec2::ZERO).extend(0.0);
        g_q.z -= (focal.x * g_jx.x + focal.y * g_jy.y) / squared + 2.0 * ray.dot(g_ray);
        if mode == GradientMode::Exact {
            // The length of a clamped ray still depends on depth.
            g_q.z += ray.dot(DVec2::select(free, DVec2::ZERO, g_ray));
        }
    }

    // The center.
    let (inverse_w, row_w) =
        if view.orthographic { (1.0, DVec3::ZERO) } else { ((q.z + 1e-7).recip(), camera.row(2).truncate()) };
    let mut g_mean = to_capture * g_q;
    for (row, gradient) in view.clip_rows().into_iter().zip(splat.ndc) {
        let row = row.as_dvec4();
        let ndc = row.dot(gaussian.mean_now.extend(1.0)) * inverse_w;
        g_mean += (row.truncate() - row_w * ndc) * (inverse_w * gradient);
    }
    (g_covariance, g_mean, factor)
}

/// Returns the factor of the filter of Mip-Splatting on the opacity of a splat with this covariance on the screen (xx,
/// xy, yy, with the low-pass), and the gradient with respect to that covariance, from that with respect to the factor;
/// 1 and zero in a view without this filter.
fn through_filter(view: &View, [a, b, c]: [f64; 3], g_factor: f64) -> (f64, [f64; 3]) {
    if view.trained_pixel != 0.0 {
        return (1.0, [0.0; 3]);
    }
    let (thin_a, thin_c) = (a - f64::from(LOW_PASS), c - f64::from(LOW_PASS));
    let (thin, det) = (thin_a * thin_c - b * b, a * c - b * b);
    if thin <= 0.0 {
        return (0.0, [0.0; 3]);
    }
    let factor = (thin / det).sqrt();
    let half = 0.5 * g_factor * factor;
    (
        factor,
        [half * (thin_c / thin - c / det), 2.0 * half * b * (1.0 / det - 1.0 / thin), half * (thin_a / thin - a / det)],
    )
}

/// Gradients with respect to the inputs of the color.
struct ColorGradient {
    /// With respect to all coefficients.
    harmonics: Vec<f64>,
    /// With respect to the temporal mean, through the temporal harmonics.
    mean_t: f64,
    /// With respect to the point toward which the direction points.
    point: DVec3,
}

/// Returns the gradients with respect to the inputs of the color: section 7.3 of the 4DGS model.
fn through_color(
    gaussian: &Moment,
    harmonics: &Harmonics,
    index: usize,
    view: &View,
    settings: &GradientSettings,
    g_color: DVec3,
) -> ColorGradient {
    let sh = harmonics.of(index);
    let coefficient = |k: usize| DVec3::from([sh[3 * k], sh[3 * k + 1], sh[3 * k + 2]].map(f64::from));
    let spatial = (harmonics.degree as usize + 1).pow(2);
    let last = if harmonics.degree == 3 { harmonics.degree_t as usize } else { 0 };
    let frequency = |n: usize| TAU * n as f64 / f64::from(settings.time_span);
    let cosine = |n: usize| if n == 0 { 1.0 } else { (frequency(n) * gaussian.tau).cos() };
    let at_time = |k: usize| (0..=last).map(|n| coefficient(16 * n + k) * cosine(n)).sum::<DVec3>();
    let effective: Vec<DVec3> = (0..spatial).map(at_time).collect();

    // A channel that is clamped below has no gradient.
    let seen = match settings.sh_direction {
        ShDirection::Canonical => gaussian.mean,
        ShDirection::Displaced => gaussian.mean_now,
    };
    let (values, _) = basis(sight(view, seen).0);
    let color = effective.iter().zip(values).fold(DVec3::splat(0.5), |sum, (&sh, value)| sum + sh * value);
    let g_color = DVec3::select(color.cmplt(DVec3::ZERO), DVec3::ZERO, g_color);

    let (direction, per_length) = sight(view, if settings.is_displaced() { gaussian.mean_now } else { gaussian.mean });
    let (values, slopes) = basis(direction);
    let mut g_harmonics = vec![0.0; sh.len()];
    let mut set = |k: usize, gradient: DVec3| g_harmonics[3 * k..][..3].copy_from_slice(&gradient.to_array());
    for n in 0..=last {
        for (k, &value) in values.iter().enumerate().take(spatial) {
            set(16 * n + k, g_color * (cosine(n) * value));
        }
    }
    let compat = settings.mode == GradientMode::Compat;
    if compat && gaussian.model != Model::Static3d && !settings.force_sh_3d && harmonics.degree > 0 {
        set(1, g_color * values[0]);
    }
    let slope_t = |n: usize| {
        let block: f64 = (0..16).map(|k| values[k] * coefficient(16 * n + k).dot(g_color)).sum();
        -frequency(n) * (frequency(n) * gaussian.tau).sin() * block
    };
    let mean_t = match settings.mode {
        GradientMode::Exact => (1..=last).map(slope_t).sum::<f64>(),
        // The original has the wrong sign, and only the last harmonic.
        GradientMode::Compat if last > 0 => -slope_t(last),
        GradientMode::Compat => 0.0,
    };
    let g_direction: DVec3 = slopes.iter().zip(&effective).map(|(&slope, sh)| slope * sh.dot(g_color)).sum();
    let point = (g_direction - direction * direction.dot(g_direction)) * per_length;
    ColorGradient { harmonics: g_harmonics, mean_t, point }
}

/// Returns the unit direction in which a point is seen, and the inverse of its distance; 0 for the latter if rays are
/// parallel, so that the direction does not depend on the point.
fn sight(view: &View, point: DVec3) -> (DVec3, f64) {
    let camera = view.camera_position.as_dvec3();
    if view.orthographic {
        return (camera, 0.0);
    }
    let offset = point - camera;
    let length = offset.length();
    (offset / length, length.recip())
}

/// Returns the gradients with respect to raw geometry and opacity, from those with respect to conditional covariance,
/// conditional mean and the splat's opacity: section 7.4 of the 4DGS model.
fn through_slice(
    gaussian: &Moment,
    settings: &GradientSettings,
    g_covariance: DMat3,
    g_mean: DVec3,
    g_splat_opacity: f64,
) -> ParameterGradient {
    let Moment { model, dt, coupling: c, variance_t: v, variance_marginal, marginal, opacity, .. } = *gaussian;
    let compat = settings.mode == GradientMode::Compat;
    // Without a 4D rotation the original has no gradient through the marginal, and omits it as a factor on that of the
    // opacity.
    let ignores_marginal = compat && model != Model::Rotated4d;
    let (g_opacity, g_exponent) = if ignores_marginal {
        (g_splat_opacity, 0.0)
    } else {
        (g_splat_opacity * marginal, g_splat_opacity * opacity * marginal)
    };

    let g_variance = g_exponent * dt * dt / (2.0 * variance_marginal * variance_marginal);
    let g_mean_t = g_exponent * dt / variance_marginal - g_mean.dot(c) / v;
    let shape = through_sigma(gaussian, g_covariance, g_mean * dt, g_variance);
    // The original omits the modifier.
    let modifier = if compat { f64::from(settings.slice.scale_modifier) } else { 1.0 };
    ParameterGradient {
        mean: g_mean.to_array(),
        mean_t: if model == Model::Static3d { 0.0 } else { g_mean_t },
        log_scale: shape.log_scale.map(|gradient| gradient / modifier),
        log_scale_t: if ignores_marginal { 0.0 } else { shape.log_scale_t / modifier },
        opacity_logit: g_opacity * opacity * (1.0 - opacity),
        ..shape
    }
}

/// Returns the gradients with respect to scales and rotations, from those with respect to conditional covariance,
/// velocity c/v and temporal variance; all others are zero.
fn through_sigma(gaussian: &Moment, g_covariance: DMat3, g_velocity: DVec3, g_variance: f64) -> ParameterGradient {
    let Moment { model, coupling: c, variance_t: v, .. } = *gaussian;

    // The parts of the 4D covariance.
    let coupled = g_covariance * c;
    let g_c = coupled * (-2.0 / v) + g_velocity / v;
    let g_v = (c.dot(coupled) - g_velocity.dot(c)) / (v * v) + g_variance;
    let g_sigma = DMat4::from_cols(
        g_covariance.x_axis.extend(0.5 * g_c.x),
        g_covariance.y_axis.extend(0.5 * g_c.y),
        g_covariance.z_axis.extend(0.5 * g_c.z),
        (0.5 * g_c).extend(g_v),
    );

    // Scales and rotation.
    let rotation = gaussian.rotation;
    let x = g_sigma * rotation * 2.0;
    let squared = gaussian.scale * gaussian.scale;
    let columns = DVec4::from([0, 1, 2, 3].map(|i| x.col(i).dot(rotation.col(i))));
    let g_log_scale = squared * columns;
    let g_rotation = x * DMat4::from_diagonal(squared);
    let along = |m: DMat4| (0..4).map(|i| g_rotation.col(i).dot(m.col(i))).sum::<f64>();
    let (l, r) = (&gaussian.rotation_l, &gaussian.rotation_r);
    // The rotation is linear in each of its quaternions.
    let g_l = DVec4::from(DVec4::AXES.map(|axis| along(rotation_4d(axis, r.unit))));
    let g_r = DVec4::from(DVec4::AXES.map(|axis| along(rotation_4d(l.unit, axis))));
    let (rotation_l, rotation_r) = match model {
        Model::Rotated4d => (l.raw_gradient(g_l), r.raw_gradient(g_r)),
        Model::Unrotated4d | Model::Static3d => (at_rest(l.raw_gradient(g_l + g_r)), DVec4::ZERO),
    };
    ParameterGradient {
        log_scale: g_log_scale.truncate().to_array(),
        log_scale_t: match model {
            Model::Rotated4d => g_log_scale.w,
            // The temporal scale is the square of the deviation.
            Model::Unrotated4d => 0.5 * g_log_scale.w,
            Model::Static3d => 0.0,
        },
        rotation_l: rotation_l.to_array(),
        rotation_r: rotation_r.to_array(),
        ..ParameterGradient::default()
    }
}

/// Returns the 16 real spherical harmonics up to degree 3 in the unit direction given, as
/// [`harmonics::basis`](super::harmonics::basis) does, and their derivatives with respect to the direction.
fn basis(direction: DVec3) -> ([f64; 16], [DVec3; 16]) {
    const C0: f64 = 0.282_094_791_773_878_14;
    const C1: f64 = 0.488_602_511_902_919_9;
    const C2: [f64; 3] = [1.092_548_430_592_079_2, 0.315_391_565_252_520_05, 0.546_274_215_296_039_6];
    const C3: [f64; 5] = [
        0.590_043_589_926_643_5,
        2.890_611_442_640_554,
        0.457_045_799_464_465_8,
        0.373_176_332_590_115_4,
        1.445_305_721_320_277,
    ];
    let DVec3 { x, y, z } = direction;
    let (xx, yy, zz) = (x * x, y * y, z * z);
    let values = [
        C0,
        -C1 * y,
        C1 * z,
        -C1 * x,
        C2[0] * x * y,
        -C2[0] * y * z,
        C2[1] * (2.0 * zz - xx - yy),
        -C2[0] * x * z,
        C2[2] * (xx - yy),
        -C3[0] * y * (3.0 * xx - yy),
        C3[1] * x * y * z,
        -C3[2] * y * (4.0 * zz - xx - yy),
        C3[3] * z * (2.0 * zz - 3.0 * xx - 3.0 * yy),
        -C3[2] * x * (4.0 * zz - xx - yy),
        C3[4] * z * (xx - yy),
        -C3[0] * x * (xx - 3.0 * yy),
    ];
    let slopes = [
        DVec3::ZERO,
        DVec3::new(0.0, -C1, 0.0),
        DVec3::new(0.0, 0.0, C1),
        DVec3::new(-C1, 0.0, 0.0),
        C2[0] * DVec3::new(y, x, 0.0),
        -C2[0] * DVec3::new(0.0, z, y),
        C2[1] * DVec3::new(-2.0 * x, -2.0 * y, 4.0 * z),
        -C2[0] * DVec3::new(z, 0.0, x),
        C2[2] * DVec3::new(2.0 * x, -2.0 * y, 0.0),
        -C3[0] * DVec3::new(6.0 * x * y, 3.0 * (xx - yy), 0.0),
        C3[1] * DVec3::new(y * z, x * z, x * y),
        -C3[2] * DVec3::new(-2.0 * x * y, 4.0 * zz - xx - 3.0 * yy, 8.0 * y * z),
        C3[3] * DVec3::new(-6.0 * x * z, -6.0 * y * z, 6.0 * zz - 3.0 * xx - 3.0 * yy),
        -C3[2] * DVec3::new(4.0 * zz - 3.0 * xx - yy, -2.0 * x * y, 8.0 * x * z),
        C3[4] * DVec3::new(2.0 * x * z, -2.0 * y * z, xx - yy),
        -C3[0] * DVec3::new(3.0 * (xx - yy), -6.0 * x * y, 0.0),
    ];
    (values, slopes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gaussian::harmonics;

    #[test]
    fn the_basis_matches_the_color_and_its_slopes_are_its_derivatives() {
        let direction = DVec3::new(0.36, -0.48, 0.8);
        let (values, slopes) = basis(direction);
        for (k, (single, double)) in harmonics::basis(direction.as_vec3()).into_iter().zip(values).enumerate() {
            assert!(
                (f64::from(single) - double).abs() < 1e-6,
                "value {k}: {double} in double, {single} in single precision"
            );
        }
        let step = 1e-5;
        for (i, axis) in DVec3::AXES.into_iter().enumerate() {
            let (before, after) = (basis(direction - axis * step).0, basis(direction + axis * step).0);
            for (k, slope) in slopes.iter().enumerate() {
                let quotient = (after[k] - before[k]) / (2.0 * step);
                assert!(
                    (slope[i] - quotient).abs() < 1e-8,
                    "slope {k} along axis {i}: {slope}, difference quotient {quotient}"
                );
            }
        }
    }
}
