//! The amount of blending in a view.
//!
//! In: a scene and a view. Out: [`Workload`], means over its pixels.

use super::{Layer, Splat, TileLists, project, tile_lists};
use crate::gaussian::alpha::{BlendStep, blend_step};
use crate::gaussian::overlap::tile_index;
use crate::scene::RuntimeScene;
use crate::view::{Appearance, BlendSpace, TILE_SIZE, View};
use glam::{UVec2, Vec2};
use rayon::prelude::*;

/// Splats per pixel of a view, means over its pixels.
#[derive(Debug, Clone, Copy, Default, PartialEq, serde::Serialize)]
pub struct Workload {
    /// Splats of the pixel's tile, up to the one that makes the pixel opaque.
    pub evaluated: f64,
    /// Splats that change the pixel.
    pub contributing: f64,
}

/// Counts the splats that each pixel of a view evaluates and blends.
pub fn workload(scene: &RuntimeScene, view: &View) -> Workload {
    let splats = project(&Layer { scene, view: *view, appearance: Appearance::default() }, BlendSpace::Encoded);
    let TileLists { pairs, ranges, .. } = tile_lists(&splats, view);
    let (size, tiles) = (view.size, view.tiles());
    let of_pixel = |i: u32| {
        let at = UVec2::new(i % size.x, i / size.x);
        let own = &pairs[ranges[tile_index(at / TILE_SIZE, tiles) as usize].clone()];
        counts(own.iter().map(|pair| &splats[pair.splat as usize]), at.as_vec2())
    };
    let pixels = (0..size.x * size.y).into_par_iter().map(of_pixel);
    let [evaluated, contributing] = pixels.reduce(|| [0; 2], |a, b| [a[0] + b[0], a[1] + b[1]]);
    let each = 1.0 / f64::from((size.x * size.y).max(1));
    Workload { evaluated: evaluated as f64 * each, contributing: contributing as f64 * each }
}

fn counts<'a>(splats: impl Iterator<Item = &'a Splat>, at: Vec2) -> [u64; 2] {
    let (mut evaluated, mut contributing, mut left) = (0, 0, 1.0);
    for splat in splats {
        evaluated += 1;
        match blend_step(splat.conic, splat.opacity, splat.center - at, left) {
            BlendStep::Skip => {}
            BlendStep::Stop => break,
            BlendStep::Blend { transmittance, .. } => {
                contributing += 1;
                left = transmittance;
            }
        }
    }
    [evaluated, contributing]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gaussian::{Gaussian, Harmonics};
    use crate::view::{Camera, RasterFov};
    use glam::Vec3;

    /// Returns a scene of Gaussians of this opacity behind each other, far larger than the view.
    fn walls(count: usize, opacity: f32) -> RuntimeScene {
        let gaussians = (0..count).map(|i| Gaussian {
            mean: [0.0, i as f32, 0.0],
            mean_t: 0.0,
            velocity: [0.0; 3],
            sigma_t: f32::INFINITY,
            covariance: [1e4, 0.0, 0.0, 1e-6, 0.0, 1e4],
            opacity,
            padding: 0.0,
        });
        let values = vec![0.5; 3 * count];
        RuntimeScene::sliced(gaussians.collect(), Harmonics { coefficients: 1, degree: 0, degree_t: 0, values })
    }

    fn of(scene: &RuntimeScene) -> Workload {
        let camera = Camera::look_at(Vec3::new(0.0, -3.0, 0.0), Vec3::ZERO, Vec3::Z, 0.8, UVec2::new(20, 12));
        workload(scene, &camera.view(0.0, RasterFov::Reference))
    }

    #[test]
    fn every_splat_counts_until_a_pixel_is_opaque() {
        assert_eq!(
            of(&walls(5, 0.1)),
            Workload { evaluated: 5.0, contributing: 5.0 },
            "all are blended while the pixel is transparent"
        );
        assert_eq!(of(&walls(5, 0.001)).contributing, 0.0, "splats with an alpha below 1/255 do not contribute");
        // Each splat leaves a hundredth of the transmittance; the third would leave less than 1e-4, so blending stops
        // before it.
        let found = of(&walls(50, 1.0));
        assert!(found.contributing < 4.0 && found.evaluated < 4.0, "blending stops at an opaque pixel: {found:?}");
    }
}
