//! The check that the images of a dataset show a capture.
//!
//! In: a scene before pruning, its training views. Out: an error if the pictures of the scene are no closer to the images of
//! their own views than to the images of other views.

use super::OfflineError;
use super::dataset::TrainingView;
use super::dataset::selection::even_subset;
use super::engine::Engine;
use super::metrics::SquaredError;
use crate::scene::RuntimeScene;
use crate::view::{Background, Picture};
use glam::Vec3;

/// Number of compared views.
const VIEWS: usize = 8;
/// PSNR against its own images above which a scene passes in any case, dB.
const CLOSE: f64 = 20.0;
/// Least difference of the PSNR against own images and against images of other views, dB.
const CLOSER: f64 = 0.1;

/// Checks that the pictures of some views are closer to their own images than to the images of other views. Views whose
/// image is missing are left out; with fewer than two views of one size the check is impossible, and every dataset passes.
///
/// # Errors
/// Images that cannot be read or that show another scene, a failure of the engine.
pub fn require_belonging(
    engine: &mut Engine,
    scene: &RuntimeScene,
    views: &[TrainingView],
    background: Background,
) -> Result<(), OfflineError> {
    let there: Vec<TrainingView> = views.iter().filter(|view| view.image.is_file()).cloned().collect();
    let chosen: Vec<&TrainingView> = even_subset(&there, VIEWS).into_iter().map(|index| &there[index]).collect();
    let behind = match background {
        Background::Color(color) => Vec3::from(color),
        Background::None | Background::Environment => Vec3::ZERO,
    };
    let truth: Vec<Picture> =
        chosen.iter().map(|view| Ok(view.load_covered()?.over(behind))).collect::<Result<_, OfflineError>>()?;
    let mut drawing = engine.drawing(scene, background)?;
    let (mut own, mut other, mut others) = (SquaredError::default(), SquaredError::default(), 0);
    for (index, view) in chosen.iter().enumerate() {
        let picture = drawing.draw(&view.camera.view(view.time, scene.trained_with.raster_fov))?.clamped();
        own.add(&truth[index], &picture)?;
        for (_, image) in
            truth.iter().enumerate().filter(|(place, image)| *place != index && image.size == picture.size)
        {
            other.add(image, &picture)?;
            others += 1;
        }
    }
    let (own, other) = (own.psnr(), other.psnr());
    match chosen.first() {
        Some(view) if others > 0 && own < CLOSE && own < other + CLOSER => Err(OfflineError::at(
            &view.image,
            format!(
                "and the other images do not show this capture: its pictures have {own:.1} dB against their own images and \
                 {other:.1} dB against those of other views; is --data the folder that it was trained on? \
                 --trust-images skips this check"
            ),
        )),
        _ => Ok(()),
    }
}
