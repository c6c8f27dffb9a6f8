//! The environment map before the first step.
//!
//! In: training images that cover all of their pixels, the number of rows. Out: a map that shows, in each direction, the mean color of the
//! pixels that look there; where none does, the mean color of all.

use crate::offline::dataset::CoveredImage;
use crate::scene::Environment;
use crate::view::View;
use glam::Vec3;

/// Pixels of an image that are looked at, at most about so many.
const PIXELS: u32 = 20_000;

/// Returns the map, with twice as many columns as rows.
pub(super) fn surroundings(images: &[(&View, &CoveredImage)], rows: u32) -> Environment {
    let (width, height) = (2 * rows, rows);
    let plane = (width * height) as usize;
    let mut map = Environment { width, height, texels: vec![0.0; 3 * plane] };
    let mut sums = vec![(Vec3::ZERO, 0.0); plane];
    for (view, image) in images {
        let step = (f64::from(image.size.element_product()) / f64::from(PIXELS)).sqrt().ceil() as u32;
        for (x, y) in (0..image.size.y)
            .step_by(step as usize)
            .flat_map(|y| (0..image.size.x).step_by(step as usize).map(move |x| (x, y)))
        {
            let [r, g, b, _] = image.texels[(y * image.size.x + x) as usize];
            let color = Vec3::from([r, g, b].map(|value| f32::from(value) / 255.0));
            for (texel, weight) in map.weights(view.camera_position, view.ray(x, y)) {
                sums[texel].0 += weight * color;
                sums[texel].1 += weight;
            }
        }
    }
    let (all, weight) = sums.iter().fold((Vec3::ZERO, 0.0), |sum, own| (sum.0 + own.0, sum.1 + own.1));
    let mean = all / f32::max(weight, f32::MIN_POSITIVE);
    for (texel, (sum, weight)) in sums.into_iter().enumerate() {
        let color = if weight > 0.0 { sum / weight } else { mean };
        (0..3).for_each(|channel| map.texels[channel * plane + texel] = color[channel]);
    }
    map
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::view::{Camera, RasterFov};
    use glam::UVec2;

    #[test]
    fn the_map_shows_the_mean_color_of_each_direction() {
        let size = UVec2::splat(24);
        let look =
            |target: Vec3| Camera::look_at(Vec3::ZERO, target, Vec3::Z, 0.8, size).view(0.0, RasterFov::Corrected);
        let (red, blue) = ([255, 0, 0, 255], [0, 0, 255, 255]);
        let image = |color| CoveredImage { size, texels: vec![color; 24 * 24], has_gaps: false };
        let (views, images) = ([look(Vec3::X), look(Vec3::Y)], [image(red), image(blue)]);
        let map = surroundings(&views.iter().zip(&images).collect::<Vec<_>>(), 16);
        assert_eq!((map.width, map.height, map.check()), (32, 16, Ok(())), "twice as wide as high");
        let seen = |direction| map.sample(Vec3::ZERO, direction);
        assert!(seen(Vec3::X).distance(Vec3::X) < 1e-5, "red along x: {}", seen(Vec3::X));
        assert!(seen(Vec3::Y).distance(Vec3::Z) < 1e-5, "blue along y: {}", seen(Vec3::Y));
        let mean = Vec3::new(0.5, 0.0, 0.5);
        assert!(seen(Vec3::NEG_Y).distance(mean) < 0.05, "the mean where no camera looks: {}", seen(Vec3::NEG_Y));
    }
}
