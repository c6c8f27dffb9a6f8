//! `gs4d bake CHECKPOINT --data DIR -o OUT`: from a trained checkpoint to a small, fast package, and a report of what it cost.
//!
//! In: a checkpoint, its training views. Out: a package, `OUT.report.json` and `OUT.report.html`. The stages score, prune, mask,
//! compress, evaluate and report leave their results in `OUT.bake/`, so that an interrupted bake goes on where it was.

mod pruning;
mod steps;
mod summary;

use super::convert::is_same_file;
use super::engine::{Engine, EngineArgs};
use super::failure::Failure;
use super::filters::{FILTERS, KEYS, filter, filter_name};
use super::opening::{CheckpointArgs, PackageArgs};
use super::report::Report;
use super::splits::SplitArgs;
use super::training::{self, Choice, ScoringArgs};
use super::{interrupt, values};
use crate::offline::bake::{Fingerprint, Stage, Work};
use crate::offline::dataset::selection::distinct_times;
use crate::offline::dataset::{Split, TrainingView};
use crate::offline::prune::select;
use crate::offline::quantize::{CompressSettings, Quality, compress};
use crate::offline::sliced;
use crate::offline::temporal_filter::keys_every;
use crate::scene::{FilterKind, GaussianScene, MAX_SEGMENTS, RuntimeScene, TemporalFilter};
use crate::view::Background;
use pruning::Pruning;
use std::path::{Path, PathBuf};
use steps::Steps;

/// Stages of a bake, without the fine-tuning that is to come.
const STAGES: usize = 6;

/// Turn a trained checkpoint into a small, fast package: score, prune, mask, compress, evaluate, report.
///
/// An interrupted bake goes on where it was, from the results in OUT.bake/; with other inputs or options it starts over where they
/// matter. Nothing is trained.
#[derive(clap::Args)]
#[command(group = clap::ArgGroup::new("goal").args(["ratio", "keep", "max_loss"]))]
#[command(after_help = "\
Examples:
  gs4d bake chkpnt30000.pth --data data/toybox -o toybox.gs4d
  gs4d bake chkpnt30000.pth --data data/toybox --ratio 0.5 --quality small -o toybox.gs4d
  gs4d bake n3v.pth --data data/n3v --time-interval 0,10 --max-loss 0.2 --every 20 -o n3v.gs4d

Beside the package: OUT.report.html with plots and pictures (open it in a browser; it needs no network) and OUT.report.json.
Cameras and times of the training views are enough with --ratio or --keep; --max-loss needs their images, too, and the report
compares the test views only if theirs are there.")]
pub struct Bake {
    /// The checkpoint, or a package of it in the trained form.
    #[arg(value_name = "CHECKPOINT")]
    input: PathBuf,
    #[command(flatten)]
    package: PackageArgs,
    #[command(flatten)]
    data: SplitArgs,
    /// Share of the Gaussians to remove, 0 to 1.
    #[arg(long, value_name = "R", value_parser = values::share)]
    ratio: Option<f64>,
    /// Number of Gaussians to keep.
    #[arg(long, value_name = "N", value_parser = values::count(1_000_000_000))]
    keep: Option<usize>,
    /// Keep as few as lose no more than this on held-out training views, dB [default: 0.1, unless --ratio or --keep is given].
    #[arg(long, value_name = "DB", value_parser = values::not_negative)]
    max_loss: Option<f64>,
    /// Prune by this score; auto tries ours and the paper's.
    #[arg(long, value_name = "SCORE", default_value = "auto", value_parser = training::choice(false))]
    variant: Choice,
    /// Which temporal filter.
    #[arg(long, value_name = "FILTER", default_value = "support", value_parser = values::one_of(&FILTERS))]
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

/// What the stages work with.
struct Inputs {
    scene: GaussianScene,
    runtime: RuntimeScene,
    background: Background,
    /// Every training view.
    views: Vec<TrainingView>,
    engine: Engine,
    work: Work,
    /// Of the files and of how the checkpoint is read.
    fingerprint: Fingerprint,
}

impl Bake {
    /// Runs every stage that is not done yet.
    pub fn run(&self) -> Result<Report, Failure> {
        let out = self.package.out()?;
        if is_same_file(&self.input, out) {
            return Err(Failure::about(out, "is the input itself: write to another file"));
        }
        let mut inputs = self.open(out)?;
        let report = self.stages(out, &mut inputs);
        if report.is_err() {
            inputs.work.remove_if_empty();
        } else if !self.keep_work {
            inputs.work.remove()?;
        }
        report
    }

    fn open(&self, out: &Path) -> Result<Inputs, Failure> {
        let mut scene = self.checkpoint.load(&self.input)?;
        scene.filter = None;
        let views = self.data.open(Split::Train, &scene.trained_with)?.views;
        let runtime = scene.clone().into_runtime().map_err(|error| Failure::at(&self.input, &error))?;
        let background = self.checkpoint.background.map_or(runtime.trained_background(), Background::Color);
        let cameras = self.data.data.join(Split::Train.file_name());
        let files = Fingerprint::of_files(&[&self.input, &cameras])?;
        let read = format!("{:?} {:?} {:?}", scene.trained_with, scene.playback, self.data.resolution);
        let fingerprint = files.and(env!("CARGO_PKG_VERSION")).and(&read);
        Ok(Inputs {
            scene,
            runtime,
            background,
            views,
            engine: self.engine.open()?,
            work: Work::beside(out)?,
            fingerprint,
        })
    }

    fn stages(&self, out: &Path, inputs: &mut Inputs) -> Result<Report, Failure> {
        let mut steps = Steps::new(STAGES);
        let pruning = self.prune(&mut steps, inputs)?;
        let mut pruned = select(&inputs.scene, &pruning.kept);
        // Stage::FineTune has its place here: it trains what is left, and everything after goes by what it trained.
        let (filter, masked) = self.mask(&mut steps, inputs, &pruned, pruning.fingerprint)?;
        let after = sliced(&pruned)?.into_owned();
        pruned.filter = Some(filter.clone());
        self.compress(&mut steps, inputs, pruned, masked, out)?;
        let compared = steps.run(Stage::Evaluate, None, || {
            let baked = self.checkpoint.load(out)?.into_runtime().map_err(|error| Failure::at(out, &error))?;
            let Inputs { engine, runtime, background, .. } = &mut *inputs;
            summary::compare(&self.data, engine, runtime, &baked, *background)
        })?;
        let times = steps.times();
        let before = sliced(&inputs.scene)?;
        steps.run(Stage::Report, None, || {
            let facts = summary::Facts {
                checkpoint: &self.input,
                data: &self.data.data,
                out,
                trained: &inputs.scene.trained_with,
                before: &before,
                after: &after,
                filter: &filter,
                choices: self.choices(&pruning, &filter),
                trials: pruning.found.tried,
                stages: times,
                compared,
            };
            let report = facts.report()?;
            let json = report.json()?;
            let files = summary::write(&json, report.html(), out)?;
            Ok(Report::new(json, summary::in_words(&report, &files)))
        })
    }

    /// Finds the filter of the Gaussians that are left.
    fn mask(
        &self,
        steps: &mut Steps,
        inputs: &mut Inputs,
        pruned: &GaussianScene,
        before: Fingerprint,
    ) -> Result<(TemporalFilter, Fingerprint), Failure> {
        const FILE: &str = "filter.bits";
        let Inputs { engine, views, work, .. } = inputs;
        let keys = match self.every {
            Some(frames) => u32::try_from(keys_every(distinct_times(views), frames)).unwrap_or(u32::MAX),
            None => self.key_frames.unwrap_or(KEYS),
        };
        let keys = keys.min(MAX_SEGMENTS + 1);
        let fingerprint = before.and(&format!("{:?} {keys}", self.filter));
        let (segments, count) = (keys - 1, pruned.len());
        let stored = work.load(FILE, fingerprint).and_then(|bytes| {
            let bits = words(&bytes);
            let whole = bits.len() == TemporalFilter::words(count) * segments as usize;
            whole.then(|| TemporalFilter::from_bits(self.filter, segments, count, bits))
        });
        let filter = steps.run(Stage::Mask, stored, || {
            let filter = filter(engine, pruned, self.filter, keys, views)?;
            interrupt::whole(|| work.store(FILE, fingerprint, &bytes(&filter.to_bits())))?;
            Ok(filter)
        })?;
        Ok((filter, fingerprint))
    }

    /// Writes the package, unless the one that is there is it.
    fn compress(
        &self,
        steps: &mut Steps,
        inputs: &Inputs,
        pruned: GaussianScene,
        before: Fingerprint,
        out: &Path,
    ) -> Result<(), Failure> {
        const FILE: &str = "package.crc32";
        let fingerprint = before.and(&format!("{:?} {:?}", self.quality, self.package.level));
        let checksum = || Some(Fingerprint::of_files(&[out]).ok()?.0.to_le_bytes().to_vec());
        let stored = inputs.work.load(FILE, fingerprint).filter(|stored| checksum().as_ref() == Some(stored));
        steps.run(Stage::Compress, stored.map(|_| ()), || {
            let runtime = pruned.into_runtime().map_err(|error| Failure::at(&self.input, &error))?;
            let (compressed, _) = compress(runtime, &CompressSettings::from(self.quality))?;
            self.package.save(&compressed)?;
            if let Some(checksum) = checksum() {
                interrupt::whole(|| inputs.work.store(FILE, fingerprint, &checksum))?;
            }
            Ok(())
        })
    }

    /// What was chosen, for the report.
    fn choices(&self, pruning: &Pruning, filter: &TemporalFilter) -> Vec<(String, String)> {
        let pair = |name: &str, value: String| (name.to_owned(), value);
        let goal = match (self.max_loss, self.keep, self.ratio) {
            (_, Some(keep), _) => format!("keep {keep}"),
            (.., Some(ratio)) => format!("remove {:.1} %", ratio * 100.0),
            (loss, ..) => format!("lose at most {} dB on held-out training views", loss.unwrap_or(pruning::MAX_LOSS)),
        };
        let quality = Quality::NAMES.iter().find(|(_, quality)| *quality == self.quality).map_or("", |(name, _)| name);
        let kind = filter_name(filter.kind);
        vec![
            pair("goal", goal),
            pair("score", pruning.found.variant.clone()),
            pair("held-out views", pruning.found.judged.clone()),
            pair("fine-tuning", "none".to_owned()),
            pair("temporal filter", format!("{kind}, {} key-frames", filter.segments + 1)),
            pair("active share", format!("{:.1} %", filter.active_share() * 100.0)),
            pair("quality", quality.to_owned()),
        ]
    }
}

/// Little-endian words as bytes.
fn bytes(words: &[u32]) -> Vec<u8> {
    words.iter().flat_map(|word| word.to_le_bytes()).collect()
}

/// The words of such bytes; a rest of fewer than four is left out.
fn words(bytes: &[u8]) -> Vec<u32> {
    bytes.chunks_exact(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect()
}
