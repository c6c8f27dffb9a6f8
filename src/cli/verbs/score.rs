//! `gs4d score CHECKPOINT --data DIR`: scores each Gaussian over the training views.
//!
//! In: a checkpoint, cameras and times; or the parts of all shards. Out: a file of one float32 for each Gaussian, or a
//! folder with a file for each score; or the part of one shard.

use crate::cli::args::{
    CheckpointArgs, DataArgs, EngineArgs, Given, Need, PART, Portion, ScoringArgs, ShardArgs, ValidationArgs,
    score_choice, values,
};
use crate::cli::output::failure::Failure;
use crate::cli::output::progress::Bars;
use crate::cli::output::report::{Report, part_report};
use crate::cli::output::table::{Table, lines};
use crate::offline::engine::Engine;
use crate::offline::engine::Purpose;
use crate::offline::engine::memory::Pictures;
use crate::offline::forms::Subject;
use crate::offline::measure::belonging::require_belonging;
use crate::offline::prune::search::{ScoreSearch, candidates, no_validation};
use crate::offline::prune::{Candidate, Goal, ScoreChoice, SearchSummary};
use crate::offline::score::{Scores, Variant, parts, write_scores};
use crate::offline::store::outputs::Files;
use crate::offline::store::shard::Shard;
use crate::scene::GaussianScene;
use serde_json::json;
use std::fs;
use std::path::PathBuf;
use std::time::Instant;

/// Score the Gaussians of a checkpoint by what they contribute to its training views.
///
/// Cameras and times are enough; only `auto` also reads the images of the validation views.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  gs4d score chkpnt30000.pth --data data/toybox --out energy.f32 --variant energy
  gs4d score chkpnt30000.pth --data data/standup --resolution 2 --out scores --variant all
  gs4d score chkpnt30000.pth --data data/toybox --out best.f32 --ratio 0.5 --views 200
  gs4d score chkpnt30000.pth --data data/toybox --variant energy --shard 0/4 --out 0.gs4p
  gs4d score --variant energy --merge 0.gs4p 1.gs4p 2.gs4p 3.gs4p --out energy.f32

Scores are little-endian float32 in the checkpoint's order; higher is better. `auto` prunes by ours (energy, removal,
energy-removal) and by the paper's (full), draws the validation views, which are not scored, and keeps the best.")]
pub(crate) struct Score {
    #[command(flatten)]
    given: Given,
    /// The checkpoint, or a package of it in the trained form.
    #[arg(value_name = "CHECKPOINT", required_unless_present = "merge")]
    input: Option<PathBuf>,
    /// The file of scores to write; with --variant all a folder for one file each, which is created if it does not
    /// exist; with --shard the part.
    #[arg(short, long, value_name = "OUT")]
    out: PathBuf,
    /// The score.
    #[arg(long, value_name = "SCORE", default_value = "auto", value_parser = score_choice(true))]
    variant: ScoreChoice,
    /// Share of the Gaussians that `auto` removes to compare scores.
    #[arg(long, value_name = "R", default_value = "0.5", value_parser = values::share)]
    ratio: f64,
    #[command(flatten)]
    data: DataArgs,
    #[command(flatten)]
    validation: ValidationArgs,
    #[command(flatten)]
    shards: ShardArgs,
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
    pub(crate) fn run(&self) -> Result<Report, Failure> {
        self.check_options()?;
        if self.variant != ScoreChoice::All && self.out.is_dir() {
            return Err(Failure::about(&self.out, "is a folder: name a file, or give --variant all"));
        }
        self.files().check()?;
        let Some(input) = &self.input else {
            return self.report(&parts::merge(self.shards.parts(), None)?, None, None);
        };
        let progress = &mut Bars::default();
        let scene = self.checkpoint.load(input)?;
        let (auto, scoring) = (self.variant == ScoreChoice::Auto, self.scoring.settings());
        let (scored, validation) = if auto {
            let splits = self.data.divide(self.validation, &scene.trained_with, progress)?;
            (splits.train, splits.validation)
        } else {
            (self.data.open(&scene.trained_with, progress)?, Vec::new())
        };
        let subject = Subject::new(input, scene, self.checkpoint.background)?;
        let mut engine = self.engine.open(&self.given)?;
        let label = |engine: &Engine, shard| parts::label(input, &subject, &scored, &scoring, engine, shard);
        let start = Instant::now();
        if let Portion::Shard(shard) = self.shards.portion() {
            let label = label(&engine, shard)?;
            let written = parts::write(&self.out, &label, &scoring, &mut engine, &subject, &scored, progress)?;
            let work = written.then(|| (start.elapsed().as_secs_f64(), engine.name()));
            return Ok(part_report(shard, &self.out, work));
        }
        if auto && validation.is_empty() {
            return Err(no_validation(false).into());
        }
        Pictures::compared(&validation).require(engine.headless(), Purpose::Dataset)?;
        if auto && !self.validation.trust_images {
            require_belonging(&mut engine, &subject.runtime, &validation, subject.background)?;
        }
        let scores = match self.shards.portion() {
            Portion::Parts(paths) => parts::merge(paths, Some(&label(&engine, Shard::WHOLE)?))?,
            Portion::All | Portion::Shard(_) => scoring.scores(&mut engine, &subject, &scored, progress)?,
        };
        let seconds = start.elapsed().as_secs_f64();
        let mut best = None;
        if auto {
            let Subject { runtime, background, .. } = subject;
            let search = ScoreSearch::open(&mut engine, &validation, &runtime, background, false, progress)?;
            let (whole, found) = (GaussianScene::from(runtime), candidates(self.variant, &scores)?);
            let outcome = search.best(&mut engine, &whole, found, Goal::Remove(self.ratio), progress)?;
            best = Some((outcome.candidate, search.summary(outcome.outcomes)));
        }
        self.report(&scores, best, Some((seconds, engine.name())))
    }

    /// Writes the scores, of the best candidate alone if there is one. `work` is the number of seconds that scoring
    /// took, and the name of the engine.
    fn report(
        &self,
        scores: &Scores,
        best: Option<(Candidate, SearchSummary)>,
        work: Option<(f64, String)>,
    ) -> Result<Report, Failure> {
        let (found, table, summary) = match best {
            Some((best, summary)) => {
                let table = format!("\n{}best: {}\n", search_table(&summary), best.name);
                (vec![best], table, Some(summary))
            }
            None => (candidates(self.variant, scores)?, String::new(), None),
        };
        let files = self.write(&found)?;
        let names: Vec<&str> = found.iter().map(|candidate| candidate.name.as_str()).collect();
        let (total, views) = (scores.len(), scores.views());
        let took = work.as_ref().map_or(String::new(), |(seconds, engine)| format!(" in {seconds:.1} s on {engine}"));
        let text = lines(&[
            ("scored", format!("{total} Gaussians, {} of which contribute", scores.contributing())),
            ("views", format!("{views}{took}")),
            ("scores", names.join(", ")),
            ("written", self.out.display().to_string()),
        ]) + &table;
        let (seconds, engine) = work.unzip();
        let json = json!({
            "in": self.input.as_ref().map(|input| input.display().to_string()),
            "files": files,
            "scores": names,
            "gaussians": total,
            "contributing": scores.contributing(),
            "views": views,
            "seconds": seconds,
            "engine": engine,
            "contest": summary,
        });
        Ok(Report::new(json, text))
    }

    /// Checks that every option has an effect.
    fn check_options(&self) -> Result<(), Failure> {
        self.engine.check(&self.given)?;
        self.scoring.check(&self.given, &[self.variant])?;
        self.shards.check(&self.given)?;
        if self.input.is_none() && self.variant == ScoreChoice::Auto {
            let message =
                "auto draws views to compare scores: give the CHECKPOINT and --data, too, or another --variant";
            return Err(Failure::new(message));
        }
        self.given.require(Need::Work, self.input.is_some())?;
        self.given.require(Need::ComparedScores, self.variant == ScoreChoice::Auto)?;
        [Need::Playback, Need::UpAxis].into_iter().try_for_each(|need| self.given.require(need, false))
    }

    /// Returns the files that are read and those that may be written.
    fn files(&self) -> Files {
        let files = self.input.iter().fold(Files::default(), |files, input| files.reads_scene(input));
        let files = self.data.add_to(files).reads(self.shards.parts());
        if let Portion::Shard(_) = self.shards.portion() {
            return files.writes(&self.out, PART);
        }
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
pub(crate) fn search_table(search: &SearchSummary) -> String {
    let mut table = Table::new(&["score", "kept", "PSNR", "loss"]);
    let decibels = |value: Option<f64>| value.map_or("-".to_owned(), |value| format!("{value:.3}"));
    for outcome in &search.candidates {
        let psnr = outcome.psnr.filter(|psnr| psnr.is_finite());
        let loss = psnr.zip(search.psnr_before).map(|(psnr, before)| before - psnr);
        table.row([outcome.score.clone(), outcome.kept.to_string(), decibels(psnr), decibels(loss)]);
    }
    format!("{table}dB on {} validation views, {}\n", search.views, search.compared_with)
}
