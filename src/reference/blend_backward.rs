//! `blend_backward`: the gradient of a loss on a view, back from its pixels to its splats, and on to the raw parameters
//! of a trained scene; CPU reference of `shaders/offline/blend_backward.wgsl`.
//!
//! In: splats and their lists by tile, the background, and the gradient with respect to every pixel. Out: one
//! [`SplatGradient`] for each splat; for a scene in the trained form, one [`ParameterGradient`] for each Gaussian.
//!
//! Each pixel is traversed front to back twice: for the sum over all its splats, then for the gradients, which need the
//! part of that sum behind the splat. Section 7.1 of the 4DGS model traverses it from back to front.

use super::{Layer, Pair, Splat, TileLists, behind, project, tile_lists};
use crate::gaussian::alpha::{ALPHA_MAX, BlendStep, blend_step};
use crate::gaussian::conic::conic_entries;
use crate::gaussian::overlap::tile_at;
use crate::gaussian::{
    GradientMode, GradientSettings, ParameterGradient, SliceSettings, SplatGradient, parameter_gradient,
};
use crate::scene::{RuntimeScene, Trained};
use crate::view::{Appearance, Background, BlendSpace, TILE_SIZE, View};
use glam::{DVec2, DVec3, UVec2, Vec3};
use rayon::prelude::*;

/// The gradient of a loss with respect to every pixel of a view, row by row.
#[derive(Debug, Clone, Copy)]
pub struct PixelGradients<'a> {
    /// With respect to the color, background included.
    pub color: &'a [Vec3],
    /// With respect to the expected depth `Σ z α T`.
    pub depth: &'a [f32],
    /// With respect to alpha, one minus the remaining transmittance.
    pub alpha: &'a [f32],
}

/// Returns the gradient of a loss on a view of a trained scene with respect to the raw parameters of each Gaussian.
///
/// `scene` is `trained` after the slice with the settings `slice`; it is shown as trained, over `background`.
///
/// # Panics
/// If `scene` has more Gaussians than `trained`, or `pixels` fewer entries than the view has pixels.
pub fn gradients(
    trained: &Trained,
    slice: &SliceSettings,
    scene: &RuntimeScene,
    view: &View,
    background: Background,
    pixels: &PixelGradients<'_>,
    mode: GradientMode,
) -> Vec<ParameterGradient> {
    let (appearance, space) = (Appearance::default(), BlendSpace::Encoded);
    let environment = scene.environment.as_ref().map(|map| (map, appearance));
    let splats = project(&Layer { scene, view: *view, appearance }, space);
    let lists = tile_lists(&splats, view);
    let backdrop = |x, y| behind(view, background, environment, space, x, y);
    let settings = GradientSettings {
        slice: *slice,
        sh_direction: scene.trained_with.sh_direction,
        time_span: scene.trained_with.period_of_colors(),
        force_sh_3d: scene.trained_with.force_sh_3d,
        mode,
    };
    let Trained { parameters, harmonics } = trained;
    let of_one = |(index, splat): (usize, SplatGradient)| {
        parameter_gradient(parameters, harmonics, index, view, &settings, &splat)
    };
    blend_backward(&splats, &lists, view, backdrop, pixels, mode).into_par_iter().enumerate().map(of_one).collect()
}

/// Returns the gradient of a loss on a view with respect to each splat, from that with respect to each pixel.
/// `background` returns the color behind all Gaussians at pixel `(x, y)`.
///
/// The result is the same on every run: tiles are summed in order.
///
/// # Panics
/// If `pixels` has fewer entries than the view has pixels, or `lists` are not those of the splats and the view.
pub fn blend_backward(
    splats: &[Splat],
    lists: &TileLists,
    view: &View,
    background: impl Fn(u32, u32) -> Vec3 + Sync,
    pixels: &PixelGradients<'_>,
    mode: GradientMode,
) -> Vec<SplatGradient> {
    let (size, grid) = (view.size, view.tiles());
    let of_tile = |tile: usize| {
        let pairs = &lists.pairs[lists.ranges[tile].clone()];
        let mut parts = vec![SplatGradient::default(); pairs.len()];
        let low = tile_at(tile as u32, grid) * TILE_SIZE;
        let high = (low + TILE_SIZE).min(size);
        for (x, y) in (low.y..high.y).flat_map(|y| (low.x..high.x).map(move |x| (x, y))) {
            let i = (y * size.x + x) as usize;
            let (color, alpha) = (pixels.color[i].as_dvec3(), f64::from(pixels.alpha[i]));
            let pixel = Pixel {
                color,
                depth: f64::from(pixels.depth[i]),
                transmittance: color.dot(background(x, y).as_dvec3()) - alpha,
            };
            blend_pixel_backward(splats, pairs, UVec2::new(x, y), size.as_dvec2(), &pixel, mode, &mut parts);
        }
        parts
    };
    let tiles: Vec<Vec<SplatGradient>> = (0..lists.ranges.len()).into_par_iter().map(of_tile).collect();
    let mut gradients = vec![SplatGradient::default(); splats.len()];
    for (pair, part) in lists.pairs.iter().zip(tiles.into_iter().flatten()) {
        gradients[pair.splat as usize] += part;
    }
    gradients
}

/// The gradient with respect to the accumulated values of a pixel.
struct Pixel {
    color: DVec3,
    depth: f64,
    /// With respect to the remaining transmittance, which alpha and the background depend on.
    transmittance: f64,
}

impl Pixel {
    /// Returns the gradient with respect to the weight of a splat.
    fn of_weight(&self, splat: &Splat) -> f64 {
        self.color.dot(splat.color.as_dvec3()) + self.depth * f64::from(splat.depth)
    }
}

/// Adds the gradients of one pixel to `parts`, which has one for each pair.
fn blend_pixel_backward(
    splats: &[Splat],
    pairs: &[Pair],
    at: UVec2,
    size: DVec2,
    pixel: &Pixel,
    mode: GradientMode,
    parts: &mut [SplatGradient],
) {
    // Weights times their gradients: of all splats and the background, then of the splats behind the current one.
    let mut behind = 0.0;
    let left = walk(splats, pairs, at, |_, splat, blended| behind += pixel.of_weight(splat) * blended.weight());
    behind += pixel.transmittance * left;
    walk(splats, pairs, at, |index, splat, blended| {
        let (value, weight) = (pixel.of_weight(splat), blended.weight());
        behind -= value * weight;
        let g_alpha = if blended.clamped && mode == GradientMode::Exact {
            0.0
        } else {
            blended.transmittance * value - behind / (1.0 - blended.alpha)
        };
        let g_power = f64::from(splat.opacity) * blended.falloff * g_alpha;
        let ([xx, xy, yy], DVec2 { x, y }) = (conic_entries(splat.conic.to_array().map(f64::from)), blended.offset);
        let g_center = -g_power * DVec2::new(xx * x + xy * y, xy * x + yy * y);
        parts[index] += SplatGradient {
            ndc: (g_center * size * 0.5).to_array(),
            conic: [-0.5 * g_power * x * x, -g_power * x * y, -0.5 * g_power * y * y],
            opacity: blended.falloff * g_alpha,
            color: (pixel.color * weight).to_array(),
            depth: pixel.depth * weight,
        };
    });
}

/// A splat as it is blended at a pixel.
struct Blended {
    /// From the pixel to the splat's center, pixels.
    offset: DVec2,
    /// The factor on its opacity.
    falloff: f64,
    alpha: f64,
    /// Whether alpha is clamped from above.
    clamped: bool,
    /// Transmittance before it.
    transmittance: f64,
}

impl Blended {
    fn weight(&self) -> f64 {
        self.alpha * self.transmittance
    }
}

/// Calls `each` for every splat that is blended at a pixel, front to back, with the index of its pair, and returns the
/// remaining transmittance. Decisions are those of `blend`, in single precision; values are in double precision.
fn walk(splats: &[Splat], pairs: &[Pair], at: UVec2, mut each: impl FnMut(usize, &Splat, &Blended)) -> f64 {
    let (mut left, mut transmittance) = (1.0f32, 1.0f64);
    for (index, pair) in pairs.iter().enumerate() {
        let splat = &splats[pair.splat as usize];
        let offset = splat.center - at.as_vec2();
        match blend_step(splat.conic, splat.opacity, offset, left) {
            BlendStep::Skip => {}
            BlendStep::Stop => break,
            BlendStep::Blend { transmittance: after, .. } => {
                let (conic, offset) = (splat.conic.as_dvec3(), offset.as_dvec2());
                let DVec2 { x, y } = offset;
                let along = x + conic.y * y;
                let falloff = (-0.5 * (conic.x * along * along + conic.z * y * y)).exp();
                let (alpha, most) = (f64::from(splat.opacity) * falloff, f64::from(ALPHA_MAX));
                let blended =
                    Blended { offset, falloff, alpha: alpha.min(most), clamped: alpha >= most, transmittance };
                each(index, splat, &blended);
                transmittance *= 1.0 - blended.alpha;
                left = after;
            }
        }
    }
    transmittance
}
