//! The views and images of each step.
//!
//! In: the images of a run at their present size, its schedule. Out: the [`Sample`]s of a step. As many images as have
//! room stay on the GPU; the others are uploaded when they are needed.

use crate::offline::train::error::TrainError;
use crate::offline::train::gpu::{GpuImage, Sample};
use crate::offline::train::images::TrainingImages;
use crate::offline::train::images::prefetch::Prefetch;
use crate::offline::train::schedule::{Behind, Schedule};
use crate::offline::train::settings::FineTuneSettings;
use crate::offline::train::trainer::Trainer;
use crate::view::Background;

/// Most bytes of images that stay on the GPU.
const RESIDENT_BYTES: u64 = 512 << 20;

/// The batches of a run, while its images have one size: every call gets the images that it was made of.
pub(super) struct Batches {
    schedule: Schedule,
    /// The images on the GPU.
    resident: Vec<Option<GpuImage>>,
    prefetch: Prefetch,
    /// What is behind the scene, unless that is random.
    background: Background,
    is_random: bool,
}

/// The views of a step, with their images that do not stay on the GPU.
pub(super) struct Batch {
    index: usize,
    views: Vec<(usize, Option<GpuImage>)>,
}

impl Batches {
    /// Uploads the images that are in memory, as many as have room.
    pub(super) fn new(
        trainer: &Trainer<'_>,
        images: &TrainingImages,
        settings: &FineTuneSettings,
        background: Background,
    ) -> Result<Self, TrainError> {
        let schedule = Schedule { seed: settings.seed, views: images.len(), batch: settings.batch };
        let is_random = settings.behind == Behind::Random && background != Background::Environment && images.has_gaps();
        let mut bytes = 0;
        let mut resident = Vec::with_capacity(images.len());
        for (index, shot) in images.shots.iter().enumerate() {
            let is_there = shot.image.is_some();
            bytes += if is_there { 4 * shot.view.size.as_u64vec2().element_product() } else { 0 };
            let fits = is_there && bytes <= RESIDENT_BYTES;
            let image = fits.then(|| images.image(index)).transpose()?;
            resident.push(image.map(|image| trainer.upload(&image)).transpose()?);
        }
        Ok(Self { schedule, resident, prefetch: Prefetch::new(images), background, is_random })
    }

    /// Returns the batch of a step, from 0. Uploads its images that do not stay on the GPU, and begins to read those of
    /// the following steps.
    pub(super) fn of_step(
        &mut self,
        trainer: &Trainer<'_>,
        images: &TrainingImages,
        index: usize,
    ) -> Result<Batch, TrainError> {
        let indices = self.schedule.batch(index);
        self.prefetch.follow(images, &self.schedule, index);
        let mut views = Vec::with_capacity(indices.len());
        for view in indices {
            let uploaded = match (&self.resident[view], &images.shots[view].image) {
                (Some(_), _) => None,
                (None, Some(_)) => Some(trainer.upload(&*images.image(view)?)?),
                (None, None) => Some(trainer.upload(&*self.prefetch.take(images, index, view)?)?),
            };
            views.push((view, uploaded));
        }
        Ok(Batch { index, views })
    }

    /// Returns the views of a batch with their images and backgrounds.
    pub(super) fn samples<'s>(&'s self, images: &'s TrainingImages, batch: &'s Batch) -> Vec<Sample<'s>> {
        let sample = |(place, (view, uploaded)): (usize, &'s (usize, Option<GpuImage>))| {
            // One of both is there.
            let image = uploaded.as_ref().or(self.resident[*view].as_ref())?;
            let background = match self.is_random {
                true => Background::Color(self.schedule.background(batch.index, place)),
                false => self.background,
            };
            Some(Sample { view: &images.shots[*view].view, image, background, number: *view as u32 })
        };
        batch.views.iter().enumerate().filter_map(sample).collect()
    }
}
