//! `gs4d bake INPUT -o OUT`: from a trained checkpoint, or from pictures, to a small, fast package, and a report of what it cost.
//!
//! In: a checkpoint and its training views, or the folder of a dataset alone. Out: a package `NAME.gs4d`, `NAME.report.json` and
//! `NAME.report.html` beside it, a summary of the report; the capture trained from a dataset as `NAME.trained.gs4d`.

use super::args::{CheckpointArgs, EngineArgs, Given, PackageArgs, ScoringArgs, ValidationArgs, score_choice, values};
use super::failure::Failure;
use super::interrupt;
use super::progress::Bars;
use super::report::Report;
use super::table::{bytes, lines};
use crate::offline::bake::{BakeSettings, Baked, bake};
use crate::offline::engine::Engine;
use crate::offline::evaluation::color_name;
use crate::offline::fine_tune::{FineTuneSettings, GradientSums};
use crate::offline::quantize::Quality;
use crate::offline::report::{BakeReport, Change};
use crate::offline::search::{Goal, ScoreChoice};
use crate::offline::splits::SplitOptions;
use crate::offline::temporal_filter::FILTER_NAMES;
use crate::offline::train::{TrainSettings, train_dataset, trained_path};
use crate::scene::{FilterKind, GaussianScene, MAX_SEGMENTS};
use std::path::{Path, PathBuf};

/// Turn a trained checkpoint, or pictures, into a small, fast package: train, score, prune, fine-tune, mask, compress, evaluate, report.
///
/// With the folder of a dataset in place of a checkpoint, a capture is trained from its pictures first, as by gs4d train, and kept beside OUT
/// as NAME.trained.gs4d, from which other packages can be baked.
///
/// An interrupted bake resumes from the results in OUT.bake/. A stage runs again if any of its inputs has changed: the checkpoint, a camera,
/// an image, a mask, an option, the version of gs4d.
#[derive(clap::Args)]
#[command(group = clap::ArgGroup::new("goal").args(["ratio", "keep", "max_loss", "target_size"]))]
#[command(after_help = "\
Examples:
  gs4d bake chkpnt30000.pth --data data/toybox -o toybox.gs4d
  gs4d bake chkpnt30000.pth --data data/toybox --ratio 0.5 --quality small -o toybox.gs4d
  gs4d bake chkpnt30000.pth --data data/toybox --target-size 1.5 -o toybox.gs4d
  gs4d bake data/hook --resolution 2 -o hook.gs4d
  gs4d bake hook.trained.gs4d --data data/hook --resolution 2 --target-size 0.6 -o small.gs4d
  gs4d bake n3v.pth --data data/n3v --time-interval 0,10 --max-loss 0.2 --every 20 -o n3v.gs4d

Beside the package: OUT.report.html with plots and pictures (open it in a browser; it needs no network) and OUT.report.json.
Every choice is made on validation views, which nothing is trained on. The report compares the test views, which no choice looks at, if
their images are there. Cameras and times of the training views are enough with --ratio or --keep; --max-loss needs their images, too.")]
pub(super) struct Bake {
    #[command(flatten)]
    given: Given,
    /// The checkpoint, a package of it in the trained form, or the folder of a dataset, whose pictures a capture is trained from.
    #[arg(value_name = "INPUT")]
    input: PathBuf,
    #[command(flatten)]
    package: PackageArgs,
    /// Folder of the dataset, with `transforms_train.json` and `transforms_test.json`, unless it is the INPUT.
    #[arg(long, help_heading = "Data", value_name = "DIR")]
    data: Option<PathBuf>,
    /// Divisor of the picture size (1, 2, 3, 4, 8), -1 (at most 1600 wide) or a target width, as in training.
    #[arg(long, help_heading = "Data", value_name = "N", allow_negative_numbers = true)]
    resolution: Option<i32>,
    /// Number of Gaussians to train from pictures [default: 60000].
    #[arg(long, help_heading = "Training from pictures", value_name = "N", value_parser = values::count(100_000_000))]
    gaussians: Option<usize>,
    /// Steps of training from pictures [default: 20000].
    #[arg(long, help_heading = "Training from pictures", value_name = "N", value_parser = values::count(100_000_000))]
    train_steps: Option<usize>,
    #[command(flatten)]
    validation: ValidationArgs,
    /// Share of the Gaussians to remove, 0 to 1.
    #[arg(long, value_name = "R", value_parser = values::share)]
    ratio: Option<f64>,
    /// Number of Gaussians to keep.
    #[arg(long, value_name = "N", value_parser = values::count(1_000_000_000))]
    keep: Option<usize>,
    /// Keep as few as lose no more than this on the validation views, dB [default: 0.1, unless another goal is given]. Where the others are
    /// trained, the loss is that after a short training.
    #[arg(long, value_name = "DB", value_parser = values::not_negative)]
    max_loss: Option<f64>,
    /// Make a package of at most this many megabytes (of 1,000,000 bytes). If that cannot be done, OUT stays as it was and the smallest
    /// package is kept in OUT.bake/.
    #[arg(long, value_name = "MB", value_parser = values::positive)]
    target_size: Option<f32>,
    /// Remove the others in so many rounds, with training and scoring between, if what is left is trained.
    #[arg(long, value_name = "N", default_value = "4", conflicts_with = "no_fine_tune", value_parser = values::count(100))]
    rounds: usize,
    /// Prune by this score; auto tries ours and the paper's, each with a short training where the remaining Gaussians are trained.
    #[arg(long, value_name = "SCORE", default_value = "energy-removal", value_parser = score_choice(false))]
    variant: ScoreChoice,
    /// Which temporal filter.
    #[arg(long, value_name = "FILTER", default_value = "support", value_parser = values::one_of(&FILTER_NAMES))]
    filter: FilterKind,
    /// Number of key-frames of the filter, evenly over the time interval, both ends included [default: 11].
    #[arg(long, value_name = "K", value_parser = clap::value_parser!(u32).range(2..=i64::from(MAX_SEGMENTS) + 1))]
    key_frames: Option<u32>,
    /// A key-frame every so many of the training data's timestamps, instead.
    #[arg(long, value_name = "FRAMES", conflicts_with = "key_frames", value_parser = values::count(1_000_000))]
    every: Option<usize>,
    /// How small against how exact.
    #[arg(long, value_name = "QUALITY", default_value = "balanced", value_parser = values::one_of(&Quality::NAMES))]
    quality: Quality,
    /// Do not train what is left after pruning. It is trained if there is a GPU and the images of the training views are there.
    #[arg(long)]
    no_fine_tune: bool,
    /// Steps of fine-tuning; a third as many train the codebooks of color.
    #[arg(long, value_name = "N", default_value = "5000", conflicts_with = "no_fine_tune", value_parser = values::count(100_000_000))]
    steps: usize,
    /// Views of each of these steps.
    #[arg(long, value_name = "N", default_value = "2", conflicts_with = "no_fine_tune", value_parser = values::count(1000))]
    batch: usize,
    /// Sum the gradients of fine-tuning in a fixed order, the same in every run, or by atomic additions, which differ by rounding and need
    /// an adapter with float atomics.
    #[arg(long, help_heading = "Experimental", value_name = "HOW", default_value = "deterministic", conflicts_with = "no_fine_tune",
        value_parser = values::one_of(&GradientSums::NAMES))]
    sums: GradientSums,
    /// Leave the intermediate results in OUT.bake/ when all is done.
    #[arg(long)]
    keep_work: bool,
    #[command(flatten)]
    scoring: ScoringArgs,
    #[command(flatten)]
    engine: EngineArgs,
    #[command(flatten)]
    checkpoint: CheckpointArgs,
}

/// The options of training, for which a GPU is needed.
const OF_TRAINING: [&str; 4] = ["--steps", "--batch", "--rounds", "--sums"];

impl Bake {
    /// Runs every stage whose result is not stored yet.
    ///
    /// # Errors
    /// A checkpoint or views that cannot be used, files that cannot be written, a failure of the engine.
    pub(super) fn run(&self) -> Result<Report, Failure> {
        self.engine.check(&self.given, &OF_TRAINING)?;
        self.scoring.check(&self.given, &[self.variant])?;
        let (settings, progress) = (self.settings(self.package.out()?)?, &mut Bars::default());
        settings.check_files()?;
        let (scene, engine) = if self.is_dataset() {
            let engine = self.engine.open(&self.given, &OF_TRAINING)?;
            self.train(&settings, engine, progress)?
        } else {
            (self.checkpoint.load_to_change(&self.input)?, self.engine.open(&self.given, &OF_TRAINING)?)
        };
        let Baked { report, html, .. } = bake(scene, &settings, &mut { engine }, progress)?;
        Ok(Report::new(report.json()?, in_short(&report, &html)))
    }

    /// Returns whether the input is a dataset, from whose pictures a capture is trained.
    fn is_dataset(&self) -> bool {
        self.input.is_dir()
    }

    /// Returns the folder of the dataset, after checking that every option has an effect.
    fn data(&self) -> Result<&Path, Failure> {
        match (&self.data, self.is_dataset()) {
            (Some(data), false) => {
                let of_pictures = ["--gaussians", "--train-steps"];
                self.given.none_of(&of_pictures, "with a checkpoint: they are of the training from pictures")?;
                Ok(data)
            }
            (None, true) => {
                self.given.none_of(&CheckpointArgs::OF_CHECKPOINTS, "with a dataset: they are of checkpoints")?;
                Ok(&self.input)
            }
            (Some(_), true) => Err(Failure::about(&self.input, "is the dataset: --data has no effect on it")),
            (None, false) => Err(Failure::about(
                &self.input,
                "is baked with the views that it was trained on: give --data DIR, or the folder of a dataset as INPUT",
            )),
        }
    }

    /// Trains the capture from the pictures of the dataset.
    fn train(
        &self,
        settings: &BakeSettings,
        mut engine: Engine,
        progress: &mut Bars,
    ) -> Result<(GaussianScene, Engine), Failure> {
        let mut training = TrainSettings::usual(settings.data.clone(), settings.splits);
        training.start.gaussians = self.gaussians.unwrap_or(training.start.gaussians);
        training.tuning = TrainSettings::tuning(self.train_steps.unwrap_or(TrainSettings::STEPS));
        training.capture = self.checkpoint.capture();
        let deferred = interrupt::defer();
        let scene = train_dataset(&training, &settings.out, &mut engine, progress)?;
        drop(deferred);
        Ok((scene, engine))
    }

    fn settings(&self, out: &Path) -> Result<BakeSettings, Failure> {
        let data = self.data()?.to_owned();
        Ok(BakeSettings {
            checkpoint: if self.is_dataset() { trained_path(out) } else { self.input.clone() },
            data,
            out: out.to_owned(),
            splits: SplitOptions { size: None, resolution: self.resolution, validation: self.validation.validation },
            background: self.checkpoint.background,
            goal: self.goal(),
            rounds: self.rounds,
            score: self.variant,
            scoring: self.scoring.settings(),
            filter: self.filter,
            key_frames: values::key_frames(self.key_frames, self.every),
            fine_tune: (!self.no_fine_tune).then(|| FineTuneSettings {
                steps: self.steps,
                batch: self.batch,
                sums: self.sums,
                ..FineTuneSettings::default()
            }),
            quality: self.quality,
            level: self.package.level,
            trust_images: self.validation.trust_images,
            keep_work: self.keep_work,
        })
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
