//! The number of Gaussians whose package has a given size.
//!
//! In: a limit in bytes, a function from a number of Gaussians to the size of their package, such as that of
//! [`Packages`]. Out: a number of Gaussians whose package is just below the limit.

use super::BakeError;
use crate::codec::package;
use crate::offline::compress::{CompressSettings, PackedOrder, Quality, compress};
use crate::offline::prune::select::select;
use crate::offline::work::{Progress, write_settings};
use crate::scene::{GaussianScene, TemporalFilter};

/// Bytes for each Gaussian in the first estimate.
const BYTES_OF_GAUSSIAN: u64 = 24;
/// Largest number of packages that are tried.
const TRIES: usize = 5;
/// Target size, as a fraction of the bytes left for Gaussians: training changes how well a package compresses.
const AIM: f64 = 0.985;
/// The search ends at a package within the limit that has at least this fraction of its bytes.
const NEAR: f64 = 0.97;

/// The packages of some of a scene's Gaussians.
pub(crate) struct Packages<'a> {
    pub scene: &'a GaussianScene,
    /// Number of key-frames of the temporal filter.
    pub key_frames: u32,
    pub quality: Quality,
    /// The order of the Gaussians.
    pub order: &'a PackedOrder,
    /// zstd level; `None`: that of [`write_settings`].
    pub level: Option<i32>,
    /// Whether the Gaussians are trained: the sizes of codebooks then follow their number.
    pub is_trained: bool,
}

impl Packages<'_> {
    /// Returns the size in bytes of the package of these Gaussians without training.
    pub(crate) fn size_of(&self, kept: &[u32]) -> Result<u64, BakeError> {
        let mut scene = select(self.scene, kept);
        let (interval, cutoff) = (scene.trained_with.time_interval, scene.trained_with.marginal_cutoff);
        let gaussians = scene.gaussians()?.into_owned();
        scene.filter = Some(TemporalFilter::support(gaussians.into_iter(), interval, cutoff, self.key_frames - 1));
        let options = match self.is_trained {
            true => CompressSettings::suiting(self.quality, kept.len()),
            false => CompressSettings::from(self.quality),
        };
        let options = CompressSettings { order: self.order.clone(), ..options };
        let (compressed, _) = compress(scene.into_runtime()?, &options)?;
        let mut bytes = Vec::new();
        package::write(&mut bytes, &compressed, &write_settings(&compressed.form, self.level))?;
        Ok(bytes.len() as u64)
    }
}

/// Returns how many of `total` Gaussians fit into a package of `limit` bytes, given the size of a package of any number
/// and that of a single Gaussian. Begins the task "finding the count".
pub(crate) fn count_within(
    limit: u64,
    total: usize,
    one: u64,
    size_of: impl Fn(usize) -> Result<u64, BakeError>,
    progress: &mut dyn Progress,
) -> Result<usize, BakeError> {
    let mut count = usize::try_from(limit / BYTES_OF_GAUSSIAN).map_or(total, |count| count.clamp(1, total.max(1)));
    progress.begin("finding the count", TRIES);
    for _ in 0..TRIES {
        let size = size_of(count)?;
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

/// Returns the count at which a package that has `size` bytes with `count` Gaussians, and `one` with a single one,
/// would have slightly less than `limit`.
pub(crate) fn fitting(count: usize, size: u64, limit: u64, one: u64) -> usize {
    let [room, used] = [limit, size].map(|bytes| bytes.saturating_sub(one) as f64);
    (count as f64 * AIM * room / used.max(1.0)) as usize
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::offline::work::NoProgress;

    #[test]
    fn counts_follow_the_size() {
        assert_eq!(fitting(1000, 2000, 1000, 0), 492, "a little less than half");
        assert_eq!(fitting(1000, 500, 1000, 0), 1970, "a little less than twice");
        assert_eq!(fitting(3, 1000, 10, 0), 0, "no Gaussian fits");
        assert_eq!(fitting(1000, 2900, 1900, 900), 492, "the bytes that all Gaussians share are counted once");
        assert_eq!(fitting(1, 901, 900, 900), 0, "a single Gaussian is too large");
    }

    #[test]
    fn a_package_of_the_found_count_nearly_fills_the_size() {
        let size_of = |count: usize| Ok(500 + 20 * count as u64);
        let count = count_within(100_000, 90_000, 520, size_of, &mut NoProgress).expect("sizes are known");
        assert!((4825..=4975).contains(&count), "97 to 100 percent of the size: {count}");
        let all = count_within(100_000, 300, 520, size_of, &mut NoProgress).expect("sizes are known");
        assert_eq!(all, 300, "all Gaussians fit");
    }
}
