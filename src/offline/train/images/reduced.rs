//! Images at a reduced size.
//!
//! In: shares of the steps ([`Coarse`]), an image. Out: how large images are at a step ([`Detail`]); the image at that
//! size, each pixel the mean of the area that it covers. A view at another size is the same view with that size: its
//! projection does not depend on it.

use crate::offline::dataset::CoveredImage;
use glam::UVec2;
use rayon::prelude::*;

/// The sizes of the images of a training: at first a quarter, then half, then whole. Images whose longer side is at
/// most [`whole_up_to`](Self::whole_up_to) are always whole.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Coarse {
    /// Share of the steps that are made on images with a quarter of each side. Default: 0.3.
    pub quarter_until: f64,
    /// Share of the steps after which images are whole; between both, they have half of each side. Default: 0.6.
    pub half_until: f64,
    /// Longer side up to which an image is always whole, pixels. Default: 1000.
    pub whole_up_to: u32,
}

impl Default for Coarse {
    fn default() -> Self {
        Self { quarter_until: 0.3, half_until: 0.6, whole_up_to: 1000 }
    }
}

/// How large images are at a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Detail {
    Quarter,
    Half,
    Whole,
}

impl Detail {
    fn divisor(self) -> u32 {
        match self {
            Self::Quarter => 4,
            Self::Half => 2,
            Self::Whole => 1,
        }
    }
}

impl Coarse {
    /// Returns the sizes for images of these sizes, pixels: if none of them is reduced, all steps are at whole size.
    pub(crate) fn over(self, mut sizes: impl Iterator<Item = UVec2>) -> Self {
        let reduces = sizes.any(|size| self.reduces(size));
        if reduces { self } else { Self { quarter_until: 0.0, half_until: 0.0, ..self } }
    }

    /// Returns how large images are at a step, from 0, of `steps`. After the last step they are whole.
    pub(crate) fn detail(&self, step: usize, steps: usize) -> Detail {
        let share = step as f64 / steps.max(1) as f64;
        match step < steps {
            true if share < self.quarter_until => Detail::Quarter,
            true if share < self.half_until => Detail::Half,
            _ => Detail::Whole,
        }
    }

    /// Returns whether images of this size, pixels, are reduced.
    fn reduces(&self, size: UVec2) -> bool {
        size.max_element() > self.whole_up_to
    }

    /// Returns the size that an image of this size has, pixels: the nearest whole one, at least 1.
    pub(crate) fn size(&self, size: UVec2, detail: Detail) -> UVec2 {
        let divisor = if self.reduces(size) { detail.divisor() } else { 1 };
        ((size + divisor / 2) / divisor).max(UVec2::ONE)
    }
}

/// Returns an image at a size that is no larger: each pixel is the mean of the area that it covers, colors times
/// coverage and coverage alike.
pub(crate) fn reduced(image: &CoveredImage, size: UVec2) -> CoveredImage {
    let [across, down] = [0, 1].map(|axis| spans(image.size[axis], size[axis]));
    let across = &across[..];
    let row = |down: &Span| -> Vec<[u8; 4]> { across.iter().map(|across| mean(image, across, down)).collect() };
    let texels = down.par_iter().flat_map_iter(row).collect();
    CoveredImage { size, texels, has_gaps: image.has_gaps }
}

/// The pixels of a row or column that one reduced pixel covers.
struct Span {
    first: usize,
    /// The share of each, from the first on.
    shares: Vec<f32>,
}

/// Returns the span of each of `to` pixels in a row or column of `from`.
fn spans(from: u32, to: u32) -> Vec<Span> {
    let edge = |index: u32| f64::from(index) * f64::from(from) / f64::from(to);
    let span = |index: u32| {
        let (begin, end) = (edge(index), edge(index + 1));
        let (first, last) = (begin.floor() as usize, (end.ceil() as usize).min(from as usize));
        let share = |pixel: usize| {
            let covered = end.min((pixel + 1) as f64) - begin.max(pixel as f64);
            (covered / (end - begin)) as f32
        };
        Span { first, shares: (first..last).map(share).collect() }
    };
    (0..to).map(span).collect()
}

/// Returns the mean of the pixels of two spans.
fn mean(image: &CoveredImage, across: &Span, down: &Span) -> [u8; 4] {
    let mut sums = [0.0; 4];
    for (row, of_row) in (down.first..).zip(&down.shares) {
        let texels = &image.texels[row * image.size.x as usize + across.first..];
        for (texel, of_pixel) in texels.iter().zip(&across.shares) {
            let share = of_row * of_pixel;
            sums.iter_mut().zip(texel).for_each(|(sum, &value)| *sum += share * f32::from(value));
        }
    }
    // A conversion to a byte ends at 0 and 255.
    sums.map(|sum| (sum + 0.5) as u8)
}

#[cfg(test)]
mod tests {
    use super::Detail::{Half, Quarter, Whole};
    use super::*;

    #[test]
    fn images_are_small_at_first_and_whole_in_the_end() {
        let coarse = Coarse::default();
        let details = [0, 29, 30, 59, 60, 99, 100].map(|step| coarse.detail(step, 100));
        assert_eq!(details, [Quarter, Quarter, Half, Half, Whole, Whole, Whole], "by shares of the steps");
        let never = Coarse { quarter_until: 2.0, half_until: 2.0, ..coarse };
        assert_eq!((never.detail(9, 10), never.detail(10, 10)), (Quarter, Whole), "whole after the last step");
        assert_eq!(Coarse { quarter_until: f64::NAN, ..coarse }.detail(0, 10), Half, "no number is no share");
    }

    #[test]
    fn only_large_images_are_reduced() {
        let coarse = Coarse::default();
        let size = |x, y, detail| coarse.size(UVec2::new(x, y), detail);
        assert_eq!(size(1000, 800, Quarter), UVec2::new(1000, 800), "not larger than 1000 pixels");
        assert_eq!(size(720, 1280, Quarter), UVec2::new(180, 320), "a quarter of each side");
        assert_eq!(size(1001, 3, Half), UVec2::new(501, 2), "the nearest whole size");
        assert_eq!(size(4001, 1, Quarter), UVec2::new(1000, 1), "at least one pixel");
        assert_eq!(size(4001, 1, Whole), UVec2::new(4001, 1), "whole");
        let small = coarse.over([UVec2::new(800, 600), UVec2::new(1000, 10)].into_iter());
        assert_eq!(small.detail(0, 100), Whole, "all steps, if no image is large");
        assert_eq!(coarse.over([UVec2::new(800, 600), UVec2::new(10, 1001)].into_iter()), coarse, "one is large");
    }

    #[test]
    fn a_reduced_pixel_is_the_mean_of_those_it_covers() {
        let texels = (0..8 * 4).map(|i| [8 * (i % 8), 10 * (i / 8), 40, if i % 8 < 4 { 255 } else { 0 }]).collect();
        let image = CoveredImage { size: UVec2::new(8, 4), texels, has_gaps: true };
        let found = reduced(&image, UVec2::new(2, 1));
        assert_eq!((found.size, found.has_gaps), (UVec2::new(2, 1), true), "of the size, with gaps as before");
        assert_eq!(found.texels, [[12, 15, 40, 255], [44, 15, 40, 0]], "means of four by four pixels");
        assert_eq!(reduced(&image, image.size).texels, image.texels, "at its own size it is the same");
    }

    #[test]
    fn pixels_on_an_edge_count_by_their_area() {
        let texels = [0, 30, 90].map(|value| [value, value, value, 255]).to_vec();
        let image = CoveredImage { size: UVec2::new(3, 1), texels, has_gaps: false };
        let found = reduced(&image, UVec2::new(2, 1));
        // (1 · 0 + 0.5 · 30) / 1.5 and (0.5 · 30 + 1 · 90) / 1.5.
        assert_eq!(found.texels, [[10, 10, 10, 255], [70, 70, 70, 255]], "half of the middle to each side");
        let size = UVec2::splat(101);
        let plain = CoveredImage { size, texels: vec![[200, 7, 0, 255]; 101 * 101], has_gaps: false };
        assert!(reduced(&plain, UVec2::splat(25)).texels.iter().all(|texel| *texel == [200, 7, 0, 255]), "plain stays");
    }
}
