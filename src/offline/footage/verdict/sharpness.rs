//! How much fine detail a picture has.
//!
//! In: a gray picture at full size, a mask of what moves. Out: [`Sharpness`]: the energy of the gradient at full size
//! over that at half size, for what stands and for what moves. The quotient hardly depends on what the picture shows:
//! footage in focus has 0.45 to 0.8, a blur of one pixel (standard deviation) 0.4, of two pixels 0.29, and 0.25 is what
//! remains without any detail.

use super::plane::Plane;
use crate::offline::dataset::mask::INSIDE;
use image::GrayImage;

/// Quotient of a picture without detail.
pub(super) const NO_DETAIL: f32 = 0.25;
/// Least number of pixels of a part, and least mean square of its gradient at half size, for a quotient.
const FEWEST: usize = 2000;
const TEXTURE: f64 = 4.0;

/// Quotients of the energy of the gradient; `None` for a part that is too small or has no texture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Sharpness {
    /// Of what stands still.
    pub still: Option<f32>,
    /// Of what moves.
    pub moving: Option<f32>,
}

impl Sharpness {
    /// Measures a picture. Without a mask all of it stands still.
    pub(super) fn of(picture: &Plane, mask: Option<&GrayImage>) -> Self {
        let fine = energies(picture, mask);
        let coarse = energies(&picture.halved(), mask);
        let quotient = |part: usize| {
            let ([fine, count], [coarse, half_count]) = (fine[part], coarse[part]);
            let is_known = count as usize >= FEWEST && half_count >= 1.0 && coarse / half_count >= TEXTURE;
            is_known.then(|| ((fine / count) / (coarse / half_count)) as f32)
        };
        Self { still: quotient(0), moving: quotient(1) }
    }
}

/// Returns the sum of the squared gradient and the number of pixels, of what stands and of what moves.
fn energies(picture: &Plane, mask: Option<&GrayImage>) -> [[f64; 2]; 2] {
    let (width, height) = (picture.size.x, picture.size.y);
    let mask = mask.filter(|mask| mask.width() > 0 && mask.height() > 0);
    let mut sums = [[0.0; 2]; 2];
    for y in 1..height.saturating_sub(1) {
        for x in 1..width.saturating_sub(1) {
            let moves = mask.is_some_and(|mask| {
                mask.get_pixel(x * mask.width() / width, y * mask.height() / height).0[0] >= INSIDE
            });
            let across = f64::from(picture.at(x + 1, y) - picture.at(x - 1, y));
            let down = f64::from(picture.at(x, y + 1) - picture.at(x, y - 1));
            let sum = &mut sums[usize::from(moves)];
            sum[0] += across * across + down * down;
            sum[1] += 1.0;
        }
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::UVec2;

    #[test]
    fn a_blurred_picture_is_less_sharp() {
        let size = UVec2::splat(120);
        let stripes = |soft: f32| {
            let value = |index: u32| {
                let x = index % size.x;
                let phase = ((x / 12 * 12) as f32 - x as f32 + 6.0) / soft;
                let side = if (x / 12).is_multiple_of(2) { 1.0 } else { -1.0 };
                128.0 + 90.0 * side * phase.clamp(-1.0, 1.0)
            };
            let picture = Plane { size, values: (0..size.element_product()).map(value).collect() };
            Sharpness::of(&picture, None).still.expect("it has texture")
        };
        let (sharp, soft) = (stripes(0.5), stripes(6.0));
        assert!(sharp > 1.2 * soft, "sharp {sharp}, soft {soft}");
    }

    #[test]
    fn a_part_without_texture_has_no_quotient() {
        let flat = Plane { size: UVec2::splat(100), values: vec![50.0; 10_000] };
        assert_eq!(Sharpness::of(&flat, None), Sharpness { still: None, moving: None }, "flat");
    }
}
