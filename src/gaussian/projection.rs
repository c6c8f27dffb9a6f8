//! Projection: from a Gaussian at a time to a splat on the screen (EWA splatting, as the original rasterizer does it).
//!
//! In: a [`Gaussian`] and a [`View`]. Out: [`Projected`]; `None` if the Gaussian is not drawn. The steps and their
//! order are those of the original rasterizer, and of `shaders/global_sort/project.wgsl`; for thin and for very large
//! splats see [`conic`](super::conic).

use super::conic::{LOW_PASS, ScreenCovariance};
use super::lifespan::MARGINAL_CUTOFF;
use super::overlap::{TileRect, tiles_of};
use super::slice::Gaussian;
use crate::view::View;
use glam::{Mat3, Vec2, Vec3, Vec3Swizzles, Vec4};

/// Rays are clamped to this multiple of the field of view before the Jacobian is taken.
pub(super) const FRUSTUM_CLAMP: f32 = 1.3;

/// The geometry of a splat: a Gaussian sliced at a time and projected to a view, without its color.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Projected {
    /// Center in pixels (pixel centers at integers).
    pub center: Vec2,
    /// Depth: z in camera space.
    pub depth: f32,
    /// Covariance on the screen with the low-pass: xx, xy, yy, pixels squared.
    pub covariance: Vec3,
    /// Inverse of the covariance, factored: `x (dx + y dy)² + z dy²`.
    pub conic: Vec3,
    /// Opacity times marginal, times the compensation of the low-pass.
    pub opacity: f32,
    /// Conditional mean, capture space.
    pub mean: Vec3,
    /// The original's radius: three standard deviations of the longer axis, rounded up, pixels.
    pub radius: u32,
    /// Tiles that the original assigns.
    pub tiles: TileRect,
}

/// Projects one Gaussian, with the cut-off of the original; `None` if it is not drawn.
pub fn project(gaussian: &Gaussian, view: &View) -> Option<Projected> {
    project_with(gaussian, view, &view.clip_rows(), MARGINAL_CUTOFF)
}

/// Projects one of many Gaussians, as [`project`]; `clip` are the view's [`clip_rows`](View::clip_rows), computed once
/// for all, `cutoff` is the marginal at and below which a Gaussian is not drawn.
pub fn project_with(gaussian: &Gaussian, view: &View, clip: &[Vec4; 2], cutoff: f32) -> Option<Projected> {
    let marginal = gaussian.marginal(view.time);
    if marginal <= cutoff {
        return None;
    }
    let mean = gaussian.mean_at(view.time);
    let q = view.world_to_camera.transform_point3(mean);
    if q.z <= view.near {
        return None;
    }
    let size = view.size.as_vec2();
    let [clip_x, clip_y] = clip;
    let divisor = if view.orthographic { 1.0 } else { q.z + 1e-7 };
    let ndc = Vec2::new(clip_x.dot(mean.extend(1.0)), clip_y.dot(mean.extend(1.0))) / divisor;
    let center = ((ndc + 1.0) * size - 1.0) * 0.5;

    // The nesting of min and max matters: with the sentinel the limits are negative.
    let limit = FRUSTUM_CLAMP * view.reach();
    let ray = limit.min((-limit).max(q.xy() / q.z));
    let focal = view.focal();
    let (jx, jy) = if view.orthographic {
        (Vec3::X * focal.x, Vec3::Y * focal.y)
    } else {
        let jx = Vec3::new(focal.x / q.z, 0.0, -focal.x * ray.x / q.z);
        (jx, Vec3::new(0.0, focal.y / q.z, -focal.y * ray.y / q.z))
    };
    let to_world = Mat3::from_mat4(view.world_to_camera).transpose();
    let (mx, my) = (to_world * jx, to_world * jy);
    let [xx, xy, xz, yy, yz, zz] = gaussian.covariance;
    let covariance = Mat3::from_cols(Vec3::new(xx, xy, xz), Vec3::new(xy, yy, yz), Vec3::new(xz, yz, zz));
    let screen = ScreenCovariance::project(covariance, mx, my)?;
    let mid = 0.5 * (screen.entries.x + screen.entries.z);
    let radius = (3.0 * (mid + (mid * mid - screen.determinant).max(0.1).sqrt()).sqrt()).ceil();
    let tiles = tiles_of(center, radius, view.tiles());
    if tiles.is_empty() {
        return None;
    }
    let per_unit = Vec2::new(jx.x, jy.y);
    Some(Projected {
        center,
        depth: q.z,
        covariance: screen.entries,
        conic: screen.conic(),
        opacity: gaussian.opacity * marginal * compensation(view, per_unit, &screen),
        mean,
        radius: radius as u32,
        tiles,
    })
}

/// Returns the factor on the opacity of a splat that the low-pass makes larger than it was in training: the square root
/// of the ratio of the determinants of its covariances, so that the integral of its alpha stays the same. The original
/// has no such factor, so that distant captures look thicker. The factor is 1 where pixels are no larger than in
/// training, and in every view without anti-aliasing. With a pixel of size 0 the factor is that of Mip-Splatting, which
/// is a part of its training. `per_unit` is in pixels per camera unit.
fn compensation(view: &View, per_unit: Vec2, screen: &ScreenCovariance) -> f32 {
    let trained = view.trained_variance() * LOW_PASS * per_unit * per_unit;
    let wider = (LOW_PASS - trained).max(Vec2::ZERO);
    if wider == Vec2::ZERO {
        // Exactly 1, without rounding errors.
        return 1.0;
    }
    (screen.determinant_with_less(wider) / screen.determinant).sqrt()
}
