//! Peaks of the error of a drawn picture: places where something small is missing.
//!
//! In: a drawn picture and the image that it should look like. Out: [`Peak`]s, each a place whose error is larger than
//! that of its surroundings, with the color that the image has there; the largest errors first.
//!
//! The error of a pixel is the mean difference of its three channels, averaged over the pixels around it, so that a
//! small thing has one peak and noise has none. Errors that much of a picture has are no peaks: the least error is a
//! multiple of the median.

use crate::view::Picture;
use glam::{UVec2, Vec2, Vec3};

/// Pixels in each direction over which errors are averaged: five across and down.
const AROUND: usize = 2;
/// Least error of a peak, and least error as a multiple of the median.
const LEAST: f32 = 0.06;
const OF_MEDIAN: f32 = 4.0;
/// Least distance between two peaks, pixels.
const APART: f32 = 6.0;
/// Pixels in each direction whose errors give the center of a peak.
const CENTERED: u32 = 5;
/// Most peaks of a picture.
const MOST: usize = 64;

/// A place of a picture with a large error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Peak {
    /// Pixels from the upper left corner of the picture; pixel centers are at half-integers.
    pub at: Vec2,
    /// Color of the image, RGB.
    pub color: Vec3,
}

/// Returns the peaks of the error of a drawn picture, the largest errors first; none if the sizes differ.
pub(crate) fn error_peaks(drawn: &Picture, image: &Picture) -> Vec<Peak> {
    let size = image.size;
    if drawn.size != size || drawn.pixels.len() != image.pixels.len() || image.pixels.is_empty() {
        return Vec::new();
    }
    let difference = |(drawn, image): (&Vec3, &Vec3)| {
        let error = (*drawn - *image).abs().element_sum() / 3.0;
        if error.is_finite() { error } else { 0.0 }
    };
    let error = averaged(&drawn.pixels.iter().zip(&image.pixels).map(difference).collect::<Vec<f32>>(), size);
    let least = LEAST.max(OF_MEDIAN * median(&error));
    let is_peak = |&index: &usize| error[index] > least && is_highest(&error, size, pixel(index, size));
    let mut found: Vec<usize> = (0..error.len()).filter(is_peak).collect();
    found.sort_by(|&a, &b| error[b].total_cmp(&error[a]).then(a.cmp(&b)));
    let mut kept: Vec<UVec2> = Vec::new();
    for index in found {
        let own = pixel(index, size);
        if kept.iter().all(|other| other.as_vec2().distance(own.as_vec2()) >= APART) {
            kept.push(own);
        }
        if kept.len() == MOST {
            break;
        }
    }
    let peak = |pixel: UVec2| {
        let at = center(&error, size, pixel);
        Peak { at, color: color_around(image, at.as_uvec2().min(size - 1)) }
    };
    kept.into_iter().map(peak).collect()
}

fn pixel(index: usize, size: UVec2) -> UVec2 {
    UVec2::new(index as u32 % size.x, index as u32 / size.x)
}

fn index_of(pixel: UVec2, size: UVec2) -> usize {
    pixel.y as usize * size.x as usize + pixel.x as usize
}

/// Returns the pixels at most so many pixels across and down from one.
fn around(pixel: UVec2, distance: u32, size: UVec2) -> impl Iterator<Item = UVec2> {
    let low = pixel.saturating_sub(UVec2::splat(distance));
    let high = (pixel + distance).min(size - 1);
    (low.y..=high.y).flat_map(move |y| (low.x..=high.x).map(move |x| UVec2::new(x, y)))
}

/// Returns for each pixel the mean over the square of pixels around it, as far as the picture has these.
fn averaged(values: &[f32], size: UVec2) -> Vec<f32> {
    let [width, height] = size.to_array().map(|side| side as usize);
    // The mean along a line of `length` pixels that are `step` apart, around the one at `place`.
    let mean = |values: &[f32], index: usize, place: usize, length: usize, step: usize| {
        let (before, after) = (place.min(AROUND), (length - 1 - place).min(AROUND));
        let first = index - before * step;
        let count = before + after + 1;
        (0..count).map(|along| values[first + along * step]).sum::<f32>() / count as f32
    };
    let across: Vec<f32> = (0..values.len()).map(|index| mean(values, index, index % width, width, 1)).collect();
    (0..values.len()).map(|index| mean(&across, index, index / width, height, width)).collect()
}

/// Returns the median; of an even number of values, the larger of both in the middle.
fn median(values: &[f32]) -> f32 {
    let mut values = values.to_vec();
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f32::total_cmp).1
}

/// Returns whether no pixel beside one has a larger error.
fn is_highest(error: &[f32], size: UVec2, pixel: UVec2) -> bool {
    let own = error[index_of(pixel, size)];
    around(pixel, 1, size).all(|other| error[index_of(other, size)] <= own)
}

/// Returns the center of the errors around a peak that are above half of its own, pixels.
fn center(error: &[f32], size: UVec2, peak: UVec2) -> Vec2 {
    let half = 0.5 * error[index_of(peak, size)];
    let (mut sum, mut weights) = (Vec2::ZERO, 0.0);
    for pixel in around(peak, CENTERED, size) {
        let weight = (error[index_of(pixel, size)] - half).max(0.0);
        sum += weight * pixel.as_vec2();
        weights += weight;
    }
    // The peak itself has a weight.
    sum / weights + 0.5
}

/// Returns the mean color of a pixel and those beside it.
fn color_around(image: &Picture, pixel: UVec2) -> Vec3 {
    let (mut sum, mut count) = (Vec3::ZERO, 0.0);
    for other in around(pixel, 1, image.size) {
        sum += image.pixels[index_of(other, image.size)];
        count += 1.0;
    }
    sum / count
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: UVec2 = UVec2::new(90, 70);
    const GRAY: Vec3 = Vec3::splat(0.5);

    /// Returns a gray picture with discs of eight pixels: their centers and colors.
    fn discs(discs: &[(Vec2, Vec3)]) -> Picture {
        let color = |index: usize| {
            let at = pixel(index, SIZE).as_vec2() + 0.5;
            discs.iter().find(|(center, _)| center.distance(at) < 4.0).map_or(GRAY, |(_, color)| *color)
        };
        Picture { size: SIZE, pixels: (0..SIZE.element_product() as usize).map(color).collect() }
    }

    #[test]
    fn each_thing_that_is_missing_has_one_peak() {
        let missing = [(Vec2::new(20.3, 30.0), Vec3::new(1.0, 0.8, 0.1)), (Vec2::new(60.0, 12.7), Vec3::X)];
        let image = discs(&missing);
        let mut drawn = discs(&[]);
        // Noise of less than the least error.
        drawn.pixels.iter_mut().enumerate().for_each(|(index, pixel)| *pixel += 0.01 * (index % 7) as f32);
        let found = error_peaks(&drawn, &image);
        assert_eq!(found.len(), 2, "a peak for each: {found:?}");
        for (center, color) in missing {
            let near = found.iter().find(|peak| peak.at.distance(center) < 0.7);
            let near = near.unwrap_or_else(|| panic!("no peak at {center}: {found:?}"));
            assert!((near.color - color).abs().max_element() < 0.01, "its color: {near:?}");
        }
    }

    #[test]
    fn an_error_that_the_whole_picture_has_is_no_peak() {
        let image = discs(&[(Vec2::new(40.0, 30.0), GRAY + 0.25)]);
        let drawn = Picture::filled(SIZE, GRAY + 0.2);
        assert_eq!(error_peaks(&drawn, &image), [], "no error is four times the median");
        assert_eq!(error_peaks(&image, &image), [], "nor is there one without errors");
        assert_eq!(error_peaks(&Picture::filled(UVec2::ONE, GRAY), &image), [], "pictures of two sizes");
    }

    #[test]
    fn peaks_are_apart_and_not_too_many() {
        let image = Picture::filled(SIZE, Vec3::ONE);
        let mut drawn = image.clone();
        // Most of the picture is right; the rest is a wide hole and has equal errors.
        drawn.pixels.iter_mut().take(2000).for_each(|pixel| *pixel = Vec3::ZERO);
        let found = error_peaks(&drawn, &image);
        assert!(found.len() > 20 && found.len() <= MOST, "{} peaks", found.len());
    }
}
