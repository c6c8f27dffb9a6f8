//! The comparison of a package with the scene that it was made from, on the test views.
//!
//! In: the scene before pruning, the bytes of the package, the test views. Out: the metrics of both, over the
//! background of training and over a contrasting one, and a few pictures ([`Compared`]).

use super::BakeError;
use crate::codec::package;
use crate::offline::dataset::Dataset;
use crate::offline::dataset::splits::{Splits, split_name};
use crate::offline::engine::Engine;
use crate::offline::forms::Subject;
use crate::offline::measure::evaluation::color_name;
use crate::offline::measure::{Evaluation, MeasureError, MetricSet, contrast, evaluate_scene};
use crate::offline::report::{Change, Sample};
use crate::offline::work::{FileError, Progress};
use crate::scene::RuntimeScene;
use crate::view::Picture;
use std::io::Cursor;
use std::path::Path;

/// Most views whose pictures the report shows.
const SAMPLES: usize = 3;

/// Difference of the package's PSNR over the two backgrounds above which a bake reports a note, dB.
const LARGE_DIFFERENCE: f64 = 3.0;

/// The test views, drawn of the scene before pruning and of the package.
pub(crate) struct Compared {
    /// Name of the split.
    pub split: &'static str,
    /// Metrics of the scene before pruning and of the package.
    pub evaluation: Change<Evaluation>,
    /// Pictures of some of the views.
    pub samples: Vec<Sample>,
}

/// Draws the test views of the scene and of the package that will be written to `out`. `None`, with a note, if the
/// views or their images are missing.
pub(crate) fn compare_test_views(
    engine: &mut Engine,
    subject: &Subject,
    splits: &Splits,
    out: &Path,
    package: &[u8],
    progress: &mut dyn Progress,
) -> Result<Option<Compared>, BakeError> {
    let after = package::read(Cursor::new(package)).map_err(|error| FileError::at(out, error))?;
    let after = after.into_runtime().map_err(|error| FileError::at(out, error))?;
    let Some(dataset) = test_views(subject, splits, progress) else { return Ok(None) };
    let count = dataset.views.len();
    let samples = SAMPLES.min(count);
    let sampled: Vec<usize> = (0..samples).map(|k| (2 * k + 1) * count / (2 * samples)).collect();
    let mut draw = |scene: &RuntimeScene| -> Result<(Evaluation, Vec<[Picture; 2]>), MeasureError> {
        let (mut index, mut kept) = (0, Vec::new());
        let (background, metrics) = (subject.background, MetricSet::ALL);
        let views = &dataset.views;
        let mut evaluation =
            evaluate_scene(engine, scene, views, background, metrics, progress, |_, reference, picture| {
                if sampled.contains(&index) {
                    kept.push([reference.clone(), picture.clone()]);
                }
                index += 1;
                Ok(())
            })?;
        evaluation.contrast = contrast(engine, scene, views, background, &evaluation, progress)?;
        Ok((evaluation, kept))
    };
    let ((before, pictures), (after, pictures_after)) = (draw(&subject.runtime)?, draw(&after)?);
    if let Some(note) = difference_of_backgrounds(&after) {
        progress.note(&note);
    }
    let pictures = pictures.into_iter().zip(pictures_after);
    let samples = sampled.iter().zip(pictures).map(|(&index, ([reference, before], [_, after]))| {
        let view = &dataset.views[index];
        Sample { name: format!("{}, time {}", view.name, view.time), reference, before, after }
    });
    let samples = samples.collect();
    Ok(Some(Compared { split: split_name(dataset.split), evaluation: Change { before, after }, samples }))
}

/// Returns the test views; `None`, with a note, if they or any of their images are missing.
fn test_views(subject: &Subject, splits: &Splits, progress: &mut dyn Progress) -> Option<Dataset> {
    let dataset = splits.test(&subject.runtime.trained_with, progress);
    match dataset.and_then(|dataset| dataset.require_images().map(|()| dataset)) {
        Ok(dataset) => Some(dataset),
        Err(error) => {
            progress.note(&format!("note: the package is not compared with test views: {error}"));
            None
        }
    }
}

/// Returns a note if the PSNR of the package over the two backgrounds differs much.
fn difference_of_backgrounds(package: &Evaluation) -> Option<String> {
    let contrast = package.contrast?;
    let (first, second) = (package.mean.psnr_pooled, contrast.mean.psnr_pooled);
    ((first - second).abs() > LARGE_DIFFERENCE).then(|| {
        format!(
            "note: the PSNR of the package is {first:.2} dB over {} and {second:.2} dB over {}: it has Gaussians that only one of the \
             backgrounds shows, such as fog; a capture trained over random backgrounds has none",
            color_name(package.background),
            color_name(contrast.background),
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::offline::measure::{Contrast, ImageMetrics, MeanMetrics};
    use glam::{UVec2, Vec3};

    /// Returns the metrics of a picture whose values differ by `difference` from its reference.
    fn mean(difference: f32) -> MeanMetrics {
        let picture = |value| Picture::filled(UVec2::splat(2), Vec3::splat(value));
        let metrics = ImageMetrics::of(&picture(0.0), &picture(difference), MetricSet::PSNR).expect("the same size");
        MeanMetrics::of(&[metrics]).expect("one view")
    }

    #[test]
    fn a_psnr_that_depends_on_the_background_is_noted() {
        let evaluation = |over_black: f32, over_white: f32| Evaluation {
            background: [0.0; 3],
            has_gaps: true,
            views: Vec::new(),
            mean: mean(over_black),
            contrast: Some(Contrast { background: [1.0; 3], mean: mean(over_white) }),
        };
        let note = difference_of_backgrounds(&evaluation(0.01, 0.1)).expect("40 and 20 dB differ by more than 3 dB");
        assert!(note.contains("40.00 dB over black and 20.00 dB over white"), "both figures are named: {note}");
        assert!(difference_of_backgrounds(&evaluation(0.1, 0.01)).is_some(), "a lower PSNR over black is noted, too");
        assert_eq!(difference_of_backgrounds(&evaluation(0.01, 0.013)), None, "2.3 dB are not noted");
        let alone = Evaluation { contrast: None, ..evaluation(0.01, 0.1) };
        assert_eq!(difference_of_backgrounds(&alone), None, "one background has no difference");
    }
}
