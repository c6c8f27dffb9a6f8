//! How many Gaussians fit into a package of a given size.
//!
//! In: a number of bytes, scores. Out: the number of Gaussians; fewer of them if the package that was written is too large.

use super::Bake;
use super::pruning::Pruning;
use super::stages::Stages;
use crate::codec::package;
use crate::offline::prune::{highest, select};
use crate::offline::quantize::{CompressSettings, compress};
use crate::offline::search::Goal;
use crate::offline::{OfflineError, Progress, sliced, write_settings};
use crate::scene::TemporalFilter;
use std::fs;

/// Bytes of a Gaussian with which the search begins.
const BYTES_OF_GAUSSIAN: u64 = 24;
/// Packages that are tried before the bake, and whole bakes.
const TRIES: usize = 5;
const BAKES: usize = 4;
/// The share of the size that is aimed at: training changes how well a package compresses.
const AIM: f64 = 0.985;
/// A package this much smaller, as a share of the size, is large enough.
const NEAR: f64 = 0.97;

impl Bake<'_> {
    /// Returns how many of the Gaussians with the highest scores fit into a package of this many bytes, before they are trained. Begins the
    /// task "finding the count".
    ///
    /// # Errors
    /// Not even one Gaussian fits.
    pub(super) fn count_of_size(
        &self,
        limit: u64,
        scores: &[f32],
        progress: &mut dyn Progress,
    ) -> Result<usize, OfflineError> {
        let total = self.subject.scene.len();
        let mut count = usize::try_from(limit / BYTES_OF_GAUSSIAN).map_or(total, |count| count.clamp(1, total.max(1)));
        progress.begin("finding the count", TRIES);
        for _ in 0..TRIES {
            let size = self.size_of(&highest(scores, count))?;
            progress.advance();
            let whole = count == total && size <= limit;
            let near = size <= limit && size as f64 >= NEAR * limit as f64;
            if whole || near {
                break;
            }
            count = fitting(count, size, limit).min(total);
            if count == 0 {
                return Err(self.too_small(limit));
            }
        }
        progress.finish();
        Ok(count)
    }

    /// Returns the bytes of a package of these Gaussians as they are.
    fn size_of(&self, kept: &[u32]) -> Result<u64, OfflineError> {
        let (settings, out) = (self.settings, &self.settings.out);
        let mut scene = select(&self.subject.scene, kept);
        let segments = settings.key_frames.count(&self.views).max(2) as u32 - 1;
        let interval = scene.trained_with.time_interval;
        scene.filter = Some(TemporalFilter::support(sliced(&scene)?.iter().copied(), interval, segments));
        let options = match self.tunes() {
            Some(_) => CompressSettings::suiting(settings.quality, kept.len()),
            None => CompressSettings::from(settings.quality),
        };
        let (compressed, _) = compress(scene.into_runtime()?, &options)?;
        let mut bytes = Vec::new();
        let written = package::write(&mut bytes, &compressed, &write_settings(&compressed.form, settings.level));
        written.map_err(|error| OfflineError::at(out, error))?;
        Ok(bytes.len() as u64)
    }

    /// Returns a selection of fewer Gaussians if the package is larger than it may be; `None` if it is not.
    ///
    /// # Errors
    /// It has been too large several times.
    pub(super) fn keep_fewer(
        &self,
        pruning: &Pruning,
        stages: &mut Stages<'_>,
    ) -> Result<Option<Pruning>, OfflineError> {
        let Goal::Size(limit) = self.settings.goal else { return Ok(None) };
        let out = &self.settings.out;
        let size = fs::metadata(out).map_err(|error| OfflineError::at(out, error))?.len();
        if size <= limit {
            return Ok(None);
        }
        let count = fitting(pruning.kept.len(), size, limit);
        if pruning.bakes + 1 == BAKES || count == 0 {
            return Err(self.too_small(limit));
        }
        stages.note(&format!("the package has {size} bytes, {limit} are allowed: again with {count} Gaussians"));
        Ok(Some(Pruning {
            kept: highest(&pruning.scores, count),
            scores: pruning.scores.clone(),
            found: pruning.found.clone(),
            fingerprint: pruning.fingerprint.and(&format!("{count}")),
            bakes: pruning.bakes + 1,
        }))
    }

    fn too_small(&self, limit: u64) -> OfflineError {
        let reason = format!("this capture does not fit into {limit} bytes: choose a lower quality or a larger size");
        OfflineError::at(&self.settings.out, reason)
    }
}

/// Returns the count at which a package that has `size` bytes with `count` Gaussians would have nearly `limit`.
fn fitting(count: usize, size: u64, limit: u64) -> usize {
    (count as f64 * AIM * limit as f64 / size.max(1) as f64) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_follow_the_size() {
        assert_eq!(fitting(1000, 2000, 1000), 492, "a little less than half");
        assert_eq!(fitting(1000, 500, 1000), 1970, "a little less than twice");
        assert_eq!(fitting(3, 1000, 10), 0, "nothing fits");
    }
}
