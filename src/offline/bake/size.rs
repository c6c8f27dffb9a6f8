//! How many Gaussians fit into a package of a given size.
//!
//! In: a number of bytes, scores. Out: the number of Gaussians, as far as can be told before they are trained. Only a package that is small
//! enough takes its place.

use super::Bake;
use crate::codec::{CodecError, package};
use crate::offline::prune::{highest, select};
use crate::offline::quantize::{CompressSettings, compress};
use crate::offline::search::Goal;
use crate::offline::{OfflineError, Progress, sliced, write_beside, write_settings};
use crate::scene::TemporalFilter;
use std::fs::{self, File};
use std::io;
use std::path::Path;

/// Bytes of a Gaussian with which the search begins.
const BYTES_OF_GAUSSIAN: u64 = 24;
/// Packages that are tried before the bake.
const TRIES: usize = 5;
/// The share of the room for Gaussians that is aimed at: training changes how well a package compresses.
const AIM: f64 = 0.985;
/// A package this much smaller, as a share of the size, is large enough.
const NEAR: f64 = 0.97;
/// Names of the package that was just made and of the smallest that was too large, in the folder of the bake.
pub(super) const MADE: &str = "package.gs4d";
pub(super) const TOO_LARGE: &str = "too-large.gs4d";

impl Bake<'_> {
    /// Checks, before anything is computed, that there is room for what the package of this capture has whichever Gaussians are kept: the header
    /// and the environment map. A filter and codebooks come with the Gaussians.
    ///
    /// # Errors
    /// There is none.
    pub(super) fn require_room(&self) -> Result<(), OfflineError> {
        let Goal::Size(limit) = self.settings.goal else { return Ok(()) };
        let least = self.size_of(&[])?;
        if least > limit {
            return Err(self.too_small(limit, &format!("a package without Gaussians has {least}")));
        }
        Ok(())
    }

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
        let one = self.size_of(&highest(scores, 1))?;
        if one > limit {
            return Err(self.too_small(limit, &format!("a package of a single Gaussian has {one}")));
        }
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
            count = fitting(count, size, limit, one).clamp(1, total.max(1));
        }
        progress.finish();
        Ok(count)
    }

    /// Returns the bytes of a package of these Gaussians as they are.
    pub(super) fn size_of(&self, kept: &[u32]) -> Result<u64, OfflineError> {
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

    /// Returns the most bytes that the package may have.
    pub(super) fn limit(&self) -> u64 {
        match self.settings.goal {
            Goal::Size(limit) => limit,
            Goal::Keep(_) | Goal::Remove(_) | Goal::MaxLoss(_) => u64::MAX,
        }
    }

    /// Removes the packages in the folder of the bake, once there is one in its place.
    pub(super) fn remove_made(&self) {
        for name in [MADE, TOO_LARGE] {
            // Most bakes leave neither.
            let _ = fs::remove_file(self.work.folder().join(name));
        }
    }

    /// Returns the error that no package has been found that is small enough; `found` says what the smallest has.
    pub(super) fn too_small(&self, limit: u64, found: &str) -> OfflineError {
        let remedy = "choose a lower quality or a larger size; a file that was here before has not changed";
        let reason = format!("this capture does not fit into {limit} bytes: {found}; {remedy}");
        OfflineError::at(&self.settings.out, reason)
    }
}

/// Writes a package that was made elsewhere to its place, unless it has more bytes than are allowed: then returns how many.
///
/// # Errors
/// A folder that cannot be written to, a full disk.
pub(super) fn put_in_place(made: &Path, out: &Path, limit: u64) -> Result<Option<u64>, CodecError> {
    let at_made = |error: io::Error| CodecError { path: made.to_owned(), kind: error.into() };
    let mut file = File::open(made).map_err(at_made)?;
    let size = file.metadata().map_err(at_made)?.len();
    if size > limit {
        return Ok(Some(size));
    }
    write_beside(out, |writer| io::copy(&mut file, writer).map(|_| ()))?;
    Ok(None)
}

/// Returns the count at which a package that has `size` bytes with `count` Gaussians, and `one` with a single one, would have nearly `limit`.
pub(super) fn fitting(count: usize, size: u64, limit: u64, one: u64) -> usize {
    let [room, used] = [limit, size].map(|bytes| bytes.saturating_sub(one) as f64);
    (count as f64 * AIM * room / used.max(1.0)) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_follow_the_size() {
        assert_eq!(fitting(1000, 2000, 1000, 0), 492, "a little less than half");
        assert_eq!(fitting(1000, 500, 1000, 0), 1970, "a little less than twice");
        assert_eq!(fitting(3, 1000, 10, 0), 0, "nothing fits");
        assert_eq!(fitting(1000, 2900, 1900, 900), 492, "what one Gaussian needs, all of them need once");
        assert_eq!(fitting(1, 901, 900, 900), 0, "a single one is too large");
    }

    #[test]
    fn a_package_that_is_too_large_replaces_nothing() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let [made, out] = ["made.gs4d", "out.gs4d"].map(|name| folder.path().join(name));
        fs::write(&made, b"ten bytes.").expect("the folder can be written to");
        fs::write(&out, b"before").expect("the folder can be written to");
        let put = |limit| put_in_place(&made, &out, limit).expect("the folder can be written to");
        assert_eq!(put(9), Some(10), "one byte too many");
        assert_eq!(fs::read(&out).expect("it is there"), b"before", "the old package stays");
        assert_eq!(put(10), None, "as many as are allowed");
        assert_eq!(fs::read(&out).expect("it is there"), b"ten bytes.", "the new package");
    }
}
