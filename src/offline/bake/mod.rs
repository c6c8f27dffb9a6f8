//! The whole way from a trained checkpoint to a small, fast package, and a report of what it cost.
//!
//! In: a checkpoint, the views of its dataset, [`BakeSettings`]. Out: a package, and `NAME.report.json` and `NAME.report.html` next to a
//! package `NAME.gs4d` ([`Baked`]). [`Bake::run`] is the list of stages. All stages before the evaluation store their results in the folder
//! `OUT.bake` next to a package `OUT` ([`Store`]), so that an interrupted bake resumes. Two bakes cannot share it.
//!
//! Every choice (score, count, step) looks at the validation views alone, which nothing trains on; test views are drawn for the report,
//! after the last choice.

mod choice;
mod compression;
mod rounds;
mod size;
mod summary;
mod tuning;

use super::belonging::require_belonging;
use super::dataset::TrainingView;
use super::engine::Engine;
use super::files::Files;
use super::fine_tune::{FineTuneSettings, TrainingImages};
use super::prune::highest;
use super::quantize::Quality;
use super::report::BakeReport;
use super::score::ScoringSettings;
use super::search::{Goal, ScoreChoice};
use super::splits::{SplitOptions, Splits};
use super::stages::Stages;
use super::store::{Key, Store};
use super::temporal_filter::KeyFrames;
use super::test_comparison::compare_test_views;
use super::{OfflineError, Progress, Subject, sliced, trained_pixel};
use crate::scene::{FilterKind, GaussianScene, TemporalFilter};
use choice::{Choice, ScoreTable};
use size::Attempts;
use std::path::PathBuf;
use std::sync::Arc;
use summary::Facts;

/// Number of stages of a bake: score, prune, rounds, fine-tune, mask, compress, evaluate, report.
const STAGES: usize = 8;

/// Settings of a bake.
#[derive(Debug, Clone, PartialEq)]
pub struct BakeSettings {
    /// The file that the scene was read from. Results of an earlier bake are reused only if it has not changed.
    pub checkpoint: PathBuf,
    /// Folder of the dataset, with `transforms_train.json`. The report compares test views if there is a `transforms_test.json`.
    pub data: PathBuf,
    /// How the views are read and divided.
    pub splits: SplitOptions,
    /// The package to write; must not be the checkpoint.
    pub out: PathBuf,
    /// Background, RGB, 0 to 1; `None` uses the one that the capture was trained with.
    pub background: Option<[f32; 3]>,
    /// How many Gaussians to keep.
    pub goal: Goal,
    /// Rounds in which the others are removed, with training between where the Gaussians are trained; 1 removes all at once.
    pub rounds: usize,
    /// Which score to prune by.
    pub score: ScoreChoice,
    /// Settings of the scoring.
    pub scoring: ScoringSettings,
    /// Kind of the temporal filter.
    pub filter: FilterKind,
    /// Number of key-frames of the filter.
    pub key_frames: KeyFrames,
    /// How the remaining Gaussians are trained, if there is a GPU and the images of the training views are there; `None` leaves that out. An
    /// interrupted training resumes from its last evaluation; that of codebooks, from a multiple of as many steps.
    pub fine_tune: Option<FineTuneSettings>,
    /// How much compression may lose.
    pub quality: Quality,
    /// zstd level of the package, 1 (fast) to 19 (small); `None` uses the default of
    /// [`write_settings`](super::write_settings).
    pub level: Option<i32>,
    /// Whether images are used without a check that they show the capture.
    pub trust_images: bool,
    /// Whether to keep the folder `OUT.bake` after the bake.
    pub keep_work: bool,
}

impl BakeSettings {
    /// Checks that the package and the reports can be written and are none of the files that are read. [`bake`] does so, too; programs
    /// that take long to read the checkpoint can find out before.
    ///
    /// # Errors
    /// The first of them with which something is wrong.
    pub fn check_files(&self) -> Result<(), OfflineError> {
        let files = Files::default().reads_scene(&self.checkpoint).reads_data(&self.data).writes(&self.out, "gs4d");
        let [json, html] = summary::paths(&self.out);
        files.writes(&json, "json").writes(&html, "html").check()
    }
}

/// A finished bake.
#[derive(Debug, Clone, PartialEq)]
pub struct Baked {
    /// The report.
    pub report: BakeReport,
    /// Path of the report as JSON.
    pub json: PathBuf,
    /// Path of the report as an HTML page.
    pub html: PathBuf,
}

/// Runs every stage whose result is not stored yet, on the scene that was read from the checkpoint. A temporal filter
/// of the scene is replaced. Begins the task "bake" and, inside it, the tasks of the stages.
///
/// # Errors
/// Training views that are missing or show nothing of the scene, images that a loss needs and that are missing, files
/// that cannot be written or are read, another bake to the same package, a failure of the engine.
pub fn bake(
    scene: GaussianScene,
    settings: &BakeSettings,
    engine: &mut Engine,
    progress: &mut dyn Progress,
) -> Result<Baked, OfflineError> {
    settings.check_files()?;
    let mut bake = Bake::open(scene, settings, engine, progress)?;
    let baked = bake.run(progress)?;
    if !settings.keep_work {
        bake.store.remove()?;
    }
    Ok(baked)
}

/// The state that the stages share.
struct Bake<'a> {
    settings: &'a BakeSettings,
    engine: &'a mut Engine,
    subject: Subject,
    splits: Splits,
    /// Every training view, those held out included.
    views: Vec<TrainingView>,
    store: Store,
    /// The contents of the checkpoint, and how it was read.
    scene_key: Key,
    /// The cameras and times of the training and the validation views.
    cameras_key: Key,
    /// The contents of the images of these views.
    images_key: Key,
    /// These images, once a stage has needed them.
    images: Option<Arc<TrainingImages>>,
}

impl<'a> Bake<'a> {
    fn open(
        mut scene: GaussianScene,
        settings: &'a BakeSettings,
        engine: &'a mut Engine,
        progress: &mut dyn Progress,
    ) -> Result<Self, OfflineError> {
        let BakeSettings { checkpoint, data, splits: options, .. } = settings;
        let store = Store::beside(&settings.out, ".bake")?;
        scene.filter = None;
        scene.levels.clear();
        let splits = Splits::open(data, options, &scene.trained_with, progress)?;
        progress.note(&splits.to_string());
        let views = splits.all_training(&scene.trained_with, progress)?;
        scene.trained_with.validation = Some(splits.to_string());
        let read = format!("{:?} {:?} {:?}", scene.trained_with, scene.playback, settings.background);
        let scene_key = Key::of_files(&[checkpoint])?.and(env!("CARGO_PKG_VERSION")).and(&read);
        let cameras_key = Key::of(format!("{:?} {:?}", splits.train, splits.validation).as_bytes());
        let images_key = Key::of_images(&splits.train)?.with(Key::of_images(&splits.validation)?);
        let mut subject = Subject::new(checkpoint, scene, settings.background)?;
        let pixel = trained_pixel(&subject.scene, &views);
        (subject.scene.trained_with.pixel, subject.runtime.trained_with.pixel) = (pixel, pixel);
        if !settings.trust_images {
            require_belonging(engine, &subject.runtime, &views, subject.background)?;
        }
        Ok(Self { settings, engine, subject, splits, views, store, scene_key, cameras_key, images_key, images: None })
    }

    /// Runs the stages.
    fn run(&mut self, progress: &mut dyn Progress) -> Result<Baked, OfflineError> {
        if let (Some(tuning), Engine::Gpu(headless)) = (self.tunes(), &*self.engine) {
            tuning.sums.check(headless)?;
        }
        self.require_validation()?;
        self.require_room()?;
        let store = self.store.clone();
        let mut stages = Stages::begin("bake", STAGES, &store, progress);

        let count = self.subject.scene.len();
        let (scores, key) = stages.run(
            "score",
            self.score_key(),
            |scores: &ScoreTable| scores.are_of(count),
            |progress| self.score(progress),
        )?;
        let (choice, key) =
            stages.run("prune", self.choice_key(key), |_| true, |progress| self.choose(&scores, progress))?;
        let Choice { score, kept, .. } = &choice.0;
        let scores = scores.of(score).ok_or(OfflineError::NoScore)?;
        let mut attempts = Attempts::load(&store, self.attempts_key(key), *kept);
        let (filter, after, tuning) = loop {
            let kept = highest(scores, attempts.count());
            let (thinned, key) = self.thin(&mut stages, scores, score, &kept, key)?;
            let (mut tuned, tuning, key) = self.fine_tune(&mut stages, thinned, key)?;
            let (filter, masked) = stages.run(
                "mask",
                self.mask_key(key),
                |filter: &TemporalFilter| filter.count == tuned.len(),
                |progress| self.mask(&tuned, progress),
            )?;
            let after = sliced(&tuned)?.into_owned();
            tuned.filter = Some(filter.clone());
            let key = self.compress_key(key.with(masked));
            let (package, _) = stages.run(
                "compress",
                key,
                |_| true,
                |progress| self.compress(tuned, tuning.is_some(), key, progress),
            )?;
            if self.put_in_place(&package.0, stages.progress())? {
                break (filter, after, tuning);
            }
            self.keep_fewer(&mut attempts, &package.0, scores, stages.progress())?;
        };
        let compared = stages.run_always("evaluate", |progress| {
            compare_test_views(self.engine, &self.subject, &self.splits, &self.settings.out, progress)
        })?;
        let times = stages.times();
        let before = sliced(&self.subject.scene)?;
        let baked = stages.run_always("report", |progress| {
            let facts = Facts {
                settings: self.settings,
                trained_with: &self.subject.scene.trained_with,
                before: &before,
                after: &after,
                filter: &filter,
                choice: choice.0,
                tuning,
                stages: times,
                compared,
            };
            let report = facts.report()?;
            let [json, html] = summary::write(&report, &self.settings.out, progress)?;
            Ok(Baked { report, json, html })
        })?;
        stages.finish();
        Ok(baked)
    }

    /// Returns the images to train and to validate on, which are loaded once.
    fn images(&mut self, progress: &mut dyn Progress) -> Result<Arc<TrainingImages>, OfflineError> {
        if let Some(images) = &self.images {
            return Ok(images.clone());
        }
        let Splits { train, validation, .. } = &self.splits;
        let images = TrainingImages::load(train.clone(), validation, &self.subject.scene.trained_with, progress)?;
        Ok(self.images.insert(Arc::new(images)).clone())
    }
}
