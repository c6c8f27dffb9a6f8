//! The stages mask and compress of a bake.
//!
//! In: the remaining Gaussians. Out: their temporal filter; the bytes of the package, and the package in its place.

use super::Bake;
use crate::codec::package;
use crate::offline::quantize::{CompressSettings, compress};
use crate::offline::store::Key;
use crate::offline::stored::Stored;
use crate::offline::temporal_filter::filter;
use crate::offline::{OfflineError, Progress, write_beside, write_settings};
use crate::scene::{GaussianScene, MAX_SEGMENTS, SceneForm, TemporalFilter};
use std::io::{Cursor, Write};

/// The bytes of a package that can be read.
pub(super) struct Package(pub Vec<u8>);

impl Stored for Package {
    fn encode(&self) -> Result<Vec<u8>, OfflineError> {
        Ok(self.0.clone())
    }

    fn decode(bytes: &[u8]) -> Option<Self> {
        package::read(Cursor::new(bytes)).ok()?;
        Some(Self(bytes.to_vec()))
    }
}

impl Bake<'_> {
    /// Returns the key of everything that the temporal filter depends on, given that of the scene.
    pub(super) fn mask_key(&self, scene: Key) -> Key {
        scene.with(self.cameras_key).and(&format!("{:?} {}", self.settings.filter, self.key_frames()))
    }

    /// Computes the temporal filter of the remaining Gaussians.
    pub(super) fn mask(
        &mut self,
        scene: &GaussianScene,
        progress: &mut dyn Progress,
    ) -> Result<TemporalFilter, OfflineError> {
        let (kind, keys) = (self.settings.filter, self.key_frames());
        filter(self.engine, scene, kind, keys, &self.views, progress)
    }

    /// Returns the number of key-frames of the filter.
    pub(super) fn key_frames(&self) -> u32 {
        let count = self.settings.key_frames.count(&self.views);
        u32::try_from(count).unwrap_or(u32::MAX).clamp(2, MAX_SEGMENTS + 1)
    }

    /// Returns the key of everything that the package depends on, given that of the scene and its filter.
    pub(super) fn compress_key(&self, masked: Key) -> Key {
        let settings = self.settings;
        let images = if self.tunes().is_some() { masked.with(self.images_key) } else { masked };
        images.and(&format!("{:?} {:?} {:?}", settings.quality, settings.level, self.tunes()))
    }

    /// Returns the package of a scene, with trained codebooks if the scene has been fine-tuned.
    pub(super) fn compress(
        &mut self,
        scene: GaussianScene,
        is_tuned: bool,
        key: Key,
        progress: &mut dyn Progress,
    ) -> Result<Package, OfflineError> {
        let settings = self.settings;
        let scene = if is_tuned { self.with_codebooks(scene, key, progress)? } else { scene };
        let packed = match scene.form {
            SceneForm::Trained(_) => {
                let runtime = scene.into_runtime();
                let runtime = runtime.map_err(|error| OfflineError::at(&settings.checkpoint, error))?;
                compress(runtime, &CompressSettings::from(settings.quality))?.0
            }
            SceneForm::Ready(_) => scene,
        };
        let mut bytes = Vec::new();
        package::write(&mut bytes, &packed, &write_settings(&packed.form, settings.level))?;
        Ok(Package(bytes))
    }

    /// Writes the package to its place, unless the same bytes are there; returns `false` if it has more bytes than are allowed.
    pub(super) fn put_in_place(&self, package: &[u8], progress: &mut dyn Progress) -> Result<bool, OfflineError> {
        let out = &self.settings.out;
        if package.len() as u64 > self.limit() {
            return Ok(false);
        }
        if !(out.is_file() && Key::of_file(out).is_ok_and(|there| there == Key::of(package))) {
            progress.uninterrupted(&mut || write_beside(out, |file| file.write_all(package)))?;
        }
        Ok(true)
    }
}
