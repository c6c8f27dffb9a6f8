//! `gs4d score CHECKPOINT --data DIR`: what each Gaussian is worth to the training views.
//!
//! In: a checkpoint, cameras and times. Out: one float32 for each Gaussian, or a folder of every score.

use super::contest::{Candidate, Goal, ScoreSearch, candidates};
use super::engine::EngineArgs;
use super::failure::Failure;
use super::opening::CheckpointArgs;
use super::report::{Report, lines};
use super::training::{self, Choice, DataArgs, ScoringArgs};
use super::{interrupt, values};
use crate::offline;
use crate::offline::prune::kept_count;
use crate::scene::GaussianScene;
use crate::view::Background;
use serde_json::json;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Score the Gaussians of a checkpoint by what they contribute to its training views.
///
/// Cameras and times are enough; only `auto` also looks at the images of the views it holds out.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  gs4d score chkpnt30000.pth --data data/toybox --out energy.f32 --variant energy
  gs4d score chkpnt30000.pth --data data/standup --resolution 2 --out scores --variant all
  gs4d score chkpnt30000.pth --data data/toybox --out best.f32 --ratio 0.5 --views 200

Scores are little-endian float32 in the checkpoint's order, the more the better. `auto` prunes by ours (energy, removal,
energy-removal) and by the paper's (full), draws training views that were not scored, and keeps the best.")]
pub struct Score {
    /// The checkpoint, or a package of it in the trained form.
    #[arg(value_name = "CHECKPOINT")]
    input: PathBuf,
    /// The file of scores to write; with --variant all a folder, made if it is not there, for one file each.
    #[arg(short, long, value_name = "OUT")]
    out: PathBuf,
    /// Which score.
    #[arg(long, value_name = "SCORE", default_value = "auto", value_parser = training::choice(true))]
    variant: Choice,
    /// Share of the Gaussians that would be removed, at which `auto` compares.
    #[arg(long, value_name = "R", default_value = "0.5", value_parser = values::share)]
    ratio: f64,
    #[command(flatten)]
    data: DataArgs,
    #[command(flatten)]
    scoring: ScoringArgs,
    #[command(flatten)]
    engine: EngineArgs,
    #[command(flatten)]
    checkpoint: CheckpointArgs,
}

impl Score {
    /// Scores and writes.
    pub fn run(&self) -> Result<Report, Failure> {
        if self.variant != Choice::All && self.out.is_dir() {
            return Err(Failure::about(&self.out, "is a folder: name a file, or give --variant all"));
        }
        let scene = self.checkpoint.load(&self.input)?;
        let auto = self.variant == Choice::Auto;
        let (scored, held_out) = self.scoring.share(self.data.open(&scene.trained_with)?, auto);
        let runtime = scene.clone().into_runtime().map_err(|error| Failure::at(&self.input, &error))?;
        let background = self.checkpoint.background.map_or(runtime.trained_background(), Background::Color);
        let mut engine = self.engine.open()?;
        let start = Instant::now();
        let scores = self.scoring.scores(&mut engine, &scene, &runtime, background, &scored)?;
        let seconds = start.elapsed().as_secs_f64();
        let mut found = candidates(self.variant, &scores)?;
        let (mut table, mut contest) = (String::new(), None);
        if auto {
            let judge = ScoreSearch::open(&mut engine, &held_out, &runtime, background, false)?;
            let goal = Goal::Keep(kept_count(scene.len(), self.ratio));
            let (best, rows) = judge.best(&mut engine, &GaussianScene::from(runtime), found, goal)?;
            table = format!("\n{}best: {}\n", judge.table(&rows), best.candidate.name);
            contest = Some(judge.json(rows));
            found = vec![best.candidate];
        }
        let files = self.write(&found)?;
        let names: Vec<&str> = found.iter().map(|candidate| candidate.name.as_str()).collect();
        let text = lines(&[
            ("scored", format!("{} Gaussians, {} of which contribute", scene.len(), scores.contributing())),
            ("views", format!("{} in {seconds:.1} s on {}", scored.len(), engine.name())),
            ("scores", names.join(", ")),
            ("written", self.out.display().to_string()),
        ]) + &table;
        let json = json!({
            "in": self.input.display().to_string(),
            "files": files,
            "scores": names,
            "gaussians": scene.len(),
            "contributing": scores.contributing(),
            "views": scored.len(),
            "seconds": seconds,
            "engine": engine.name(),
            "contest": contest,
        });
        Ok(Report::new(json, text))
    }

    /// Writes one file, or one for each in a folder; tells their paths.
    fn write(&self, found: &[Candidate]) -> Result<Vec<String>, Failure> {
        let folder = self.variant == Choice::All;
        if folder {
            fs::create_dir_all(&self.out).map_err(|error| Failure::at(&self.out, &error))?;
        }
        let mut files = Vec::with_capacity(found.len());
        for candidate in found {
            let path = if folder { self.out.join(format!("{}.f32", candidate.name)) } else { self.out.clone() };
            write_scores(&path, &candidate.scores)?;
            files.push(path.display().to_string());
        }
        Ok(files)
    }
}

fn write_scores(path: &Path, scores: &[f32]) -> Result<(), Failure> {
    let bytes: Vec<u8> = scores.iter().flat_map(|score| score.to_le_bytes()).collect();
    Ok(interrupt::whole(|| offline::write_beside(path, |file| file.write_all(&bytes)))?)
}
