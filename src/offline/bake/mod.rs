//! From a trained checkpoint, or from pictures, to a small, fast package, and a report of the loss of quality.
//!
//! In: a checkpoint, or the capture of [`train_dataset`], the views of its dataset, [`BakeSettings`]. Out: a package,
//! and `NAME.report.json` and `NAME.report.html` next to a package `NAME.gs4d` ([`Baked`]). [`bake()`] is the list of
//! stages.
//!
//! All stages before the evaluation store their results in the folder `OUT.bake` next to a package `OUT`, so that an
//! interrupted bake resumes; they are removed once everything is written. Two bakes cannot use one folder at the same
//! time; the jobs of a `plan`, which are single stages, can.
//!
//! Every choice (score, count, step) depends on the validation views alone, which are not trained on; test views are
//! drawn for the report, after the last choice.
//!
//! | file | subject |
//! |---|---|
//! | `settings`, `inputs` | what a bake is given, and what its stages share |
//! | `ahead`, `before_training` | refuses what a later stage would refuse, before anything is computed |
//! | `train_stage` | train: the capture of a dataset |
//! | `choice`, `trained_search`, `merged_scores` | score and prune: which Gaussians to keep |
//! | `rounds`, `tuning` | rounds and fine-tune: gradual pruning, and training the remaining Gaussians |
//! | `compression`, `size`, `package_size` | mask and compress, and how many Gaussians fit into a package |
//! | `test_comparison`, `summary` | evaluate and report |
//! | `chunk_files` | the package in chunk files |
//! | `job`, `plan` | single stages as jobs for many machines |

mod ahead;
mod before_training;
mod choice;
mod chunk_files;
mod compression;
mod error;
mod inputs;
pub(crate) mod job;
mod merged_scores;
mod package_size;
pub(crate) mod plan;
mod rounds;
mod settings;
mod size;
mod summary;
mod test_comparison;
mod train_stage;
mod trained_search;
mod tuning;

pub(crate) use ahead::obstacle_to_tuning;
pub(crate) use before_training::check_pictures;
pub use chunk_files::{chunk_folder, has_chunk_files, wants_chunk_files, write_chunk_files};
pub use error::BakeError;
pub use settings::BakeSettings;
pub use train_stage::{train_dataset, trained_path};

use crate::gaussian::Gaussian;
use crate::offline::engine::Engine;
use crate::offline::prune::PruneError;
use crate::offline::prune::search::of_name;
use crate::offline::prune::select::highest;
use crate::offline::report::{BakeReport, write_with_report};
use crate::offline::store::StoreError;
use crate::offline::store::results::{Key, Store};
use crate::offline::store::stages::Stages;
use crate::offline::work::Progress;
use crate::scene::{GaussianScene, TemporalFilter};
use choice::{Choice, choose, score};
use compression::{compress, mask};
use inputs::{Inputs, bakeable};
use job::Job;
use rounds::thin;
use size::{Attempts, require_room};
use std::path::PathBuf;
use summary::Facts;
use test_comparison::compare_test_views;
use tuning::{Tuning, fine_tune};

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
/// A scene that is packed already, training views that are missing or show nothing of the scene, images that a loss
/// needs and that are missing, files that cannot be written or are read, another bake to the same package, a failure of
/// the engine.
pub fn bake(
    scene: GaussianScene,
    settings: &BakeSettings,
    engine: &mut Engine,
    progress: &mut dyn Progress,
) -> Result<Baked, BakeError> {
    bake_and(scene, settings, engine, progress, |_, _| Ok(())).map(|(baked, ())| baked)
}

/// Runs a bake as [`bake`], and then `last`, which writes what else belongs to it. The stored results are removed only
/// after that, so that a bake whose last part fails or is interrupted resumes, too.
///
/// # Errors
/// As [`bake`], and those of `last`.
pub(crate) fn bake_and<T, E: From<BakeError>>(
    scene: GaussianScene,
    settings: &BakeSettings,
    engine: &mut Engine,
    progress: &mut dyn Progress,
    last: impl FnOnce(&Baked, &mut dyn Progress) -> Result<T, E>,
) -> Result<(Baked, T), E> {
    let Some((baked, store)) = stages_of(scene, settings, None, engine, progress)? else {
        // All stages were to run.
        return Err(BakeError::from(StoreError::Unreadable { stage: REPORT }).into());
    };
    let written = last(&baked, progress)?;
    if !settings.keep_work {
        store.remove().map_err(BakeError::from)?;
    }
    Ok((baked, written))
}

/// Runs one job of a bake: a stage whose result is not stored yet, given the stored results of all stages before it.
/// Other jobs of the bake may run at the same time, on other machines, and so may the same job. Nothing that is stored
/// is removed: that is left to [`bake`], which finds every stage done.
///
/// # Errors
/// As [`bake`], and a stage before this one that has not run.
pub(crate) fn bake_job(
    scene: GaussianScene,
    settings: &BakeSettings,
    job: Job,
    engine: &mut Engine,
    progress: &mut dyn Progress,
) -> Result<(), BakeError> {
    stages_of(scene, settings, Some(job), engine, progress).map(drop)
}

/// Runs the stages of a bake, or one job. Returns the bake and the folder of its results; `None` unless the report has
/// been written.
fn stages_of(
    scene: GaussianScene,
    settings: &BakeSettings,
    job: Option<Job>,
    engine: &mut Engine,
    progress: &mut dyn Progress,
) -> Result<Option<(Baked, Store)>, BakeError> {
    settings.check_files()?;
    let mut inputs = Inputs::open(bakeable(scene, settings)?, settings, job, engine, progress)?;
    require_room(&inputs)?;
    let store = inputs.store.clone();
    let mut stages = Stages::begin("bake", STAGES, &store, progress).only(job.map(|job| job.stage));
    let scoring = job.map(|job| job.scoring).unwrap_or_default();
    let Some((scores, key)) = score(&mut inputs, &mut stages, scoring)?.filter(|_| !stages.is_reached()) else {
        return Ok(None);
    };
    let (choice, key) = choose(&mut inputs, &mut stages, &scores, key)?;
    if stages.is_reached() {
        return Ok(None);
    }
    let scores = of_name(&scores, &choice.score).ok_or(PruneError::NoScore)?;
    let Some(made) = make_package(&mut inputs, &mut stages, scores, &choice, key)? else { return Ok(None) };
    let compared = stages.run_always("evaluate", |progress| {
        compare_test_views(inputs.engine, &inputs.subject, &inputs.splits, &settings.out, &made.package, progress)
    })?;
    let times = stages.times();
    let baked = stages.run_always(REPORT, |_| -> Result<_, BakeError> {
        let facts = Facts {
            settings,
            trained_with: &inputs.subject.scene.trained_with,
            before: &inputs.subject.scene.gaussians()?,
            after: &made.after,
            filter: &made.filter,
            package: &made.package,
            choice,
            tuning: made.tuning,
            stages: times,
            compared,
        };
        let report = facts.report()?;
        let [json, html] = write_with_report(&report, &made.package, &settings.out)?;
        Ok(Baked { report, json, html })
    })?;
    stages.finish();
    Ok(Some((baked, store)))
}

/// A package that is small enough, and how it was made.
struct Made {
    filter: TemporalFilter,
    /// The Gaussians of the package, before they were compressed.
    after: Vec<Gaussian>,
    tuning: Option<Tuning>,
    package: Vec<u8>,
}

/// Runs the stages from rounds to compress, again with fewer Gaussians after a package that is too large, given the
/// scores to prune by and the key of the choice. `None` if the only stage of a job is one of these.
fn make_package(
    inputs: &mut Inputs<'_>,
    stages: &mut Stages<'_>,
    scores: &[f32],
    choice: &Choice,
    key: Key,
) -> Result<Option<Made>, BakeError> {
    let mut attempts = Attempts::load(inputs, key, choice.kept);
    loop {
        let kept = highest(scores, attempts.count());
        let (thinned, key) = thin(inputs, stages, scores, &choice.score, &kept, key)?;
        if stages.is_reached() {
            return Ok(None);
        }
        let (tuned, tuning, key) = fine_tune(inputs, stages, thinned, key)?;
        if stages.is_reached() {
            return Ok(None);
        }
        let (filter, key) = mask(inputs, stages, &tuned, key)?;
        if stages.is_reached() {
            return Ok(None);
        }
        let after = tuned.gaussians()?.into_owned();
        let tuned = GaussianScene { filter: Some(filter.clone()), ..tuned };
        let package = compress(inputs, stages, tuned, tuning.is_some(), key)?;
        if package.len() as u64 <= inputs.limit() {
            return Ok((!stages.is_reached()).then_some(Made { filter, after, tuning, package }));
        }
        attempts.keep_fewer(inputs, &package, scores, stages.progress())?;
        stages.again();
    }
}
