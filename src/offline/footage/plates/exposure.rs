//! The exposure of a picture against that of another of the same camera.
//!
//! In: two pictures of one size. Out: the gain, which is the factor that most pixels have changed by, and colors
//! without it.

use glam::Vec3;
use image::RgbImage;

/// Most pixels that a gain is taken from.
const SAMPLES: usize = 1 << 16;
/// Brightness, the mean of three channels of 0 to 255, of the pixels that gains are taken from: neither lost in noise
/// nor clipped.
const DARK: f32 = 20.0;
const BRIGHT: f32 = 240.0;
/// Largest gain; the least is its inverse. What exceeds it is no flicker.
const LARGEST: f32 = 2.0;

/// A picture and its exposure.
pub(super) struct Exposed<'a> {
    picture: &'a RgbImage,
    /// The inverse of the gain.
    scale: f32,
}

impl<'a> Exposed<'a> {
    /// Compares a picture with a reference of the same size.
    pub(super) fn new(picture: &'a RgbImage, reference: &RgbImage) -> Self {
        Self { picture, scale: 1.0 / gain(picture, reference) }
    }

    /// Returns the color of a pixel, by its index in the order of rows, as the exposure of the reference shows it: 0 to
    /// 255, more if the picture is darker.
    pub(super) fn color(&self, index: usize) -> Vec3 {
        color(self.picture, index) * self.scale
    }
}

/// Returns the color of a pixel, 0 to 255, by its index in the order of rows.
pub(super) fn color(picture: &RgbImage, index: usize) -> Vec3 {
    let bytes = &picture.as_raw()[3 * index..3 * index + 3];
    Vec3::new(f32::from(bytes[0]), f32::from(bytes[1]), f32::from(bytes[2]))
}

/// Returns the number of pixels of a picture.
pub(super) fn pixel_count(picture: &RgbImage) -> usize {
    picture.width() as usize * picture.height() as usize
}

/// Returns the median ratio of the brightness of the pixels of a picture to that of a reference; 1 if all are too dark
/// or clipped.
fn gain(picture: &RgbImage, reference: &RgbImage) -> f32 {
    let pixels = pixel_count(reference);
    let is_usable = |brightness: f32| brightness > DARK && brightness < BRIGHT;
    // An odd step meets all columns.
    let step = (pixels / SAMPLES) | 1;
    let ratio = |index: usize| {
        let [own, other] = [picture, reference].map(|picture| color(picture, index).element_sum() / 3.0);
        (is_usable(other) && own < BRIGHT).then(|| own / other)
    };
    let mut ratios: Vec<f32> = (0..pixels).step_by(step).filter_map(ratio).collect();
    if ratios.is_empty() {
        return 1.0;
    }
    let middle = ratios.len() / 2;
    let (_, &mut median, _) = ratios.select_nth_unstable_by(middle, f32::total_cmp);
    median.clamp(1.0 / LARGEST, LARGEST)
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Rgb;

    #[test]
    fn a_gain_is_what_most_pixels_changed_by() {
        let reference = RgbImage::from_fn(20, 20, |x, y| Rgb([100 + x as u8, 100 + y as u8, 100]));
        let brighter = |x: u32, y: u32| reference.get_pixel(x, y).0.map(|value| (f32::from(value) * 1.2).round() as u8);
        let picture = RgbImage::from_fn(20, 20, |x, y| if x < 8 { Rgb([10, 200, 10]) } else { Rgb(brighter(x, y)) });
        let gain = gain(&picture, &reference);
        assert!((gain - 1.2).abs() < 0.01, "a moving thing changes nothing: {gain}");
        let color = Exposed::new(&picture, &reference).color(15);
        assert!((color - Vec3::new(115.0, 100.0, 100.0)).length() < 2.0, "the color of the reference: {color}");
    }

    #[test]
    fn a_black_picture_has_no_gain_beyond_the_bound() {
        let reference = RgbImage::from_pixel(4, 4, Rgb([100; 3]));
        assert_eq!(gain(&RgbImage::new(4, 4), &reference), 1.0 / LARGEST, "no division by zero later");
        assert_eq!(gain(&reference, &RgbImage::new(4, 4)), 1.0, "no pixel can be compared");
    }
}
