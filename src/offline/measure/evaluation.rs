//! Evaluating a scene on the views of a dataset.
//!
//! In: a scene, views with their images, an [`Engine`]. Out: an [`Evaluation`] over one background; each picture is
//! passed to the caller; and the same metrics over a contrasting background ([`contrast`]). As in the original,
//! pictures are clamped and not rounded.

use super::MeasureError;
use super::memory::compared_at_once;
use super::metrics::{Contrast, Evaluation, ImageMetrics, MeanMetrics, MetricSet, ViewMetrics};
use crate::offline::dataset::TrainingView;
use crate::offline::engine::Engine;
use crate::offline::work::{Progress, proceed};
use crate::scene::{RuntimeScene, TrainedWith};
use crate::view::{Background, Picture};
use glam::Vec3;
use rayon::prelude::*;

/// Weights of red, green and blue in the luminance of a background, sRGB-encoded (Rec. 709).
const LUMINANCE: [f32; 3] = [0.2126, 0.7152, 0.0722];

/// Draws every view of a scene, with the field of view of training, and compares the picture with the image of the
/// view. Transparent images are composited over the color of `background`; over black if it is [`Background::None`], and
/// over the color of training in front of an environment map. Calls `each` with the metrics of each view, its image and
/// its picture (not clamped), in the order of the views. Images are read and compared on all threads. Begins the task
/// "comparing".
///
/// # Errors
/// Images that are missing or cannot be read, no views, a failure of the engine, and errors of `each`.
pub fn evaluate_scene(
    engine: &mut Engine,
    scene: &RuntimeScene,
    views: &[TrainingView],
    background: Background,
    metrics: MetricSet,
    progress: &mut dyn Progress,
    mut each: impl FnMut(&ViewMetrics, &Picture, &Picture) -> Result<(), MeasureError>,
) -> Result<Evaluation, MeasureError> {
    let (behind, optics) = (color_behind(background, &scene.trained_with), scene.trained_with.optics());
    let mut drawing = engine.drawing(scene, background)?;
    let (mut all, mut has_gaps) = (Vec::with_capacity(views.len()), false);
    progress.begin("comparing", views.len());
    for some in views.chunks(compared_at_once(views, metrics)) {
        let images: Vec<_> = some.par_iter().map(TrainingView::load_covered).collect();
        let mut pairs = Vec::with_capacity(some.len());
        for (view, image) in some.iter().zip(images) {
            let image = image?;
            has_gaps |= image.has_gaps;
            let picture = drawing.draw(&view.camera.view(view.time, optics))?;
            pairs.push((image.over(Vec3::from(behind)), picture));
        }
        let compare = |(image, picture): &(Picture, Picture)| ImageMetrics::of(image, &picture.clamped(), metrics);
        let compared: Vec<_> = pairs.par_iter().map(compare).collect();
        for ((view, (image, picture)), metrics) in some.iter().zip(&pairs).zip(compared) {
            let measured = ViewMetrics { name: view.name.clone(), time: view.time, metrics: metrics? };
            proceed(progress)?;
            progress.advance();
            each(&measured, image, picture)?;
            all.push(measured);
        }
    }
    progress.finish();
    let metrics: Vec<ImageMetrics> = all.iter().map(|view| view.metrics).collect();
    let mean = MeanMetrics::of(&metrics).ok_or(MeasureError::NoViews)?;
    Ok(Evaluation { background: behind, has_gaps, views: all, mean, contrast: None })
}

/// Returns the color behind pixels that an image does not cover, RGB, 0 to 1: that of `background`, black without one,
/// that of training behind an environment map.
pub(super) fn color_behind(background: Background, trained_with: &TrainedWith) -> [f32; 3] {
    match background {
        Background::Color(color) => color,
        Background::None => [0.0; 3],
        Background::Environment => trained_with.background,
    }
}

/// Evaluates the scene over the color that contrasts with `background`: fog that is invisible over a black background
/// is visible over a white one. Pass the views and the background of `evaluation`. Returns `None` if no background is
/// visible: the images have no gaps, or the background is an environment map. Begins the task "comparing" otherwise.
///
/// # Errors
/// The errors of [`evaluate_scene`].
pub fn contrast(
    engine: &mut Engine,
    scene: &RuntimeScene,
    views: &[TrainingView],
    background: Background,
    evaluation: &Evaluation,
    progress: &mut dyn Progress,
) -> Result<Option<Contrast>, MeasureError> {
    if !evaluation.has_gaps {
        return Ok(None);
    }
    let over = evaluate_over_contrast(engine, scene, views, background, progress)?;
    Ok(over.map(|Evaluation { background, mean, .. }| Contrast { background, mean }))
}

/// Evaluates the scene over the color that contrasts with `background`; `None` if that is an environment map. Begins
/// the task "comparing".
///
/// # Errors
/// The errors of [`evaluate_scene`].
pub(crate) fn evaluate_over_contrast(
    engine: &mut Engine,
    scene: &RuntimeScene,
    views: &[TrainingView],
    background: Background,
    progress: &mut dyn Progress,
) -> Result<Option<Evaluation>, MeasureError> {
    let Background::Color(color) = background else { return Ok(None) };
    let background = Background::Color(contrasting(color));
    evaluate_scene(engine, scene, views, background, MetricSet::PSNR, progress, |_, _, _| Ok(())).map(Some)
}

/// Returns white for a color whose luminance is below 0.5, else black.
fn contrasting(color: [f32; 3]) -> [f32; 3] {
    let luminance: f32 = color.iter().zip(LUMINANCE).map(|(value, weight)| value * weight).sum();
    [if luminance < 0.5 { 1.0 } else { 0.0 }; 3]
}

/// Returns the name of a background color: `black`, `white`, or its three values.
pub(crate) fn color_name([red, green, blue]: [f32; 3]) -> String {
    match [red, green, blue] {
        [0.0, 0.0, 0.0] => "black".to_owned(),
        [1.0, 1.0, 1.0] => "white".to_owned(),
        _ => format!("{red},{green},{blue}"),
    }
}

/// Returns why an evaluation has no contrasting background.
pub(crate) fn without_contrast(evaluation: &Evaluation) -> &'static str {
    match evaluation.has_gaps {
        true => "PSNR is over the environment map of the scene, which covers the background",
        false => "the images have no gaps: no background is visible behind them",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dark_colors_contrast_with_white_and_bright_ones_with_black() {
        for (color, expected) in [
            ([0.0; 3], [1.0; 3]),
            ([0.49; 3], [1.0; 3]),
            ([1.0, 0.0, 1.0], [1.0; 3]),
            ([0.0, 1.0, 0.0], [0.0; 3]),
            ([1.0; 3], [0.0; 3]),
        ] {
            assert_eq!(contrasting(color), expected, "the contrast of {color:?}");
        }
    }

    #[test]
    fn colors_are_named() {
        let names = [[0.0; 3], [1.0; 3], [0.2, 0.5, 1.0]].map(color_name);
        assert_eq!(names, ["black", "white", "0.2,0.5,1"], "black and white by name, other colors by value");
    }
}
