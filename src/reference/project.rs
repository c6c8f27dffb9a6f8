//! `project`: Gaussians to splats, twin of `shaders/project.wgsl`.
//!
//! In: a scene and a view. Out: one [`Splat`] for each Gaussian, invisible where it is not drawn.

use crate::gaussian::{ShDirection, View, projection};
use crate::scene::RuntimeScene;
use glam::{UVec4, Vec2, Vec3, Vec4};
use rayon::prelude::*;

/// A Gaussian sliced at a time and projected to a view.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Splat {
    /// Centre in pixels.
    pub center: Vec2,
    /// Inverse covariance on the screen: xx, xy, yy.
    pub conic: Vec3,
    /// Opacity times marginal.
    pub opacity: f32,
    /// Colour, clamped below at 0.
    pub color: Vec3,
    /// Depth in camera units.
    pub depth: f32,
    /// Tiles where it can contribute: x0, y0, x1, y1, ends excluded.
    pub tiles: UVec4,
}

impl Splat {
    const INVISIBLE: Self = Self {
        center: Vec2::ZERO,
        conic: Vec3::ZERO,
        opacity: 0.0,
        color: Vec3::ZERO,
        depth: f32::INFINITY,
        tiles: UVec4::ZERO,
    };

    /// Whether it touches a tile at all.
    pub fn is_visible(&self) -> bool {
        self.tile_count() > 0
    }

    /// Number of tiles it touches.
    pub fn tile_count(&self) -> u32 {
        self.tiles.z.saturating_sub(self.tiles.x) * self.tiles.w.saturating_sub(self.tiles.y)
    }
}

/// Projects every Gaussian of the scene.
pub fn project(scene: &RuntimeScene, view: &View) -> Vec<Splat> {
    let clip = view.clip_rows();
    (0..scene.gaussians.len()).into_par_iter().map(|i| project_one(scene, i, view, &clip)).collect()
}

fn project_one(scene: &RuntimeScene, index: usize, view: &View, clip: &[Vec4; 2]) -> Splat {
    let gaussian = &scene.gaussians[index];
    let Some(projected) = projection::project_with(gaussian, view, clip) else { return Splat::INVISIBLE };
    let seen = match scene.trained_with.sh_direction {
        ShDirection::Canonical => Vec3::from(gaussian.mean),
        ShDirection::Displaced => projected.mean,
    };
    let direction = (seen - view.camera_position).normalize();
    let tau = gaussian.mean_t - view.time;
    Splat {
        center: projected.center,
        conic: projected.conic,
        opacity: projected.opacity,
        color: scene.harmonics.color(index, direction, tau, scene.trained_with.time_span()),
        depth: projected.depth,
        tiles: projected.contributing_tiles(),
    }
}
