//! Loaders: from files of an asset source to captures.
//!
//! In: the bytes of a file named `*.gs4d` or `*.pth`. For a checkpoint, also the file `cfg_args` in the same folder, and
//! [`ReadOptions`] with the values that neither file contains (`load_builder().with_settings(|options: &mut ReadOptions| ..)`
//! or a `.meta` file). Out: a [`GaussianCapture`] or a [`CaptureLoadError`], to which Bevy adds the path.

use super::pause::pause;
use crate::codec::ReadOptions;
use crate::codec::checkpoint::{self, CheckpointError};
use crate::codec::package::{self, PackageError, Reading};
use crate::gaussian::InvalidGaussian;
use crate::plugin::component::GaussianCapture;
use bevy::asset::io::Reader;
use bevy::asset::{AssetLoader, AssetPath, LoadContext, RenderAssetUsages};
use bevy::reflect::TypePath;
use serde::{Deserialize, Serialize};
use std::io::Cursor;

/// Bytes that a step decompresses, and bytes of a file between pauses.
const STEP: usize = 1 << 18;
const PIECE: f32 = 262_144.0;

/// Why a capture could not be loaded.
#[derive(Debug, thiserror::Error)]
pub enum CaptureLoadError {
    /// The asset source could not deliver the bytes.
    #[error("the file could not be read: {0}")]
    Read(#[from] std::io::Error),
    /// The bytes are not an intact package.
    #[error(transparent)]
    Package(#[from] PackageError),
    /// The bytes are not a readable checkpoint.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
    /// The file is intact but contains a Gaussian that cannot be drawn.
    #[error(transparent)]
    Gaussian(#[from] InvalidGaussian),
}

/// Settings of loading a package: `load_builder().with_settings(|settings: &mut PackageLoaderSettings| ..)` or a `.meta` file.
///
/// # Examples
///
/// ```
/// use bevy::asset::RenderAssetUsages;
/// use bevy::prelude::*;
/// use bevy_gs4d::asset::PackageLoaderSettings;
/// use bevy_gs4d::prelude::*;
///
/// /// Loads a capture whose Gaussians are dropped from memory once they are on the GPU.
/// fn setup(mut commands: Commands, assets: Res<AssetServer>) {
///     let drop_copy = |settings: &mut PackageLoaderSettings| settings.asset_usage = RenderAssetUsages::RENDER_WORLD;
///     let capture = assets.load_builder().with_settings(drop_copy).load("toybox.gs4d");
///     commands.spawn(GaussianCapture3d(capture));
/// }
/// # bevy::ecs::system::assert_is_system(setup);
/// ```
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PackageLoaderSettings {
    /// Where the Gaussians are needed, as in [`GaussianCapture::with_usages`]. With `RenderAssetUsages::RENDER_WORLD` alone they are dropped
    /// from memory once they are on the GPU; the capture can then be neither picked nor saved. Default: both worlds.
    pub asset_usage: RenderAssetUsages,
}

/// Loads packages, `.gs4d`, as [`GaussianCapture`]s. Errors: [`CaptureLoadError`].
#[derive(Debug, Default, TypePath)]
pub struct PackageLoader;

impl AssetLoader for PackageLoader {
    type Asset = GaussianCapture;
    type Settings = PackageLoaderSettings;
    type Error = CaptureLoadError;

    async fn load(
        &self,
        reader: &mut dyn Reader,
        settings: &PackageLoaderSettings,
        _context: &mut LoadContext<'_>,
    ) -> Result<GaussianCapture, CaptureLoadError> {
        let bytes = bytes(reader).await?;
        let (length, mut before) = (bytes.len() as f32, 0.0);
        let mut reading = Reading::new(Cursor::new(bytes))?;
        while reading.advance(STEP)? {
            if (reading.progress() - before) * length > PIECE {
                before = reading.progress();
                pause().await;
            }
        }
        let scene = reading.finish()?;
        Ok(GaussianCapture::new(scene.into_runtime()?).with_usages(settings.asset_usage))
    }

    fn extensions(&self) -> &[&str] {
        package::EXTENSIONS
    }
}

/// Loads checkpoints of the original code, `.pth`, as [`GaussianCapture`]s. Errors: [`CaptureLoadError`].
///
/// Values that the settings do not give are read from `cfg_args`, the file that the trainer writes into the same folder, if it exists.
/// `cfg_args` is then a dependency of the checkpoint: when `cfg_args` changes, the checkpoint is loaded again.
#[derive(Debug, Default, TypePath)]
pub struct CheckpointLoader;

impl AssetLoader for CheckpointLoader {
    type Asset = GaussianCapture;
    type Settings = ReadOptions;
    type Error = CaptureLoadError;

    async fn load(
        &self,
        reader: &mut dyn Reader,
        settings: &ReadOptions,
        context: &mut LoadContext<'_>,
    ) -> Result<GaussianCapture, CaptureLoadError> {
        let cfg_args = read_cfg_args(context).await;
        let scene = checkpoint::read(Cursor::new(bytes(reader).await?), settings, cfg_args.as_deref())?;
        Ok(GaussianCapture::new(scene.into_runtime()?))
    }

    fn extensions(&self) -> &[&str] {
        checkpoint::EXTENSIONS
    }
}

/// Returns the text of `cfg_args` in the folder of a checkpoint; `None` if the file does not exist or cannot be read.
async fn read_cfg_args(context: &mut LoadContext<'_>) -> Option<String> {
    let checkpoint = context.path();
    let cfg_args = AssetPath::from(checkpoint.path().with_file_name("cfg_args"));
    let path = cfg_args.with_source(checkpoint.source().clone_owned());
    let text = context.read_asset_bytes(path).await.ok()?;
    Some(String::from_utf8_lossy(&text).into_owned())
}

/// Reads the whole file: both decoders seek in it.
async fn bytes(reader: &mut dyn Reader) -> std::io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    reader.read_to_end(&mut bytes).await?;
    Ok(bytes)
}
