//! How many Gaussians of a bake fit into a package of a given size.
//!
//! In: a number of bytes, scores. Out: the number of Gaussians, estimated before they are trained; a smaller number
//! after each package that is too large ([`Attempts`]).

use super::BakeError;
use super::inputs::Inputs;
use super::package_size::{Packages, count_within, fitting};
use super::settings::BakeSettings;
use crate::offline::prune::search::Goal;
use crate::offline::prune::select::highest;
use crate::offline::store::results::{Key, Store};
use crate::offline::store::stored::{Stored, Text};
use crate::offline::work::{FileError, Progress};
use crate::scene::GaussianScene;

/// Largest number of packages that a bake makes.
const ATTEMPTS: usize = 4;
/// Name under which the attempts are stored.
const FILE: &str = "attempts";

/// The packages of a bake that were too large.
pub(super) struct Attempts {
    key: Key,
    /// Number of Gaussians of the first package.
    first: usize,
    /// Number of Gaussians of the next package, for each package that was too large.
    next: Vec<usize>,
}

impl Attempts {
    /// Returns the attempts of an interrupted bake with the same inputs, or none, given the key of the choice.
    pub(super) fn load(inputs: &Inputs<'_>, choice: Key, first: usize) -> Self {
        let BakeSettings { rounds, filter, level, goal, quality, order, key_frames, colliders, .. } = inputs.settings;
        let of_training = format!("attempts {rounds} {filter:?} {level:?} {:?}", inputs.tunes());
        let key = choice.with(inputs.scene_key).with(inputs.cameras_key).with(inputs.images_key());
        let key = key.and(&format!("{of_training} {goal:?} {quality:?} {order:?} {key_frames:?} {colliders:?}"));
        Self::of(&inputs.store, key, first)
    }

    fn of(store: &Store, key: Key, first: usize) -> Self {
        let stored = store.load(FILE, key).and_then(|text| Text::<Vec<usize>>::decode(&text)).map(|Text(next)| next);
        let next = stored.filter(|next| next.len() < ATTEMPTS && next.iter().all(|&count| count < first));
        Self { key, first, next: next.unwrap_or_default() }
    }

    /// Returns the number of Gaussians to keep.
    pub(super) fn count(&self) -> usize {
        self.next.last().copied().unwrap_or(self.first)
    }

    /// Chooses a smaller number of Gaussians, at least one, after a package that was too large.
    ///
    /// # Errors
    /// The package was too large for the last attempt, or with a single Gaussian. It is then kept in the folder of the
    /// bake.
    pub(super) fn keep_fewer(
        &mut self,
        inputs: &Inputs<'_>,
        package: &[u8],
        scores: &[f32],
        progress: &mut dyn Progress,
    ) -> Result<(), BakeError> {
        let (limit, size, before) = (inputs.limit(), package.len() as u64, self.count());
        if self.next.len() + 1 == ATTEMPTS || before <= 1 {
            let kept = inputs.store.keep_aside("too-large", "gs4d", package)?;
            let single = if before <= 1 { "not even with a single Gaussian; " } else { "" };
            let found = format!("{single}the last package that was made has {size} and is kept as {}", kept.display());
            return Err(too_small(inputs.settings, limit, &found).into());
        }
        let one = size_of(inputs, &highest(scores, 1))?;
        let next = fitting(before, size, limit, one).clamp(1, before - 1);
        progress.note(&format!("the package has {size} bytes, {limit} are allowed: again with {next} Gaussians"));
        self.next.push(next);
        inputs.store.store(FILE, self.key, &Text(self.next.clone()).encode()?)?;
        Ok(())
    }
}

/// Checks, before the scoring, that the parts of the package that do not depend on the kept Gaussians fit: the header,
/// the environment map and the sound.
///
/// # Errors
/// These parts do not fit.
pub(super) fn require_room(inputs: &Inputs<'_>) -> Result<(), BakeError> {
    require_least(&inputs.subject.scene, inputs.settings, inputs.key_frames(), inputs.tunes().is_some())
}

/// Checks that a package without any of the Gaussians of a scene fits. `is_trained`: whether the remaining Gaussians
/// are trained.
///
/// # Errors
/// It does not fit.
pub(super) fn require_least(
    scene: &GaussianScene,
    settings: &BakeSettings,
    key_frames: u32,
    is_trained: bool,
) -> Result<(), BakeError> {
    let Goal::Size(limit) = settings.goal else { return Ok(()) };
    let BakeSettings { quality, ref order, level, .. } = *settings;
    let least = Packages { scene, key_frames, quality, order, level, is_trained }.size_of(&[])?;
    match least > limit {
        true => Err(too_small(settings, limit, &format!("a package without Gaussians has {least}")).into()),
        false => Ok(()),
    }
}

/// Returns how many of the Gaussians with the highest scores fit into a package of this many bytes, before they are
/// trained.
///
/// # Errors
/// Not even one Gaussian fits.
pub(super) fn count_of_size(
    inputs: &Inputs<'_>,
    limit: u64,
    scores: &[f32],
    progress: &mut dyn Progress,
) -> Result<usize, BakeError> {
    let total = inputs.subject.scene.len();
    let one = size_of(inputs, &highest(scores, 1))?;
    if one > limit {
        let found = format!("a package of a single Gaussian has {one}");
        return Err(too_small(inputs.settings, limit, &found).into());
    }
    count_within(limit, total, one, |count| size_of(inputs, &highest(scores, count)), progress)
}

/// Returns the size in bytes of a package of these Gaussians without training.
fn size_of(inputs: &Inputs<'_>, kept: &[u32]) -> Result<u64, BakeError> {
    let (scene, settings) = (&inputs.subject.scene, inputs.settings);
    let (key_frames, is_trained) = (inputs.key_frames(), inputs.tunes().is_some());
    let BakeSettings { quality, ref order, level, .. } = *settings;
    Packages { scene, key_frames, quality, order, level, is_trained }.size_of(kept)
}

/// Returns the error for a limit that no package meets; `found` describes the smallest package.
fn too_small(settings: &BakeSettings, limit: u64, found: &str) -> FileError {
    let remedy = "choose a lower quality or a larger size, or no sound; a file that was here before has not changed";
    let reason = format!("this capture does not fit into {limit} bytes: {found}; {remedy}");
    FileError::at(&settings.out, reason)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::offline::store::results::BAKE_FOLDER;

    #[test]
    fn attempts_of_other_inputs_are_not_resumed() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let store = Store::beside(&folder.path().join("out.gs4d"), BAKE_FOLDER).expect("the folder can be made");
        let (key, other) = (Key::of(b"these inputs"), Key::of(b"other inputs"));
        let text = Text(vec![30usize, 20]).encode().expect("attempts are text");
        store.store(FILE, key, &text).expect("the folder can be written to");
        assert_eq!(Attempts::of(&store, key, 40).count(), 20, "the bake resumes with the count of the last attempt");
        assert_eq!(Attempts::of(&store, other, 40).count(), 40, "other inputs begin with the first count");
        assert_eq!(Attempts::of(&store, key, 25).count(), 25, "attempts from another first count are not resumed");
    }
}
