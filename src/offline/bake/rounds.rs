//! The stage rounds of a bake: gradual pruning.
//!
//! In: the scores of all Gaussians, the number to keep. Out: the scene with that many. In several rounds, each removes the same share of what
//! is left, trains the others for a while, and scores them again: what a Gaussian is worth depends on which others are left.

use super::pruning::Pruning;
use super::stages::Stages;
use super::trials::Trials;
use super::{Bake, Fingerprint, Stage};
use crate::codec::package::{self, WriteSettings};
use crate::offline::fine_tune::TrainingImages;
use crate::offline::prune::{highest, select};
use crate::offline::score::variant::Variant;
use crate::offline::{OfflineError, Subject};
use crate::scene::GaussianScene;
use std::io::Cursor;

impl Bake<'_> {
    /// Removes Gaussians in rounds, or all at once if there is one round or nothing is trained.
    pub(super) fn thin(
        &mut self,
        stages: &mut Stages<'_>,
        pruning: &Pruning,
    ) -> Result<(GaussianScene, Fingerprint), OfflineError> {
        const FILE: &str = "thinned.gs4d";
        let rounds = self.settings.rounds;
        let fingerprint = pruning.fingerprint.and(&format!("{} Gaussians", pruning.kept.len()));
        let tunes = self.tunes().filter(|_| rounds > 1).cloned();
        let Some((tuning, variant)) = tunes.zip(pruning.found.score.parse::<Variant>().ok()) else {
            stages.note_left_out(Stage::Rounds, None);
            return Ok((select(&self.subject.scene, &pruning.kept), fingerprint));
        };
        let fingerprint = fingerprint.and(&format!("{rounds} rounds of {tuning:?}"));
        let Self { settings, engine, subject, views, work, .. } = self;
        let stored = work.load(FILE, fingerprint).and_then(|bytes| package::read(Cursor::new(bytes)).ok());
        let scene = stages.run(Stage::Rounds, stored, |progress| {
            let (scored, _) = settings.scoring.split(views.clone(), true);
            // What is held out later is never trained on.
            let images = TrainingImages::load(views, tuning.held_out, &subject.scene.trained_with, progress)?;
            let trials = Trials::new(images, &tuning);
            let counts = counts(subject.scene.len(), pruning.kept.len(), rounds);
            let mut scene = select(&subject.scene, &highest(&pruning.scores, counts[0]));
            for &count in &counts[1..] {
                let tuned = trials.tune(engine, scene, progress)?;
                let subject = Subject::new(&settings.checkpoint, tuned, settings.background)?;
                let scores = settings.scoring.scores(engine, &subject, &scored, progress)?.of(variant)?;
                scene = select(&subject.scene, &highest(&scores, count));
                progress.note(&format!("{count} Gaussians are left"));
            }
            let mut bytes = Vec::new();
            let written = package::write(&mut bytes, &scene, &WriteSettings { level: 1 });
            written.map_err(|error| OfflineError::at(&work.folder().join(FILE), error))?;
            work.store(FILE, fingerprint, &bytes, progress)?;
            Ok(scene)
        })?;
        Ok((scene, fingerprint))
    }
}

/// Returns how many Gaussians each round leaves: the same share each time, `keep` at the end.
fn counts(total: usize, keep: usize, rounds: usize) -> Vec<usize> {
    let share = keep as f64 / total.max(1) as f64;
    let left = |round: usize| (total as f64 * share.powf(round as f64 / rounds as f64)).round() as usize;
    (1..rounds).map(left).chain([keep]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_round_removes_the_same_share() {
        assert_eq!(counts(8000, 1000, 3), [4000, 2000, 1000], "half of them");
        assert_eq!(counts(90, 45, 1), [45], "all at once");
        assert_eq!(counts(5, 0, 2), [0, 0], "nothing is left");
    }
}
