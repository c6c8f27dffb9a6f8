//! `blend`: front to back over each tile, twin of `shaders/blend.wgsl`. Section 3.4 of the 4DGS model.
//!
//! In: splats, sorted pairs and tile ranges, the background. Out: the [`Frame`].

use super::{Pair, Splat};
use crate::frame::{Background, Counts, Frame};
use crate::gaussian::View;
use crate::gaussian::projection::{ALPHA_MAX, ALPHA_MIN, TILE_SIZE, TRANSMITTANCE_MIN};
use crate::picture::Picture;
use crate::scene::Environment;
use glam::Vec3;
use rayon::prelude::*;
use std::ops::Range;

/// Blends every pixel.
pub fn blend(
    splats: &[Splat],
    pairs: &[Pair],
    ranges: &[Range<usize>],
    view: &View,
    background: Background,
    environment: Option<&Environment>,
    counts: Counts,
) -> Frame {
    let size = view.size;
    let tiles = view.tiles();
    let pixels: Vec<(Vec3, f32, f32)> = (0..size.x * size.y)
        .into_par_iter()
        .map(|i| {
            let (x, y) = (i % size.x, i / size.x);
            let tile = (y / TILE_SIZE) * tiles.x + x / TILE_SIZE;
            let (color, transmittance, depth) = blend_pixel(splats, &pairs[ranges[tile as usize].clone()], x, y);
            (color + transmittance * behind(view, background, environment, x, y), transmittance, depth)
        })
        .collect();
    Frame {
        picture: Picture { size, pixels: pixels.iter().map(|p| p.0).collect() },
        transmittance: pixels.iter().map(|p| p.1).collect(),
        depth: pixels.iter().map(|p| p.2).collect(),
        counts,
    }
}

/// What stands behind all Gaussians at pixel `(x, y)`.
pub(super) fn behind(view: &View, background: Background, environment: Option<&Environment>, x: u32, y: u32) -> Vec3 {
    match (background, environment) {
        (Background::Color(color), _) => Vec3::from(color),
        (Background::Environment, Some(map)) => map.sample(view.camera_position, view.ray(x, y)),
        _ => Vec3::ZERO,
    }
}

fn blend_pixel(splats: &[Splat], pairs: &[Pair], x: u32, y: u32) -> (Vec3, f32, f32) {
    let (mut color, mut transmittance, mut depth) = (Vec3::ZERO, 1.0f32, 0.0f32);
    for pair in pairs {
        let splat = &splats[pair.splat as usize];
        let (dx, dy) = (splat.center.x - x as f32, splat.center.y - y as f32);
        let conic = splat.conic;
        let power = -0.5 * (conic.x * dx * dx + conic.z * dy * dy) - conic.y * dx * dy;
        if power > 0.0 {
            continue;
        }
        let alpha = (splat.opacity * power.exp()).min(ALPHA_MAX);
        if alpha < ALPHA_MIN {
            continue;
        }
        let left = transmittance * (1.0 - alpha);
        if left < TRANSMITTANCE_MIN {
            break;
        }
        let weight = alpha * transmittance;
        color += splat.color * weight;
        depth += splat.depth * weight;
        transmittance = left;
    }
    (color, transmittance, depth)
}
