//! `blend`: front to back over each tile, as the original rasterizer does; CPU reference of
//! `shaders/global_sort/blend.wgsl`.
//!
//! In: splats, sorted pairs and tile ranges, the background. Out: the [`Frame`].

use super::{Pair, Splat};
use crate::gaussian::alpha::{BlendStep, blend_step};
use crate::gaussian::overlap::tile_index;
use crate::scene::Environment;
use crate::view::{Appearance, Background, BlendSpace, Counts, Frame, Picture, TILE_SIZE, View};
use glam::{UVec2, Vec2, Vec3};
use rayon::prelude::*;
use std::ops::Range;

/// Blends every pixel. `environment` is a map and the appearance of its capture; `view` is the view of that capture.
///
/// # Panics
/// If `ranges` has fewer entries than the view has tiles, or if a range or a pair is out of range.
pub fn blend(
    splats: &[Splat],
    pairs: &[Pair],
    ranges: &[Range<usize>],
    view: &View,
    background: Background,
    environment: Option<(&Environment, Appearance)>,
    space: BlendSpace,
    counts: Counts,
) -> Frame {
    let size = view.size;
    let tiles = view.tiles();
    let pixels: Vec<Pixel> = (0..size.x * size.y)
        .into_par_iter()
        .map(|i| {
            let (x, y) = (i % size.x, i / size.x);
            let tile = tile_index(UVec2::new(x, y) / TILE_SIZE, tiles);
            let mut pixel = blend_pixel(splats, &pairs[ranges[tile as usize].clone()], x, y);
            pixel.color += pixel.transmittance * behind(view, background, environment, space, x, y);
            pixel
        })
        .collect();
    Frame {
        picture: Picture { size, pixels: pixels.iter().map(|p| p.color).collect() },
        transmittance: pixels.iter().map(|p| p.transmittance).collect(),
        depth: pixels.iter().map(|p| p.depth).collect(),
        median_depth: pixels.iter().map(|p| p.median_depth).collect(),
        counts,
    }
}

/// Returns the color behind all Gaussians at pixel `(x, y)`, in the blend space.
pub fn behind(
    view: &View,
    background: Background,
    environment: Option<(&Environment, Appearance)>,
    space: BlendSpace,
    x: u32,
    y: u32,
) -> Vec3 {
    match (background, environment) {
        (Background::Color(color), _) => Vec3::from(color),
        (Background::Environment, Some((map, appearance))) if !view.orthographic => {
            appearance.color(map.sample(view.camera_position, view.ray(x, y)), space)
                * appearance.opacity.clamp(0.0, 1.0)
        }
        _ => Vec3::ZERO,
    }
}

/// Accumulated values of a pixel.
#[derive(Debug, Clone, Copy)]
struct Pixel {
    color: Vec3,
    transmittance: f32,
    depth: f32,
    median_depth: f32,
}

fn blend_pixel(splats: &[Splat], pairs: &[Pair], x: u32, y: u32) -> Pixel {
    let mut pixel = Pixel { color: Vec3::ZERO, transmittance: 1.0, depth: 0.0, median_depth: 0.0 };
    for pair in pairs {
        let splat = &splats[pair.splat as usize];
        let offset = splat.center - Vec2::new(x as f32, y as f32);
        match blend_step(splat.conic, splat.opacity, offset, pixel.transmittance) {
            BlendStep::Skip => {}
            BlendStep::Stop => break,
            BlendStep::Blend { weight, transmittance } => {
                pixel.color += splat.color * weight;
                pixel.depth += splat.depth * weight;
                if pixel.transmittance > 0.5 && transmittance <= 0.5 {
                    pixel.median_depth = splat.depth;
                }
                pixel.transmittance = transmittance;
            }
        }
    }
    pixel
}
