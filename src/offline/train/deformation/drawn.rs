//! The views that a deformation draws, and their files.
//!
//! In: the training views of a dataset, a [`Fit`]. Out: [`Drawn`]: views from the places of other training views at times all over the interval, their
//! images in the folder of intermediate results, and native Gaussians to begin with, which are stored there too. Times at which the deformation does not
//! show the images themselves are left out.

use super::fitting::Fit;
use super::native::Extent;
use crate::gaussian::Harmonics;
use crate::gaussian::harmonics::evaluated;
use crate::offline::dataset::{Correction, TrainingView};
use crate::offline::fine_tune::TrainingImages;
use crate::offline::fine_tune::records::{parameters, records};
use crate::offline::layout::TrainedRecord;
use crate::offline::metrics::SquaredError;
use crate::offline::store::{Key, Store, drawn_name};
use crate::offline::{OfflineError, Progress, proceed, write_beside};
use crate::scene::random::Random;
use crate::scene::{Trained, TrainedWith};
use crate::view::{Background, Frame};
use glam::Vec3;
use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder};
use rayon::prelude::*;
use std::io::Write;
use std::path::Path;

/// Views that are drawn for each training view.
const FOR_EACH: usize = 2;
/// Most pixels of all that are drawn.
const MOST_PIXELS: u64 = 1 << 28;
/// Views that are encoded at once.
const AT_ONCE: usize = 32;
/// Least PSNR in dB, over gray, of the images before and after a time.
const LEAST_PSNR: f64 = 26.0;
/// What images are compared over.
const GRAY: f32 = 0.5;
/// Names of the stored results: the Gaussians to begin with; the numbers of the views that were drawn, which are stored last.
const START: &str = "start";
const STAGE: &str = "drawn";

/// What a deformation leaves for the training of native Gaussians.
#[derive(Debug)]
pub(in crate::offline::train) struct Drawn {
    /// Views to train on beside those of the dataset.
    pub views: Vec<TrainingView>,
    /// Gaussians to begin with.
    pub start: Trained,
}

/// Views that can be drawn.
#[derive(Debug)]
pub(in crate::offline::train) struct Drawing {
    views: Vec<TrainingView>,
}

impl Drawing {
    /// Chooses the views for a dataset with these training views: times evenly over theirs, each seen from the place of any of them. Their images
    /// will be in `folder`.
    pub(in crate::offline::train) fn new(views: &[TrainingView], folder: &Path, seed: u64) -> Self {
        let mut random = Random::new(seed);
        let times = || views.iter().map(|view| view.time);
        let (first, last) = (times().fold(f32::INFINITY, f32::min), times().fold(f32::NEG_INFINITY, f32::max));
        let largest = views.iter().map(|view| view.camera.size.as_u64vec2().element_product()).max().unwrap_or(1);
        let count = (FOR_EACH * views.len()).min(usize::try_from(MOST_PIXELS / largest.max(1)).unwrap_or(usize::MAX));
        let view = |number: usize| {
            let from = &views[random.below(views.len())];
            let name = drawn_name(number);
            TrainingView {
                time: first + (last - first) * (number as f32 + random.unit()) / count as f32,
                camera: from.camera,
                original: from.camera.size,
                image: folder.join(format!("{name}.png")),
                mask: None,
                correction: Correction::default(),
                name,
            }
        };
        Self { views: (0..count).map(view).collect() }
    }

    /// Returns all views, of which some may not be drawn.
    pub(in crate::offline::train) fn views(&self) -> &[TrainingView] {
        &self.views
    }

    /// Returns what an earlier run with the same key has left; `None` if none has finished.
    pub(in crate::offline::train) fn stored(&self, store: &Store, key: Key, extent: Extent) -> Option<Drawn> {
        let numbers: Vec<u32> = bytemuck::pod_collect_to_vec(&store.load(STAGE, key)?);
        let views = numbers.into_iter().map(|number| self.views.get(number as usize).cloned());
        let views: Vec<_> = views.collect::<Option<_>>()?;
        let start = unpacked(&store.load(START, key)?, extent)?;
        views.iter().all(|view| view.image.is_file()).then_some(Drawn { views, start })
    }

    /// Draws the views at the times at which `fit` shows the images, and stores which these are. Begins the task "drawing views".
    ///
    /// # Errors
    /// A lost device, a folder that cannot be written to, [`OfflineError::Interrupted`] if the user has asked to end.
    pub(in crate::offline::train) fn draw(
        &self,
        mut fit: Fit<'_>,
        images: &TrainingImages,
        trained_with: &TrainedWith,
        extent: Extent,
        (store, key): (&Store, Key),
        progress: &mut dyn Progress,
    ) -> Result<Drawn, OfflineError> {
        let start = fit.native(trained_with.time_interval, extent)?;
        let shown = shown(&mut fit, images)?;
        let numbers: Vec<u32> =
            (0..self.views.len() as u32).filter(|&number| is_shown(&shown, self.views[number as usize].time)).collect();
        progress.begin("drawing views", numbers.len());
        for some in numbers.chunks(AT_ONCE) {
            proceed(progress)?;
            let mut frames = Vec::with_capacity(some.len());
            for &number in some {
                let view = &self.views[number as usize];
                frames.push((view, fit.draw(&view.camera.view(view.time, trained_with.raster_fov), Background::None)?));
                progress.advance();
            }
            frames.par_iter().try_for_each(|(view, frame)| write(&view.image, frame))?;
        }
        progress.finish();
        progress.note(&format!("{} of {} views drawn to train on beside the images", numbers.len(), self.views.len()));
        store.store(START, key, &packed(&start))?;
        store.store(STAGE, key, bytemuck::cast_slice(&numbers))?;
        Ok(Drawn { views: numbers.into_iter().map(|number| self.views[number as usize].clone()).collect(), start })
    }
}

/// Returns raw parameters, then colors, as bytes.
fn packed(start: &Trained) -> Vec<u8> {
    let Trained { parameters, harmonics } = start;
    let records = records(parameters);
    [bytemuck::cast_slice(&records), bytemuck::cast_slice::<f32, u8>(&harmonics.values)].concat()
}

/// Returns the Gaussians of these bytes; `None` if they are of other degrees.
fn unpacked(bytes: &[u8], Extent { degree, degree_t, .. }: Extent) -> Option<Trained> {
    let coefficients = evaluated(degree, degree_t);
    let each = size_of::<TrainedRecord>() + coefficients * 3 * size_of::<f32>();
    if !bytes.len().is_multiple_of(each) {
        return None;
    }
    let (records, values) = bytes.split_at_checked(bytes.len() / each * size_of::<TrainedRecord>())?;
    let records: Vec<TrainedRecord> = bytemuck::pod_collect_to_vec(records);
    let values = bytemuck::pod_collect_to_vec(values);
    Some(Trained { parameters: parameters(&records), harmonics: Harmonics { coefficients, degree, degree_t, values } })
}

/// Returns the time of each image, and whether the deformation shows it, in the order of time.
fn shown(fit: &mut Fit<'_>, images: &TrainingImages) -> Result<Vec<(f32, bool)>, OfflineError> {
    let mut shown = Vec::new();
    for (view, image) in images.first() {
        let mut error = SquaredError::default();
        let frame = fit.draw(view, Background::Color([GRAY; 3]))?;
        error.add(&image.over(Vec3::splat(GRAY)), &frame.picture.clamped())?;
        shown.push((view.time, error.psnr() >= LEAST_PSNR));
    }
    shown.sort_by(|(a, _), (b, _)| a.total_cmp(b));
    Ok(shown)
}

/// Returns whether the images before and after a time are shown.
fn is_shown(shown: &[(f32, bool)], time: f32) -> bool {
    let after = shown.partition_point(|(own, _)| *own < time);
    [after.checked_sub(1), Some(after)].into_iter().flatten().filter_map(|at| shown.get(at)).all(|(_, shown)| *shown)
}

/// Writes a frame that was drawn over nothing, with its coverage.
fn write(path: &Path, frame: &Frame) -> Result<(), OfflineError> {
    let texel = |(color, transmittance): (&Vec3, &f32)| {
        let coverage = (1.0 - transmittance).clamp(0.0, 1.0);
        let own = if coverage > 0.0 { *color / coverage } else { Vec3::ZERO };
        let [r, g, b] = own.to_array();
        [r, g, b, coverage].map(|value| (value.clamp(0.0, 1.0) * 255.0).round() as u8)
    };
    let texels: Vec<u8> = frame.picture.pixels.iter().zip(&frame.transmittance).flat_map(texel).collect();
    let size = frame.picture.size;
    let mut bytes = Vec::new();
    PngEncoder::new(&mut bytes)
        .write_image(&texels, size.x, size.y, ExtendedColorType::Rgba8)
        .map_err(|error| OfflineError::at(path, error))?;
    Ok(write_beside(path, |file| file.write_all(&bytes))?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::view::{Camera, Counts, Picture};
    use glam::UVec2;

    #[test]
    fn times_are_even_and_places_are_those_of_the_dataset() {
        let views: Vec<TrainingView> = (0..20u8)
            .map(|index| TrainingView {
                name: format!("{index}"),
                camera: Camera::look_at(
                    Vec3::new(f32::from(index), 9.0, 1.0),
                    Vec3::ZERO,
                    Vec3::Z,
                    0.7,
                    UVec2::splat(8),
                ),
                time: 3.0 + f32::from(index),
                original: UVec2::splat(8),
                image: "none".into(),
                mask: None,
                correction: Correction::default(),
            })
            .collect();
        let drawing = Drawing::new(&views, Path::new("folder"), 1);
        assert_eq!(drawing.views().len(), FOR_EACH * 20, "so many for each");
        for (number, view) in drawing.views().iter().enumerate() {
            let begin = 3.0 + 19.0 * number as f32 / (FOR_EACH * 20) as f32;
            assert!(
                (begin..=begin + 19.0 / (FOR_EACH * 20) as f32).contains(&view.time),
                "{}: {}",
                view.name,
                view.time
            );
            assert!(views.iter().any(|own| own.camera == view.camera), "{}: a camera of the dataset", view.name);
            assert_eq!(view.image, Path::new("folder").join(format!("drawn_{number:04}.png")), "a file of its own");
        }
        let cameras = drawing.views().iter().map(|view| view.camera.world_to_camera.to_cols_array().map(f32::to_bits));
        let cameras: std::collections::HashSet<_> = cameras.collect();
        assert!(cameras.len() > 10, "different cameras: {}", cameras.len());
    }

    #[test]
    fn times_beside_an_image_that_is_not_shown_are_left_out() {
        let shown = [(0.0, true), (0.5, true), (1.0, false), (1.5, true), (2.0, true)];
        let found = [0.0, 0.2, 0.5, 0.6, 1.0, 1.2, 1.6, 2.0].map(|time| is_shown(&shown, time));
        assert_eq!(found, [true, true, true, false, false, false, true, true]);
    }

    #[test]
    fn a_frame_is_written_with_its_coverage() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("drawn_0000.png");
        let frame = Frame {
            picture: Picture { size: UVec2::new(3, 1), pixels: vec![Vec3::ZERO, Vec3::new(0.25, 0.5, 0.0), Vec3::ONE] },
            transmittance: vec![1.0, 0.5, 0.0],
            depth: vec![0.0; 3],
            median_depth: vec![0.0; 3],
            counts: Counts::default(),
        };
        write(&path, &frame).expect("a picture is written");
        let found = image::open(&path).expect("a picture").into_rgba8();
        let texels: Vec<[u8; 4]> = found.pixels().map(|pixel| pixel.0).collect();
        assert_eq!(texels, [[0, 0, 0, 0], [128, 255, 0, 128], [255; 4]]);
    }
}
