//! Loaders: from files of an asset source to captures.
//!
//! In: the bytes of a file named `*.gs4d` or `*.pth` and, for a checkpoint, the [`CheckpointOptions`] for what it does not say
//! (`load_builder().with_settings(|options: &mut CheckpointOptions| ..)` or a `.meta` file). Out: a [`GaussianCapture`] or a
//! [`CaptureLoadError`], to which Bevy adds the path.

use super::GaussianCapture;
use crate::codec::checkpoint::{self, CheckpointError, CheckpointOptions};
use crate::codec::package::{self, PackageError};
use crate::gaussian::InvalidGaussian;
use bevy::asset::{AssetLoader, LoadContext, io::Reader};
use bevy::reflect::TypePath;
use std::io::Cursor;

/// Why a capture could not be loaded.
#[derive(Debug, thiserror::Error)]
pub enum CaptureLoadError {
    /// The asset source could not deliver the bytes.
    #[error("the file could not be read: {0}")]
    Read(#[from] std::io::Error),
    /// The bytes are no intact package.
    #[error(transparent)]
    Package(#[from] PackageError),
    /// The bytes are no checkpoint that can be read.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
    /// The file is intact but holds a Gaussian that cannot be drawn.
    #[error(transparent)]
    Gaussian(#[from] InvalidGaussian),
}

/// Loads packages, `.gs4d`.
#[derive(Debug, Default, TypePath)]
pub struct PackageLoader;

impl AssetLoader for PackageLoader {
    type Asset = GaussianCapture;
    type Settings = ();
    type Error = CaptureLoadError;

    async fn load(
        &self,
        reader: &mut dyn Reader,
        _settings: &(),
        _context: &mut LoadContext<'_>,
    ) -> Result<GaussianCapture, CaptureLoadError> {
        let scene = package::read(Cursor::new(bytes(reader).await?))?;
        Ok(GaussianCapture::new(scene.into_runtime()?))
    }

    fn extensions(&self) -> &[&str] {
        &["gs4d"]
    }
}

/// Loads checkpoints of the original code, `.pth`.
#[derive(Debug, Default, TypePath)]
pub struct CheckpointLoader;

impl AssetLoader for CheckpointLoader {
    type Asset = GaussianCapture;
    type Settings = CheckpointOptions;
    type Error = CaptureLoadError;

    async fn load(
        &self,
        reader: &mut dyn Reader,
        settings: &CheckpointOptions,
        _context: &mut LoadContext<'_>,
    ) -> Result<GaussianCapture, CaptureLoadError> {
        let scene = checkpoint::read(Cursor::new(bytes(reader).await?), settings, None)?;
        Ok(GaussianCapture::new(scene.into_runtime()?))
    }

    fn extensions(&self) -> &[&str] {
        &["pth"]
    }
}

/// The whole file: both formats are read out of order.
async fn bytes(reader: &mut dyn Reader) -> std::io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    reader.read_to_end(&mut bytes).await?;
    Ok(bytes)
}
