//! Images that are not in memory, read ahead of the steps that need them.
//!
//! In: training views, the schedule of steps. Out: the images of a step. Threads decode those of the following steps
//! meanwhile.

use super::shot::Shot;
use super::targets::{TrainingImages, ahead};
use crate::offline::dataset::{CoveredImage, DatasetError};
use crate::offline::train::schedule::Schedule;
use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, sync_channel};

/// An image that a thread reads.
#[derive(Debug)]
struct Ahead {
    step: usize,
    index: usize,
    image: Receiver<Result<Arc<CoveredImage>, DatasetError>>,
}

/// The images that are being read, in the order in which they are needed.
#[derive(Debug)]
pub(crate) struct Prefetch {
    /// Whether any image is not in memory.
    reads: bool,
    waiting: VecDeque<Ahead>,
    /// The first step whose images are not being read yet.
    next: usize,
}

impl Prefetch {
    pub(crate) fn new(images: &TrainingImages) -> Self {
        let reads = images.shots.iter().any(|shot| shot.image.is_none());
        Self { reads, waiting: VecDeque::new(), next: 0 }
    }

    /// Begins to read images of a step and of those after it.
    pub(crate) fn follow(&mut self, images: &TrainingImages, schedule: &Schedule, step: usize) {
        if !self.reads {
            return;
        }
        while self.waiting.front().is_some_and(|ahead| ahead.step < step) {
            self.waiting.pop_front();
        }
        if self.waiting.is_empty() {
            self.next = step;
        }
        // Of some steps all images may be in memory.
        let last = step + ahead();
        while self.waiting.len() < ahead() && self.next < last {
            for index in schedule.batch(self.next) {
                if images.shots[index].image.is_none() {
                    let image = begin_to_read(images, index);
                    self.waiting.push_back(Ahead { step: self.next, index, image });
                }
            }
            self.next += 1;
        }
    }

    /// Returns an image of a step that is not in memory.
    ///
    /// # Errors
    /// An image that has become unreadable.
    pub(crate) fn take(
        &mut self,
        images: &TrainingImages,
        step: usize,
        index: usize,
    ) -> Result<Arc<CoveredImage>, DatasetError> {
        let place = self.waiting.iter().position(|ahead| (ahead.step, ahead.index) == (step, index));
        let waiting = place.and_then(|place| self.waiting.remove(place));
        let read = waiting.and_then(|ahead| ahead.image.recv().ok());
        read.unwrap_or_else(|| images.image(index))
    }
}

/// Begins to read an image on another thread.
fn begin_to_read(images: &TrainingImages, index: usize) -> Receiver<Result<Arc<CoveredImage>, DatasetError>> {
    let (sender, receiver) = sync_channel(1);
    let (view, size) = (images.views[index].clone(), images.shots[index].view.size);
    rayon::spawn(move || {
        // The receiver is gone after a jump to another step.
        sender.send(Shot::read(&view, size)).ok();
    });
    receiver
}
