//! What the checks of footage look at.
//!
//! In: a take with its pictures, masks of what moves. Out: [`Evidence`]: the cameras with the moments of their frames,
//! small pictures of moments that are spread evenly, how sharp each camera is at full size, and pictures that cannot be
//! read. The caller adds how well the cameras are synchronized, and what a short training has reached.

use super::plane::Plane;
use super::sharpness::Sharpness;
use crate::offline::dataset::mask::INSIDE;
use crate::offline::dataset::{DatasetError, TrainingView};
use crate::offline::footage::take::{Filmed, Frame, Take, reduced};
use crate::offline::footage::working::WorkingPictures;
use crate::offline::work::{Interrupted, Progress, proceed};
use crate::view::Camera;
use glam::UVec2;
use image::imageops::{FilterType, resize};
use image::{GrayImage, RgbImage};
use rayon::prelude::*;
use std::collections::HashSet;

/// Longer side of the small pictures, pixels.
pub(crate) const LONGEST: u32 = 320;
/// Small pictures of all cameras, and the least and most of a camera.
const PICTURES: usize = 400;
const FEWEST: usize = 8;
const MOST: usize = 32;
/// Longest side of the pictures whose sharpness is measured, pixels.
const FULL: u32 = 2048;

/// What the checks look at.
#[derive(Debug)]
pub(crate) struct Evidence {
    pub(super) cameras: Vec<Seen>,
    /// Number of moments of the take.
    pub(super) moments: usize,
    /// How well the cameras are synchronized, if it has been measured.
    pub synchrony: Option<Synchrony>,
    /// What a short training has reached, if there was one.
    pub rehearsal: Option<Rehearsal>,
}

/// A camera.
#[derive(Debug)]
pub(super) struct Seen {
    pub name: String,
    /// The camera at the size of its small pictures.
    pub camera: Camera,
    /// The moments of all of its frames, ascending.
    pub moments: Vec<usize>,
    /// Small pictures, ascending in time.
    pub samples: Vec<Sample>,
    /// Of a picture at full size, if one shows something.
    pub sharpness: Option<Sharpness>,
    /// Number of pictures that cannot be read, and why the first cannot.
    pub unreadable: Option<(usize, String)>,
}

/// A small picture.
#[derive(Debug)]
pub(super) struct Sample {
    pub moment: usize,
    pub color: RgbImage,
    pub gray: Plane,
    /// The mask of what moves, of the same size.
    pub mask: Option<GrayImage>,
    /// Whether it shows nothing.
    pub blank: bool,
}

/// How well the cameras are synchronized.
#[derive(Debug, Clone)]
pub(crate) struct Synchrony {
    /// Seconds from one frame to the next.
    pub frame: f32,
    pub cameras: Vec<CameraSync>,
}

/// How well a camera is synchronized with the others.
#[derive(Debug, Clone, Copy)]
pub(crate) struct CameraSync {
    /// The index of the camera in the take.
    pub camera: usize,
    /// Seconds by which its times are late, as the motion in its pictures says; `None` if that is not sure.
    pub offset: Option<f32>,
    /// Seconds by which its sound disagrees with that of the others after they are aligned; `None` without sound.
    pub residual: Option<f32>,
}

/// What a short training has reached.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Rehearsal {
    /// Mean PSNR of the views held out, dB.
    pub db: f32,
    /// Number of views held out.
    pub views: usize,
}

impl Evidence {
    /// Reads small pictures of a take. `masks` returns what moves in the picture of a camera at a moment (255; 0 for
    /// what stands), of any size; `None` if it is not known. Begins and finishes a task of its own.
    ///
    /// # Errors
    /// [`Interrupted`]. Pictures that cannot be read are evidence.
    pub(crate) fn of(
        (take, pictures): (&Take, &WorkingPictures),
        masks: impl Fn(usize, usize) -> Option<GrayImage> + Sync,
        progress: &mut dyn Progress,
    ) -> Result<Self, Interrupted> {
        let wanted = (PICTURES / take.cameras.len().max(1)).clamp(FEWEST, MOST);
        let chosen: HashSet<usize> = spread(take.moments.len(), wanted).into_iter().collect();
        progress.begin("looking at the footage", take.cameras.len());
        let mut cameras = Vec::with_capacity(take.cameras.len());
        for (index, filmed) in take.cameras.iter().enumerate() {
            proceed(progress)?;
            cameras.push(Seen::of((filmed, pictures), &chosen, |moment| masks(index, moment)));
            progress.advance();
        }
        progress.finish();
        Ok(Self { cameras, moments: take.moments.len(), synchrony: None, rehearsal: None })
    }

    /// Returns the names of all cameras.
    pub(super) fn names(&self) -> Vec<&str> {
        self.cameras.iter().map(|seen| seen.name.as_str()).collect()
    }
}

impl Seen {
    /// Reads the pictures of these moments.
    fn of(
        (filmed, pictures): (&Filmed, &WorkingPictures),
        chosen: &HashSet<usize>,
        masks: impl Fn(usize) -> Option<GrayImage> + Sync,
    ) -> Self {
        let frames: Vec<&Frame> = filmed.frames.iter().filter(|frame| chosen.contains(&frame.moment)).collect();
        let read: Vec<Result<Sample, DatasetError>> =
            frames.into_par_iter().map(|frame| Sample::of(frame, masks(frame.moment), pictures)).collect();
        let (mut samples, mut failures, mut first) = (Vec::new(), 0, None);
        for result in read {
            match result {
                Ok(sample) => samples.push(sample),
                Err(error) => {
                    failures += 1;
                    first = first.or_else(|| Some(error.to_string()));
                }
            }
        }
        let shown: Vec<usize> = samples.iter().filter(|sample| !sample.blank).map(|sample| sample.moment).collect();
        let middle = shown.get(shown.len() / 2);
        let middle = middle.and_then(|moment| filmed.frames.iter().find(|frame| frame.moment == *moment));
        let sharpness = middle.and_then(|frame| {
            let picture = loaded(frame, full(&frame.view), pictures).ok()?;
            Some(Sharpness::of(&Plane::luminance(&picture), masks(frame.moment).as_ref()))
        });
        Self {
            name: filmed.name.clone(),
            camera: reduced(&filmed.camera, LONGEST),
            moments: filmed.frames.iter().map(|frame| frame.moment).collect(),
            samples,
            sharpness,
            unreadable: first.map(|reason| (failures, reason)),
        }
    }

    /// Returns the small pictures that show something.
    pub(super) fn shown(&self) -> impl Iterator<Item = &Sample> {
        self.samples.iter().filter(|sample| !sample.blank)
    }
}

impl Sample {
    /// Reads the small picture of a frame.
    fn of(frame: &Frame, mask: Option<GrayImage>, pictures: &WorkingPictures) -> Result<Self, DatasetError> {
        let color = loaded(frame, reduced(&frame.view.camera, LONGEST), pictures)?;
        Ok(Self::new(frame.moment, color, mask))
    }

    /// A small picture, with a mask of any size.
    pub(super) fn new(moment: usize, color: RgbImage, mask: Option<GrayImage>) -> Self {
        let gray = Plane::luminance(&color);
        let mask = mask.filter(|mask| mask.width() > 0 && mask.height() > 0);
        let mask = mask.map(|mask| resize(&mask, color.width(), color.height(), FilterType::Nearest));
        let blank = gray.is_blank();
        Self { moment, color, gray, mask, blank }
    }

    /// Returns whether a pixel stands still, as far as a mask says.
    pub(super) fn stands(&self, x: u32, y: u32) -> bool {
        self.mask.as_ref().is_none_or(|mask| mask.get_pixel(x, y).0[0] < INSIDE)
    }
}

/// Returns the picture of a frame at the size of a camera, whole: not multiplied by the mask of the view.
fn loaded(frame: &Frame, camera: Camera, pictures: &WorkingPictures) -> Result<RgbImage, DatasetError> {
    pictures.picture(&TrainingView { camera, mask: None, ..frame.view.clone() })
}

/// Returns the camera of a view at the size of its original picture, but not larger than 2048 pixels. Only the size is
/// to be used.
fn full(view: &TrainingView) -> Camera {
    let (size, original) = (view.camera.size.as_vec2(), view.original.max_element().min(FULL) as f32);
    let scale = original / size.max_element().max(1.0);
    Camera { size: (size * scale).round().as_uvec2().max(UVec2::ONE), ..view.camera }
}

/// Returns at most `wanted` of so many indices, ascending, evenly spread, with the first and the last.
pub(super) fn spread(count: usize, wanted: usize) -> Vec<usize> {
    if count <= wanted {
        return (0..count).collect();
    }
    (0..wanted).map(|index| index * (count - 1) / (wanted - 1).max(1)).collect()
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use glam::Vec3;
    use image::{Luma, Rgb};

    /// Returns a camera on a ring around the origin, which has seen `pictures` at the moments 0, 1, 2, ….
    pub(crate) fn seen(index: usize, count: usize, pictures: Vec<RgbImage>) -> Seen {
        let angle = index as f32 / count as f32 * std::f32::consts::TAU;
        let size = pictures.first().map_or(UVec2::new(160, 120), |picture| UVec2::from(picture.dimensions()));
        let eye = Vec3::new(4.0 * angle.cos(), 4.0 * angle.sin(), 1.5);
        let samples = pictures.into_iter().enumerate().map(|(moment, picture)| Sample::new(moment, picture, None));
        let samples: Vec<Sample> = samples.collect();
        Seen {
            name: format!("cam{index}"),
            camera: Camera::look_at(eye, Vec3::ZERO, Vec3::Z, 0.7, size),
            moments: (0..samples.len()).collect(),
            samples,
            sharpness: None,
            unreadable: None,
        }
    }

    /// Returns a picture of random blocks, scaled around its middle, shifted to the right (pixels), and brighter.
    pub(crate) fn textured(scale: f32, shift: f32, gain: f32) -> RgbImage {
        let value = |x: f32, y: f32| {
            let (column, row) = ((x / 9.0).floor() as u32, (y / 9.0).floor() as u32);
            let cell = column.wrapping_mul(73_856_093) ^ row.wrapping_mul(19_349_663);
            (cell.wrapping_mul(0x9E37_79B1) >> 24) as f32 * 0.7 + 20.0
        };
        RgbImage::from_fn(160, 120, |x, y| {
            // The mean of four places within the pixel.
            let places = [[0.25, 0.25], [0.75, 0.25], [0.25, 0.75], [0.75, 0.75]];
            let at = |[dx, dy]: [f32; 2]| {
                let (x, y) = (x as f32 + dx - 80.0 - shift, y as f32 + dy - 60.0);
                value(x / scale + 500.0, y / scale + 500.0) / 4.0
            };
            Rgb([(places.map(at).iter().sum::<f32>() * gain).min(255.0) as u8; 3])
        })
    }

    /// Returns the evidence of these cameras alone.
    pub(crate) fn evidence(cameras: Vec<Seen>) -> Evidence {
        let moments = cameras.iter().flat_map(|seen| &seen.moments).max().map_or(0, |last| last + 1);
        Evidence { cameras, moments, synchrony: None, rehearsal: None }
    }

    #[test]
    fn moments_are_spread_from_the_first_to_the_last() {
        assert_eq!(spread(100, 4), [0, 33, 66, 99], "four of a hundred");
        assert_eq!(spread(3, 8), [0, 1, 2], "all of three");
    }

    #[test]
    fn a_mask_gets_the_size_of_its_picture() {
        let mask = GrayImage::from_fn(2, 1, |x, _| Luma([x as u8 * 255]));
        let sample = Sample::new(0, textured(1.0, 0.0, 1.0), Some(mask));
        assert!(sample.stands(10, 60) && !sample.stands(150, 60), "the right half moves");
        assert!(!sample.blank, "it shows blocks");
    }
}
