//! `project`: Gaussians to splats, twin of `shaders/project.wgsl`.
//!
//! In: a [`Layer`] and the blend space. Out: one [`Splat`] for each Gaussian, invisible where it is not drawn.

use super::Layer;
use crate::gaussian::{ShDirection, projection};
use crate::view::BlendSpace;
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

/// Projects every Gaussian of the scene that its filter, if it has one, leaves active.
pub fn project(layer: &Layer<'_>, space: BlendSpace) -> Vec<Splat> {
    let Layer { scene, view, .. } = layer;
    let clip = view.clip_rows();
    let active =
        scene.filter.as_ref().map(|filter| (filter, filter.segment_of(view.time, scene.trained_with.time_interval)));
    let is_active = |i| active.is_none_or(|(filter, segment)| filter.is_active(segment, i));
    let one = |i| if is_active(i) { project_one(layer, i, space, &clip) } else { Splat::INVISIBLE };
    (0..scene.len()).into_par_iter().map(one).collect()
}

fn project_one(layer: &Layer<'_>, index: usize, space: BlendSpace, clip: &[Vec4; 2]) -> Splat {
    let Layer { scene, view, appearance } = layer;
    let gaussian = &scene.gaussian(index);
    let Some(projected) = projection::project_with(gaussian, view, clip) else { return Splat::INVISIBLE };
    if !appearance.shows(projected.mean) {
        return Splat::INVISIBLE;
    }
    let projected = projection::Projected { opacity: projected.opacity * appearance.opacity, ..projected };
    let seen = match scene.trained_with.sh_direction {
        ShDirection::Canonical => Vec3::from(gaussian.mean),
        ShDirection::Displaced => projected.mean,
    };
    let tau = gaussian.mean_t - view.time;
    Splat {
        center: projected.center,
        conic: projected.conic,
        opacity: projected.opacity,
        color: appearance.color(scene.color(index, view.direction_to(seen), tau), space),
        depth: projected.depth,
        tiles: projected.contributing_tiles(),
    }
}
