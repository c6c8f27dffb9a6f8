//! A bake as jobs for many machines.
//!
//! In: the settings of a bake, its scene and views, the command that bakes. Out: a [`Plan`]: each stage as a command,
//! what it needs and what it waits for. Workflow engines read it as JSON; this crate does not.
//!
//! Needs are estimates by the numbers of Gaussians, views and pixels, for time limits and the choice of machines.

use super::BakeError;
use super::ahead::require_validation;
use super::before_training::divided;
use super::inputs::{bakeable, key_frames};
use super::job::shard_name;
use super::settings::BakeSettings;
use super::size::require_least;
use crate::offline::dataset::TrainingView;
use crate::offline::dataset::selection::distinct_cameras;
use crate::offline::dataset::splits::Splits;
use crate::offline::engine::memory::{IMAGE, PICTURE};
use crate::offline::filter::temporal_filter::needs_views;
use crate::offline::prune::search::{Goal, ScoreChoice};
use crate::offline::report::report_paths;
use crate::offline::store::results::{BAKE_FOLDER, folder_beside};
use crate::offline::store::shard::Shard;
use crate::offline::train::{Divided, FineTuneSettings, TrainSettings, untrainable::obstacle};
use crate::offline::work::Progress;
use crate::scene::GaussianScene;
use serde::Serialize;
use std::fs;
use std::path::PathBuf;

/// A bake as jobs.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Plan {
    /// Name and version of the program that wrote it. Another version has other results.
    pub generator: String,
    /// The folder that the commands run in: paths are relative to it.
    pub directory: PathBuf,
    /// The package that is made.
    pub package: PathBuf,
    /// The jobs; each follows those that it waits for.
    pub jobs: Vec<PlannedJob>,
}

/// A job.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct PlannedJob {
    /// Its name, unique in the plan.
    pub id: String,
    /// The stage, of which the job may be a shard.
    pub stage: &'static str,
    /// The program and its arguments.
    pub command: Vec<String>,
    /// What it needs.
    pub needs: Needs,
    /// The jobs that must have ended.
    pub after: Vec<String>,
    /// The files and folders that it reads.
    pub inputs: Vec<PathBuf>,
    /// The files that it writes.
    pub outputs: Vec<PathBuf>,
}

/// What a job needs. Memory and time are estimates.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(crate) struct Needs {
    /// Whether it computes on a GPU.
    pub gpu: bool,
    /// Bytes of memory.
    pub memory_bytes: u64,
    /// Seconds.
    pub seconds: f64,
}

/// A command of `gs4d bake`, to which a job adds options.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Command {
    /// The arguments before and including the verb.
    pub verb: Vec<String>,
    /// Those after it.
    pub options: Vec<String>,
}

impl Command {
    fn with(&self, options: &[String]) -> Vec<String> {
        [&self.verb[..], options, &self.options].concat()
    }
}

/// What is baked.
#[derive(Debug)]
pub(crate) enum Source<'a> {
    /// This scene.
    Scene(Box<GaussianScene>),
    /// A capture that is trained from pictures with these settings.
    Pictures(&'a TrainSettings),
}

/// Bytes of memory for each Gaussian: parameters, their copies for drawing and coding, sums of scores.
const OF_GAUSSIAN: u64 = 2000;
/// Bytes of memory for each pixel of a picture that is drawn and compared.
const OF_PIXEL: u64 = 300;
/// Bytes of memory of the program and of a GPU driver.
const OF_PROGRAM: u64 = 500_000_000;
/// Seconds for each pixel of a view, and for each Gaussian: on two cores, and on a GPU.
const ON_CPU: [f64; 2] = [1.5e-6, 1e-6];
const ON_GPU: [f64; 2] = [1e-8, 1e-8];
/// Duration of a step of training, relative to drawing its views.
const OF_STEP: f64 = 4.0;

/// Plans a bake whose scoring is done in `shards` shards, on GPUs or on CPUs.
///
/// # Errors
/// What its jobs would refuse on any machine: a scene or views that cannot be used, images that are missing, a size
/// below that of an empty package.
pub(crate) fn plan(
    source: Source<'_>,
    settings: &BakeSettings,
    gpu: bool,
    shards: u32,
    directory: PathBuf,
    command: &Command,
    progress: &mut dyn Progress,
) -> Result<Plan, BakeError> {
    let tuning = settings.fine_tune.as_ref().filter(|_| gpu);
    let (splits, views, count, tuning, training) = match source {
        Source::Scene(scene) => {
            let scene = bakeable(*scene, settings)?;
            let splits = Splits::open(&settings.data, &settings.splits, &scene.trained_with, progress)?;
            let views = splits.all_training(&scene.trained_with, progress)?;
            let tuning = tuning.filter(|_| obstacle(&scene.form, &views).is_none());
            require_least(&scene, settings, key_frames(settings, &views), tuning.is_some())?;
            (splits, views, scene.len(), tuning, None)
        }
        Source::Pictures(training) => {
            let Divided { splits, views, .. } = divided(settings, training, progress)?;
            (splits, views, training.start.gaussians, tuning, Some(training.tuning.steps))
        }
    };
    require_validation(settings, &splits)?;
    let planner = Planner { settings, splits: &splits, views: &views, gpu, count, tuning, training, command };
    let generator = format!("gs4d {}", env!("CARGO_PKG_VERSION"));
    Ok(Plan { generator, directory, package: settings.out.clone(), jobs: planner.jobs(shards) })
}

struct Planner<'a> {
    settings: &'a BakeSettings,
    splits: &'a Splits,
    views: &'a [TrainingView],
    gpu: bool,
    /// Number of Gaussians before pruning.
    count: usize,
    tuning: Option<&'a FineTuneSettings>,
    /// Steps of the training from pictures, if there is one.
    training: Option<usize>,
    command: &'a Command,
}

impl Planner<'_> {
    fn jobs(&self, shards: u32) -> Vec<PlannedJob> {
        let mut jobs = Vec::new();
        let (out, scored) = (&self.settings.out, self.splits.train.len() as f64 * self.draw());
        let stored = |name: &str| vec![self.folder().join(name)];
        if let Some(steps) = self.training {
            let outputs = vec![self.settings.checkpoint.clone(), self.folder().join("train")];
            jobs.push(self.job("train".to_owned(), "train", &[], &[], outputs, self.steps(steps)));
        }
        let before: Vec<String> = jobs.iter().map(|job: &PlannedJob| job.id.clone()).collect();
        let mut last = before.clone();
        if shards > 1 {
            last.clear();
            for shard in Shard::all(shards) {
                let options = ["--shard".to_owned(), shard.to_string()];
                let (id, seconds) = (format!("score-{}", shard.index()), scored / f64::from(shards));
                jobs.push(self.job(id.clone(), "score", &options, &before, stored(&shard_name(shard)), seconds));
                last.push(id);
            }
        }
        let merge = ["--shards".to_owned(), shards.to_string()];
        let (merge, seconds) = if shards > 1 { (&merge[..], 1.0) } else { (&[][..], scored) };
        let mut push = |stage: &'static str, options: &[String], outputs: Vec<PathBuf>, seconds: f64| {
            jobs.push(self.job(stage.to_owned(), stage, options, &last, outputs, seconds));
            last = vec![stage.to_owned()];
        };
        push("score", merge, stored("score"), seconds);
        push("prune", &[], stored("prune"), self.pruning());
        if let Some(tuning) = self.tuning {
            let rounds = self.settings.rounds.saturating_sub(1) as f64;
            if rounds > 0.0 {
                push("rounds", &[], stored("rounds"), rounds * (self.steps(tuning.steps) / 5.0 + scored));
            }
            push("fine-tune", &[], stored("fine-tune"), self.steps(tuning.steps));
        }
        push("mask", &[], stored("mask"), self.mask());
        let coding = self.tuning.map_or(0.0, |tuning| self.steps(tuning.steps) / 3.0);
        push("compress", &[], stored("compress"), self.count as f64 * 2e-5 + coding);
        let tested = self.views.len().min(200) as f64;
        let reports = report_paths(out).into_iter();
        let outputs = [out.clone()].into_iter().chain(reports).collect();
        push("report", &[], outputs, tested * (4.0 * self.draw() + self.pixels() as f64 * 2e-6));
        jobs
    }

    fn job(
        &self,
        id: String,
        stage: &'static str,
        options: &[String],
        after: &[String],
        outputs: Vec<PathBuf>,
        seconds: f64,
    ) -> PlannedJob {
        let only = ["--only".to_owned(), stage.to_owned()];
        // A capture that is trained from pictures is there once its first job has ended.
        let mut inputs = vec![self.settings.data.clone()];
        if stage != "train" {
            inputs.insert(0, self.settings.checkpoint.clone());
        }
        inputs.extend(self.settings.audio.clone());
        if stage != "train" && !after.is_empty() {
            inputs.push(self.folder());
        }
        let tunes = matches!(stage, "prune" | "rounds" | "fine-tune" | "compress") && self.tuning.is_some();
        let trained = if tunes || stage == "train" { self.views.len() as u64 * IMAGE } else { 0 };
        // Counts are compared with every validation view.
        let compared = if stage == "prune" { self.splits.validation.len() as u64 * PICTURE } else { 0 };
        let of_pixels = self.pixels() * (OF_PIXEL + trained + compared);
        let memory_bytes = OF_PROGRAM + self.count as u64 * OF_GAUSSIAN + of_pixels;
        // The scene and the images are read, and hashed.
        let read = fs::metadata(&self.settings.checkpoint).map_or(0, |file| file.len()) as f64 / 2e8;
        let seconds = (1.0 + read + self.views.len() as f64 * 2e-3 + seconds).ceil();
        let command = self.command.with(&[&only[..], options].concat());
        let needs = Needs { gpu: self.gpu, memory_bytes, seconds };
        PlannedJob { id, stage, command, needs, after: after.to_vec(), inputs, outputs }
    }

    /// Returns the folder of results.
    fn folder(&self) -> PathBuf {
        folder_beside(&self.settings.out, BAKE_FOLDER)
    }

    /// Returns the number of pixels of the largest view.
    fn pixels(&self) -> u64 {
        let pixels = |view: &TrainingView| u64::from(view.camera.size.x) * u64::from(view.camera.size.y);
        self.views.iter().map(pixels).max().unwrap_or(0)
    }

    /// Returns the seconds in which a view is drawn.
    fn draw(&self) -> f64 {
        let [of_pixel, of_gaussian] = if self.gpu { ON_GPU } else { ON_CPU };
        self.pixels() as f64 * of_pixel + self.count as f64 * of_gaussian
    }

    /// Returns the seconds of steps of training.
    fn steps(&self, steps: usize) -> f64 {
        let batch = self.settings.fine_tune.as_ref().map_or(1, |tuning| tuning.batch);
        (steps * batch) as f64 * self.draw() * OF_STEP
    }

    fn pruning(&self) -> f64 {
        let by_loss = matches!(self.settings.goal, Goal::MaxLoss(_));
        let candidates = self.settings.score.variants(true).len() as f64;
        let drawn = self.splits.validation.len() as f64 * self.draw() * if by_loss { 12.0 } else { 5.0 } * candidates;
        let trains = by_loss || self.settings.score == ScoreChoice::Auto;
        let trained = self.tuning.filter(|_| trains).map_or(0.0, |tuning| self.steps(tuning.steps) / 5.0);
        drawn + trained * candidates.max(4.0)
    }

    fn mask(&self) -> f64 {
        if !needs_views(self.settings.filter) {
            return self.count as f64 * 1e-5;
        }
        let keys = self.settings.key_frames.count(self.views) * distinct_cameras(self.views).len();
        (keys + self.views.len()) as f64 * self.draw()
    }
}
