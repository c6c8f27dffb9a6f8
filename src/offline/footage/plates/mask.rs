//! Masks of what moves before a camera that stands still.
//!
//! In: pictures of a camera and its plate. Out: a mask for each picture: 0 where it shows the background, 255 where it
//! does not, [`INSIDE`] and more in what is taken to move. At most [`UNKNOWN`] where the background is not known, so
//! that the picture cannot tell.

use super::morphology::{closed, filled, opened, seeded, without_specks};
use super::plate::Plate;
use super::reference::Reference;
use super::shadow::relit;
use super::window::box_mean;
use crate::offline::dataset::mask::INSIDE;
use glam::UVec2;
use image::{GrayImage, Luma, RgbImage};
use rayon::prelude::*;

/// Most that a mask says where the background is not known.
const UNKNOWN: u8 = 160;
/// Confidence of a plate, 0 to 255, below which the background is not known: half of the pictures disagree.
const CONFIDENT: u8 = 128;
/// Departures from the plate, in standard deviations in the mean around a pixel, from which something may move, and
/// from which it surely does. What may move does if it is connected to what surely does.
const LIKELY: f32 = 4.0;
const SURE: f32 = 6.0;
/// Largest departure that counts, so that the mean does not widen what moves.
const MOST: f32 = 9.0;
/// Largest hole in what moves, as a share of the picture.
const HOLE: f32 = 0.01;
/// Smallest place where the background is not known, and largest hole in it, as shares of the picture.
const UNKNOWN_SPECK: f32 = 0.001;
const UNKNOWN_HOLE: f32 = 0.015;

/// Returns the masks of pictures, without parts that are smaller than this share of a picture. Each depends on its
/// picture and the plate only, so that pictures may be given in parts. A picture of another size than the plate has a
/// mask that knows nothing.
pub(crate) fn masks(pictures: &[RgbImage], plate: &Plate, smallest: f32) -> Vec<GrayImage> {
    let reference = Reference::new(plate);
    let unknown = unknown(plate, &reference);
    pictures.par_iter().map(|picture| mask(picture, &reference, &unknown, smallest)).collect()
}

/// Returns the places where the background is not known: whole, with what lies between.
fn unknown(plate: &Plate, reference: &Reference<'_>) -> Vec<bool> {
    let (size, unit) = (reference.size, reference.unit);
    let doubts = plate.confidence.pixels().map(|share| f32::from(share.0[0] < CONFIDENT)).collect();
    let doubtful: Vec<bool> = box_mean(doubts, size, 2 * unit).iter().map(|&share| share > 0.5).collect();
    let places = closed(&opened(&doubtful, size, unit), size, 4 * unit);
    without_specks(&filled(places, size, share(size, UNKNOWN_HOLE)), size, share(size, UNKNOWN_SPECK))
}

/// Returns the mask of a picture.
fn mask(picture: &RgbImage, reference: &Reference<'_>, unknown: &[bool], smallest: f32) -> GrayImage {
    let (size, unit) = (reference.size, reference.unit);
    if UVec2::from(picture.dimensions()) != size {
        return GrayImage::from_pixel(picture.width(), picture.height(), Luma([UNKNOWN]));
    }
    let departures = departures(picture, reference);
    let [likely, sure] =
        [LIKELY, SURE].map(|least| -> Vec<bool> { departures.iter().map(|&departure| departure > least).collect() });
    let moving = seeded(&opened(&likely, size, unit), &sure, size);
    let all: Vec<bool> = moving.iter().zip(unknown).map(|(&moving, &unknown)| moving || unknown).collect();
    let whole = filled(closed(&all, size, 2 * unit), size, share(size, HOLE));
    let whole = without_specks(&whole, size, share(size, smallest));
    let inside = whole.iter().map(|&inside| f32::from(inside)).collect();
    let ramp = box_mean(inside, size, unit);
    let value = |index: usize| {
        let part = (ramp[index] * 127.0) as u8;
        match (whole[index], unknown[index] && !moving[index]) {
            (true, true) => (part + INSIDE).min(UNKNOWN),
            (true, false) => part + INSIDE,
            (false, _) => part,
        }
    };
    GrayImage::from_raw(size.x, size.y, (0..whole.len()).map(value).collect()).unwrap_or_default()
}

/// Returns how far the surroundings of each pixel depart from the plate, in standard deviations; zero where only the
/// light has changed.
fn departures(picture: &RgbImage, reference: &Reference<'_>) -> Vec<f32> {
    let colors = reference.exposed(picture);
    let departure = |index: usize| {
        let rest = colors[index] - reference.colors[index];
        (rest * rest / reference.variances[index]).element_sum() / 3.0
    };
    let raw = (0..colors.len()).map(|index| departure(index).sqrt().min(MOST)).collect();
    let mut departures = box_mean(raw, reference.size, reference.unit);
    let departs: Vec<bool> = departures.iter().map(|&departure| departure > LIKELY).collect();
    for (departure, is_relit) in departures.iter_mut().zip(relit(&colors, &departs, reference)) {
        if is_relit {
            *departure = 0.0;
        }
    }
    departures
}

/// Returns the number of pixels of a share of a picture, at least one.
fn share(size: UVec2, share: f32) -> usize {
    ((size.as_vec2().element_product() * share) as usize).max(1)
}

#[cfg(test)]
mod tests {
    use super::super::plate::plate;
    use super::*;
    use image::Rgb;

    /// Returns noise of -2 to 2.
    fn noise(x: u32, y: u32, frame: u32, channel: u32) -> f32 {
        let mixed = (x + 160 * y + 16_000 * frame + 400_000 * channel + 1).wrapping_mul(0x9E37_79B1);
        ((mixed ^ (mixed >> 15)).wrapping_mul(0x85EB_CA6B) >> 13) as f32 % 5.0 - 2.0
    }

    /// Returns a picture of a red square, its shadow and a lit wall, in a light that flickers.
    fn scene(frame: u32) -> RgbImage {
        let light = 1.0 + 0.03 * (frame % 4) as f32;
        RgbImage::from_fn(128, 80, |x, y| {
            let shade = if is_inside(frame, x, y, 40) { 0.7 } else { 1.0 };
            let wall = [90.0 + 0.4 * x as f32, 110.0 + 0.3 * y as f32, 80.0 + 10.0 * (x / 16 % 2) as f32];
            let color = if is_inside(frame, x, y, 20) { [200.0, 50.0, 40.0] } else { wall.map(|value| value * shade) };
            let channel = |channel: usize| color[channel] * light + noise(x, y, frame, channel as u32);
            Rgb([0, 1, 2].map(|at| channel(at).round().clamp(0.0, 255.0) as u8))
        })
    }

    /// Returns whether a pixel is in the square of a frame whose upper border is given.
    fn is_inside(frame: u32, x: u32, y: u32, top: u32) -> bool {
        (4 + 5 * frame..18 + 5 * frame).contains(&x) && (top..top + 14).contains(&y)
    }

    #[test]
    fn a_mask_has_what_moves_and_not_its_shadow() {
        let pictures: Vec<_> = (0..20).map(scene).collect();
        for (frame, mask) in (0..).zip(&masks(&pictures, &plate(&pictures, &[]), 1e-4)) {
            let (mut both, mut either) = (0, 0);
            for (x, y, value) in mask.enumerate_pixels() {
                let [own, true_one] = [value.0[0] >= 128, is_inside(frame, x, y, 20)];
                both += usize::from(own && true_one);
                either += usize::from(own || true_one);
                assert!(y < 38 || value.0[0] == 0, "at {x}, {y} of frame {frame} the shadow has {}", value.0[0]);
            }
            assert!(both * 10 > either * 8, "of {either} pixels {both} are right in frame {frame}");
            assert_eq!(mask.get_pixel(11 + 5 * frame, 27).0, [255], "inside of the square of frame {frame}");
        }
    }

    #[test]
    fn parts_below_the_smallest_share_are_left_out() {
        let picture = |frame: u32| {
            let is_there = |x: u32, y: u32| (10 * frame..10 * frame + 6).contains(&x) && (40..46).contains(&y);
            let color = |x, y| if is_there(x, y) { 250 } else { 100 };
            RgbImage::from_fn(128, 96, |x, y| Rgb([color(x, y); 3]))
        };
        let pictures: Vec<_> = (0..10).map(picture).collect();
        let plate = plate(&pictures, &[]);
        let inside =
            |smallest: f32| masks(&pictures, &plate, smallest)[5].pixels().filter(|value| value.0[0] >= 128).count();
        let (kept, dropped) = (inside(1e-4), inside(0.02));
        assert!((20..120).contains(&kept) && dropped == 0, "a square of 36 pixels of 12,288: {kept}, {dropped}");
    }

    #[test]
    fn an_unknown_background_is_in_all_masks_but_not_surely() {
        let picture = |frame: u32| {
            RgbImage::from_fn(64, 64, |x, _| if x < 24 { Rgb([10 + 25 * frame as u8; 3]) } else { Rgb([150; 3]) })
        };
        let pictures: Vec<_> = (0..8).map(picture).collect();
        let plate = plate(&pictures, &[]);
        let found = masks(&pictures, &plate, 1e-4);
        assert!(found.iter().all(|mask| mask.get_pixel(10, 30).0[0] >= 128), "nothing tells what is behind");
        assert!(found.iter().any(|mask| mask.get_pixel(10, 30).0[0] <= UNKNOWN), "nor what is not");
        assert!(found.iter().all(|mask| mask.get_pixel(40, 30).0 == [0]), "the rest stands still");
        let other = masks(&[RgbImage::new(3, 2)], &plate, 1e-4);
        assert!(other[0].pixels().all(|value| value.0 == [UNKNOWN]), "a picture of another size");
    }
}
