//! `gs4d score CHECKPOINT --data DIR`: scores each Gaussian over the training views.
//!
//! In: a checkpoint, cameras and times. Out: a file of one float32 for each Gaussian, or a folder with a file for each
//! score.

use super::args::{CheckpointArgs, DataArgs, EngineArgs, Given, ScoringArgs, ValidationArgs, score_choice, values};
use super::failure::Failure;
use super::progress::Bars;
use super::report::Report;
use super::table::{Table, lines};
use crate::offline::Subject;
use crate::offline::belonging::require_belonging;
use crate::offline::files::Files;
use crate::offline::memory_check::{BY_RESOLUTION, Pictures};
use crate::offline::score::Variant;
use crate::offline::score::write_scores;
use crate::offline::search::{Candidate, Goal, ScoreChoice, ScoreSearch, SearchSummary, candidates};
use crate::scene::GaussianScene;
use serde_json::json;
use std::fs;
use std::path::PathBuf;
use std::time::Instant;

/// Score the Gaussians of a checkpoint by what they contribute to its training views.
///
/// Cameras and times are enough; only `auto` also looks at the images of the validation views.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  gs4d score chkpnt30000.pth --data data/toybox --out energy.f32 --variant energy
  gs4d score chkpnt30000.pth --data data/standup --resolution 2 --out scores --variant all
  gs4d score chkpnt30000.pth --data data/toybox --out best.f32 --ratio 0.5 --views 200

Scores are little-endian float32 in the checkpoint's order, the more the better. `auto` prunes by ours (energy, removal,
energy-removal) and by the paper's (full), draws the validation views, which are not scored, and keeps the best.")]
pub struct Score {
    #[command(flatten)]
    given: Given,
    /// The checkpoint, or a package of it in the trained form.
    #[arg(value_name = "CHECKPOINT")]
    input: PathBuf,
    /// The file of scores to write; with --variant all a folder, made if it is not there, for one file each.
    #[arg(short, long, value_name = "OUT")]
    out: PathBuf,
    /// Which score.
    #[arg(long, value_name = "SCORE", default_value = "auto", value_parser = score_choice(true))]
    variant: ScoreChoice,
    /// Share of the Gaussians that would be removed, at which `auto` compares.
    #[arg(long, value_name = "R", default_value = "0.5", value_parser = values::share)]
    ratio: f64,
    #[command(flatten)]
    data: DataArgs,
    #[command(flatten)]
    validation: ValidationArgs,
    #[command(flatten)]
    scoring: ScoringArgs,
    #[command(flatten)]
    engine: EngineArgs,
    #[command(flatten)]
    checkpoint: CheckpointArgs,
}

impl Score {
    /// Scores and writes.
    ///
    /// # Errors
    /// A checkpoint or views that cannot be used, scores that cannot be written, a failure of the engine.
    pub fn run(&self) -> Result<Report, Failure> {
        self.check_options()?;
        if self.variant != ScoreChoice::All && self.out.is_dir() {
            return Err(Failure::about(&self.out, "is a folder: name a file, or give --variant all"));
        }
        self.files().check()?;
        let progress = &mut Bars::default();
        let scene = self.checkpoint.load(&self.input)?;
        let (auto, scoring) = (self.variant == ScoreChoice::Auto, self.scoring.settings());
        let (scored, validation) = if auto {
            let splits = self.data.divide(self.validation, &scene.trained_with, progress)?;
            (splits.train, splits.validation)
        } else {
            (self.data.open(&scene.trained_with, progress)?, Vec::new())
        };
        let subject = Subject::new(&self.input, scene, self.checkpoint.background)?;
        let mut engine = self.engine.open(&self.given, &[])?;
        let start = Instant::now();
        Pictures::compared(&validation).require(engine.headless(), BY_RESOLUTION)?;
        if auto && !self.validation.trust_images {
            require_belonging(&mut engine, &subject.runtime, &validation, subject.background)?;
        }
        let (scores, views) = scoring.scores(&mut engine, &subject, &scored, progress)?;
        let seconds = start.elapsed().as_secs_f64();
        let total = subject.scene.len();
        let mut found = candidates(self.variant, &scores)?;
        let (mut table, mut summary) = (String::new(), None);
        if auto {
            let Subject { runtime, background, .. } = subject;
            let search = ScoreSearch::open(&mut engine, &validation, &runtime, background, false, progress)?;
            let whole = GaussianScene::from(runtime);
            let outcome = search.best(&mut engine, &whole, found, Goal::Remove(self.ratio), progress)?;
            let in_short = search.summary(outcome.outcomes);
            table = format!("\n{}best: {}\n", search_table(&in_short), outcome.candidate.name);
            summary = Some(in_short);
            found = vec![outcome.candidate];
        }
        let files = self.write(&found)?;
        let names: Vec<&str> = found.iter().map(|candidate| candidate.name.as_str()).collect();
        let text = lines(&[
            ("scored", format!("{total} Gaussians, {} of which contribute", scores.contributing())),
            ("views", format!("{views} in {seconds:.1} s on {}", engine.name())),
            ("scores", names.join(", ")),
            ("written", self.out.display().to_string()),
        ]) + &table;
        let json = json!({
            "in": self.input.display().to_string(),
            "files": files,
            "scores": names,
            "gaussians": total,
            "contributing": scores.contributing(),
            "views": views,
            "seconds": seconds,
            "engine": engine.name(),
            "contest": summary,
        });
        Ok(Report::new(json, text))
    }

    /// Checks that every option has an effect.
    fn check_options(&self) -> Result<(), Failure> {
        self.engine.check(&self.given, &[])?;
        self.scoring.check(&self.given, &[self.variant])?;
        match self.variant {
            ScoreChoice::Auto => Ok(()),
            ScoreChoice::All | ScoreChoice::One(_) => {
                let compared = ["--ratio", "--validation", "--trust-images"];
                self.given.none_of(&compared, "without --variant auto, which alone compares scores")
            }
        }
    }

    /// Returns the files that are read and those that may be written.
    fn files(&self) -> Files {
        let files = self.data.add_to(Files::default().reads_scene(&self.input));
        match self.variant {
            ScoreChoice::All => files.writes_folder(&self.out, Variant::ALL.map(|variant| self.path(variant.name()))),
            ScoreChoice::Auto | ScoreChoice::One(_) => files.writes(&self.out, "f32"),
        }
    }

    /// Returns the path of the file with this score.
    fn path(&self, score: &str) -> PathBuf {
        match self.variant {
            ScoreChoice::All => self.out.join(format!("{score}.f32")),
            ScoreChoice::Auto | ScoreChoice::One(_) => self.out.clone(),
        }
    }

    /// Writes one file, or a folder with one for each candidate. Returns the paths of the files.
    fn write(&self, found: &[Candidate]) -> Result<Vec<String>, Failure> {
        if self.variant == ScoreChoice::All {
            fs::create_dir_all(&self.out).map_err(|error| Failure::at(&self.out, &error))?;
        }
        let mut files = Vec::with_capacity(found.len());
        for candidate in found {
            let path = self.path(&candidate.name);
            write_scores(&path, &candidate.scores)?;
            files.push(path.display().to_string());
        }
        Ok(files)
    }
}

/// Returns a table with a row for the outcome of each candidate.
pub fn search_table(search: &SearchSummary) -> String {
    let mut table = Table::new(&["score", "kept", "PSNR", "loss"]);
    let decibels = |value: Option<f64>| value.map_or("-".to_owned(), |value| format!("{value:.3}"));
    for outcome in &search.candidates {
        let psnr = outcome.psnr.filter(|psnr| psnr.is_finite());
        let loss = psnr.zip(search.psnr_before).map(|(psnr, before)| before - psnr);
        table.row([outcome.score.clone(), outcome.kept.to_string(), decibels(psnr), decibels(loss)]);
    }
    format!("{table}dB on {} validation views, {}\n", search.views, search.compared_with)
}
