//! `gs4d prune IN -o OUT`: removes the Gaussians with the lowest scores.
//!
//! In: a scene, training views or a file of scores, the number to keep or the loss allowed. Out: a package of the
//! remaining Gaussians, in their original order.

use super::score::search_table;
use crate::cli::args::{
    CheckpointArgs, DataArgs, EngineArgs, Given, Need, PackageArgs, ScoringArgs, ValidationArgs, file_size,
    score_choice, values,
};
use crate::cli::output::colliders::note_colliders;
use crate::cli::output::failure::Failure;
use crate::cli::output::progress::Bars;
use crate::cli::output::report::Report;
use crate::cli::output::table::{Table, bytes, lines};
use crate::offline::forms::Subject;
use crate::offline::prune::{Candidate, Goal, PruneSettings, Pruned, ScoreChoice, Trial, prune_by_views};
use crate::offline::score::read_scores;
use crate::offline::store::outputs::Files;
use crate::offline::work::FileError;
use crate::scene::GaussianScene;
use serde_json::json;
use std::path::PathBuf;

/// Keep only the Gaussians that contribute most to the training views.
///
/// Scores come from the training views (--data) or from a file (--scores). Nothing is trained afterwards.
#[derive(clap::Args)]
#[command(group = clap::ArgGroup::new("goal").args(["ratio", "keep", "max_loss"]).required(true))]
#[command(after_help = "\
Examples:
  gs4d prune chkpnt30000.pth --data data/toybox --ratio 0.5 -o half.gs4d
  gs4d prune chkpnt30000.pth --scores energy.f32 --keep 45000 -o half.gs4d
  gs4d prune chkpnt30000.pth --data data/toybox --max-loss 0.1 --variant energy-removal -o small.gs4d

--max-loss searches for the smallest count whose PSNR on the validation views falls by no more than that; it needs their images. `auto`
prunes by ours (energy, removal, energy-removal) and by the paper's (full) and keeps the best. Unless the validation views are the dataset's
own split `val`, the checkpoint was trained on them, and its loss on other views may differ.")]
pub(crate) struct Prune {
    #[command(flatten)]
    given: Given,
    /// The checkpoint or package to prune.
    #[arg(value_name = "IN")]
    input: PathBuf,
    #[command(flatten)]
    package: PackageArgs,
    /// Share of the Gaussians to remove, 0 to 1.
    #[arg(long, value_name = "R", value_parser = values::share)]
    ratio: Option<f64>,
    /// Number of Gaussians to keep.
    #[arg(long, value_name = "N", value_parser = values::count(1_000_000_000))]
    keep: Option<usize>,
    /// Keep the smallest number of Gaussians that loses at most this much PSNR on the validation views, dB.
    #[arg(long, value_name = "DB", value_parser = values::not_negative)]
    max_loss: Option<f64>,
    /// Prune by the scores in this file, as `gs4d score` writes them.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["variant", "views", "volume_power", "volume_rank"])]
    scores: Option<PathBuf>,
    /// Prune by this score.
    #[arg(long, value_name = "SCORE", default_value = "auto", value_parser = score_choice(false))]
    variant: ScoreChoice,
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

impl Prune {
    /// Prunes and writes.
    ///
    /// # Errors
    /// A scene, views or scores that cannot be used, a package that cannot be written, a failure of the engine.
    pub(crate) fn run(&self) -> Result<Report, Failure> {
        self.check_options()?;
        let files = Files::default().reads_scene(&self.input).reads(&self.scores);
        let out = self.package.checked_out(self.data.add_to(files))?;
        let before = file_size(&self.input)?;
        let scene = self.checkpoint.load_to_change(&self.input)?;
        let total = scene.len();
        let Pruned { scene, outcome, search } = self.prune(scene)?;
        note_colliders(&scene, outcome.kept, total);
        let after = self.package.save(&scene)?;
        let (kept, score) = (outcome.kept, &outcome.score);
        let mut text = String::new();
        if let Some(search) = &search {
            text += &format!("{}{}\n", search_table(search), trials_table(&outcome.trials));
        }
        text += &lines(&[
            ("kept", format!("{kept} of {total} Gaussians, by {score}")),
            ("wrote", format!("{}, {} (from {})", out.display(), bytes(after), bytes(before))),
        ]);
        let json = json!({
            "in": self.input.display().to_string(),
            "out": out.display().to_string(),
            "bytes_in": before,
            "bytes_out": after,
            "gaussians_in": total,
            "gaussians": kept,
            "score": score,
            "psnr": outcome.psnr,
            "contest": search,
        });
        Ok(Report::new(json, text))
    }

    /// Checks that every option has an effect.
    fn check_options(&self) -> Result<(), Failure> {
        self.engine.check(&self.given)?;
        self.scoring.check(&self.given, &[self.variant])?;
        let (by_loss, by_file) = (self.max_loss.is_some(), self.scores.is_some());
        self.given.require(Need::PrunedViews, by_loss || !by_file)?;
        self.given.require(Need::ComparedPictures, by_loss || by_file || self.variant == ScoreChoice::Auto)
    }

    /// Returns how many Gaussians to keep.
    fn goal(&self) -> Goal {
        match (self.max_loss, self.keep, self.ratio) {
            (Some(loss), ..) => Goal::MaxLoss(loss),
            (_, Some(keep), _) => Goal::Keep(keep),
            (.., ratio) => Goal::Remove(ratio.unwrap_or_default()),
        }
    }

    fn prune(&self, scene: GaussianScene) -> Result<Pruned, Failure> {
        let goal = self.goal();
        let read = |path: &PathBuf| -> Result<Candidate, FileError> {
            let scores = read_scores(path, scene.len())?;
            Ok(Candidate { name: path.display().to_string(), scores })
        };
        let given = match (goal.count(scene.len()), self.scores.as_ref().map(read).transpose()?) {
            (Some(count), Some(candidate)) => return Ok(Pruned::unchecked(&scene, candidate, count)),
            (_, given) => given,
        };
        let progress = &mut Bars::default();
        let splits = self.data.divide(self.validation, &scene.trained_with, progress)?;
        let subject = Subject::new(&self.input, scene, self.checkpoint.background)?;
        let (scoring, trust_images) = (self.scoring.settings(), self.validation.trust_images);
        let settings = PruneSettings { goal, score: self.variant, scoring, trust_images };
        let engine = &mut self.engine.open(&self.given)?;
        Ok(prune_by_views(engine, subject, &splits, given, &settings, progress)?)
    }
}

/// Returns a table of every count that was tried; empty if there are fewer than two.
fn trials_table(trials: &[Trial]) -> String {
    if trials.len() < 2 {
        return String::new();
    }
    let mut table = Table::new(&["tried", "PSNR"]);
    for trial in trials {
        table.row([trial.count.to_string(), format!("{:.3}", trial.psnr)]);
    }
    format!("\n{table}")
}
