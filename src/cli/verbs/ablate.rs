//! `gs4d ablate CHECKPOINT --data DIR`: the cost of every score, prune ratio and temporal filter, in one table.
//!
//! In: a checkpoint, its training views, validation views with images. Out: one row for the whole scene, one for each
//! filter, one for each score at each ratio; nothing is trained.

use crate::cli::args::{
    CheckpointArgs, EngineArgs, Given, Need, ScoringArgs, SplitArgs, ValidationArgs, score_choice, values,
};
use crate::cli::output::failure::Failure;
use crate::cli::output::progress::Bars;
use crate::cli::output::report::Report;
use crate::cli::output::table::{Table, lines};
use crate::offline::dataset::splits::{Splits, subset};
use crate::offline::dataset::{Split, require_images};
use crate::offline::filter::temporal_filter::FILTER_NAMES;
use crate::offline::forms::Subject;
use crate::offline::forms::convert::require_no_windows;
use crate::offline::measure::MeanMetrics;
use crate::offline::measure::belonging::require_belonging;
use crate::offline::prune::{AblationRow, AblationSettings, PruneError, ScoreChoice, ValidatedChoice, ablate};
use crate::offline::store::outputs::Files;
use crate::offline::work::write_beside;
use crate::scene::{FilterKind, MAX_SEGMENTS};
use serde_json::json;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Tabulate what every score, prune ratio and temporal filter costs on the validation views, without any training.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  gs4d ablate chkpnt30000.pth --data data/toybox
  gs4d ablate chkpnt30000.pth --data data/standup --resolution 2 --variants auto --ratios 0.5,0.85
  gs4d ablate chkpnt30000.pth --data data/toybox --filters key-frame --key-frames 6,11,16 --ratios 0.8 --csv table.csv

Every row is measured on its own: filters on the whole scene, ratios without a filter. The active share is the mean over the
segments of a filter.")]
pub(crate) struct Ablate {
    #[command(flatten)]
    given: Given,
    /// The checkpoint, or a package of it in the trained form.
    #[arg(value_name = "CHECKPOINT")]
    input: PathBuf,
    #[command(flatten)]
    data: SplitArgs,
    /// The views that rows are measured on. A choice that is made on the test views must not be evaluated on them
    /// afterwards.
    #[arg(long, value_name = "SPLIT", default_value = "validation", value_parser = values::one_of(&MEASURED))]
    split: Measured,
    #[command(flatten)]
    validation: ValidationArgs,
    /// Number of these views to measure on, evenly spread [default: all].
    #[arg(long, value_name = "N", value_parser = values::count(1_000_000))]
    measured_views: Option<usize>,
    /// Shares of the Gaussians to remove.
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_value = "0.2,0.5,0.8", value_parser = values::share)]
    ratios: Vec<f64>,
    /// Scores to prune by: names, auto (ours and the paper's), or all.
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_value = "all", value_parser = score_choice(true))]
    variants: Vec<ScoreChoice>,
    /// Kinds of temporal filter.
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_value = "support,interval,key-frame", value_parser = values::one_of(&FILTER_NAMES))]
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

impl Ablate {
    /// Measures every row.
    ///
    /// # Errors
    /// A checkpoint or views that cannot be used, images that are missing or show something else, a table that cannot
    /// be written, a failure of the engine.
    pub(crate) fn run(&self) -> Result<Report, Failure> {
        self.engine.check(&self.given)?;
        self.scoring.check(&self.given, &self.variants)?;
        self.given.require(Need::DividedViews, self.split == Measured::Validation)?;
        [Need::Playback, Need::UpAxis].into_iter().try_for_each(|need| self.given.require(need, false))?;
        if let Some(csv) = &self.csv {
            self.data.add_to(Files::default().reads_scene(&self.input)).writes(csv, "csv").check()?;
        }
        let progress = &mut Bars::default();
        let start = Instant::now();
        let mut scene = self.checkpoint.load(&self.input)?;
        let no_windows = require_no_windows(scene.filter.as_ref(), "a comparison of filters");
        no_windows.map_err(|error| Failure::at(&self.input, &error))?;
        scene.filter = None;
        let (train, measured) = match self.split {
            Measured::Validation => {
                let Splits { train, validation, .. } =
                    self.data.divide(self.validation, &scene.trained_with, progress)?;
                if validation.is_empty() {
                    return Err(PruneError::NoValidation { choice: ValidatedChoice::Rows }.into());
                }
                (train, validation)
            }
            Measured::Split(split) => (
                self.data.open(Split::Train, &scene.trained_with, progress)?.views,
                self.data.open(split, &scene.trained_with, progress)?.views,
            ),
        };
        let measured = subset(measured, self.measured_views);
        require_images(&measured)?;
        let subject = Subject::new(&self.input, scene, self.checkpoint.background)?;
        let mut engine = self.engine.open(&self.given)?;
        if !self.validation.trust_images {
            require_belonging(&mut engine, &subject.runtime, &measured, subject.background)?;
        }
        let rows = ablate(&mut engine, subject, train, &measured, &self.settings(), progress)?;
        let seconds = start.elapsed().as_secs_f64();

        let mut table = Table::new(&HEADS);
        rows.iter().for_each(|row| table.row(cells(row, "-")));
        if let Some(path) = &self.csv {
            write_csv(path, &rows)?;
        }
        let (views, split) = (measured.len(), self.split.name());
        let text = format!("{table}\n")
            + &lines(&[
                ("views", format!("{views} of the {split} views of {}", self.data.data.display())),
                ("time", format!("{seconds:.1} s on {}", engine.name())),
            ]);
        let json = json!({
            "in": self.input.display().to_string(),
            "data": self.data.data.display().to_string(),
            "split": split,
            "views": views,
            "rows": rows,
            "csv": self.csv.as_ref().map(|path| path.display().to_string()),
            "engine": engine.name(),
            "seconds": seconds,
        });
        Ok(Report::new(json, text))
    }

    fn settings(&self) -> AblationSettings {
        AblationSettings {
            filters: self.filters.clone(),
            key_frames: self.key_frames.clone(),
            ratios: self.ratios.clone(),
            scores: self.variants.clone(),
            scoring: self.scoring.settings(),
        }
    }
}

/// The views that rows are measured on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Measured {
    /// The validation views, which are not scored.
    Validation,
    /// All views of a split.
    Split(Split),
}

const MEASURED: [(&str, Measured); 4] = [
    ("validation", Measured::Validation),
    ("train", Measured::Split(Split::Train)),
    ("test", Measured::Split(Split::Test)),
    ("val", Measured::Split(Split::Val)),
];

impl Measured {
    fn name(self) -> &'static str {
        MEASURED.iter().find(|(_, measured)| *measured == self).map_or("", |(name, _)| name)
    }
}

const HEADS: [&str; 6] = ["row", "PSNR", "pooled", "SSIM", "Gaussians", "active share"];

fn cells(row: &AblationRow, absent: &str) -> [String; 6] {
    let MeanMetrics { psnr, psnr_pooled, ssim, .. } = row.metrics;
    let optional =
        |value: Option<f64>, digits: usize| value.map_or(absent.to_owned(), |value| format!("{value:.digits$}"));
    [
        row.row.clone(),
        format!("{psnr:.3}"),
        format!("{psnr_pooled:.3}"),
        optional(ssim, 4),
        row.gaussians.to_string(),
        optional(row.active_share, 3),
    ]
}

fn write_csv(path: &Path, rows: &[AblationRow]) -> Result<(), Failure> {
    let mut text = "row,psnr,psnr_pooled,ssim,gaussians,active_share\n".to_owned();
    for row in rows {
        // Names hold commas, but no quotes.
        let [name, values @ ..] = cells(row, "");
        text += &format!("\"{name}\",{}\n", values.join(","));
    }
    Ok(write_beside(path, |file| file.write_all(text.as_bytes()))?)
}
