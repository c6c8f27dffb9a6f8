//! Projection: from a Gaussian at a time to a splat on the screen (EWA splatting, as the original rasterizer does it).
//!
//! In: a [`Gaussian`] and a [`View`]. Out: [`Projected`], or nothing where the Gaussian is not drawn. Section 3.3 of the 4DGS
//! model, step by step in its order; laid beside `shaders/project.wgsl`.

use super::{Gaussian, MARGINAL_CUTOFF};
use crate::view::View;
use glam::{Mat2, Mat3, UVec4, Vec2, Vec3, Vec3Swizzles, Vec4};

/// Side of a tile in pixels.
pub const TILE_SIZE: u32 = 16;
/// Added to both variances on the screen, pixels squared; the original does not compensate opacity for it.
pub const LOW_PASS: f32 = 0.3;
/// A splat's alpha below this is skipped.
pub const ALPHA_MIN: f32 = 1.0 / 255.0;
/// Alpha is clamped to this from above.
pub const ALPHA_MAX: f32 = 0.99;
/// A pixel stops before its transmittance would fall below this.
pub const TRANSMITTANCE_MIN: f32 = 1e-4;
/// Rays are clamped to this multiple of the field of view before the Jacobian is taken.
const FRUSTUM_CLAMP: f32 = 1.3;

/// The geometry of a splat: a Gaussian sliced at a time and projected to a view, without its colour.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Projected {
    /// Centre in pixels (pixel centres at integers).
    pub center: Vec2,
    /// Depth: z in camera space.
    pub depth: f32,
    /// Covariance on the screen with the low-pass: xx, xy, yy, pixels squared.
    pub covariance: Vec3,
    /// Its inverse: xx, xy, yy.
    pub conic: Vec3,
    /// Opacity times marginal.
    pub opacity: f32,
    /// Conditional mean, capture space.
    pub mean: Vec3,
    /// The original's radius: three standard deviations of the longer axis, rounded up, pixels.
    pub radius: u32,
    /// Tiles the original assigns: x0, y0, x1, y1, ends excluded.
    pub tiles: UVec4,
}

/// Projects one Gaussian.
pub fn project(gaussian: &Gaussian, view: &View) -> Option<Projected> {
    project_with(gaussian, view, &view.clip_rows())
}

/// Projects one of many Gaussians: `clip` are the view's [`clip_rows`](View::clip_rows), worked out once for all.
pub fn project_with(gaussian: &Gaussian, view: &View, clip: &[Vec4; 2]) -> Option<Projected> {
    let marginal = gaussian.marginal(view.time);
    if marginal <= MARGINAL_CUTOFF {
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
    let (cx, cy) = (covariance * mx, covariance * my);
    let (a, b, c) = (mx.dot(cx) + LOW_PASS, mx.dot(cy), my.dot(cy) + LOW_PASS);
    let det = a * c - b * b;
    if det == 0.0 {
        return None;
    }
    let mid = 0.5 * (a + c);
    let radius = (3.0 * (mid + (mid * mid - det).max(0.1).sqrt()).sqrt()).ceil();
    let tiles = tiles_of(center, radius, view);
    if !radius.is_finite() || tiles.z <= tiles.x || tiles.w <= tiles.y {
        return None;
    }
    Some(Projected {
        center,
        depth: q.z,
        covariance: Vec3::new(a, b, c),
        conic: Vec3::new(c, -b, a) / det,
        opacity: gaussian.opacity * marginal,
        mean,
        radius: radius as u32,
        tiles,
    })
}

/// The tiles of the square of `radius` pixels about `center`, clamped to the picture; division truncates as in C.
fn tiles_of(center: Vec2, radius: f32, view: &View) -> UVec4 {
    let grid = view.tiles().as_vec2();
    let tile = TILE_SIZE as f32;
    let low = ((center - radius) / tile).trunc().clamp(Vec2::ZERO, grid);
    let high = ((center + radius + (tile - 1.0)) / tile).trunc().clamp(Vec2::ZERO, grid);
    UVec4::new(low.x as u32, low.y as u32, high.x as u32, high.y as u32)
}

impl Projected {
    /// The part of [`tiles`](Self::tiles) where alpha can reach 1/255 at all; empty rectangles mean that it never does.
    ///
    /// `opacity · exp(−½ dᵀ conic d) ≥ 1/255` needs `dᵀ conic d ≤ 2 ln(255 opacity) = e`, and the box about that ellipse is
    /// `|dx| ≤ sqrt(e · xx)`, `|dy| ≤ sqrt(e · yy)`. Leaving out the rest changes no pixel: `blend` would skip it.
    pub fn contributing_tiles(&self) -> UVec4 {
        if Mat2::from_cols_array(&[self.covariance.x, self.covariance.y, self.covariance.y, self.covariance.z])
            .determinant()
            <= 0.0
        {
            return self.tiles;
        }
        let energy = 2.0 * (self.opacity / ALPHA_MIN).ln();
        if energy < -1e-3 {
            return UVec4::ZERO;
        }
        // A hundredth of a pixel and a thousandth of the size stand above rounding.
        let half = (energy.max(0.0) * Vec2::new(self.covariance.x, self.covariance.z)).sqrt() * 1.001 + 0.01;
        let tile = TILE_SIZE as f32;
        let low = ((self.center - half) / tile).floor().max(Vec2::ZERO);
        let high = ((self.center + half) / tile).floor() + 1.0;
        let high = high.max(Vec2::ZERO);
        UVec4::new(
            self.tiles.x.max(low.x as u32),
            self.tiles.y.max(low.y as u32),
            self.tiles.z.min(high.x as u32),
            self.tiles.w.min(high.y as u32),
        )
    }
}
