//! From a trained checkpoint, or from pictures, to a small, fast package, and a report of the loss of quality.
//!
//! In: a checkpoint or the capture of [`train_dataset`](super::train::train_dataset), the views of its dataset, [`BakeSettings`]. Out: a package, and `NAME.report.json` and `NAME.report.html` next to a
//! package `NAME.gs4d` ([`Baked`]). [`bake()`] is the list of stages. All stages before the evaluation store their results in the folder
//! `OUT.bake` next to a package `OUT` ([`Store`](super::store::Store)), so that an interrupted bake resumes. Two bakes cannot use one
//! folder at the same time; the jobs of a `plan`, which are single stages, can.
//!
//! Every choice (score, count, step) depends on the validation views alone, which are not trained on; test views are drawn for the report,
//! after the last choice.

mod ahead;
mod before_training;
mod choice;
mod compression;
mod inputs;
mod rounds;
mod size;
mod summary;
mod tuning;

pub use super::bake_settings::BakeSettings;
pub(crate) use ahead::{obstacle_to_tuning, require_validation};
pub(crate) use before_training::check_pictures;

use super::engine::Engine;
use super::jobs::job::Job;
use super::prune::highest;
use super::quantize::require_unpacked;
use super::report::{BakeReport, write_with_report};
use super::search::of_name;
use super::stages::Stages;
use super::test_comparison::compare_test_views;
use super::{OfflineError, Progress, sliced};
use crate::scene::GaussianScene;
use choice::{choose, score};
use compression::{compress, mask};
use inputs::Inputs;
use rounds::thin;
use size::{Attempts, require_room};
use std::path::PathBuf;
use summary::Facts;
use tuning::fine_tune;

/// The last stage.
const REPORT: &str = "report";
/// Number of stages of a bake: score, prune, rounds, fine-tune, mask, compress, evaluate, report.
const STAGES: usize = 8;

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
/// A scene that is packed already, training views that are missing or show nothing of the scene, images that a loss needs and that are
/// missing, files that cannot be written or are read, another bake to the same package, a failure of the engine.
pub fn bake(
    scene: GaussianScene,
    settings: &BakeSettings,
    engine: &mut Engine,
    progress: &mut dyn Progress,
) -> Result<Baked, OfflineError> {
    match stages_of(scene, settings, None, engine, progress)? {
        Some(baked) => Ok(baked),
        // All stages were to run.
        None => Err(OfflineError::Unreadable { stage: REPORT }),
    }
}

/// Runs one job of a bake: a stage whose result is not stored yet, given the stored results of all stages before it. Other jobs of the bake may
/// run at the same time, on other machines, and so may the same job. Nothing that is stored is removed: that is left to [`bake`], which finds
/// every stage done.
///
/// # Errors
/// As [`bake`], and a stage before this one that has not run.
pub(crate) fn bake_job(
    scene: GaussianScene,
    settings: &BakeSettings,
    job: Job,
    engine: &mut Engine,
    progress: &mut dyn Progress,
) -> Result<(), OfflineError> {
    stages_of(scene, settings, Some(job), engine, progress).map(drop)
}

/// Runs the stages of a bake, or one job. `None` unless the report has been written.
fn stages_of(
    scene: GaussianScene,
    settings: &BakeSettings,
    job: Option<Job>,
    engine: &mut Engine,
    progress: &mut dyn Progress,
) -> Result<Option<Baked>, OfflineError> {
    settings.check_files()?;
    require_unpacked(&scene.form).map_err(|error| OfflineError::at(&settings.checkpoint, error))?;
    let mut inputs = Inputs::open(scene, settings, job, engine, progress)?;
    require_room(&inputs)?;
    let store = inputs.store.clone();
    let mut stages = Stages::begin("bake", STAGES, &store, progress).only(job.map(|job| job.stage));

    let Some((scores, key)) = score(&mut inputs, &mut stages, job.map(|job| job.scoring).unwrap_or_default())? else {
        return Ok(None);
    };
    if stages.is_reached() {
        return Ok(None);
    }
    let (choice, key) = choose(&mut inputs, &mut stages, &scores, key)?;
    if stages.is_reached() {
        return Ok(None);
    }
    let scores = of_name(&scores, &choice.score).ok_or(OfflineError::NoScore)?;
    let mut attempts = Attempts::load(&inputs, key, choice.kept);
    let (filter, after, tuning, package) = loop {
        let kept = highest(scores, attempts.count());
        let (thinned, key) = thin(&mut inputs, &mut stages, scores, &choice.score, &kept, key)?;
        if stages.is_reached() {
            return Ok(None);
        }
        let (tuned, tuning, key) = fine_tune(&mut inputs, &mut stages, thinned, key)?;
        if stages.is_reached() {
            return Ok(None);
        }
        let (filter, key) = mask(&mut inputs, &mut stages, &tuned, key)?;
        if stages.is_reached() {
            return Ok(None);
        }
        let after = sliced(&tuned)?.into_owned();
        let tuned = GaussianScene { filter: Some(filter.clone()), ..tuned };
        let package = compress(&mut inputs, &mut stages, tuned, tuning.is_some(), key)?;
        if package.len() as u64 <= inputs.limit() {
            break (filter, after, tuning, package);
        }
        attempts.keep_fewer(&inputs, &package, scores, stages.progress())?;
        stages.again();
    };
    if stages.is_reached() {
        return Ok(None);
    }
    let compared = stages.run_always("evaluate", |progress| {
        compare_test_views(inputs.engine, &inputs.subject, &inputs.splits, &settings.out, &package, progress)
    })?;
    let times = stages.times();
    let baked = stages.run_always(REPORT, |_| {
        let facts = Facts {
            settings,
            trained_with: &inputs.subject.scene.trained_with,
            before: &sliced(&inputs.subject.scene)?,
            after: &after,
            filter: &filter,
            package: &package,
            choice,
            tuning,
            stages: times,
            compared,
        };
        let report = facts.report()?;
        let [json, html] = write_with_report(&report, &package, &settings.out)?;
        Ok(Baked { report, json, html })
    })?;
    stages.finish();
    if job.is_none() && !settings.keep_work {
        store.remove()?;
    }
    Ok(Some(baked))
}
