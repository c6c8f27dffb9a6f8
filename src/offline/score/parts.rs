//! Scores in parts, one for each shard, and their merge.
//!
//! In: a scene, the views to score with, an [`Engine`], a shard; or the paths of parts. Out: the file of a part, or the
//! [`Scores`] of all.

use super::{ScoreError, Scores, ScoringSettings};
use crate::offline::dataset::TrainingView;
use crate::offline::engine::Engine;
use crate::offline::forms::Subject;
use crate::offline::store::StoreError;
use crate::offline::store::results::Key;
use crate::offline::store::shard::{Label, Shard, part, parts};
use crate::offline::store::stored::Stored;
use crate::offline::work::{FileError, Progress};
use std::path::{Path, PathBuf};

/// Most bytes of a part whose scene is not known: sums of a hundred million Gaussians.
const MOST: usize = 100_000_000 * super::BYTES;

/// Returns the label of scores. `checkpoint` is the file of the scene.
///
/// # Errors
/// The checkpoint cannot be read.
pub(crate) fn label(
    checkpoint: &Path,
    subject: &Subject,
    views: &[TrainingView],
    settings: &ScoringSettings,
    engine: &Engine,
    shard: Shard,
) -> Result<Label, StoreError> {
    let Subject { scene, background, .. } = subject;
    let ScoringSettings { views: count, score } = settings;
    let read = format!("{:?} {:?} {background:?}", scene.trained_with, scene.playback);
    Ok(Label::new("score", shard)
        .with("checkpoint", Key::of_scene(checkpoint)?)
        .with("reading of the checkpoint", Key::of(read.as_bytes()))
        .with("set of training views", Key::of_views(views))
        .with("number of views", count.map_or("all".to_owned(), |count| count.to_string()))
        .with("power of the volume", score.volume_power)
        .with("rank of the volume", score.volume_rank)
        .with("engine", engine.kind()))
}

/// Scores the views of the shard of the label, and writes the part; returns false if the same part is there already.
///
/// # Errors
/// As [`ScoringSettings::of_shard`], and a part that cannot be written.
pub(crate) fn write(
    out: &Path,
    label: &Label,
    settings: &ScoringSettings,
    engine: &mut Engine,
    subject: &Subject,
    views: &[TrainingView],
    progress: &mut dyn Progress,
) -> Result<bool, ScoreError> {
    if part::is_there(out, label) {
        return Ok(false);
    }
    let scores = settings.of_shard(engine, subject, views, label.shard(), progress)?;
    part::write(out, label, &scores.encode()?)?;
    Ok(true)
}

/// Reads parts and merges their scores. The parts must have the inputs of `expected`, or else those of the first part.
///
/// # Errors
/// As `parts::in_order`, files that cannot be read, views that show nothing of the scene.
pub fn merge(paths: &[PathBuf], expected: Option<&Label>) -> Result<Scores, ScoreError> {
    let (paths, _) = parts::in_order(paths, expected)?;
    let mut merged: Option<Scores> = None;
    for path in &paths {
        let most = merged.as_ref().map_or(MOST, Scores::bytes);
        let scores = Scores::decode(&part::result(path, most)?);
        let fits = |scores: &Scores| merged.as_ref().is_none_or(|merged| merged.len() == scores.len());
        let message = "does not hold the sums of the scores of this scene: make it again";
        let scores = scores.filter(fits).ok_or_else(|| FileError::at(path, message))?;
        match &mut merged {
            Some(merged) => merged.merge(&scores),
            None => merged = Some(scores),
        }
    }
    merged.ok_or(ScoreError::NoViews)?.whole()
}
