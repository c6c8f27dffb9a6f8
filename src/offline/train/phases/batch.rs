//! The views and images of each step.
//!
//! In: the images of a run, its schedule. Out: the [`Sample`]s of a step. As many images as have room stay on the GPU;
//! the others are uploaded when they are needed.

use crate::offline::train::error::TrainError;
use crate::offline::train::gpu::{GpuImage, Sample};
use crate::offline::train::images::TrainingImages;
use crate::offline::train::images::prefetch::Prefetch;
use crate::offline::train::schedule::{Behind, Schedule};
use crate::offline::train::settings::FineTuneSettings;
use crate::offline::train::trainer::Trainer;
use crate::view::Background;

/// Most bytes of images that stay on the GPU.
const RESIDENT_BYTES: usize = 512 << 20;

/// The batches of a run.
pub(super) struct Batches<'a> {
    images: &'a TrainingImages,
    schedule: Schedule,
    /// The images on the GPU.
    resident: Vec<Option<GpuImage>>,
    prefetch: Prefetch<'a>,
    /// What is behind the scene, unless that is random.
    background: Background,
    is_random: bool,
}

/// The views of a step, with their images that do not stay on the GPU.
pub(super) struct Batch {
    index: usize,
    views: Vec<(usize, Option<GpuImage>)>,
}

impl<'a> Batches<'a> {
    /// Uploads the images that are in memory, as many as have room.
    pub(super) fn new(
        trainer: &Trainer<'_>,
        images: &'a TrainingImages,
        settings: &FineTuneSettings,
        background: Background,
    ) -> Result<Self, TrainError> {
        let schedule = Schedule { seed: settings.seed, views: images.len(), batch: settings.batch };
        let is_random = settings.behind == Behind::Random && background != Background::Environment && images.has_gaps();
        let mut bytes = 0;
        let mut resident = Vec::with_capacity(images.len());
        for shot in &images.shots {
            bytes += shot.image.as_ref().map_or(0, |image| 4 * image.texels.len());
            let fitting = shot.image.as_ref().filter(|_| bytes <= RESIDENT_BYTES);
            resident.push(fitting.map(|image| trainer.upload(image)).transpose()?);
        }
        Ok(Self { images, schedule, resident, prefetch: Prefetch::new(images), background, is_random })
    }

    /// Returns the batch of a step, from 0. Uploads its images that do not stay on the GPU, and begins to read those of
    /// the following steps.
    pub(super) fn of_step(&mut self, trainer: &Trainer<'_>, index: usize) -> Result<Batch, TrainError> {
        let indices = self.schedule.batch(index);
        self.prefetch.follow(&self.schedule, index);
        let mut views = Vec::with_capacity(indices.len());
        for view in indices {
            let uploaded = match (&self.resident[view], &self.images.shots[view].image) {
                (Some(_), _) => None,
                (None, Some(image)) => Some(trainer.upload(image)?),
                (None, None) => Some(trainer.upload(&self.prefetch.take(index, view)?)?),
            };
            views.push((view, uploaded));
        }
        Ok(Batch { index, views })
    }

    /// Returns the views of a batch with their images and backgrounds.
    pub(super) fn samples<'s>(&'s self, batch: &'s Batch) -> Vec<Sample<'s>> {
        let sample = |(place, (view, uploaded)): (usize, &'s (usize, Option<GpuImage>))| {
            // One of both is there.
            let image = uploaded.as_ref().or(self.resident[*view].as_ref())?;
            let background = match self.is_random {
                true => Background::Color(self.schedule.background(batch.index, place)),
                false => self.background,
            };
            Some(Sample { view: &self.images.shots[*view].view, image, background, number: *view as u32 })
        };
        batch.views.iter().enumerate().filter_map(sample).collect()
    }
}
