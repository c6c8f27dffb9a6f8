//! What pictures are compared with: a plate, prepared.
//!
//! In: a plate. Out: its colors, the variance that is expected of pictures, which is larger at edges, and how fast the
//! brightness changes from pixel to pixel.

use super::exposure::{Exposed, color, pixel_count};
use super::plate::Plate;
use glam::{UVec2, Vec2, Vec3};
use image::RgbImage;

/// Distance in pixels by which edges of the background may shift: cameras tremble, compression rings.
const TREMBLE: f32 = 0.25;
/// Longer side of the pictures whose smallest distance is a pixel.
const LONGEST: f32 = 640.0;

/// A plate, prepared for comparing. Pixels are in the order of rows.
pub(super) struct Reference<'a> {
    plate: &'a RgbImage,
    /// Pixels.
    pub size: UVec2,
    /// The smallest distance, in pixels, at which pictures of this size are looked at.
    pub unit: usize,
    /// Colors, 0 to 255.
    pub colors: Vec<Vec3>,
    /// The variance of each channel.
    pub variances: Vec<Vec3>,
    /// Slopes of the brightness, a pixel.
    pub slopes: Vec<Vec2>,
    /// The variance of slopes of pictures.
    pub slope_variances: Vec<f32>,
}

impl<'a> Reference<'a> {
    /// Prepares a plate.
    pub(super) fn new(plate: &'a Plate) -> Self {
        let size = UVec2::from(plate.picture.dimensions());
        let colors: Vec<Vec3> = (0..pixel_count(&plate.picture)).map(|index| color(&plate.picture, index)).collect();
        let slopes = slopes(&colors, size);
        let edges = |slope: &Vec2| TREMBLE * TREMBLE * slope.length_squared();
        let squares = plate.noise * plate.noise;
        // A slope is half of a difference of two pixels.
        let flat = squares.element_sum() / 3.0 / 2.0;
        Self {
            plate: &plate.picture,
            size,
            unit: ((size.max_element() as f32 / LONGEST).round() as usize).max(1),
            variances: slopes.iter().map(|slope| squares + edges(slope)).collect(),
            slope_variances: slopes.iter().map(|slope| flat + edges(slope)).collect(),
            colors,
            slopes,
        }
    }

    /// Returns the colors of a picture of the size of the plate in the exposure of the plate.
    pub(super) fn exposed(&self, picture: &RgbImage) -> Vec<Vec3> {
        let exposed = Exposed::new(picture, self.plate);
        (0..self.colors.len()).map(|index| exposed.color(index)).collect()
    }
}

/// Returns the slopes of the brightness, which is the mean of the channels; zero at the border.
pub(super) fn slopes(colors: &[Vec3], size: UVec2) -> Vec<Vec2> {
    let [width, height] = size.to_array().map(|side| side as usize);
    let brightness = |index: usize| colors[index].element_sum() / 3.0;
    let half = |before: usize, after: usize| (brightness(after) - brightness(before)) / 2.0;
    let slope = |index: usize| {
        let (x, y) = (index % width, index / width);
        let across = if x > 0 && x + 1 < width { half(index - 1, index + 1) } else { 0.0 };
        let down = if y > 0 && y + 1 < height { half(index - width, index + width) } else { 0.0 };
        Vec2::new(across, down)
    };
    (0..colors.len()).map(slope).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slopes_are_a_pixel_and_zero_at_the_border() {
        let size = UVec2::new(5, 4);
        let colors: Vec<Vec3> = (0..20).map(|index| Vec3::splat((3 * (index % 5) + 7 * (index / 5)) as f32)).collect();
        let slopes = slopes(&colors, size);
        assert_eq!(slopes[5 + 2], Vec2::new(3.0, 7.0), "inside");
        assert_eq!(slopes[0], Vec2::ZERO, "in the corner");
        assert_eq!(slopes[2], Vec2::new(3.0, 0.0), "at the upper border");
    }
}
