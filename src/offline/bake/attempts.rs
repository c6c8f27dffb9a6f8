//! The attempts of a bake to a size: as long as the package is too large, the bake is made again with fewer Gaussians.
//!
//! In: the selection of the first attempt, or the bytes of a package that is too large. Out: the selection of the attempt that an earlier bake
//! has come to, whose stages then find their results; one of fewer Gaussians, down to a single one.

use super::pruning::Pruning;
use super::size::{MADE, TOO_LARGE, fitting};
use super::stages::Stages;
use super::{Bake, BakeSettings, Fingerprint};
use crate::offline::OfflineError;
use crate::offline::prune::highest;
use serde::{Deserialize, Serialize};
use std::fs;

/// Most attempts.
const ATTEMPTS: usize = 4;
/// Name of the file that says which attempt the bake has come to.
const FILE: &str = "attempt.ron";

/// The attempt that a bake has come to, after the first.
#[derive(Serialize, Deserialize)]
struct Attempt {
    /// Number of Gaussians to keep.
    kept: usize,
    /// Packages made before, which were too large.
    bakes: usize,
    /// Bytes of the smallest of them.
    smallest: u64,
}

impl Bake<'_> {
    /// Returns the selection of the attempt in which an earlier bake was interrupted; `first`, that of the first attempt, if it was in that or if
    /// there is none.
    pub(super) fn resume_attempt(&self, first: Pruning, stages: &mut Stages<'_>) -> Pruning {
        let stored = self.work.load(FILE, self.fingerprint_of_attempts(&first));
        let stored = stored.and_then(|text| ron::de::from_bytes::<Attempt>(&text).ok());
        let follows =
            |stored: &Attempt| (1..first.kept.len()).contains(&stored.kept) && (1..ATTEMPTS).contains(&stored.bakes);
        let Some(Attempt { kept, bakes, smallest }) = stored.filter(follows) else { return first };
        stages.note(&format!("packages of more Gaussians were too large: the bake goes on with {kept}"));
        let is_there = fs::metadata(self.work.folder().join(TOO_LARGE)).is_ok_and(|file| file.len() == smallest);
        let smallest = if is_there { smallest } else { u64::MAX };
        Pruning { kept: highest(&first.scores, kept), bakes, smallest, ..first }
    }

    /// Returns a selection of fewer Gaussians, at least one, after their package turned out to have `size` bytes, which are too many. The
    /// smallest such package is kept in the folder of the bake.
    ///
    /// # Errors
    /// It has been too large several times, or with a single Gaussian.
    pub(super) fn keep_fewer(
        &self,
        pruning: Pruning,
        size: u64,
        stages: &mut Stages<'_>,
    ) -> Result<Pruning, OfflineError> {
        let (limit, folder) = (self.limit(), self.work.folder());
        let kept = folder.join(TOO_LARGE);
        if size < pruning.smallest {
            fs::rename(folder.join(MADE), &kept).map_err(|error| OfflineError::at(&kept, error))?;
        }
        let (smallest, bakes, before) = (size.min(pruning.smallest), pruning.bakes + 1, pruning.kept.len());
        if bakes == ATTEMPTS || before <= 1 {
            let single = if before <= 1 { "not even with a single Gaussian; " } else { "" };
            let kept = kept.display();
            let found = format!("{single}the smallest package that was made has {smallest} and is kept as {kept}");
            return Err(self.too_small(limit, &found));
        }
        let one = self.size_of(&highest(&pruning.scores, 1))?;
        let count = fitting(before, size, limit, one).clamp(1, before - 1);
        stages.note(&format!("the package has {size} bytes, {limit} are allowed: again with {count} Gaussians"));
        let attempt = ron::to_string(&Attempt { kept: count, bakes, smallest })?;
        let fingerprint = self.fingerprint_of_attempts(&pruning);
        self.work.store(FILE, fingerprint, attempt.as_bytes(), stages.progress())?;
        Ok(Pruning { kept: highest(&pruning.scores, count), bakes, smallest, ..pruning })
    }

    /// Returns the fingerprint of everything that the sizes of packages depend on.
    fn fingerprint_of_attempts(&self, pruning: &Pruning) -> Fingerprint {
        let BakeSettings { rounds, filter, level, .. } = self.settings;
        pruning.fingerprint.and(&format!("attempts {rounds} {filter:?} {level:?} {:?}", self.tunes()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::offline::bake::pruning::Found;
    use crate::offline::engine::Engine;
    use crate::offline::quantize::Quality;
    use crate::offline::score::ScoringSettings;
    use crate::offline::score::variant::Variant;
    use crate::offline::search::{Goal, ScoreChoice};
    use crate::offline::temporal_filter::KeyFrames;
    use crate::offline::work::Work;
    use crate::offline::{NoProgress, Subject};
    use crate::scene::FilterKind;
    use crate::scene::synth::{SynthSettings, synthesize};
    use std::path::Path;

    const COUNT: usize = 40;
    /// More than a package of a single Gaussian has.
    const LIMIT: u64 = 6000;

    fn settings(folder: &Path) -> BakeSettings {
        BakeSettings {
            checkpoint: folder.join("scene.gs4d"),
            data: folder.join("data"),
            out: folder.join("out.gs4d"),
            resolution: None,
            background: None,
            goal: Goal::Size(LIMIT),
            rounds: 1,
            score: ScoreChoice::One(Variant::Energy),
            scoring: ScoringSettings::default(),
            filter: FilterKind::Support,
            key_frames: KeyFrames::default(),
            fine_tune: None,
            quality: Quality::default(),
            level: None,
            keep_work: false,
        }
    }

    /// Returns a bake on the CPU, of whose packages only the sizes matter.
    fn bake<'a>(settings: &'a BakeSettings, engine: &'a mut Engine) -> Bake<'a> {
        let scene = synthesize(&SynthSettings { count: COUNT, degree: 0, ..SynthSettings::default() });
        let subject = Subject::new(&settings.checkpoint, scene, None).expect("a synthetic scene can be drawn");
        let work = Work::beside(&settings.out, ".bake").expect("the folder can be made");
        Bake { settings, engine, subject, views: Vec::new(), work, fingerprint: Fingerprint(7) }
    }

    fn first() -> Pruning {
        let found = Found { score: "energy".to_owned(), held_out: String::new(), tried: Vec::new() };
        let scores: Vec<f32> = (0..COUNT).map(|index| index as f32).collect();
        let kept = highest(&scores, COUNT);
        Pruning { kept, scores, found, fingerprint: Fingerprint(9), bakes: 0, smallest: u64::MAX }
    }

    /// Goes on after a package of this size.
    fn after(bake: &Bake<'_>, pruning: Pruning, size: u64) -> Result<Pruning, OfflineError> {
        fs::write(bake.work.folder().join(MADE), vec![0u8; size as usize]).expect("the folder can be written to");
        bake.keep_fewer(pruning, size, &mut Stages::begin(&mut NoProgress))
    }

    #[test]
    fn the_last_attempt_has_a_single_gaussian() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let (settings, mut engine) = (settings(folder.path()), Engine::Cpu);
        let bake = bake(&settings, &mut engine);
        let single = after(&bake, first(), 1000 * LIMIT).expect("fewer Gaussians can be tried");
        assert_eq!(single.kept, [COUNT as u32 - 1], "the one with the highest score, although none is expected to fit");
        let message = after(&bake, single, LIMIT + 1).err().expect("there are no fewer").to_string();
        assert!(message.contains("not even with a single Gaussian"), "what was tried: {message}");
        assert!(message.contains(&format!("has {} and is kept as", LIMIT + 1)), "the smallest: {message}");
    }

    #[test]
    fn every_attempt_has_fewer_and_they_end() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let (settings, mut engine) = (settings(folder.path()), Engine::Cpu);
        let bake = bake(&settings, &mut engine);
        let mut pruning = first();
        for attempt in 1..ATTEMPTS {
            let before = pruning.kept.len();
            pruning = after(&bake, pruning, LIMIT + 1).expect("fewer Gaussians can be tried");
            assert!((1..before).contains(&pruning.kept.len()), "attempt {attempt}: fewer than {before}");
        }
        let message = after(&bake, pruning, LIMIT + 2).err().expect("it was tried often enough").to_string();
        assert!(message.contains(&format!("has {} and is kept as", LIMIT + 1)), "the smallest: {message}");
        assert!(!message.contains("single Gaussian"), "there were more: {message}");
    }

    #[test]
    fn a_bake_goes_on_with_the_attempt_that_it_has_come_to() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let (settings, mut engine) = (settings(folder.path()), Engine::Cpu);
        let bake = bake(&settings, &mut engine);
        let resumed = |bake: &Bake<'_>| bake.resume_attempt(first(), &mut Stages::begin(&mut NoProgress));
        assert_eq!(resumed(&bake).kept.len(), COUNT, "the first attempt");
        let second = after(&bake, first(), 2 * LIMIT).expect("fewer Gaussians can be tried");
        let again = resumed(&bake);
        assert_eq!((&again.kept, again.bakes, again.smallest), (&second.kept, 1, 2 * LIMIT), "the second");
        fs::remove_file(bake.work.folder().join(TOO_LARGE)).expect("it is kept");
        assert_eq!(resumed(&bake).smallest, u64::MAX, "no package is kept any more");
        let others = BakeSettings { filter: FilterKind::KeyFrame, ..settings.clone() };
        let other = Bake { settings: &others, ..bake };
        assert_eq!(resumed(&other).kept.len(), COUNT, "packages with another filter have other sizes");
    }
}
