//! The exposures before the first step of fine-tuning.
//!
//! In: a scene, the images of several cameras. Out: for each camera the exposure that fits drawn views of the scene to
//! their images. A scene that was trained with exposures has the mean exposure of its cameras; from exposures that
//! change nothing, the first steps would put the differences between the cameras into the colors of the scene.

use super::evaluation::{behind, color_behind};
use crate::offline::train::error::TrainError;
use crate::offline::train::images::TrainingImages;
use crate::offline::train::reference::exposure::{Exposure, Fit, center};
use crate::offline::train::trainer::Trainer;
use crate::view::Background;

/// Most views of each camera that are drawn.
const VIEWS: usize = 4;

/// Returns the exposures of all cameras, with the mean that changes nothing.
pub(super) fn first_exposures(
    trainer: &mut Trainer<'_>,
    images: &TrainingImages,
    background: Background,
) -> Result<Vec<Exposure>, TrainError> {
    let cameras = images.cameras();
    let count = cameras.iter().max().map_or(0, |last| *last as usize + 1);
    let mut views = vec![Vec::new(); count];
    for (index, &camera) in cameras.iter().enumerate() {
        views[camera as usize].push(index);
    }
    let mut exposures = Vec::with_capacity(count);
    for own in views {
        let mut fit = Fit::default();
        for &index in own.iter().step_by(own.len().div_ceil(VIEWS).max(1)) {
            let frame = trainer.draw(&images.shots[index].view, background)?;
            let image = images.image(index)?.over(behind(background));
            fit.add(&frame, &image, color_behind(background));
        }
        exposures.push(fit.exposure());
    }
    center(&mut exposures);
    Ok(exposures)
}
