//! The saver: from a capture in memory to a package.
//!
//! In: a [`GaussianCapture`] and [`PackageSaverSettings`]. Out: the bytes of a `.gs4d` file, in any asset source that
//! Bevy can write, which [`CaptureLoader`] loads as the same capture.

use super::loader::{CaptureLoader, CaptureLoaderSettings};
use crate::codec::package::{self, PackageError, WriteSettings};
use crate::plugin::component::GaussianCapture;
use crate::scene::GaussianScene;
use bevy::asset::io::Writer;
use bevy::asset::saver::{AssetSaver, SavedAsset};
use bevy::asset::{AssetPath, AsyncWriteExt};
use bevy::reflect::TypePath;
use serde::{Deserialize, Serialize};

/// Saves captures as packages, `.gs4d`, without loss. While a capture is saved, its scene is in memory twice. Errors:
/// [`CaptureSaveError`].
///
/// # Examples
///
/// ```no_run
/// # use bevy::asset::saver::{SaveAssetError, SavedAsset, save_using_saver};
/// # use bevy::prelude::*;
/// # use bevy_gs4d::asset::{GaussianCapture, PackageSaver, PackageSaverSettings};
/// # async fn save(server: AssetServer, capture: GaussianCapture) -> Result<(), SaveAssetError> {
/// let saved = SavedAsset::from_asset(&capture);
/// save_using_saver(server, &PackageSaver, &"made.gs4d".into(), saved, &PackageSaverSettings::default()).await
/// # }
/// ```
#[derive(Debug, Default, Clone, Copy, TypePath)]
#[type_path = "bevy_gs4d::asset"]
pub struct PackageSaver;

/// Settings for writing a package.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PackageSaverSettings {
    /// zstd level, 1 (fast) to 19 (small); clamped to that range. Default: 9, as in [`WriteSettings`].
    pub level: i32,
}

impl Default for PackageSaverSettings {
    fn default() -> Self {
        Self { level: WriteSettings::default().level }
    }
}

/// Why a capture could not be saved.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CaptureSaveError {
    /// The Gaussians have been dropped from memory.
    #[error(
        "the Gaussians of the capture are on the GPU only: load it with RenderAssetUsages::default() in CaptureLoaderSettings, or \
         save it before it is drawn"
    )]
    Released,
    /// The format cannot hold the scene.
    #[error(transparent)]
    Package(#[from] PackageError),
    /// The asset source did not accept the bytes.
    #[error("the file could not be written: {0}")]
    Write(#[from] std::io::Error),
}

impl AssetSaver for PackageSaver {
    type Asset = GaussianCapture;
    type Settings = PackageSaverSettings;
    type OutputLoader = CaptureLoader;
    type Error = CaptureSaveError;

    async fn save(
        &self,
        writer: &mut Writer,
        capture: SavedAsset<'_, '_, GaussianCapture>,
        settings: &PackageSaverSettings,
        _path: AssetPath<'_>,
    ) -> Result<CaptureLoaderSettings, CaptureSaveError> {
        if capture.is_released() {
            return Err(CaptureSaveError::Released);
        }
        let mut bytes = Vec::new();
        let scene = GaussianScene::from(capture.scene().clone());
        package::write(&mut bytes, &scene, &WriteSettings { level: settings.level })?;
        writer.write_all(&bytes).await?;
        // All other settings are in the package.
        Ok(CaptureLoaderSettings { asset_usage: capture.usages(), ..CaptureLoaderSettings::default() })
    }
}
