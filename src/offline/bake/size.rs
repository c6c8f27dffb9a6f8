//! How many Gaussians fit into a package of a given size.
//!
//! In: a number of bytes, scores. Out: the number of Gaussians, estimated before they are trained; a smaller number for each package that
//! is too large ([`Attempts`]).

use super::inputs::Inputs;
use crate::offline::bake_settings::BakeSettings;
use crate::offline::package_size::{Packages, count_within, fitting};
use crate::offline::prune::highest;
use crate::offline::search::Goal;
use crate::offline::store::{Key, Store};
use crate::offline::{OfflineError, Progress};
use crate::scene::GaussianScene;
use serde::{Deserialize, Serialize};

/// Most packages that a bake makes.
const ATTEMPTS: usize = 4;
/// Name under which the attempts are stored.
const FILE: &str = "attempts";

/// The packages of a bake that were too large.
pub(super) struct Attempts {
    key: Key,
    /// Number of Gaussians of the first package.
    first: usize,
    made: Vec<Attempt>,
}

/// A package that was too large.
#[derive(Serialize, Deserialize)]
struct Attempt {
    /// Number of Gaussians of the next package.
    next: usize,
}

impl Attempts {
    /// Returns the attempts of an interrupted bake with the same inputs, or none, given the key of the choice.
    pub(super) fn load(inputs: &Inputs<'_>, choice: Key, first: usize) -> Self {
        let BakeSettings { rounds, filter, level, .. } = inputs.settings;
        let key = choice.and(&format!("attempts {rounds} {filter:?} {level:?} {:?}", inputs.tunes()));
        Self::of(&inputs.store, key, first)
    }

    fn of(store: &Store, key: Key, first: usize) -> Self {
        let stored = store.load(FILE, key).and_then(|text| ron::de::from_bytes::<Vec<Attempt>>(&text).ok());
        let made = stored.filter(|made| made.len() < ATTEMPTS && made.iter().all(|attempt| attempt.next < first));
        Self { key, first, made: made.unwrap_or_default() }
    }

    /// Returns the number of Gaussians to keep.
    pub(super) fn count(&self) -> usize {
        self.made.last().map_or(self.first, |last| last.next)
    }

    /// Chooses a smaller number of Gaussians, at least one, after a package that was too large.
    ///
    /// # Errors
    /// The package was too large for the last attempt, or with a single Gaussian. It is then kept in the folder of the bake.
    pub(super) fn keep_fewer(
        &mut self,
        inputs: &Inputs<'_>,
        package: &[u8],
        scores: &[f32],
        progress: &mut dyn Progress,
    ) -> Result<(), OfflineError> {
        let (limit, size, before) = (inputs.limit(), package.len() as u64, self.count());
        if self.made.len() + 1 == ATTEMPTS || before <= 1 {
            let kept = inputs.store.keep_aside("too-large", "gs4d", package)?;
            let single = if before <= 1 { "not even with a single Gaussian; " } else { "" };
            let found = format!("{single}the last package that was made has {size} and is kept as {}", kept.display());
            return Err(too_small(inputs.settings, limit, &found));
        }
        let one = size_of(inputs, &highest(scores, 1))?;
        let next = fitting(before, size, limit, one).clamp(1, before - 1);
        progress.note(&format!("the package has {size} bytes, {limit} are allowed: again with {next} Gaussians"));
        self.made.push(Attempt { next });
        inputs.store.store(FILE, self.key, ron::to_string(&self.made)?.as_bytes())?;
        Ok(())
    }
}

/// Checks, before the scoring, that the parts of the package that do not depend on the kept Gaussians fit: the header and the environment
/// map. A filter and codebooks depend on the Gaussians.
///
/// # Errors
/// These parts do not fit.
pub(super) fn require_room(inputs: &Inputs<'_>) -> Result<(), OfflineError> {
    require_least(&inputs.subject.scene, inputs.settings, inputs.key_frames(), inputs.tunes().is_some())
}

/// Checks that a package without any of the Gaussians of a scene fits. `is_trained`: whether what is left of them is trained.
///
/// # Errors
/// It does not fit.
pub(super) fn require_least(
    scene: &GaussianScene,
    settings: &BakeSettings,
    key_frames: u32,
    is_trained: bool,
) -> Result<(), OfflineError> {
    let Goal::Size(limit) = settings.goal else { return Ok(()) };
    let BakeSettings { quality, level, .. } = *settings;
    let least = Packages { scene, key_frames, quality, level, is_trained }.size_of(&[])?;
    match least > limit {
        true => Err(too_small(settings, limit, &format!("a package without Gaussians has {least}"))),
        false => Ok(()),
    }
}

/// Returns how many of the Gaussians with the highest scores fit into a package of this many bytes, before they are trained.
///
/// # Errors
/// Not even one Gaussian fits.
pub(super) fn count_of_size(
    inputs: &Inputs<'_>,
    limit: u64,
    scores: &[f32],
    progress: &mut dyn Progress,
) -> Result<usize, OfflineError> {
    let total = inputs.subject.scene.len();
    let one = size_of(inputs, &highest(scores, 1))?;
    if one > limit {
        return Err(too_small(inputs.settings, limit, &format!("a package of a single Gaussian has {one}")));
    }
    count_within(limit, total, one, |count| size_of(inputs, &highest(scores, count)), progress)
}

/// Returns the size in bytes of a package of these Gaussians without training.
fn size_of(inputs: &Inputs<'_>, kept: &[u32]) -> Result<u64, OfflineError> {
    let (scene, BakeSettings { quality, level, .. }) = (&inputs.subject.scene, inputs.settings);
    let is_trained = inputs.tunes().is_some();
    Packages { scene, key_frames: inputs.key_frames(), quality: *quality, level: *level, is_trained }.size_of(kept)
}

/// Returns the error for a limit that no package meets; `found` describes the smallest package.
fn too_small(settings: &BakeSettings, limit: u64, found: &str) -> OfflineError {
    let remedy = "choose a lower quality or a larger size; a file that was here before has not changed";
    let reason = format!("this capture does not fit into {limit} bytes: {found}; {remedy}");
    OfflineError::at(&settings.out, reason)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn attempts_of_other_inputs_are_not_resumed() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let store = Store::beside(&folder.path().join("out.gs4d"), ".bake").expect("the folder can be made");
        let (key, other) = (Key::of(b"these inputs"), Key::of(b"other inputs"));
        let text = ron::to_string(&vec![Attempt { next: 30 }, Attempt { next: 20 }]).expect("attempts are text");
        store.store(FILE, key, text.as_bytes()).expect("the folder can be written to");
        assert_eq!(Attempts::of(&store, key, 40).count(), 20, "the bake resumes with the count of the last attempt");
        assert_eq!(Attempts::of(&store, other, 40).count(), 40, "other inputs begin with the first count");
        assert_eq!(Attempts::of(&store, key, 25).count(), 25, "attempts from another first count are not resumed");
    }
}
