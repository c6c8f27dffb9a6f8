//! The whole way from a trained checkpoint to a small, fast package, and a report of what it cost.
//!
//! In: a checkpoint, its training views, how small it is to be ([`BakeSettings`]). Out: a package, `OUT.report.json`
//! and `OUT.report.html` beside it ([`Baked`]). The stages score, prune, mask, compress, evaluate and report (see
//! [`Stage`]) leave their results in the folder `OUT.bake` ([`Work`]), so that an interrupted bake goes on where it
//! was. Nothing is trained.

mod compression;
mod evaluation;
mod pruning;
mod stages;
mod summary;
mod work;

pub use stages::Stage;
pub use work::{Fingerprint, Work};

use super::dataset::{Split, TrainingView};
use super::engine::Engine;
use super::prune::select;
use super::quantize::Quality;
use super::report::BakeReport;
use super::score::ScoringSettings;
use super::search::{Goal, ScoreChoice};
use super::splits::open_split;
use super::temporal_filter::KeyFrames;
use super::{OfflineError, Progress, Subject, require_another_file, sliced};
use crate::scene::{FilterKind, GaussianScene};
use stages::Stages;
use std::path::PathBuf;
use summary::Facts;

/// What to bake, and how small against how exact.
#[derive(Debug, Clone, PartialEq)]
pub struct BakeSettings {
    /// The file that the scene was read from: results of an earlier bake count only while it is the same.
    pub checkpoint: PathBuf,
    /// Folder of the dataset, with `transforms_train.json`. The report compares test views if there is a
    /// `transforms_test.json`.
    pub data: PathBuf,
    /// The package to write, another file than the checkpoint.
    pub out: PathBuf,
    /// Divisor of the picture size or target width, as in training; pictures as they are if `None`.
    pub resolution: Option<i32>,
    /// Background, RGB, 0 to 1, in place of the one the capture was trained with.
    pub background: Option<[f32; 3]>,
    /// How many Gaussians to keep.
    pub goal: Goal,
    /// Which score to prune by.
    pub score: ScoreChoice,
    /// How to score.
    pub scoring: ScoringSettings,
    /// Which temporal filter to make.
    pub filter: FilterKind,
    /// Number of its key-frames.
    pub key_frames: KeyFrames,
    /// How much compression may lose.
    pub quality: Quality,
    /// zstd level of the package, 1 (fast) to 19 (small); the usual one if `None`.
    pub level: Option<i32>,
    /// Whether to leave the results of the stages in `OUT.bake` when all is done.
    pub keep_work: bool,
}

/// A finished bake.
#[derive(Debug, Clone, PartialEq)]
pub struct Baked {
    /// What was done and what it cost.
    pub report: BakeReport,
    /// The report as JSON on disk.
    pub json: PathBuf,
    /// The report as a page on disk.
    pub html: PathBuf,
}

/// Runs every stage that is not done yet, on the scene that was read from the checkpoint. Its temporal filter, if it
/// has one, is replaced. Begins the task "bake", and in it those of the stages.
///
/// # Errors
/// Training views that are missing or show nothing of the scene, images that a loss needs and that are missing, files
/// that cannot be written, a failure of the engine.
pub fn bake(
    scene: GaussianScene,
    settings: &BakeSettings,
    engine: &mut Engine,
    progress: &mut dyn Progress,
) -> Result<Baked, OfflineError> {
    require_another_file(&settings.checkpoint, &settings.out)?;
    let mut bake = Bake::open(scene, settings, engine, progress)?;
    let baked = bake.run(progress);
    if baked.is_err() {
        bake.work.remove_if_empty();
    } else if !settings.keep_work {
        bake.work.remove()?;
    }
    baked
}

/// What the stages work with.
struct Bake<'a> {
    settings: &'a BakeSettings,
    engine: &'a mut Engine,
    subject: Subject,
    /// Every training view.
    views: Vec<TrainingView>,
    work: Work,
    /// Of the files and of how the checkpoint was read.
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
        scene.filter = None;
        let views = open_split(data, Split::Train, *resolution, &scene.trained_with, progress)?.views;
        let cameras = data.join(Split::Train.file_name());
        let files = Fingerprint::of_files(&[checkpoint, &cameras])?;
        let read = format!("{:?} {:?} {resolution:?}", scene.trained_with, scene.playback);
        let fingerprint = files.and(env!("CARGO_PKG_VERSION")).and(&read);
        let subject = Subject::new(checkpoint, scene, settings.background)?;
        let work = Work::beside(&settings.out)?;
        Ok(Self { settings, engine, subject, views, work, fingerprint })
    }

    fn run(&mut self, progress: &mut dyn Progress) -> Result<Baked, OfflineError> {
        let mut stages = Stages::begin(progress);
        let pruning = self.prune(&mut stages)?;
        let mut pruned = select(&self.subject.scene, &pruning.kept);
        // Stage::FineTune has its place here: it trains what is left, and everything after goes by what it trained.
        let (filter, masked) = self.mask(&mut stages, &pruned, pruning.fingerprint)?;
        let after = sliced(&pruned)?.into_owned();
        pruned.filter = Some(filter.clone());
        self.compress(&mut stages, pruned, masked)?;
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
