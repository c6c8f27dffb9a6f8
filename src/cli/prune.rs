//! `gs4d prune IN -o OUT`: the scene without the Gaussians that matter least.
//!
//! In: a scene, training views or a file of scores, how many to keep or how much may be lost. Out: a package of the others, in their
//! old order.

use super::contest::{Candidate, Goal, Outcome, ScoreSearch, candidates};
use super::engine::EngineArgs;
use super::failure::Failure;
use super::opening::{self, CheckpointArgs, PackageArgs};
use super::report::{Report, Table, bytes, lines};
use super::training::{self, Choice, DataArgs, ScoringArgs, read_scores};
use super::values;
use crate::offline::prune::{highest, kept_count, select};
use crate::scene::GaussianScene;
use crate::view::Background;
use serde_json::{Value, json};
use std::path::PathBuf;

/// Keep only the Gaussians that matter most to the training views.
///
/// Scores come from the training views (--data) or from a file (--scores). Nothing is trained afterwards.
#[derive(clap::Args)]
#[command(group = clap::ArgGroup::new("goal").args(["ratio", "keep", "max_loss"]).required(true))]
#[command(after_help = "\
Examples:
  gs4d prune chkpnt30000.pth --data data/toybox --ratio 0.5 -o half.gs4d
  gs4d prune chkpnt30000.pth --scores energy.f32 --keep 45000 -o half.gs4d
  gs4d prune chkpnt30000.pth --data data/toybox --max-loss 0.1 --variant energy-removal -o small.gs4d

--max-loss looks for the smallest count whose PSNR, on training views that were not scored, falls by no more than that; it needs
their images. `auto` prunes by ours (energy, removal, energy-removal) and by the paper's (full) and keeps the best.")]
pub struct Prune {
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
    /// Keep as few as lose no more than this on held-out training views, dB.
    #[arg(long, value_name = "DB", value_parser = values::not_negative)]
    max_loss: Option<f64>,
    /// Prune by the scores in this file, as `gs4d score` writes them.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["variant", "views"])]
    scores: Option<PathBuf>,
    /// Prune by this score.
    #[arg(long, value_name = "SCORE", default_value = "auto", value_parser = training::choice(false))]
    variant: Choice,
    #[command(flatten)]
    data: DataArgs,
    #[command(flatten)]
    scoring: ScoringArgs,
    #[command(flatten)]
    engine: EngineArgs,
    #[command(flatten)]
    checkpoint: CheckpointArgs,
}

/// The best way to prune, and how it was found.
struct Found {
    outcome: Outcome,
    table: String,
    contest: Option<Value>,
}

impl Prune {
    /// Prunes and writes.
    pub fn run(&self) -> Result<Report, Failure> {
        let out = self.package.out()?;
        let before = opening::file_size(&self.input)?;
        let scene = self.checkpoint.load(&self.input)?;
        let found = self.find(&scene)?;
        let Outcome { candidate, kept, psnr, .. } = &found.outcome;
        let pruned = select(&scene, &highest(&candidate.scores, *kept));
        let after = self.package.save(&pruned)?;
        let text = found.table.clone()
            + &lines(&[
                ("kept", format!("{kept} of {} Gaussians, by {}", scene.len(), candidate.name)),
                ("wrote", format!("{}, {} (from {})", out.display(), bytes(after), bytes(before))),
            ]);
        let json = json!({
            "in": self.input.display().to_string(),
            "out": out.display().to_string(),
            "bytes_in": before,
            "bytes_out": after,
            "gaussians_in": scene.len(),
            "gaussians": kept,
            "score": candidate.name,
            "psnr": psnr,
            "contest": found.contest,
        });
        Ok(Report::new(json, text))
    }

    /// How many of `count` Gaussians to keep.
    fn goal(&self, count: usize) -> Goal {
        match (self.max_loss, self.keep, self.ratio) {
            (Some(loss), ..) => Goal::MaxLoss(loss),
            (_, Some(keep), _) => Goal::Keep(keep.min(count)),
            (.., ratio) => Goal::Keep(kept_count(count, ratio.unwrap_or_default())),
        }
    }

    fn find(&self, scene: &GaussianScene) -> Result<Found, Failure> {
        let goal = self.goal(scene.len());
        let file = self.scores.as_ref().map(|path| {
            let scores = read_scores(path, scene.len())?;
            Ok::<_, Failure>(Candidate { name: path.display().to_string(), scores })
        });
        let file = file.transpose()?;
        match (goal, file) {
            (Goal::Keep(kept), Some(candidate)) => Ok(Found::unchecked(candidate, kept)),
            (goal, file) => self.find_with_data(scene, goal, file),
        }
    }

    /// Scores with the training views unless there is a file, and compares on those held out if there is anything to compare.
    fn find_with_data(&self, scene: &GaussianScene, goal: Goal, file: Option<Candidate>) -> Result<Found, Failure> {
        let needs_loss = matches!(goal, Goal::MaxLoss(_));
        let compared = needs_loss || (file.is_none() && self.variant == Choice::Auto);
        let (scored, held_out) = self.scoring.share(self.data.open(&scene.trained_with)?, compared);
        let runtime = scene.clone().into_runtime().map_err(|error| Failure::at(&self.input, &error))?;
        let background = self.checkpoint.background.map_or(runtime.trained_background(), Background::Color);
        let mut engine = self.engine.open()?;
        // First of all, so that missing images are told at once.
        let contest = if compared {
            Some(ScoreSearch::open(&mut engine, &held_out, &runtime, background, needs_loss)?)
        } else {
            None
        };
        let mut found = match file {
            Some(candidate) => vec![candidate],
            None => {
                let scores = self.scoring.scores(&mut engine, scene, &runtime, background, &scored)?;
                candidates(self.variant, &scores)?
            }
        };
        match (contest, goal) {
            (Some(contest), _) => {
                let (outcome, rows) = contest.best(&mut engine, &GaussianScene::from(runtime), found, goal)?;
                let table = format!("{}{}\n", contest.table(&rows), trials(&outcome));
                Ok(Found { outcome, table, contest: Some(contest.json(rows)) })
            }
            (None, Goal::Keep(kept)) if !found.is_empty() => Ok(Found::unchecked(found.swap_remove(0), kept)),
            (None, _) => Err(Failure::new("there is no score to prune by")),
        }
    }
}

impl Found {
    /// One score, nothing compared.
    fn unchecked(candidate: Candidate, kept: usize) -> Self {
        let outcome = Outcome { candidate, kept, psnr: None, trials: Vec::new() };
        Self { outcome, table: String::new(), contest: None }
    }
}

/// Every count that was tried on the way to the best, if there were several.
fn trials(outcome: &Outcome) -> String {
    if outcome.trials.len() < 2 {
        return String::new();
    }
    let mut table = Table::new(&["tried", "PSNR"]);
    for trial in &outcome.trials {
        table.row([trial.count.to_string(), format!("{:.3}", trial.psnr)]);
    }
    format!("\n{table}")
}
