//! Shadows, and light that they leave.
//!
//! In: the colors of a picture, where they depart from the plate, and the plate. Out: the pixels where the light has
//! changed, but not the surface: all channels by about one factor, and the texture of the background is still there.
//! Where a shadow is in the plate, the light without it is brighter.

use super::morphology::opened;
use super::reference::{Reference, slopes};
use super::window::{box_mean, dilated};
use glam::Vec3;

/// Least and largest factor of the light.
const FACTORS: [f32; 2] = [0.5, 1.5];
/// Most that the colors and the slopes around a pixel may depart from those of the background times the factor: so many
/// standard deviations in the mean.
const ALIKE: f32 = 2.0;
/// Share of the change of a color that may be no common factor: shadows are lit by light of another color.
const TINGE: f32 = 0.15;
/// Half of the least width of a shadow whose border counts, and the width of the border, in units of distance.
const WIDE: usize = 2;
const BORDER: usize = 4;
/// Largest departure that counts, so that a pixel does not outweigh its neighbors.
const MOST: f32 = 10.0;

/// Returns which pixels of a picture, by its colors in the exposure of the plate, have the surface of the background in
/// another light, or in the same. The border of a shadow has a texture of its own: beside a place that `departs` and is
/// relit, the hue alone tells.
pub(super) fn relit(colors: &[Vec3], departs: &[bool], reference: &Reference<'_>) -> Vec<bool> {
    let size = reference.size;
    let own_slopes = slopes(colors, size);
    let factors: Vec<f32> = colors.iter().zip(&reference.colors).map(|(&own, &other)| factor(own, other)).collect();
    let hue = |index: usize| {
        let (own, other) = (colors[index], reference.colors[index]);
        let tinge = TINGE * (own - other).abs().element_sum() / 3.0;
        let rest = own - other * factors[index];
        (rest * rest / (reference.variances[index] + tinge * tinge)).element_sum() / 3.0
    };
    let texture = |index: usize| {
        let rest = own_slopes[index] - reference.slopes[index] * factors[index];
        rest.length_squared() / reference.slope_variances[index]
    };
    let around = |departures: Vec<f32>| box_mean(departures, size, 2 * reference.unit);
    let hues = around((0..colors.len()).map(|index| hue(index).sqrt().min(MOST)).collect());
    let textures = around((0..colors.len()).map(|index| texture(index).sqrt().min(MOST)).collect());
    let has_hue = |index: usize| factors[index] > FACTORS[0] && factors[index] < FACTORS[1] && hues[index] < ALIKE;
    let is_alike = |index: usize| has_hue(index) && textures[index] < ALIKE;
    let shadow: Vec<bool> = (0..colors.len()).map(|index| departs[index] && is_alike(index)).collect();
    let beside = dilated(&opened(&shadow, size, WIDE * reference.unit), size, BORDER * reference.unit);
    (0..colors.len()).map(|index| is_alike(index) || beside[index] && has_hue(index)).collect()
}

/// Returns the factor that takes a color nearest to another.
fn factor(own: Vec3, other: Vec3) -> f32 {
    own.dot(other) / other.length_squared().max(1.0)
}

#[cfg(test)]
mod tests {
    use super::super::plate::plate;
    use super::*;
    use image::{Rgb, RgbImage};

    #[test]
    fn a_shadow_keeps_hue_and_texture() {
        let background = |x: u32, y: u32| Rgb([140 + 20 * (x / 4 % 2) as u8, 120, 90 + y as u8]);
        let still = RgbImage::from_fn(32, 32, background);
        let plate = plate(&[still.clone(), still.clone(), still], &[]);
        let reference = Reference::new(&plate);
        let relit_at = |change: &dyn Fn(u32, u32) -> Vec3, at: usize| {
            let colors: Vec<Vec3> = (0..32 * 32u32).map(|index| change(index % 32, index / 32)).collect();
            relit(&colors, &[true; 32 * 32], &reference)[at]
        };
        let middle = 16 * 32 + 16;
        let color = |x: u32, y: u32| Vec3::from(background(x, y).0.map(f32::from));
        assert!(relit_at(&|x, y| color(x, y) * 0.7, middle), "darker by one factor");
        assert!(relit_at(&|x, y| color(x, y) * 1.3, middle), "brighter by one factor");
        assert!(!relit_at(&|x, y| color(x, y) * 0.3, middle), "too dark");
        assert!(!relit_at(&|x, y| color(x, y) * Vec3::new(0.8, 0.7, 0.4), middle), "another hue");
        let folds = |x: u32, y: u32| color(x, y) * if (x + y).is_multiple_of(3) { 0.6 } else { 0.8 };
        assert!(!relit_at(&folds, middle), "another texture");
    }
}
