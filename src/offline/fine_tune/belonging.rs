//! Whether images belong to a capture.
//!
//! In: a scene, views and images. Out: an error if the scene explains its images no better than those of other views.

use super::Trainer;
use super::run::squared_error;
use super::targets::Shot;
use crate::offline::OfflineError;
use crate::offline::dataset::TrainingView;
use crate::offline::metrics::SquaredError;
use crate::view::Background;

/// Views that are looked at.
const VIEWS: usize = 8;
/// A scene this close to its images, dB, belongs to them in any case.
const CLOSE: f64 = 20.0;
/// How much closer it must be to its own images than to others, dB.
const CLOSER: f64 = 0.1;

/// Checks that the pictures of some views are closer to their own images than to those of other views. `files` are the views of the
/// shots.
pub(super) fn check(
    trainer: &mut Trainer<'_>,
    shots: &[Shot],
    background: Background,
    files: &[TrainingView],
) -> Result<(), OfflineError> {
    let count = VIEWS.min(shots.len());
    let chosen: Vec<usize> = (0..count).map(|k| k * shots.len() / count.max(1)).collect();
    let (mut own, mut other, mut others) = (SquaredError::default(), SquaredError::default(), 0);
    for &index in &chosen {
        own.merge(&squared_error(trainer, &shots[index].view, &shots[index].image, background)?);
        for &another in chosen.iter().filter(|&&another| another != index) {
            if shots[another].image.size == shots[index].image.size {
                other.merge(&squared_error(trainer, &shots[index].view, &shots[another].image, background)?);
                others += 1;
            }
        }
    }
    let (own, other) = (own.psnr(), other.psnr());
    match files.first() {
        Some(view) if others > 0 && own < CLOSE && own < other + CLOSER => Err(OfflineError::at(
            &view.image,
            format!(
                "and the other images do not show this capture: its pictures are {own:.1} dB from their own images and {other:.1} dB \
                 from those of other views; is --data the folder that it was trained on?"
            ),
        )),
        _ => Ok(()),
    }
}
