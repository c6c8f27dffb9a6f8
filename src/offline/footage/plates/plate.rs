//! The background plate of a camera that stands still.
//!
//! In: pictures of one camera, of one size; masks of what moves in them, if they are known. Out: the [`Plate`]: the
//! median over time of each channel, or, where most pictures disagree with it, the color that most pictures agree
//! about. What masks have does not count. Its confidence is the share of pictures that agree; the noise is that of the
//! camera.

use super::exposure::{Exposed, color, pixel_count};
use crate::offline::dataset::mask::INSIDE;
use glam::Vec3;
use image::{GrayImage, RgbImage};
use rayon::prelude::*;
use std::iter::zip;

/// Most pictures that a plate is taken from.
const MOST: usize = 64;
/// Share of pictures that must agree about the median, or another color is looked for.
const SETTLED: f32 = 0.6;
/// Deviations from which the noise is taken, at most about so many.
const DEVIATIONS: usize = 1 << 18;
/// The standard deviation of a normal distribution over its median absolute deviation.
const NORMAL: f32 = 1.4826;
/// Least noise: that of rounding and of compression.
const LEAST_NOISE: f32 = 1.0;
/// Distance within which colors agree: so many times the noise, and so much more.
const NEAR: f32 = 3.0;
const NEAR_AT_LEAST: f32 = 2.0;
/// Bytes of a picture that are done at once.
const CHUNK: usize = 4096;

/// A picture, and what moves in it, if that is known.
type Seen<'a> = (&'a RgbImage, Option<&'a GrayImage>);

/// What a camera shows of what stands still.
#[derive(Debug, Clone)]
pub(crate) struct Plate {
    /// The background.
    pub picture: RgbImage,
    /// The share of pictures that show the background, less one since a picture agrees with itself, 255 for all: below
    /// half, the background is not known. Pictures that show what moves do not count; 0 if all do.
    pub confidence: GrayImage,
    /// Standard deviation of the noise of each channel, of 0 to 255.
    pub noise: Vec3,
}

/// Returns the plate of pictures of the size of the first; of at most 64 of them, evenly spread. A single picture is
/// its own plate, without confidence; without pictures the plate has no pixels. `moving` has a mask of what moves for
/// each picture, or none where it is not known; masks of another size are not used.
pub(crate) fn plate(pictures: &[RgbImage], moving: &[Option<GrayImage>]) -> Plate {
    let chosen = chosen(pictures, moving);
    let median = median(&chosen);
    let exposed: Vec<Exposed<'_>> = chosen.par_iter().map(|(picture, _)| Exposed::new(picture, &median)).collect();
    let noise = noise(&exposed, &median);
    let tolerance = noise * NEAR + NEAR_AT_LEAST;
    let settle = |samples: &mut Vec<Vec3>, index: usize| {
        samples.clear();
        let still = zip(&exposed, &chosen).filter(|(_, (_, mask))| stands(*mask, index));
        samples.extend(still.map(|(picture, _)| picture.color(index)));
        let usual = color(&median, index);
        let (color, share) = if samples.is_empty() { (usual, 0.0) } else { settled(samples, usual, tolerance) };
        let bytes = color.to_array().map(|value| value.round().clamp(0.0, 255.0) as u8);
        (bytes, (share * 255.0).round() as u8)
    };
    let pixels: Vec<([u8; 3], u8)> = (0..pixel_count(&median)).into_par_iter().map_init(Vec::new, settle).collect();
    let (width, height) = median.dimensions();
    let colors = pixels.iter().flat_map(|&(bytes, _)| bytes).collect();
    let shares = pixels.iter().map(|&(_, share)| share).collect();
    Plate {
        picture: RgbImage::from_raw(width, height, colors).unwrap_or_default(),
        confidence: GrayImage::from_raw(width, height, shares).unwrap_or_default(),
        noise,
    }
}

/// Returns at most [`MOST`] pictures of the size of the first, evenly spread.
fn chosen<'a>(pictures: &'a [RgbImage], moving: &'a [Option<GrayImage>]) -> Vec<Seen<'a>> {
    let size = pictures.first().map(RgbImage::dimensions);
    let mask = |index: usize| moving.get(index)?.as_ref().filter(|mask| Some(mask.dimensions()) == size);
    let alike = pictures.iter().enumerate().filter(|(_, picture)| Some(picture.dimensions()) == size);
    let alike: Vec<Seen<'a>> = alike.map(|(index, picture)| (picture, mask(index))).collect();
    let count = alike.len().min(MOST);
    (0..count).map(|index| alike[index * alike.len() / count]).collect()
}

/// Returns whether a pixel stands still, as far as a mask says.
fn stands(mask: Option<&GrayImage>, index: usize) -> bool {
    mask.is_none_or(|mask| mask.as_raw()[index] < INSIDE)
}

/// Returns the median of each byte of at most [`MOST`] pictures of one size: of those in which its pixel stands still,
/// or of all if there are none.
fn median(pictures: &[Seen<'_>]) -> RgbImage {
    let Some((first, _)) = pictures.first() else { return RgbImage::default() };
    let mut median = RgbImage::new(first.width(), first.height());
    let all: &mut [u8] = &mut median;
    all.par_chunks_mut(CHUNK).enumerate().for_each(|(chunk, bytes)| {
        let mut values = Vec::with_capacity(pictures.len());
        for (offset, byte) in bytes.iter_mut().enumerate() {
            let at = chunk * CHUNK + offset;
            let still = pictures.iter().filter(|(_, mask)| stands(*mask, at / 3));
            values.clear();
            values.extend(still.map(|(picture, _)| picture.as_raw()[at]));
            if values.is_empty() {
                values.extend(pictures.iter().map(|(picture, _)| picture.as_raw()[at]));
            }
            values.sort_unstable();
            *byte = values[values.len() / 2];
        }
    });
    median
}

/// Returns the noise of each channel: by the median absolute deviation over pixels and pictures, so that what moves
/// changes little.
fn noise(pictures: &[Exposed<'_>], median: &RgbImage) -> Vec3 {
    let pixels = pixel_count(median);
    // An odd step meets all columns.
    let step = (pixels * pictures.len() / DEVIATIONS) | 1;
    let deviation = |index: usize| {
        let (picture, pixel) = (index / pixels, index % pixels);
        (pictures[picture].color(pixel) - color(median, pixel)).abs()
    };
    let deviations: Vec<Vec3> = (0..pixels * pictures.len()).step_by(step).map(deviation).collect();
    if deviations.is_empty() {
        return Vec3::splat(LEAST_NOISE);
    }
    let channel = |channel: usize| {
        let mut values: Vec<f32> = deviations.iter().map(|deviation| deviation[channel]).collect();
        let middle = values.len() / 2;
        let (_, &mut median, _) = values.select_nth_unstable_by(middle, f32::total_cmp);
        median * NORMAL
    };
    Vec3::from([0, 1, 2].map(channel)).max(Vec3::splat(LEAST_NOISE))
}

/// Returns the color of a pixel of the plate, and the share of the pictures, less one, that agree about it, 0 to 1: the
/// median if most agree, or else the mean of the largest group of `samples` within the tolerance of one of them.
fn settled(samples: &[Vec3], median: Vec3, tolerance: Vec3) -> (Vec3, f32) {
    let is_near = |sample: Vec3, center: Vec3| (sample - center).abs().cmple(tolerance).all();
    let count = |center: Vec3| samples.iter().filter(|&&sample| is_near(sample, center)).count();
    let share = |count: usize| count.saturating_sub(1) as f32 / samples.len().saturating_sub(1).max(1) as f32;
    let of_median = count(median);
    if share(of_median) >= SETTLED {
        return (median, share(of_median));
    }
    let largest = samples.iter().map(|&center| (count(center), center)).max_by_key(|&(count, _)| count);
    match largest {
        Some((count, center)) if count > of_median => {
            let sum: Vec3 = samples.iter().copied().filter(|&sample| is_near(sample, center)).sum();
            (sum / count as f32, share(count))
        }
        _ => (median, share(of_median)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{Luma, Rgb};

    #[test]
    fn a_plate_shows_what_stands_still_under_flicker() {
        let at = |frame: u32, x: u32| if x / 4 == frame { 240 } else { 100 + x as u8 };
        let picture = |frame: u32| {
            let gain = 1.0 + 0.05 * (frame % 3) as f32;
            RgbImage::from_fn(40, 8, |x, y| Rgb([at(frame, x), 90, 80 + y as u8].map(|v| (f32::from(v) * gain) as u8)))
        };
        let pictures: Vec<_> = (0..10).map(picture).collect();
        let plate = plate(&pictures, &[]);
        for (x, y, pixel) in plate.picture.enumerate_pixels() {
            let still = [100 + x as u8, 90, 80 + y as u8].map(|value| f32::from(value) * 1.05);
            let far = (Vec3::from(pixel.0.map(f32::from)) - Vec3::from(still)).abs().max_element();
            assert!(far < 3.0, "at {x}, {y} the plate is {far} from the background");
        }
        let lowest = plate.confidence.pixels().map(|share| share.0[0]).min();
        assert!(lowest >= Some(210), "each pixel is covered in one picture of ten: {lowest:?}");
    }

    #[test]
    fn the_background_may_be_seen_in_fewer_than_half_of_the_pictures() {
        let covering = |frame: u32| Rgb([30 + 20 * frame as u8; 3]);
        let picture = |frame: u32| {
            RgbImage::from_fn(16, 16, |x, _| if x < 4 && frame < 6 { covering(frame) } else { Rgb([200, 150, 180]) })
        };
        let plate = plate(&(0..10).map(picture).collect::<Vec<_>>(), &[]);
        assert_eq!(plate.picture.get_pixel(2, 5), &Rgb([200, 150, 180]), "four pictures agree, the others do not");
        assert_eq!(plate.confidence.get_pixel(2, 5).0, [85], "three others of nine");
        assert_eq!(plate.confidence.get_pixel(9, 5).0, [255], "all agree");
    }

    #[test]
    fn what_masks_have_does_not_count() {
        let is_covered = |frame: u32, x: u32| x < 4 && frame < 8;
        let color = |frame: u32, x: u32| if is_covered(frame, x) { [60, 40, 30] } else { [200, 150, 180] };
        let mask = |frame: u32| {
            let value = |x: u32| if is_covered(frame, x) || x >= 12 { 255 } else { 0 };
            Some(GrayImage::from_fn(16, 16, |x, _| Luma([value(x)])))
        };
        let pictures: Vec<_> = (0..10).map(|frame| RgbImage::from_fn(16, 16, |x, _| Rgb(color(frame, x)))).collect();
        let masks: Vec<_> = (0..10).map(mask).collect();
        let plate = plate(&pictures, &masks);
        let at = |x: u32| (plate.picture.get_pixel(x, 5).0, plate.confidence.get_pixel(x, 5).0[0]);
        assert_eq!(at(2), ([200, 150, 180], 255), "the two pictures without the person agree");
        assert_eq!(at(9), ([200, 150, 180], 255), "nothing moves there");
        assert_eq!(at(14), ([200, 150, 180], 0), "no picture is known to show the background");
    }

    #[test]
    fn a_single_picture_is_a_plate_without_confidence() {
        let picture = RgbImage::from_fn(5, 4, |x, y| Rgb([x as u8, y as u8, 9]));
        let own = plate(&[picture.clone(), RgbImage::new(7, 7)], &[]);
        assert_eq!(own.picture, picture, "the picture of another size does not count");
        assert!(own.confidence.pixels().all(|share| share.0 == [0]), "nothing is known");
        assert_eq!(plate(&[], &[]).picture.dimensions(), (0, 0), "no pictures");
    }
}
