//! The environment map before the first step.
//!
//! In: training images that cover all of their pixels, the number of rows. Out: a map of one color, the mean of all pixels. Cameras that look at a
//! scene from around it show it in every direction: a map that began with what they see would show the scene once more behind itself.

use crate::offline::dataset::CoveredImage;
use crate::scene::Environment;
use crate::view::View;
use glam::DVec3;

/// Pixels of an image that are looked at, at most about so many.
const PIXELS: usize = 20_000;

/// Returns the map, with twice as many columns as rows.
pub(super) fn surroundings(images: &[(&View, &CoveredImage)], rows: u32) -> Environment {
    let (mut sum, mut count) = (DVec3::ZERO, 0.0);
    for (_, image) in images {
        let step = image.texels.len().div_ceil(PIXELS).max(1);
        for [r, g, b, _] in image.texels.iter().step_by(step) {
            sum += DVec3::from([r, g, b].map(|value| f64::from(*value) / 255.0));
            count += 1.0;
        }
    }
    let mean = (sum / f64::max(count, 1.0)).as_vec3();
    let plane = 2 * rows as usize * rows as usize;
    let texels = mean.to_array().into_iter().flat_map(|channel| std::iter::repeat_n(channel, plane)).collect();
    Environment { width: 2 * rows, height: rows, texels }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::view::{Camera, RasterFov};
    use glam::{UVec2, Vec3};

    #[test]
    fn the_map_has_the_mean_color_of_all_pixels() {
        let size = UVec2::splat(24);
        let view = Camera::look_at(Vec3::ZERO, Vec3::X, Vec3::Z, 0.8, size).view(0.0, RasterFov::Corrected);
        let image = |color| CoveredImage { size, texels: vec![color; 24 * 24], has_gaps: false };
        let images = [image([255, 0, 0, 255]), image([0, 0, 255, 255])];
        let map = surroundings(&images.each_ref().map(|image| (&view, image)), 16);
        assert_eq!((map.width, map.height, map.check()), (32, 16, Ok(())), "twice as wide as high");
        for direction in [Vec3::X, Vec3::NEG_Y, Vec3::new(0.3, -0.2, 0.9)] {
            let found = map.sample(Vec3::ZERO, direction);
            assert!(found.distance(Vec3::new(0.5, 0.0, 0.5)) < 1e-5, "purple everywhere: {found}");
        }
    }
}
