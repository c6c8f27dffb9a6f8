//! `gs4d bake INPUT -o OUT`: from a trained checkpoint, or from pictures, to a small, fast package, and a report of
//! what it cost.
//!
//! In: a checkpoint and its training views, or the folder of a dataset alone. Out: a package `NAME.gs4d`,
//! `NAME.report.json` and `NAME.report.html` beside it, a summary of the report; the capture trained from a dataset as
//! `NAME.trained.gs4d`; or the stages as jobs for many machines, or one of these jobs.

use super::sound::note_length;
use crate::cli::args::{
    CheckpointArgs, EngineArgs, Given, Need, OrderArgs, PackageArgs, ScoringArgs, ValidationArgs, file_size,
    score_choice, values,
};
use crate::cli::output::failure::Failure;
use crate::cli::output::interrupt;
use crate::cli::output::note::note;
use crate::cli::output::progress::Bars;
use crate::cli::output::report::Report;
use crate::cli::output::table::{bytes, lines};
use crate::codec::sound::read_sound;
use crate::offline::bake::job::{JOB_STAGES, Job, Scoring};
use crate::offline::bake::plan::{Command, Source, plan};
use crate::offline::bake::{
    BakeSettings, Baked, bake_and, bake_job, check_pictures, chunk_folder, has_chunk_files, obstacle_to_tuning,
    train_dataset, trained_path, wants_chunk_files, write_chunk_files,
};
use crate::offline::collide::CollideSettings;
use crate::offline::compress::Quality;
use crate::offline::dataset::SplitOptions;
use crate::offline::engine::{Engine, EngineChoice};
use crate::offline::filter::temporal_filter::FILTER_NAMES;
use crate::offline::footage::{is_raw, prepared};
use crate::offline::measure::evaluation::color_name;
use crate::offline::prune::{Goal, ScoreChoice};
use crate::offline::report::{BakeReport, Change};
use crate::offline::segments::Chunks;
use crate::offline::store::outputs::Files;
use crate::offline::store::shard::Shard;
use crate::offline::train::{FineTuneSettings, TrainError, TrainSettings, Usual};
use crate::offline::work::{Progress, write_beside};
use crate::scene::{ChunkTable, FilterKind, GaussianScene, MAX_SEGMENTS};
use serde_json::json;
use std::env;
use std::ffi::OsString;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Turn a trained checkpoint, or pictures, into a small, fast package: train, score, prune, fine-tune, mask, compress,
/// evaluate, report.
///
/// With the folder of a dataset in place of a checkpoint, a capture is trained from its pictures first, as by gs4d
/// train, and kept beside OUT as NAME.trained.gs4d, from which other packages can be baked.
///
/// An interrupted bake resumes from the results in OUT.bake/. A stage runs again if any of its inputs has changed: the
/// checkpoint, a camera, an image, a mask, an option, the version of gs4d.
#[derive(clap::Args)]
#[command(group = clap::ArgGroup::new("goal").args(["ratio", "keep", "max_loss", "target_size"]))]
#[command(after_help = "\
Examples:
  gs4d bake chkpnt30000.pth --data data/toybox -o toybox.gs4d
  gs4d bake chkpnt30000.pth --data data/toybox --ratio 0.5 --quality small -o toybox.gs4d
  gs4d bake chkpnt30000.pth --data data/toybox --target-size 1.5 -o toybox.gs4d
  gs4d bake data/hook --resolution 2 -o hook.gs4d
  gs4d bake data/cameras --exposure --environment 256 -o even.gs4d     # real cameras before a background
  gs4d bake hook.trained.gs4d --data data/hook --resolution 2 --target-size 0.6 -o small.gs4d
  gs4d bake n3v.pth --data data/n3v --time-interval 0,10 --max-loss 0.2 --every 20 -o n3v.gs4d
  gs4d bake chkpnt30000.pth --data data/singer --audio singer.ogg -o singer.gs4d
  gs4d bake n3v.pth --data data/n3v --engine gpu --shards 8 -o n3v.gs4d --plan n3v.json

Beside a package NAME.gs4d: NAME.report.html with plots and pictures (open it in a browser; it needs no network) and
NAME.report.json.
Every choice is made on validation views, which nothing is trained on. The report compares the test views, which no choice depends on, if
their images exist. Cameras and times of the training views are enough with --ratio or --keep; --max-loss needs their images, too.")]
pub(crate) struct Bake {
    #[command(flatten)]
    given: Given,
    /// The checkpoint, a package of it in the trained form, or the folder of a dataset, whose pictures a capture is
    /// trained from.
    #[arg(value_name = "INPUT")]
    input: PathBuf,
    #[command(flatten)]
    package: PackageArgs,
    /// Folder of the dataset, of Blender, D-NeRF, nerfstudio, N3V, COLMAP and others (docs/command.md), unless it is the
    /// INPUT.
    #[arg(long, help_heading = "Data", value_name = "DIR")]
    data: Option<PathBuf>,
    /// Divisor of the picture size (1, 2, 3, 4, 8), -1 (at most 1600 wide) or a target width, as in training.
    #[arg(long, help_heading = "Data", value_name = "N", allow_negative_numbers = true)]
    resolution: Option<i32>,
    /// Read every view at time 0, as of a scene at rest; images in subfolders of a COLMAP dataset are then no frames of
    /// cameras.
    #[arg(id = "static", long = "static", help_heading = "Data")]
    is_static: bool,
    /// Number of Gaussians to train from pictures [default: 60000; for cameras that stand still and see the same
    /// moments one for 32 pixels of a moment, for other opaque pictures one for 32 pixels of one picture of each
    /// moment, up to 400000].
    #[arg(long, help_heading = "Training from pictures", value_name = "N", value_parser = values::count(100_000_000))]
    gaussians: Option<usize>,
    /// Steps of training from pictures [default: 10000 for cameras that stand still and see the same moments, else
    /// 20000].
    #[arg(long, help_heading = "Training from pictures", value_name = "N", value_parser = values::count(100_000_000))]
    train_steps: Option<usize>,
    /// Rows of the environment map that is trained behind the Gaussians, as of gs4d train; 0: none [default: 32 if the
    /// images show surroundings].
    #[arg(long, help_heading = "Training from pictures", value_name = "ROWS", value_parser = clap::value_parser!(u32).range(0..=4096))]
    environment: Option<u32>,
    #[command(flatten)]
    validation: ValidationArgs,
    /// Share of the Gaussians to remove, 0 to 1.
    #[arg(long, value_name = "R", value_parser = values::share)]
    ratio: Option<f64>,
    /// Number of Gaussians to keep.
    #[arg(long, value_name = "N", value_parser = values::count(1_000_000_000))]
    keep: Option<usize>,
    /// Keep the smallest number of Gaussians that loses at most this much PSNR on the validation views, dB [default:
    /// 0.1, unless another goal is given]. If the remaining Gaussians are trained, the loss is measured after a short
    /// training.
    #[arg(long, value_name = "DB", value_parser = values::not_negative)]
    max_loss: Option<f64>,
    /// Make a package of at most this many megabytes (of 1,000,000 bytes). If no package is that small, OUT is
    /// unchanged, and the smallest package is kept in OUT.bake/.
    #[arg(long, value_name = "MB", value_parser = values::positive)]
    target_size: Option<f32>,
    /// Number of rounds in which Gaussians are removed, with training and scoring between them, if the remaining
    /// Gaussians are trained [default: 1 for pictures of several cameras that stand still, else 4].
    #[arg(long, value_name = "N", conflicts_with = "no_fine_tune", value_parser = values::count(100))]
    rounds: Option<usize>,
    /// Prune by this score; auto tries ours and the paper's, each with a short training if the remaining Gaussians are
    /// trained.
    #[arg(long, value_name = "SCORE", default_value = "energy-removal", value_parser = score_choice(false))]
    variant: ScoreChoice,
    /// Kind of temporal filter.
    #[arg(long, value_name = "FILTER", default_value = "support", value_parser = values::one_of(&FILTER_NAMES))]
    filter: FilterKind,
    /// Number of key-frames of the filter, evenly over the time interval, both ends included [default: 11].
    #[arg(long, value_name = "K", value_parser = clap::value_parser!(u32).range(2..=i64::from(MAX_SEGMENTS) + 1))]
    key_frames: Option<u32>,
    /// Number of timestamps of the training data between two key-frames, in place of --key-frames.
    #[arg(long, value_name = "FRAMES", conflicts_with = "key_frames", value_parser = values::count(1_000_000))]
    every: Option<usize>,
    /// How much may be lost: small, balanced, visually-lossless or lossless.
    #[arg(long, value_name = "QUALITY", default_value = "balanced", value_parser = values::one_of(&Quality::NAMES))]
    quality: Quality,
    #[command(flatten)]
    order: OrderArgs,
    /// Add colliders, as gs4d collide does, simplified by at most this distance in cells (0.5 is usual).
    #[arg(long, value_name = "CELLS", conflicts_with = "target_size", value_parser = values::up_to(4.0))]
    colliders: Option<f32>,
    /// A sound file (Ogg Vorbis or WAV) that the package carries: games play it beside the picture.
    #[arg(long, value_name = "SOUND.ogg")]
    audio: Option<PathBuf>,
    /// Also write the package as chunk files, into the folder NAME.stream beside a package NAME.gs4d: for players that
    /// stream it, as gs4d split does [default: on if the package has more than 6.25 MB and plays for more than two
    /// seconds].
    #[arg(long, value_name = "SWITCH", require_equals = true, num_args = 0..=1, default_missing_value = "on", value_parser = values::switch())]
    stream: Option<bool>,
    /// Do not train the Gaussians that remain after pruning. By default they are trained if there is a GPU and the
    /// images of all training views exist.
    #[arg(long)]
    no_fine_tune: bool,
    /// Steps of fine-tuning; a third as many train the codebooks of color [default: 500 for pictures of several cameras
    /// that stand still, else 5000].
    #[arg(long, value_name = "N", conflicts_with = "no_fine_tune", value_parser = values::count(100_000_000))]
    steps: Option<usize>,
    /// Views of each of these steps.
    #[arg(long, value_name = "N", default_value = "2", conflicts_with = "no_fine_tune", value_parser = values::count(1000))]
    batch: usize,
    /// Train an exposure for each camera wherever Gaussians are trained, as gs4d train does, for pictures whose cameras
    /// differ in exposure or white balance. The package has their mean exposure [default: on for pictures of several
    /// cameras that stand still, else off].
    #[arg(long, conflicts_with = "no_fine_tune", value_name = "SWITCH", require_equals = true, num_args = 0..=1, default_missing_value = "on", value_parser = values::switch())]
    exposure: Option<bool>,
    /// Keep the intermediate results in OUT.bake/ at the end.
    #[arg(long)]
    keep_work: bool,
    #[command(flatten)]
    jobs: JobArgs,
    #[command(flatten)]
    scoring: ScoringArgs,
    #[command(flatten)]
    engine: EngineArgs,
    #[command(flatten)]
    checkpoint: CheckpointArgs,
}

/// A bake as jobs for many machines.
#[derive(clap::Args)]
#[command(next_help_heading = "Many machines")]
struct JobArgs {
    /// Run nothing, and write the stages as jobs to this file: command, needs, inputs and outputs of each, and the jobs
    /// that it waits for.
    #[arg(long, value_name = "PLAN.json", conflicts_with_all = ["only", "shard", "keep_work", "stream"])]
    plan: Option<PathBuf>,
    /// Run only this stage, from the results in OUT.bake/, which is kept; other stages may run at the same time. The
    /// stage report also evaluates.
    #[arg(long, value_name = "STAGE", conflicts_with_all = ["keep_work", "stream"], value_parser = values::one_of(&JOB_STAGES))]
    only: Option<&'static str>,
    /// Compute only shard I of N, 0/N to N-1/N, of the stage score.
    #[arg(long, value_name = "I/N", requires = "only", conflicts_with = "shards")]
    shard: Option<Shard>,
    /// Score in N shards, with a job for each; with --only score merge their results.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    shards: Option<u32>,
}

/// The stage that exists only for a dataset.
const TRAIN: &str = "train";

impl JobArgs {
    /// Returns the job of `--only`, if it is given, after a check that every option has an effect.
    fn job(&self, given: &Given, is_dataset: bool) -> Result<Option<Job>, Failure> {
        let Some(stage) = self.only else {
            given.require(Need::Shards, self.plan.is_some())?;
            return Ok(None);
        };
        given.require(Need::ScoreStage, stage == "score")?;
        if stage == TRAIN && !is_dataset {
            return Err(Failure::new(
                "a checkpoint is trained already: --only train needs the folder of a dataset as INPUT",
            ));
        }
        let scoring = match (self.shard, self.shards) {
            (Some(shard), _) => Scoring::Shard(shard),
            (None, Some(shards)) if shards > 1 => Scoring::Merge(shards),
            (None, _) => Scoring::Whole,
        };
        Ok(Some(Job { stage, scoring }))
    }
}

/// Returns the command of this process as one to which jobs add options.
fn planned_command(arguments: impl Iterator<Item = OsString>) -> Result<Command, Failure> {
    let mut arguments = arguments.skip(1).map(OsString::into_string);
    let (mut verb, mut options) = (vec!["gs4d".to_owned()], Vec::new());
    while let Some(argument) = arguments.next() {
        let not_text = |_| Failure::new("an argument is not UTF-8, and a plan is text: choose other names of files");
        let argument = argument.map_err(not_text)?;
        let (name, has_value) = argument.split_once('=').map_or((argument.as_str(), false), |(name, _)| (name, true));
        if ["--plan", "--shards"].contains(&name) {
            if !has_value {
                arguments.next();
            }
        } else if verb.iter().any(|before| before == "bake") {
            options.push(argument);
        } else {
            verb.push(argument);
        }
    }
    Ok(Command { verb, options })
}

/// Returns the report of a job.
fn job_report(job: Job) -> Report {
    let shard = match job.scoring {
        Scoring::Shard(shard) => Some(shard.to_string()),
        Scoring::Whole | Scoring::Merge(_) => None,
    };
    let of_shard = shard.as_ref().map_or(String::new(), |shard| format!(", shard {shard}"));
    let text = lines(&[("done", format!("{}{of_shard}", job.stage))]);
    Report::new(json!({ "stage": job.stage, "shard": shard }), text)
}

impl Bake {
    /// Runs every stage whose result is not stored yet.
    ///
    /// # Errors
    /// A checkpoint or views that cannot be used, files that cannot be written, a failure of the engine.
    pub(crate) fn run(&self) -> Result<Report, Failure> {
        self.engine.check(&self.given)?;
        self.scoring.check(&self.given, &[self.variant])?;
        let (mut settings, progress) = (self.settings(self.package.out()?)?, &mut Bars::default());
        settings.check_files()?;
        if self.stream == Some(true) {
            let folder = chunk_folder(&settings.out);
            Files::default().writes_folder(&folder, [folder.join(ChunkTable::INDEX)]).check()?;
            let input = self.input.canonicalize().ok();
            if folder.canonicalize().is_ok_and(|folder| input.is_some_and(|input| input.starts_with(folder))) {
                return Err(Failure::about(&self.input, "would be replaced by the chunk files: name another OUT"));
            }
        }
        // A sound that cannot be used is refused before anything is computed.
        let sound = self.audio.as_deref().map(read_sound).transpose()?;
        let job = self.jobs.job(&self.given, self.is_dataset())?;
        if self.is_dataset() && !self.is_static && is_raw(&self.input) {
            if job.is_some() || self.jobs.plan.is_some() {
                let reason =
                    "is footage, which is not divided among machines: run gs4d footage first, and bake its dataset";
                return Err(Failure::about(&self.input, reason));
            }
            settings.data = prepared(&self.input, &settings.out, progress)?;
        }
        let usual = match self.is_dataset() {
            true => Usual::read(&settings.data, &settings.splits, progress)?,
            false => Usual::PLAIN,
        };
        self.choose(&mut settings, &usual);
        if let Some(path) = &self.jobs.plan {
            return self.plan(path, &settings, &usual, progress);
        }
        let (scene, engine) = if self.is_dataset() {
            self.train(&settings, &usual, job, self.engine.open(&self.given)?, progress)?
        } else {
            (self.load(&settings, progress)?, self.engine.open(&self.given)?)
        };
        if let Some(job) = job {
            if job.stage != TRAIN {
                bake_job(scene, &settings, job, &mut { engine }, progress)?;
            }
            return Ok(job_report(job));
        }
        let seconds = scene.playback.duration_seconds;
        let own = sound.as_ref().map(|(file, _)| file).or(scene.sound.as_deref());
        let of_sound = own.map_or(0, |file| file.bytes().len() as u64);
        if let Some((_, sound)) = &sound {
            note_length(sound, seconds);
        }
        // The results of the stages are kept until the chunk files are there, too.
        let chunk_files = |Baked { report, .. }: &Baked, progress: &mut dyn Progress| {
            report.warnings.iter().for_each(|warning| note(&format!("warning: {warning}")));
            self.chunk_files(&settings.out, [report.bytes.after, of_sound], seconds, progress)
        };
        let (baked, chunks) = bake_and(scene, &settings, &mut { engine }, progress, chunk_files)?;
        let Baked { report, html, .. } = baked;
        let (mut json, mut text) = (report.json()?, in_short(&report, &html));
        if let Some(chunks) = chunks {
            let Chunks { index, table, .. } = &chunks;
            let length = table.files.iter().map(|file| file.bytes).sum::<u64>() + file_size(index)?;
            json["chunks"] =
                json!({ "index": index.display().to_string(), "files": table.files.len(), "bytes": length });
            let what = format!("{}, {} files and the index, {}", index.display(), table.files.len(), bytes(length));
            text.push_str(&lines(&[("chunk files", what)]));
        }
        Ok(Report::new(json, text))
    }

    /// Writes the chunk files of a package that plays for `seconds`, if they are wanted: by `--stream`, or because it is
    /// large and there are none of an earlier package that are complete. `lengths`: the bytes of the package, and of its
    /// sound.
    fn chunk_files(
        &self,
        package: &Path,
        lengths: [u64; 2],
        seconds: f32,
        progress: &mut dyn Progress,
    ) -> Result<Option<Chunks>, Failure> {
        let (folder, [length, of_sound]) = (chunk_folder(package), lengths);
        match self.stream {
            Some(true) => Ok(Some(write_chunk_files(package, progress)?)),
            // Nothing is replaced that the command does not name.
            None if wants_chunk_files(length.saturating_sub(of_sound), seconds) && !has_chunk_files(package) => {
                let (folder, length) = (folder.display(), bytes(length));
                note(&format!("note: the package has {length}: {folder} has it in chunk files (--stream=off: none)"));
                // The package is there: files that cannot be written do not fail the bake.
                match write_chunk_files(package, progress).map_err(Failure::from) {
                    Ok(chunks) => Ok(Some(chunks)),
                    Err(failure) if failure.is_interruption() => Err(failure),
                    Err(failure) => {
                        note(&format!("warning: no chunk files: {}", failure.message()));
                        Ok(None)
                    }
                }
            }
            Some(false) | None => {
                if has_chunk_files(package) {
                    let index = folder.join(ChunkTable::INDEX);
                    note(&format!(
                        "note: {} is that of an earlier package: --stream replaces its files",
                        index.display()
                    ));
                }
                Ok(None)
            }
        }
    }

    /// Writes the bake as jobs.
    fn plan(
        &self,
        path: &Path,
        settings: &BakeSettings,
        usual: &Usual,
        progress: &mut Bars,
    ) -> Result<Report, Failure> {
        Files::default().reads_scene(&self.input).reads_data(&settings.data).writes(path, "json").check()?;
        let gpu = match self.engine.choice() {
            EngineChoice::Gpu => true,
            EngineChoice::Cpu => false,
            EngineChoice::Auto => {
                let message = "a plan is the same on all machines: give --engine gpu or --engine cpu with --plan";
                return Err(Failure::new(message));
            }
        };
        let directory = env::current_dir()?;
        let (command, shards) = (planned_command(env::args_os())?, self.jobs.shards.unwrap_or(1));
        let plan = if self.is_dataset() {
            if !gpu {
                return Err(TrainError::WithoutGpu.into());
            }
            let training = self.training(settings, usual);
            plan(Source::Pictures(&training), settings, gpu, shards, directory, &command, progress)?
        } else {
            let scene = Source::Scene(Box::new(self.load(settings, progress)?));
            plan(scene, settings, gpu, shards, directory, &command, progress)?
        };
        let json = serde_json::to_value(&plan)?;
        let text = format!("{json:#}\n");
        write_beside(path, |file| file.write_all(text.as_bytes()))?;
        let seconds: f64 = plan.jobs.iter().map(|job| job.needs.seconds).sum();
        let names: Vec<&str> = plan.jobs.iter().map(|job| job.id.as_str()).collect();
        let text = lines(&[
            ("jobs", format!("{}: {}", names.len(), names.join(", "))),
            ("time", format!("{seconds:.0} s in all, by estimate")),
            ("plan", path.display().to_string()),
        ]);
        Ok(Report::new(json, text))
    }

    /// Returns the settings of the training from pictures.
    fn training(&self, settings: &BakeSettings, usual: &Usual) -> TrainSettings {
        let usual = Usual {
            gaussians: self.gaussians.unwrap_or(usual.gaussians),
            steps: self.train_steps.unwrap_or(usual.steps),
            ..*usual
        };
        let mut training = TrainSettings::usual(settings.data.clone(), settings.splits, &usual);
        training.start.environment = self.environment;
        training.tuning.exposure = self.exposure.unwrap_or(training.tuning.exposure);
        training.capture = self.checkpoint.capture();
        training
    }

    /// Returns whether the input is a dataset, from whose pictures a capture is trained.
    fn is_dataset(&self) -> bool {
        self.input.is_dir()
    }

    /// Returns the folder of the dataset, after a check that every option has an effect.
    fn data(&self) -> Result<&Path, Failure> {
        match (&self.data, self.is_dataset()) {
            (Some(data), false) => {
                self.given.require(Need::Pictures, false)?;
                Ok(data)
            }
            (None, true) => {
                self.given.require(Need::Trained, false)?;
                Ok(&self.input)
            }
            (Some(_), true) => Err(Failure::about(&self.input, "is the dataset: --data has no effect on it")),
            (None, false) => Err(Failure::about(
                &self.input,
                "is baked with the views that it was trained on: give --data DIR, or the folder of a dataset as INPUT",
            )),
        }
    }

    /// Reads the checkpoint, and checks that every option of training has an effect on it.
    fn load(&self, settings: &BakeSettings, progress: &mut Bars) -> Result<GaussianScene, Failure> {
        let scene = self.checkpoint.load_to_change(&self.input)?;
        if self.given.depends_on(Need::Tuning) {
            self.given.require(Need::Tuning, obstacle_to_tuning(&scene, settings, progress)?.is_none())?;
        }
        Ok(scene)
    }

    /// Trains the capture from the pictures of the dataset, after a check that the stages of the bake can run.
    fn train(
        &self,
        settings: &BakeSettings,
        usual: &Usual,
        job: Option<Job>,
        mut engine: Engine,
        progress: &mut Bars,
    ) -> Result<(GaussianScene, Engine), Failure> {
        let (training, only) = (self.training(settings, usual), job.map(|job| job.stage));
        if only.is_none_or(|stage| stage == TRAIN) {
            check_pictures(settings, &training, &engine, progress)?;
        }
        let deferred = interrupt::defer();
        let scene = train_dataset(&training, &settings.out, only, &mut engine, progress)?;
        drop(deferred);
        Ok((scene, engine))
    }

    fn settings(&self, out: &Path) -> Result<BakeSettings, Failure> {
        let data = self.data()?.to_owned();
        self.given.require(Need::Layers, self.quality != Quality::Lossless)?;
        Ok(BakeSettings {
            checkpoint: if self.is_dataset() { trained_path(out) } else { self.input.clone() },
            data,
            out: out.to_owned(),
            splits: SplitOptions {
                size: None,
                resolution: self.resolution,
                validation: self.validation.validation,
                is_static: self.is_static,
            },
            // A capture that is trained from pictures has its own background or environment map.
            background: if self.is_dataset() { None } else { self.checkpoint.background },
            goal: self.goal(),
            rounds: Usual::PLAIN.rounds,
            score: self.variant,
            scoring: self.scoring.settings(),
            filter: self.filter,
            key_frames: values::key_frames(self.key_frames, self.every),
            fine_tune: (!self.no_fine_tune)
                .then(|| FineTuneSettings { batch: self.batch, ..FineTuneSettings::default() }),
            quality: self.quality,
            order: self.order.order(),
            level: self.package.level,
            colliders: self.colliders.map(|error| CollideSettings { error, ..CollideSettings::default() }),
            audio: self.audio.clone(),
            trust_images: self.validation.trust_images,
            keep_work: self.keep_work,
        })
    }

    /// Sets what depends on the dataset: the options that are given, the usual choices for the others.
    fn choose(&self, settings: &mut BakeSettings, usual: &Usual) {
        settings.rounds = self.rounds.unwrap_or(usual.rounds);
        if let Some(tuning) = &mut settings.fine_tune {
            tuning.exposure = self.exposure.unwrap_or(usual.is_rig);
            tuning.steps = self.steps.unwrap_or(usual.fine_tuning);
            tuning.patience = usual.patience;
        }
    }

    /// Returns how many Gaussians to keep.
    fn goal(&self) -> Goal {
        let size = self.target_size.map(|megabytes| Goal::Size((f64::from(megabytes) * 1e6) as u64));
        let loss = self.max_loss.map(Goal::MaxLoss);
        let count = self.keep.map(Goal::Keep).or(self.ratio.map(Goal::Remove));
        count.or(size).or(loss).unwrap_or_default()
    }
}

/// Returns a summary of the report for people.
fn in_short(report: &BakeReport, page: &Path) -> String {
    let mut pairs = vec![
        ("package", format!("{}, {}", report.package, bytes(report.bytes.after))),
        ("Gaussians", format!("{} of {}", report.gaussians.after, report.gaussians.before)),
    ];
    if let Some(Change { before, after }) = &report.evaluation {
        let contrasts = before.contrast.zip(after.contrast);
        let (before, after) = (before.mean, after.mean);
        pairs.push(("PSNR", format!("{:.3} dB, checkpoint {:.3} dB", after.psnr, before.psnr)));
        if let Some((before, after)) = contrasts {
            let (name, before, after) = (color_name(after.background), before.mean.psnr, after.mean.psnr);
            pairs.push(("contrast", format!("{after:.3} dB over {name}, checkpoint {before:.3} dB")));
        }
        if let (Some(before), Some(after)) = (before.ssim, after.ssim) {
            pairs.push(("SSIM", format!("{after:.4}, checkpoint {before:.4}")));
        }
    }
    let choices = report.choices.iter().map(|(name, value)| (name.as_str(), value.clone()));
    pairs.extend(choices);
    let seconds: f64 = report.stages.iter().map(|stage| stage.seconds).sum();
    pairs.push(("time", format!("{seconds:.1} s")));
    pairs.push(("report", page.display().to_string()));
    lines(&pairs)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_of_a_plan_is_this_one_without_the_options_of_the_plan() {
        let of = |line: &str| planned_command(line.split(' ').map(OsString::from)).expect("text");
        let words = |line: &str| line.split(' ').map(str::to_owned).collect::<Vec<_>>();
        let expected =
            Command { verb: words("gs4d --json bake"), options: words("in.pth --data d --engine cpu -o out.gs4d") };
        let line = "target/gs4d --json bake in.pth --plan p.json --data d --shards 4 --engine cpu -o out.gs4d";
        assert_eq!(of(line), expected, "values after the options");
        let line = "gs4d --json bake --plan=p.json in.pth --data d --engine cpu -o out.gs4d --shards=4";
        assert_eq!(of(line), expected, "values in the options");
    }
}
