//! `gs4d eval SCENE --data DIR`: how close a scene is to the views of a dataset.
//!
//! In: a scene, a split with its images. Out: the metrics of every view and their means; with `--out` a picture of each:
//! reference, render, amplified difference.

use super::drawing::Drawing;
use super::engine::EngineArgs;
use super::failure::Failure;
use super::opening::{self, CheckpointArgs};
use super::report::{Report, Table, lines, progress};
use super::splits::{self, SplitArgs};
use super::{interrupt, values};
use crate::offline;
use crate::offline::dataset::Split;
use crate::offline::metrics::{
    Evaluation, EvaluationSettings, ImageMetrics, MetricSet, ViewMetrics, evaluate, side_by_side,
};
use crate::scene::TemporalFilter;
use crate::view::{Background, Picture};
use clap::ValueEnum;
use image::codecs::png::PngEncoder;
use serde_json::json;
use std::path::{Path, PathBuf};
use std::time::Instant;
use std::{fs, io};

/// Measure how close a scene is to the views of a dataset, as the original evaluates.
///
/// Renders are clamped to 0..1 and not rounded; images are composited and resampled as in training.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  gs4d eval capture.gs4d --data data/toybox
  gs4d eval chkpnt30000.pth --data data/standup --resolution 2 --out compared
  gs4d eval capture.gs4d --data data/toybox --split train --views 60 --metrics psnr,ssim --no-filter --json

PSNR is the mean of the three channels' (as the original reports it), pooled that of all values together. MS-SSIM needs
pictures of at least 176 pixels a side. FLIP is 0 for equal pictures, 1 at most, seen at 67 pixels per degree.")]
pub struct Eval {
    /// The package or checkpoint.
    #[arg(value_name = "SCENE")]
    scene: PathBuf,
    #[command(flatten)]
    data: SplitArgs,
    /// The views: train, test or val (the test views of a folder named lego are those of val, as in the original).
    #[arg(long, value_name = "SPLIT", default_value = "test", value_parser = values::one_of(&splits::SPLITS))]
    split: Split,
    /// Take only this many views, evenly spread.
    #[arg(long, value_name = "N", value_parser = values::count(1_000_000))]
    views: Option<usize>,
    /// What to measure; PSNR always is.
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_value = "psnr,ssim,ms-ssim,flip")]
    metrics: Vec<Metric>,
    /// Draw every Gaussian, whatever the temporal filter of the scene says.
    #[arg(long)]
    no_filter: bool,
    /// Folder for pictures: reference, render and amplified difference side by side.
    #[arg(short, long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// What differences are multiplied by in those pictures.
    #[arg(long, value_name = "FACTOR", default_value = "5", value_parser = values::positive)]
    gain: f32,
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

/// The metrics of a list.
fn metric_set(list: &[Metric]) -> MetricSet {
    let has = |metric| list.contains(&metric);
    MetricSet { ssim: has(Metric::Ssim), ms_ssim: has(Metric::MsSsim), flip: has(Metric::Flip) }
}

impl Eval {
    /// Draws, compares and tabulates.
    pub fn run(&self) -> Result<Report, Failure> {
        let scene = self.checkpoint.load(&self.scene)?;
        let mut scene = scene.into_runtime().map_err(|error| Failure::at(&self.scene, &error))?;
        if self.no_filter {
            scene.filter = None;
        }
        let mut dataset = self.data.open(self.split, &scene.trained_with)?;
        dataset.views = splits::share(dataset.views, self.views);
        dataset.require_images()?;
        if let Some(out) = &self.out {
            fs::create_dir_all(out).map_err(|error| Failure::at(out, &error))?;
        }
        let mut settings = EvaluationSettings::of(&scene.trained_with, metric_set(&self.metrics));
        settings.background = self.checkpoint.background.unwrap_or(settings.background);
        let background = self.checkpoint.background.map_or(scene.trained_background(), Background::Color);
        let mut engine = self.engine.open()?;
        let engine_name = engine.name();
        let mut drawing = Drawing::of(&mut engine, &scene, background)?;

        let start = Instant::now();
        let bar = progress(dataset.views.len(), "comparing");
        let seen = |view: &ViewMetrics, reference: &Picture, render: &Picture| {
            bar.inc(1);
            match &self.out {
                Some(out) => {
                    write_png(&out.join(format!("{}.png", view.name)), &side_by_side(reference, render, self.gain))
                }
                None => Ok(()),
            }
        };
        let evaluation: Evaluation = evaluate(&dataset.views, &settings, |view| drawing.draw(view), seen)?;
        bar.finish_and_clear();
        let seconds = start.elapsed().as_secs_f64();

        let split = splits::split_name(dataset.split);
        let filtered = scene.filter.as_ref().map(TemporalFilter::active_share);
        let active = filtered.map_or("none".to_owned(), |share| format!("{:.1} % active", share * 100.0));
        let mut text = format!("{}\n", table(&evaluation));
        text += &lines(&[
            ("split", format!("{split} of {}", self.data.data.display())),
            ("filter", active),
            ("time", format!("{seconds:.1} s on {engine_name}")),
        ]);
        let json = json!({
            "scene": self.scene.display().to_string(),
            "data": self.data.data.display().to_string(),
            "split": split,
            "active_share": filtered,
            "views": evaluation.views,
            "mean": evaluation.mean,
            "out": self.out.as_ref().map(|out| out.display().to_string()),
            "engine": engine_name,
            "seconds": seconds,
            "switches": opening::switches_json(&scene.trained_with, &scene.playback),
        });
        Ok(Report::new(json, text))
    }
}

/// A row for each view and one for the means; columns of metrics that no view has are left out.
fn table(evaluation: &Evaluation) -> Table {
    let likenesses = || evaluation.views.iter().map(|view| &view.likeness);
    let optional: [(&str, fn(&ImageMetrics) -> Option<f64>); 3] =
        [("SSIM", |l| l.ssim), ("MS-SSIM", |l| l.ms_ssim), ("FLIP", |l| l.flip)];
    let optional: Vec<_> = optional.into_iter().filter(|(_, of)| likenesses().any(|l| of(l).is_some())).collect();
    let heads: Vec<&str> =
        ["view", "PSNR", "pooled"].into_iter().chain(optional.iter().map(|(name, _)| *name)).collect();
    let mut table = Table::new(&heads);
    let mut row = |name: String, likeness: &ImageMetrics| {
        let fixed = [name, format!("{:.3}", likeness.psnr), format!("{:.3}", likeness.psnr_pooled)];
        let more = optional.iter().map(|(_, of)| of(likeness).map_or("-".to_owned(), |value| format!("{value:.5}")));
        table.row(fixed.into_iter().chain(more));
    };
    for view in &evaluation.views {
        row(view.name.clone(), &view.likeness);
    }
    row(format!("mean of {}", evaluation.views.len()), &evaluation.mean);
    table
}

/// Writes a picture whole or not at all.
fn write_png(path: &Path, picture: &Picture) -> Result<(), Failure> {
    let write = |file: &mut dyn io::Write| {
        picture.to_rgb8().write_with_encoder(PngEncoder::new(file)).map_err(io::Error::other)
    };
    Ok(interrupt::whole(|| offline::write_beside(path, |file| write(file)))?)
}
