//! The check that the images of a dataset show a capture.
//!
//! In: a scene as it was read, before Gaussians are removed, and its training views. Out: an error if pictures of the
//! scene are no closer to their own images than to the images of other views, or no closer than empty pictures.

use super::MeasureError;
use super::evaluation::color_behind;
use super::metrics::SquaredError;
use crate::offline::dataset::TrainingView;
use crate::offline::dataset::selection::even_subset;
use crate::offline::engine::Purpose;
use crate::offline::engine::memory::Pictures;
use crate::offline::engine::{Draw, Engine, drawing_on_gpu};
use crate::renderer::Headless;
use crate::scene::RuntimeScene;
use crate::view::{Background, Picture};
use glam::Vec3;

/// Number of views that are compared.
const VIEWS: usize = 8;
/// PSNR in dB from which pictures may be as close to the images of other views as to their own: these images are nearly
/// the same.
const CLOSE: f64 = 20.0;
/// The least difference in PSNR, dB, between pictures that are closer to an image and pictures that are not.
const CLOSER: f64 = 0.1;

/// The PSNR, in dB, of some views against their images.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Match {
    /// Of each picture against the image of its own view.
    own: f64,
    /// Of each picture against the images of the other views of its size.
    others: f64,
    /// Of an empty picture against each image.
    empty: f64,
}

impl Match {
    /// Returns whether the images show the capture.
    fn holds(self) -> bool {
        let Self { own, others, empty } = self;
        own >= others + CLOSER || own >= CLOSE && own >= empty + CLOSER
    }
}

/// Checks that the images of the views show a scene. Some views are drawn. Their pictures must be closer to their own
/// images than to the images of other views. If the PSNR of the pictures is at least 20 dB, it is sufficient that they
/// are closer than empty pictures. Views whose image does not exist are left out. There is no error without two views
/// of the same size, because there is nothing to compare with.
///
/// # Errors
/// Images that cannot be read, do not fit the memory or show something else, a failure of the engine.
pub fn require_belonging(
    engine: &mut Engine,
    scene: &RuntimeScene,
    views: &[TrainingView],
    background: Background,
) -> Result<(), MeasureError> {
    let Some(chosen) = Chosen::of(views) else { return Ok(()) };
    Pictures::compared(chosen.0.iter()).require(engine.headless(), Purpose::Dataset)?;
    chosen.require(&mut *engine.drawing(scene, background)?, scene, background)
}

/// Checks as [`require_belonging`], with a renderer.
///
/// # Errors
/// As [`require_belonging`].
pub fn require_belonging_on_gpu(
    headless: &mut Headless,
    scene: &RuntimeScene,
    views: &[TrainingView],
    background: Background,
) -> Result<(), MeasureError> {
    let Some(chosen) = Chosen::of(views) else { return Ok(()) };
    Pictures::compared(chosen.0.iter()).require(Some(headless), Purpose::Dataset)?;
    chosen.require(&mut drawing_on_gpu(headless, scene, background)?, scene, background)
}

/// The views that are drawn, at least two.
struct Chosen(Vec<TrainingView>);

impl Chosen {
    /// Chooses views whose image exists; `None` if fewer than two have one.
    fn of(views: &[TrainingView]) -> Option<Self> {
        let with_image: Vec<TrainingView> = views.iter().filter(|view| view.image.is_file()).cloned().collect();
        let chosen = even_subset(&with_image, VIEWS).into_iter().map(|index| with_image[index].clone()).collect();
        (with_image.len() > 1).then_some(Self(chosen))
    }

    fn require(
        &self,
        drawing: &mut dyn Draw,
        scene: &RuntimeScene,
        background: Background,
    ) -> Result<(), MeasureError> {
        let Some(found) = self.measure(drawing, scene, background)?.filter(|found| !found.holds()) else {
            return Ok(());
        };
        let Match { own, others, empty } = found;
        Err(MeasureError::NotShown { image: self.0[0].image.clone(), own, others, empty })
    }

    /// Draws the views and compares the pictures with the images; `None` if no two views have the same size.
    fn measure(
        &self,
        drawing: &mut dyn Draw,
        scene: &RuntimeScene,
        background: Background,
    ) -> Result<Option<Match>, MeasureError> {
        let color = Vec3::from(color_behind(background, &scene.trained_with));
        let load = |view: &TrainingView| view.load_covered().map(|image| image.over(color));
        let images = self.0.iter().map(load).collect::<Result<Vec<_>, _>>()?;
        let [mut own, mut others, mut empty] = [SquaredError::default(); 3];
        let mut compared = false;
        for (index, view) in self.0.iter().enumerate() {
            let picture = drawing.draw(&view.camera.view(view.time, scene.trained_with.optics()))?.clamped();
            own.add(&images[index], &picture)?;
            empty.add(&images[index], &Picture { size: picture.size, pixels: vec![color; picture.pixels.len()] })?;
            for (other, image) in images.iter().enumerate() {
                if other != index && image.size == picture.size {
                    others.add(image, &picture)?;
                    compared = true;
                }
            }
        }
        Ok(compared.then(|| Match { own: own.psnr(), others: others.psnr(), empty: empty.psnr() }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn holds(own: f64, others: f64, empty: f64) -> bool {
        Match { own, others, empty }.holds()
    }

    #[test]
    fn pictures_must_be_closer_to_their_own_images_than_to_others_or_empty_pictures() {
        assert!(holds(15.0, 10.0, 18.0), "pictures closer to their own images than to others belong to these");
        assert!(!holds(15.0, 15.0, 5.0), "pictures below 20 dB must be closer to their own images");
        assert!(holds(30.0, 30.0, 12.0), "equal images of all views are accepted from 20 dB");
        assert!(!holds(30.0, 30.0, 200.0), "faint pictures are not those of black images");
        assert!(!holds(200.0, 200.0, 200.0), "empty pictures do not show the capture");
        assert!(!holds(f64::NAN, 10.0, 10.0), "NaN is not close");
    }
}
