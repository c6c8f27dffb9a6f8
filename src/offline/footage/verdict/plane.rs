//! Gray pictures of floating-point values.
//!
//! In: color pictures. Out: [`Plane`]: luminance, 0 to 255, at full and half size, and whether it shows anything.

use glam::UVec2;
use image::RgbImage;

/// Largest distance from the median, 0 to 255, of the pixels of a picture that shows nothing.
const FLAT: f32 = 6.0;
/// Share of the pixels that are as near to the median.
const FLAT_SHARE: f32 = 0.995;

/// A gray picture.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Plane {
    /// Size, pixels.
    pub size: UVec2,
    /// Luminance, 0 to 255, row by row.
    pub values: Vec<f32>,
}

impl Plane {
    /// Returns the luminance of a picture (BT.601).
    pub(super) fn luminance(picture: &RgbImage) -> Self {
        let luminance = |color: &[u8; 3]| {
            let [red, green, blue] = color.map(f32::from);
            0.299 * red + 0.587 * green + 0.114 * blue
        };
        let values = picture.pixels().map(|pixel| luminance(&pixel.0)).collect();
        Self { size: UVec2::new(picture.width(), picture.height()), values }
    }

    /// Returns the value of a pixel inside the picture.
    pub(super) fn at(&self, x: u32, y: u32) -> f32 {
        self.values[y as usize * self.size.x as usize + x as usize]
    }

    /// Returns the picture at half its size: means of two by two pixels.
    pub(super) fn halved(&self) -> Self {
        let size = self.size / 2;
        let mean = |index: u32| {
            let (x, y) = (index % size.x * 2, index / size.x * 2);
            (self.at(x, y) + self.at(x + 1, y) + self.at(x, y + 1) + self.at(x + 1, y + 1)) / 4.0
        };
        Self { size, values: (0..size.element_product()).map(mean).collect() }
    }

    /// Returns whether the picture shows nothing: nearly all of its pixels have one value.
    pub(super) fn is_blank(&self) -> bool {
        let Some(middle) = median(self.values.clone()) else { return true };
        let near = self.values.iter().filter(|&&value| (value - middle).abs() <= FLAT).count();
        near as f32 >= FLAT_SHARE * self.values.len() as f32
    }
}

/// Returns the median, of an even number of values the greater one in the middle; `None` without values.
pub(super) fn median(mut values: Vec<f32>) -> Option<f32> {
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f32::total_cmp).1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Rgb;

    #[test]
    fn a_noisy_black_picture_is_blank_and_one_with_a_small_thing_is_not() {
        let mut picture = RgbImage::from_fn(40, 40, |x, y| Rgb([((x * 7 + y * 3) % 5) as u8; 3]));
        assert!(Plane::luminance(&picture).is_blank(), "noise of four levels");
        (0..5).for_each(|x| (0..5).for_each(|y| picture.put_pixel(x, y, Rgb([90; 3]))));
        assert!(!Plane::luminance(&picture).is_blank(), "25 of 1600 pixels are bright");
    }

    #[test]
    fn half_the_size_has_the_means_of_four_pixels() {
        let plane = Plane { size: UVec2::new(3, 2), values: vec![1.0, 2.0, 9.0, 3.0, 6.0, 9.0] };
        assert_eq!(plane.halved(), Plane { size: UVec2::ONE, values: vec![3.0] }, "the odd column is left out");
    }
}
