//! `project`: Gaussians to splats; CPU reference of `shaders/global_sort/project.wgsl`.
//!
//! In: a [`Layer`] and the blend space. Out: one [`Splat`] for each Gaussian, invisible if it is not drawn.

use super::{Layer, activate};
use crate::gaussian::ShDirection;
use crate::gaussian::importance::thinned;
use crate::gaussian::overlap::{TileRect, contributing_tiles};
use crate::gaussian::projection::project_with;
use crate::view::BlendSpace;
use glam::{Vec2, Vec3, Vec4};
use rayon::prelude::*;

/// A Gaussian sliced at a time and projected to a view.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Splat {
    /// Center in pixels.
    pub center: Vec2,
    /// Inverse covariance on the screen, factored: `x (dx + y dy)² + z dy²`.
    pub conic: Vec3,
    /// Opacity times marginal.
    pub opacity: f32,
    /// Color in the blend space, clamped below at 0.
    pub color: Vec3,
    /// Depth in camera units.
    pub depth: f32,
    /// Tiles where its alpha can reach 1/255.
    pub tiles: TileRect,
}

impl Splat {
    const INVISIBLE: Self = Self {
        center: Vec2::ZERO,
        conic: Vec3::ZERO,
        opacity: 0.0,
        color: Vec3::ZERO,
        depth: f32::INFINITY,
        tiles: TileRect::EMPTY,
    };

    /// Returns whether it covers at least one tile.
    pub fn is_visible(&self) -> bool {
        !self.tiles.is_empty()
    }
}

/// Projects every Gaussian of the scene. Gaussians that its temporal filter leaves inactive are invisible.
pub fn project(layer: &Layer<'_>, space: BlendSpace) -> Vec<Splat> {
    let Layer { scene, view, .. } = layer;
    let clip = view.clip_rows();
    let one = |index: usize| project_one(layer, index, space, &clip);
    let Some(filter) = &scene.filter else { return (0..scene.len()).into_par_iter().map(one).collect() };
    let list = activate(filter, filter.segment_of(view.time, scene.trained_with.time_interval));
    let drawn: Vec<Splat> = list.par_iter().map(|&index| one(index as usize)).collect();
    let mut splats = vec![Splat::INVISIBLE; scene.len()];
    for (index, splat) in list.into_iter().zip(drawn) {
        splats[index as usize] = splat;
    }
    splats
}

fn project_one(layer: &Layer<'_>, index: usize, space: BlendSpace, clip: &[Vec4; 2]) -> Splat {
    let Layer { scene, view, appearance } = layer;
    let Some(gaussian) = &thinned(&scene.gaussian(index), &appearance.thinning) else { return Splat::INVISIBLE };
    let Some(projected) = project_with(gaussian, view, clip, scene.trained_with.marginal_cutoff) else {
        return Splat::INVISIBLE;
    };
    if !appearance.shows(projected.mean) {
        return Splat::INVISIBLE;
    }
    let opacity = appearance.thinning.boosted(projected.opacity * appearance.opacity);
    let seen = match scene.trained_with.sh_direction {
        ShDirection::Canonical => Vec3::from(gaussian.mean),
        ShDirection::Displaced => projected.mean,
    };
    let tau = gaussian.mean_t - view.time;
    Splat {
        center: projected.center,
        conic: projected.conic,
        opacity,
        color: appearance.color(scene.color(index, view.direction_to(seen), tau), space),
        depth: projected.depth,
        tiles: contributing_tiles(projected.tiles, projected.center, projected.covariance, opacity),
    }
}
