//! The stage rounds of a bake: gradual pruning.
//!
//! In: the scores of all Gaussians, the Gaussians to keep. Out: the scene with that number of Gaussians. Each of
//! several rounds removes the same fraction of the remaining Gaussians, trains the rest for a while, and scores it
//! again: the score of a Gaussian depends on which other Gaussians remain.

use super::BakeError;
use super::inputs::Inputs;
use super::tuning::short;
use crate::offline::engine::Engine;
use crate::offline::forms::Subject;
use crate::offline::prune::select::{highest, select};
use crate::offline::score::Variant;
use crate::offline::store::results::Key;
use crate::offline::store::stages::Stages;
use crate::offline::train::fine_tune;
use crate::offline::work::Progress;
use crate::scene::GaussianScene;

/// Removes Gaussians in rounds, or all at once if there is one round or nothing is trained. Returns the scene and its
/// key, given the key of the choice.
pub(super) fn thin(
    inputs: &mut Inputs<'_>,
    stages: &mut Stages<'_>,
    scores: &[f32],
    score: &str,
    kept: &[u32],
    choice: Key,
) -> Result<(GaussianScene, Key), BakeError> {
    let rounds = inputs.settings.rounds;
    let key = choice.with(inputs.scene_key).and(&format!("{} Gaussians", kept.len()));
    match (inputs.tunes().filter(|_| rounds > 1), score.parse::<Variant>()) {
        (Some(tuning), Ok(variant)) => {
            let key = key
                .with(inputs.cameras_key)
                .with(inputs.images_key())
                .and(&format!("{rounds} rounds of {tuning:?} by {variant:?}"));
            stages.run(
                "rounds",
                key,
                |_| true,
                |progress| remove_in_rounds(inputs, scores, variant, kept.len(), progress),
            )
        }
        _ => {
            stages.leave_out("rounds", None);
            Ok((select(&inputs.subject.scene, kept), key))
        }
    }
}

fn remove_in_rounds(
    inputs: &mut Inputs<'_>,
    scores: &[f32],
    variant: Variant,
    keep: usize,
    progress: &mut dyn Progress,
) -> Result<GaussianScene, BakeError> {
    let counts = counts(inputs.subject.scene.len(), keep, inputs.settings.rounds);
    let mut scene = select(&inputs.subject.scene, &highest(scores, counts[0]));
    let images = inputs.images(progress)?;
    let tuning = inputs.tunes().map(short).unwrap_or_default();
    for &count in &counts[1..] {
        if let Engine::Gpu(headless) = &mut *inputs.engine {
            scene = fine_tune(headless, scene, &images, &tuning, None, progress)?.scene;
        }
        let subject = Subject::new(&inputs.settings.checkpoint, scene, inputs.settings.background)?;
        let scores = inputs.settings.scoring.scores(inputs.engine, &subject, &inputs.splits.train, progress)?;
        scene = select(&subject.scene, &highest(&scores.of(variant)?, count));
        progress.note(&format!("{count} Gaussians remain"));
    }
    Ok(scene)
}

/// Returns how many Gaussians remain after each round: the same fraction of the previous number, and `keep` after the
/// last round.
fn counts(total: usize, keep: usize, rounds: usize) -> Vec<usize> {
    let fraction = keep as f64 / total.max(1) as f64;
    let left = |round: usize| (total as f64 * fraction.powf(round as f64 / rounds as f64)).round() as usize;
    (1..rounds).map(left).chain([keep]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_round_removes_the_same_fraction() {
        assert_eq!(counts(8000, 1000, 3), [4000, 2000, 1000], "each of three rounds keeps half");
        assert_eq!(counts(90, 45, 1), [45], "one round removes all at once");
        assert_eq!(counts(5, 0, 2), [0, 0], "no Gaussian remains");
    }
}
