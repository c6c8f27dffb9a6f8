//! The whole way from a trained checkpoint to a small, fast package, and a report of what it cost.
//!
//! In: a checkpoint, its training views, [`BakeSettings`]. Out: a package, and `NAME.report.json` and
//! `NAME.report.html` beside a package `NAME.gs4d` ([`Baked`]). The stages (see [`Stage`]) before the evaluation store
//! their results in the folder `OUT.bake` beside a package `OUT` ([`Work`]), so that an interrupted bake resumes. Two bakes cannot share it.

mod attempts;
mod compression;
mod evaluation;
mod pruning;
mod rounds;
mod size;
mod stages;
mod summary;
mod trials;
mod tuning;

pub use stages::Stage;

use super::dataset::{Split, TrainingView};
use super::engine::Engine;
use super::files::Files;
use super::fine_tune::FineTuneSettings;
use super::quantize::Quality;
use super::report::BakeReport;
use super::score::ScoringSettings;
use super::search::{Goal, ScoreChoice};
use super::splits::open_split;
use super::temporal_filter::KeyFrames;
use super::work::{Fingerprint, Work};
use super::{OfflineError, Progress, Subject, sliced, trained_pixel};
use crate::scene::{FilterKind, GaussianScene};
use stages::Stages;
use std::path::PathBuf;
use summary::Facts;

/// Settings of a bake.
#[derive(Debug, Clone, PartialEq)]
pub struct BakeSettings {
    /// The file that the scene was read from. Results of an earlier bake are reused only if it has not changed.
    pub checkpoint: PathBuf,
    /// Folder of the dataset, with `transforms_train.json`. The report compares test views if there is a
    /// `transforms_test.json`.
    pub data: PathBuf,
    /// The package to write; must not be the checkpoint.
    pub out: PathBuf,
    /// Divisor of the picture size, or target width in pixels, as in training; `None` keeps the size of the images.
    pub resolution: Option<i32>,
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
    /// interrupted training goes on from its last evaluation; that of codebooks, from a multiple of as many steps.
    pub fine_tune: Option<FineTuneSettings>,
    /// How much compression may lose.
    pub quality: Quality,
    /// zstd level of the package, 1 (fast) to 19 (small); `None` uses the default of
    /// [`write_settings`](super::write_settings).
    pub level: Option<i32>,
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
        bake.work.remove()?;
    }
    Ok(baked)
}

/// The state that the stages share.
struct Bake<'a> {
    settings: &'a BakeSettings,
    engine: &'a mut Engine,
    subject: Subject,
    /// Every training view.
    views: Vec<TrainingView>,
    work: Work,
    /// Fingerprint of the files and of the options that the checkpoint was read with.
    fingerprint: Fingerprint,
}

impl<'a> Bake<'a> {
    fn open(
        mut scene: GaussianScene,
        settings: &'a BakeSettings,
        engine: &'a mut Engine,
        progress: &mut dyn Progress,
    ) -> Result<Self, OfflineError> {
        let BakeSettings { checkpoint, data, resolution, .. } = settings;
        let work = Work::beside(&settings.out, ".bake")?;
        scene.filter = None;
        scene.levels.clear();
        let views = open_split(data, Split::Train, *resolution, &scene.trained_with, progress)?.views;
        let cameras = data.join(Split::Train.file_name());
        let files = Fingerprint::of_files(&[checkpoint, &cameras])?;
        let read = format!("{:?} {:?} {resolution:?}", scene.trained_with, scene.playback);
        let fingerprint = files.and(env!("CARGO_PKG_VERSION")).and(&read);
        let mut subject = Subject::new(checkpoint, scene, settings.background)?;
        let pixel = trained_pixel(&subject.scene, &views);
        (subject.scene.trained_with.pixel, subject.runtime.trained_with.pixel) = (pixel, pixel);
        Ok(Self { settings, engine, subject, views, work, fingerprint })
    }

    fn run(&mut self, progress: &mut dyn Progress) -> Result<Baked, OfflineError> {
        if let (Some(tuning), Engine::Gpu(headless)) = (self.tunes(), &*self.engine) {
            tuning.sums.check(headless)?;
        }
        self.require_room()?;
        let mut stages = Stages::begin(progress);
        let first = self.prune(&mut stages)?;
        let mut pruning = self.resume_attempt(first, &mut stages);
        let (filter, after, tuning) = loop {
            let (thinned, fingerprint) = self.thin(&mut stages, &pruning)?;
            let (mut tuned, tuning, fingerprint) = self.fine_tune(&mut stages, thinned, fingerprint)?;
            let (filter, masked) = self.mask(&mut stages, &tuned, fingerprint)?;
            let after = sliced(&tuned)?.into_owned();
            tuned.filter = Some(filter.clone());
            match self.compress(&mut stages, tuned, tuning.as_ref(), masked)? {
                Some(size) => pruning = self.keep_fewer(pruning, size, &mut stages)?,
                None => break (filter, after, tuning),
            }
        };
        self.remove_made();
        let compared = stages.run(Stage::Evaluate, None, |progress| self.compare(progress))?;
        let times = stages.times();
        let before = sliced(&self.subject.scene)?;
        let baked = stages.run(Stage::Report, None, |progress| {
            let facts = Facts {
                settings: self.settings,
                trained_with: &self.subject.scene.trained_with,
                before: &before,
                after: &after,
                filter: &filter,
                found: pruning.found,
                rounds: self.settings.rounds,
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
}
