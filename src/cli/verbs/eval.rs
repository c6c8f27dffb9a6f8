//! `gs4d eval SCENE --data DIR`: compares a scene with the views of a dataset.
//!
//! In: a scene, a split with its images. Out: the metrics of every view and of all views, over the background of
//! training and over a contrasting one; with `--out` a picture for each view: reference, render, amplified difference;
//! or the part of one shard of the views.

use crate::cli::args::{
    CheckpointArgs, DesignArgs, EngineArgs, Given, Need, PART, Portion, ShardArgs, SplitArgs, values,
};
use crate::cli::output::failure::Failure;
use crate::cli::output::progress::Bars;
use crate::cli::output::report::{Report, part_report, switches_json};
use crate::cli::output::table::{Table, lines};
use crate::offline::dataset::Split;
use crate::offline::dataset::splits::{SPLIT_NAMES, split_name, subset};
use crate::offline::engine::Engine;
use crate::offline::engine::Purpose;
use crate::offline::forms::convert::require_no_windows;
use crate::offline::measure::evaluation::{color_name, without_contrast};
use crate::offline::measure::evaluation_parts::{Subject, merge};
use crate::offline::measure::memory::evaluated;
use crate::offline::measure::metrics::side_by_side;
use crate::offline::measure::{
    Evaluation, ImageMetrics, MeanMetrics, MeasureError, MetricSet, ViewMetrics, contrast, evaluate_scene,
};
use crate::offline::store::outputs::Files;
use crate::offline::store::shard::Shard;
use crate::offline::work::write_png;
use crate::scene::TemporalFilter;
use crate::view::{Background, Picture};
use clap::ValueEnum;
use serde_json::json;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Measure how close a scene is to the views of a dataset, as the original evaluates.
///
/// Renders are clamped to 0..1 and not rounded. Images are resampled as in training; their gaps show the background.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  gs4d eval capture.gs4d --data data/toybox
  gs4d eval chkpnt30000.pth --data data/standup --resolution 2 --out compared
  gs4d eval capture.gs4d --data data/toybox --split train --views 60 --metrics psnr,ssim --no-filter --json
  gs4d eval capture.gs4d --data data/toybox --shard 0/2 --out 0.gs4p
  gs4d eval capture.gs4d --data data/toybox --merge 0.gs4p 1.gs4p

PSNR is the mean over the three channels (as the original reports it; channels without error are left out), pooled PSNR that of
all values together, of a view or, in the last row, of all views. The PSNR of identical views is 200 dB; they are counted, and left
out of the mean PSNR. Where images have gaps, PSNR is measured over a second background, too: white if that of training (or
--background) is dark, else black. A background hides fog of its own color, and games draw captures over scenes. MS-SSIM needs
pictures of at least 176 pixels a side. FLIP is 0 for equal pictures, 1 at most, seen at 67 pixels per degree.")]
pub(crate) struct Eval {
    #[command(flatten)]
    given: Given,
    /// The package or checkpoint.
    #[arg(value_name = "SCENE")]
    scene: PathBuf,
    #[command(flatten)]
    data: SplitArgs,
    /// The views: train, test or val (the test views of a folder named lego are those of val, as in the original).
    #[arg(long, value_name = "SPLIT", default_value = "test", value_parser = values::one_of(&SPLIT_NAMES))]
    split: Split,
    /// Take only this many views, evenly spread.
    #[arg(long, value_name = "N", value_parser = values::count(1_000_000))]
    views: Option<usize>,
    /// The metrics; PSNR is always measured.
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_value = "psnr,ssim,ms-ssim,flip")]
    metrics: Vec<Metric>,
    /// Draw every Gaussian, without the temporal filter of the scene.
    #[arg(long)]
    no_filter: bool,
    /// Folder for pictures: reference, render and amplified difference side by side; with --shard the part to write.
    #[arg(short, long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Factor on the differences in these pictures.
    #[arg(long, value_name = "FACTOR", default_value = "5", requires = "out", value_parser = values::positive)]
    gain: f32,
    #[command(flatten)]
    design: DesignArgs,
    #[command(flatten)]
    shards: ShardArgs,
    #[command(flatten)]
    engine: EngineArgs,
    #[command(flatten)]
    checkpoint: CheckpointArgs,
}

/// A metric by name.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Metric {
    /// Peak signal-to-noise ratio.
    Psnr,
    /// Structural similarity.
    Ssim,
    /// Structural similarity at five scales.
    MsSsim,
    /// FLIP.
    Flip,
}

/// Returns the set of metrics in a list.
fn metric_set(list: &[Metric]) -> MetricSet {
    let has = |metric| list.contains(&metric);
    MetricSet { ssim: has(Metric::Ssim), ms_ssim: has(Metric::MsSsim), flip: has(Metric::Flip) }
}

impl Eval {
    /// Draws, compares and tabulates.
    ///
    /// # Errors
    /// A scene or views that cannot be used, missing images, pictures that cannot be written, a failure of the engine.
    pub(crate) fn run(&self) -> Result<Report, Failure> {
        self.engine.check(&self.given)?;
        self.shards.check(&self.given)?;
        [Need::Playback, Need::UpAxis].into_iter().try_for_each(|need| self.given.require(need, false))?;
        let files = self.data.add_to(Files::default().reads_scene(&self.scene));
        let pictures = match self.shards.portion() {
            Portion::All => self.out.as_deref(),
            Portion::Shard(_) => {
                files.clone().writes(self.shards.out(self.out.as_deref())?, PART).check()?;
                None
            }
            Portion::Parts(_) => {
                self.given.require(Need::WrittenPictures, false)?;
                None
            }
        };
        if let Some(out) = pictures {
            files.clone().writes_folder(out, []).check()?;
        }
        let progress = &mut Bars::default();
        let scene = self.checkpoint.load(&self.scene)?;
        let mut scene = scene.into_runtime().map_err(|error| Failure::at(&self.scene, &error))?;
        self.given.require(Need::Filter, scene.filter.is_some())?;
        if self.no_filter {
            let no_windows = require_no_windows(scene.filter.as_ref(), "--no-filter");
            no_windows.map_err(|error| Failure::at(&self.scene, &error))?;
            scene.filter = None;
        }
        let mut dataset = self.data.open(self.split, &scene.trained_with, progress)?;
        dataset.views = subset(dataset.views, self.views);
        dataset.require_images()?;
        let metrics = metric_set(&self.metrics);
        let mut engine = self.engine.open(&self.given)?;
        evaluated(&dataset.views, metrics, pictures.is_some()).require(engine.headless(), Purpose::Dataset)?;
        if let Some(out) = pictures {
            let pictures = dataset.views.iter().map(|view| picture_of(out, &view.name));
            files.writes_folder(out, pictures).check()?;
            fs::create_dir_all(out).map_err(|error| Failure::at(out, &error))?;
        }
        let background = self.checkpoint.background.map_or(scene.trained_background(), Background::Color);
        if let Engine::Gpu(headless) = &mut engine {
            headless.set_design(self.design.renderer);
        }

        let start = Instant::now();
        let seen = |view: &ViewMetrics, reference: &Picture, render: &Picture| -> Result<(), MeasureError> {
            let Some(out) = pictures else { return Ok(()) };
            let (path, picture) = (picture_of(out, &view.name), side_by_side(reference, render, self.gain));
            Ok(write_png(&path, &picture)?)
        };
        let views = &dataset.views;
        let subject = Subject { input: &self.scene, scene: &scene, views, background, metrics };
        let evaluation = match self.shards.portion() {
            Portion::All => {
                let mut evaluation = evaluate_scene(&mut engine, &scene, views, background, metrics, progress, seen)?;
                evaluation.contrast = contrast(&mut engine, &scene, views, background, &evaluation, progress)?;
                evaluation
            }
            Portion::Shard(shard) => {
                let out = self.shards.out(self.out.as_deref())?;
                let written =
                    subject.write_part(out, &subject.label(&engine, shard, progress)?, &mut engine, progress)?;
                let work = written.then(|| (start.elapsed().as_secs_f64(), engine.name()));
                return Ok(part_report(shard, out, work));
            }
            Portion::Parts(paths) => merge(paths, &subject.label(&engine, Shard::WHOLE, progress)?, views.len())?,
        };
        let seconds = start.elapsed().as_secs_f64();

        let (split, engine) = (split_name(dataset.split), engine.name());
        let filtered = scene.filter.as_ref().map(TemporalFilter::active_share);
        let active = filtered.map_or("none".to_owned(), |share| format!("{:.1} % active", share * 100.0));
        let mut text = format!("{}\n", table(&evaluation));
        let mut pairs = backgrounds(&evaluation);
        pairs.extend([
            ("split", format!("{split} of {}", self.data.data.display())),
            ("filter", active),
            ("time", format!("{seconds:.1} s on {engine}")),
        ]);
        text += &lines(&pairs);
        let json = json!({
            "scene": self.scene.display().to_string(),
            "data": self.data.data.display().to_string(),
            "split": split,
            "active_share": filtered,
            "views": evaluation.views,
            "mean": evaluation.mean,
            "background": evaluation.background,
            "has_gaps": evaluation.has_gaps,
            "contrast": evaluation.contrast,
            "out": pictures.map(|out| out.display().to_string()),
            "engine": engine,
            "seconds": seconds,
            "switches": switches_json(&scene.trained_with, &scene.playback),
        });
        Ok(Report::new(json, text))
    }
}

/// Returns the path of the picture of a view.
fn picture_of(out: &Path, view: &str) -> PathBuf {
    out.join(format!("{view}.png"))
}

/// Returns the figures over both backgrounds, or the reason for a single background, and a sentence about identical
/// views, as names and values.
fn backgrounds(evaluation: &Evaluation) -> Vec<(&'static str, String)> {
    let Evaluation { background, mean, contrast, .. } = evaluation;
    let over = |color, mean: &MeanMetrics| {
        format!("PSNR {:.3} dB, pooled {:.3} dB over {}", mean.psnr, mean.psnr_pooled, color_name(color))
    };
    let mut pairs = match contrast {
        Some(contrast) => {
            vec![("background", over(*background, mean)), ("contrast", over(contrast.background, &contrast.mean))]
        }
        None => vec![("background", without_contrast(evaluation).to_owned())],
    };
    pairs.extend(mean.identical_in_words("views").map(|words| ("identical", words)));
    pairs
}

/// Returns a table with a row for each view and one for all views, without columns for metrics that no view has.
fn table(evaluation: &Evaluation) -> Table {
    let all = || evaluation.views.iter().map(|view| &view.metrics);
    let optional: [(&str, fn(&ImageMetrics) -> Option<f64>, fn(&MeanMetrics) -> Option<f64>); 3] =
        [("SSIM", |m| m.ssim, |m| m.ssim), ("MS-SSIM", |m| m.ms_ssim, |m| m.ms_ssim), ("FLIP", |m| m.flip, |m| m.flip)];
    let optional: Vec<_> = optional.into_iter().filter(|(_, of, _)| all().any(|m| of(m).is_some())).collect();
    let heads: Vec<&str> =
        ["view", "PSNR", "pooled"].into_iter().chain(optional.iter().map(|(name, ..)| *name)).collect();
    let mut table = Table::new(&heads);
    let number = |value: Option<f64>| value.map_or("-".to_owned(), |value| format!("{value:.5}"));
    let mut row = |name: String, psnr: String, pooled: f64, more: Vec<Option<f64>>| {
        table.row([name, psnr, format!("{pooled:.3}")].into_iter().chain(more.into_iter().map(number)));
    };
    for ViewMetrics { name, metrics, .. } in &evaluation.views {
        let psnr = if metrics.identical { "identical".to_owned() } else { format!("{:.3}", metrics.psnr) };
        row(name.clone(), psnr, metrics.psnr_pooled, optional.iter().map(|(_, of, _)| of(metrics)).collect());
    }
    let mean = &evaluation.mean;
    let more = optional.iter().map(|(_, _, of)| of(mean)).collect();
    row(format!("mean of {}", mean.count), format!("{:.3}", mean.psnr), mean.psnr_pooled, more);
    table
}
