//! `gs4d ablate CHECKPOINT --data DIR`: what every score, prune ratio and temporal filter costs, in one table.
//!
//! In: a checkpoint, its training views, its test views with images. Out: one row for the whole scene, one for each filter, one for
//! each score at each ratio; nothing is trained.

use super::drawing::Drawing;
use super::engine::{Engine, EngineArgs};
use super::failure::Failure;
use super::filters::{FILTERS, filter, filter_name};
use super::opening::CheckpointArgs;
use super::report::{Report, Table, lines, progress};
use super::splits::{self, SPLITS, SplitArgs};
use super::training::{self, Choice, ScoringArgs};
use super::{interrupt, values};
use crate::offline;
use crate::offline::dataset::{Dataset, Split};
use crate::offline::metrics::{EvaluationSettings, ImageMetrics, MetricSet, ViewMetrics, evaluate};
use crate::offline::prune::{highest, kept_count, select};
use crate::offline::score::variant::Variant;
use crate::scene::{FilterKind, GaussianScene, MAX_SEGMENTS, RuntimeScene, TemporalFilter};
use crate::view::{Background, Picture};
use serde::Serialize;
use serde_json::json;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Tabulate what every score, prune ratio and temporal filter costs on the test views, without any training.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  gs4d ablate chkpnt30000.pth --data data/toybox
  gs4d ablate chkpnt30000.pth --data data/standup --resolution 2 --variants auto --ratios 0.5,0.85
  gs4d ablate chkpnt30000.pth --data data/toybox --filters key-frame --key-frames 6,11,16 --ratios 0.8 --csv table.csv

Every row is measured on its own: filters on the whole scene, ratios without a filter. The active share is the mean over the
segments of a filter.")]
pub struct Ablate {
    /// The checkpoint, or a package of it in the trained form.
    #[arg(value_name = "CHECKPOINT")]
    input: PathBuf,
    #[command(flatten)]
    data: SplitArgs,
    /// The views that rows are measured on.
    #[arg(long, value_name = "SPLIT", default_value = "test", value_parser = values::one_of(&SPLITS))]
    split: Split,
    /// Measure on this many of them, evenly spread [default: all].
    #[arg(long, value_name = "N", value_parser = values::count(1_000_000))]
    measured_views: Option<usize>,
    /// Shares of the Gaussians to remove.
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_value = "0.2,0.5,0.8", value_parser = values::share)]
    ratios: Vec<f64>,
    /// Scores to prune by: names, auto (ours and the paper's), or all.
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_value = "all", value_parser = training::choice(true))]
    variants: Vec<Choice>,
    /// Kinds of temporal filter.
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_value = "support,interval,key-frame", value_parser = values::one_of(&FILTERS))]
    filters: Vec<FilterKind>,
    /// Numbers of key-frames, each tried with every kind of filter.
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_value = "11", value_parser = clap::value_parser!(u32).range(2..=i64::from(MAX_SEGMENTS) + 1))]
    key_frames: Vec<u32>,
    /// Write the table as comma-separated values, too.
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    #[command(flatten)]
    scoring: ScoringArgs,
    #[command(flatten)]
    engine: EngineArgs,
    #[command(flatten)]
    checkpoint: CheckpointArgs,
}

/// One row of the table.
#[derive(Serialize)]
struct Row {
    row: String,
    #[serde(flatten)]
    likeness: ImageMetrics,
    gaussians: usize,
    active_share: Option<f64>,
}

/// What rows are measured with.
struct Bench {
    engine: Engine,
    dataset: Dataset,
    settings: EvaluationSettings,
    background: Background,
    rows: Vec<Row>,
}

impl Ablate {
    /// Measures every row.
    pub fn run(&self) -> Result<Report, Failure> {
        let start = Instant::now();
        let scene = self.checkpoint.load(&self.input)?;
        let count = scene.len();
        let train = self.data.open(Split::Train, &scene.trained_with)?.views;
        let mut dataset = self.data.open(self.split, &scene.trained_with)?;
        dataset.views = splits::share(dataset.views, self.measured_views);
        dataset.require_images()?;
        let runtime = GaussianScene { filter: None, ..scene.clone() }.into_runtime();
        let mut runtime = runtime.map_err(|error| Failure::at(&self.input, &error))?;
        let mut settings = EvaluationSettings::of(&scene.trained_with, MetricSet::SSIM);
        settings.background = self.checkpoint.background.unwrap_or(settings.background);
        let background = self.checkpoint.background.map_or(runtime.trained_background(), Background::Color);
        let mut bench = Bench { engine: self.engine.open()?, dataset, settings, background, rows: Vec::new() };
        let bar = progress(1 + self.filters.len() * self.key_frames.len(), "filters");
        bench.measure("vanilla".to_owned(), &runtime, count)?;
        for &kind in &self.filters {
            for &keys in &self.key_frames {
                bar.inc(1);
                runtime.filter = Some(filter(&mut bench.engine, &scene, kind, keys, &train)?);
                let name = format!("filter only, {}, {keys} key-frames", filter_name(kind));
                bench.measure(name, &runtime, count)?;
            }
        }
        bar.finish_and_clear();
        runtime.filter = None;
        if !(self.ratios.is_empty() || self.variants.is_empty()) {
            let (scored, _) = self.scoring.share(train, false);
            let scores = self.scoring.scores(&mut bench.engine, &scene, &runtime, background, &scored)?;
            drop(scene);
            let variants = self.variants(scores.variants().collect());
            let scores = variants.into_iter().map(|variant| Ok::<_, Failure>((variant, scores.of(variant)?)));
            let scores = scores.collect::<Result<Vec<_>, _>>()?;
            self.prune(&mut bench, &runtime.into(), &scores)?;
        }
        self.report(&bench, start.elapsed().as_secs_f64())
    }

    /// The scores asked for, each once; `all` and `auto` leave out what this scene does not tell.
    fn variants(&self, told: Vec<Variant>) -> Vec<Variant> {
        let mut variants = Vec::new();
        for choice in &self.variants {
            let some: Vec<Variant> = match choice {
                Choice::All => told.clone(),
                Choice::Auto => told.iter().copied().filter(|variant| Variant::AUTO.contains(variant)).collect(),
                Choice::One(variant) => vec![*variant],
            };
            let new: Vec<Variant> = some.into_iter().filter(|variant| !variants.contains(variant)).collect();
            variants.extend(new);
        }
        variants
    }

    fn prune(&self, bench: &mut Bench, scene: &GaussianScene, scores: &[(Variant, Vec<f32>)]) -> Result<(), Failure> {
        let bar = progress(self.ratios.len() * scores.len(), "pruned");
        for &ratio in &self.ratios {
            for (variant, scores) in scores {
                bar.inc(1);
                let kept = highest(scores, kept_count(scene.len(), ratio));
                // Tenths of a percent are shown where there are any.
                let percent = (ratio * 1000.0).round() / 10.0;
                let pruned = select(scene, &kept).into_runtime()?;
                bench.measure(format!("prune {percent}% {variant}"), &pruned, kept.len())?;
            }
        }
        bar.finish_and_clear();
        Ok(())
    }

    fn report(&self, bench: &Bench, seconds: f64) -> Result<Report, Failure> {
        let mut table = Table::new(&HEADS);
        bench.rows.iter().for_each(|row| table.row(row.cells("-")));
        if let Some(path) = &self.csv {
            write_csv(path, &bench.rows)?;
        }
        let (views, split) = (bench.dataset.views.len(), splits::split_name(bench.dataset.split));
        let text = format!("{table}\n")
            + &lines(&[
                ("views", format!("{views} of the {split} split of {}", self.data.data.display())),
                ("time", format!("{seconds:.1} s on {}", bench.engine.name())),
            ]);
        let json = json!({
            "in": self.input.display().to_string(),
            "data": self.data.data.display().to_string(),
            "split": split,
            "views": views,
            "rows": bench.rows,
            "csv": self.csv.as_ref().map(|path| path.display().to_string()),
            "engine": bench.engine.name(),
            "seconds": seconds,
        });
        Ok(Report::new(json, text))
    }
}

impl Bench {
    /// Adds a row: a scene of so many Gaussians.
    fn measure(&mut self, row: String, scene: &RuntimeScene, gaussians: usize) -> Result<(), Failure> {
        let active_share = scene.filter.as_ref().map(TemporalFilter::active_share);
        let bar = progress(self.dataset.views.len(), "comparing");
        let mut drawing = Drawing::of(&mut self.engine, scene, self.background)?;
        let seen = |_: &ViewMetrics, _: &Picture, _: &Picture| {
            bar.inc(1);
            Ok::<_, Failure>(())
        };
        let evaluation = evaluate(&self.dataset.views, &self.settings, |view| drawing.draw(view), seen)?;
        bar.finish_and_clear();
        self.rows.push(Row { row, likeness: evaluation.mean, gaussians, active_share });
        Ok(())
    }
}

const HEADS: [&str; 6] = ["row", "PSNR", "pooled", "SSIM", "Gaussians", "active share"];

impl Row {
    fn cells(&self, absent: &str) -> [String; 6] {
        let ImageMetrics { psnr, psnr_pooled, ssim, .. } = self.likeness;
        let optional =
            |value: Option<f64>, digits: usize| value.map_or(absent.to_owned(), |value| format!("{value:.digits$}"));
        [
            self.row.clone(),
            format!("{psnr:.3}"),
            format!("{psnr_pooled:.3}"),
            optional(ssim, 4),
            self.gaussians.to_string(),
            optional(self.active_share, 3),
        ]
    }
}

fn write_csv(path: &Path, rows: &[Row]) -> Result<(), Failure> {
    let mut text = "row,psnr,psnr_pooled,ssim,gaussians,active_share\n".to_owned();
    for row in rows {
        // Names hold commas, but no quotes.
        let [name, values @ ..] = row.cells("");
        text += &format!("\"{name}\",{}\n", values.join(","));
    }
    Ok(interrupt::whole(|| offline::write_beside(path, |file| file.write_all(text.as_bytes())))?)
}
