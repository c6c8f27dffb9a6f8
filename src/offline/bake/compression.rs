//! The stages mask and compress of a bake.
//!
//! In: the remaining Gaussians. Out: their temporal filter; the package on disk.

use super::size::{MADE, put_in_place};
use super::stages::Stages;
use super::tuning::Tuning;
use super::{Bake, Fingerprint, Stage};
use crate::offline::quantize::{CompressSettings, compress};
use crate::offline::temporal_filter::filter;
use crate::offline::work::{bytes, words};
use crate::offline::{OfflineError, save, write_settings};
use crate::scene::{GaussianScene, MAX_SEGMENTS, TemporalFilter};

impl Bake<'_> {
    /// Computes the temporal filter of the remaining Gaussians, or loads it from an earlier bake.
    pub(super) fn mask(
        &mut self,
        stages: &mut Stages<'_>,
        pruned: &GaussianScene,
        before: Fingerprint,
    ) -> Result<(TemporalFilter, Fingerprint), OfflineError> {
        const FILE: &str = "filter.bits";
        let Self { settings, engine, views, work, .. } = self;
        let kind = settings.filter;
        let keys = u32::try_from(settings.key_frames.count(views)).unwrap_or(u32::MAX).min(MAX_SEGMENTS + 1);
        let fingerprint = before.and(&format!("{kind:?} {keys}"));
        let (segments, count) = (keys - 1, pruned.len());
        let stored = work.load(FILE, fingerprint).and_then(|bytes| {
            let bits = words(&bytes);
            let whole = bits.len() == TemporalFilter::words(count) * segments as usize;
            whole.then(|| TemporalFilter::from_bits(kind, segments, count, bits))
        });
        let filter = stages.run(Stage::Mask, stored, |progress| {
            let filter = filter(engine, pruned, kind, keys, views, progress)?;
            work.store(FILE, fingerprint, &bytes(&filter.to_bits()), progress)?;
            Ok(filter)
        })?;
        Ok((filter, fingerprint))
    }

    /// Writes the package, unless an earlier bake has written the same one and it is still on disk. A package with more bytes than are
    /// allowed stays in the folder of the bake: then returns how many.
    pub(super) fn compress(
        &mut self,
        stages: &mut Stages<'_>,
        pruned: GaussianScene,
        tuning: Option<&Tuning>,
        before: Fingerprint,
    ) -> Result<Option<u64>, OfflineError> {
        const FILE: &str = "package.crc32";
        let (settings, work, limit) = (self.settings, self.work.clone(), self.limit());
        let (made, out) = (work.folder().join(MADE), &settings.out);
        let fingerprint = before.and(&format!("{:?} {:?}", settings.quality, settings.level));
        let checksum = || Some(Fingerprint::of_files(&[out]).ok()?.0.to_le_bytes().to_vec());
        let stored = work.load(FILE, fingerprint).filter(|stored| checksum().as_ref() == Some(stored));
        stages.run(Stage::Compress, stored.map(|_| None), |progress| {
            let compressed = match self.compress_tuned(&pruned, tuning, fingerprint, progress)? {
                Some(compressed) => compressed,
                None => {
                    let runtime = pruned.into_runtime();
                    let runtime = runtime.map_err(|error| OfflineError::at(&settings.checkpoint, error))?;
                    compress(runtime, &CompressSettings::from(settings.quality))?.0
                }
            };
            let written = write_settings(&compressed.form, settings.level);
            let mut too_large = None;
            progress.uninterrupted(&mut || {
                save(&made, &compressed, &written)?;
                too_large = put_in_place(&made, out, limit)?;
                Ok(())
            })?;
            if too_large.is_none()
                && let Some(checksum) = checksum()
            {
                work.store(FILE, fingerprint, &checksum, progress)?;
            }
            Ok(too_large)
        })
    }
}
