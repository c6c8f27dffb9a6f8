//! The stage evaluate of a bake.
//!
//! In: the scene before pruning, the package on disk, the test views. Out: the metrics of both, and a few pictures
//! ([`Compared`]).

use super::Bake;
use crate::codec::{self, ReadOptions};
use crate::offline::dataset::{Dataset, Split};
use crate::offline::evaluation::evaluate_scene;
use crate::offline::metrics::{Evaluation, MetricSet};
use crate::offline::report::{Change, Sample};
use crate::offline::splits::{open_split, split_name};
use crate::offline::{OfflineError, Progress};
use crate::scene::RuntimeScene;
use crate::view::Picture;

/// Most views whose pictures are on the page.
const SAMPLES: usize = 3;

/// The test views, drawn before and after.
pub(super) struct Compared {
    /// Name of the split.
    pub split: &'static str,
    /// Metrics of the scene before pruning and of the package.
    pub evaluation: Change<Evaluation>,
    /// A few of the views.
    pub samples: Vec<Sample>,
}

impl Bake<'_> {
    /// Draws the test views of the scene and of the package. `None`, with a note, if the views or their images are
    /// missing.
    pub(super) fn compare(&mut self, progress: &mut dyn Progress) -> Result<Option<Compared>, OfflineError> {
        let out = &self.settings.out;
        let after = codec::load(out, &ReadOptions::default())?.into_runtime();
        let after = after.map_err(|error| OfflineError::at(out, error))?;
        let Some(dataset) = self.test_views(progress) else { return Ok(None) };
        let count = dataset.views.len();
        let samples = SAMPLES.min(count);
        let sampled: Vec<usize> = (0..samples).map(|k| (2 * k + 1) * count / (2 * samples)).collect();
        let mut draw = |scene: &RuntimeScene| -> Result<(Evaluation, Vec<[Picture; 2]>), OfflineError> {
            let (mut index, mut kept) = (0, Vec::new());
            let (background, metrics) = (self.subject.background, MetricSet::ALL);
            let evaluation = evaluate_scene(
                self.engine,
                scene,
                &dataset.views,
                background,
                metrics,
                progress,
                |_, reference, picture| {
                    if sampled.contains(&index) {
                        kept.push([reference.clone(), picture.clone()]);
                    }
                    index += 1;
                    Ok(())
                },
            )?;
            Ok((evaluation, kept))
        };
        let ((before, pictures), (after, pictures_after)) = (draw(&self.subject.runtime)?, draw(&after)?);
        let pictures = pictures.into_iter().zip(pictures_after);
        let samples = sampled.iter().zip(pictures).map(|(&index, ([reference, before], [_, after]))| {
            let view = &dataset.views[index];
            Sample { name: format!("{}, time {}", view.name, view.time), reference, before, after }
        });
        let samples = samples.collect();
        Ok(Some(Compared { split: split_name(dataset.split), evaluation: Change { before, after }, samples }))
    }

    /// Returns the test views; `None`, with a note, if they or any of their images are missing.
    fn test_views(&self, progress: &mut dyn Progress) -> Option<Dataset> {
        let (settings, trained_with) = (self.settings, &self.subject.runtime.trained_with);
        let dataset = open_split(&settings.data, Split::Test, settings.resolution, trained_with, progress);
        match dataset.and_then(|dataset| dataset.require_images().map(|()| dataset)) {
            Ok(dataset) => Some(dataset),
            Err(error) => {
                progress.note(&format!("note: the package is not compared with test views: {error}"));
                None
            }
        }
    }
}
