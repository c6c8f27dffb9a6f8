//! Loaders: from files of an asset source to captures.
//!
//! In: the bytes of a file: a package, a checkpoint, or a capture of another make. For a checkpoint, also the file `cfg_args` in the same
//! folder, and [`ReadOptions`] with the values that neither file contains (`load_builder().with_settings(|options: &mut ReadOptions| ..)`
//! or a `.meta` file); for captures of other makes, the files that they name. Out: a [`GaussianCapture`] or a [`CaptureLoadError`], to which
//! Bevy adds the path.

use super::pause::pause;
use crate::codec::checkpoint::{self, CheckpointError};
use crate::codec::format::imported_extensions;
use crate::codec::import::sequence::next as next_frame;
use crate::codec::import::source::{Beside, InMemory};
use crate::codec::import::{ImportError, Imported};
use crate::codec::package::{self, PackageError, Reading};
use crate::codec::{self, CodecErrorKind, ReadOptions};
use crate::gaussian::InvalidGaussian;
use crate::plugin::component::GaussianCapture;
use bevy::asset::io::Reader;
use bevy::asset::{AssetLoader, AssetPath, LoadContext, RenderAssetUsages};
use bevy::log::info;
use bevy::reflect::TypePath;
use serde::{Deserialize, Serialize};
use std::cell::Cell;
use std::io::Cursor;
use std::path::Path;
use std::sync::LazyLock;

/// Bytes that a step decompresses, and bytes of a file between pauses.
const STEP: usize = 1 << 18;
const PIECE: f32 = 262_144.0;

/// Why a capture could not be loaded.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
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
    /// The bytes are no readable capture of another make.
    #[error(transparent)]
    Import(#[from] ImportError),
    /// The bytes are of no known format.
    #[error("{0}")]
    UnknownFormat(String),
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
#[type_path = "bevy_gs4d::asset"]
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

/// Loads checkpoints of the original code (`.pth`), of gsplat (`.pt`) and of nerfstudio (`.ckpt`) as [`GaussianCapture`]s. Errors:
/// [`CaptureLoadError`].
///
/// Values that the settings do not give are read from `cfg_args`, the file that the trainer writes into the same folder, if it exists.
/// `cfg_args` is then a dependency of the checkpoint: when `cfg_args` changes, the checkpoint is loaded again.
#[derive(Debug, Default, TypePath)]
#[type_path = "bevy_gs4d::asset"]
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
        let bytes = Cursor::new(bytes(reader).await?);
        let Imported { scene, lost } = checkpoint::read_stating(bytes, settings, cfg_args.as_deref())?;
        for sentence in lost {
            info!("{}: {sentence}", context.path().path().display());
        }
        Ok(GaussianCapture::new(scene.into_runtime()?))
    }

    fn extensions(&self) -> &[&str] {
        checkpoint::EXTENSIONS
    }
}

/// Loads captures of other makes (PLY, SPZ, SOG, glTF and so on) as [`GaussianCapture`]s. Errors: [`CaptureLoadError`].
///
/// The contents of the file decide which format it is. Files that it names in its own folder, such as the textures of a SOG folder, are
/// dependencies: when one changes, the capture is loaded again. What of the file the capture does not show is logged. With
/// [`ReadOptions::sequence`], the asset is the first of files that are numbered without a gap, each a frame.
///
/// # Examples
///
/// ```
/// use bevy::prelude::*;
/// use bevy_gs4d::codec::ReadOptions;
/// use bevy_gs4d::prelude::*;
/// use bevy_gs4d::scene::UpAxis;
///
/// fn setup(mut commands: Commands, assets: Res<AssetServer>) {
///     let settings = |options: &mut ReadOptions| {
///         options.up = Some(UpAxis::NegY);
///         options.fps = Some(24.0);
///         options.sequence = true;
///     };
///     let dancer = assets.load_builder().with_settings(settings).load("dancer/frame_0000.ply");
///     commands.spawn((GaussianCapture3d(dancer), Upright));
/// }
/// # bevy::ecs::system::assert_is_system(setup);
/// ```
#[derive(Debug, Default, TypePath)]
#[type_path = "bevy_gs4d::asset"]
pub struct ImportLoader;

impl AssetLoader for ImportLoader {
    type Asset = GaussianCapture;
    type Settings = ReadOptions;
    type Error = CaptureLoadError;

    async fn load(
        &self,
        reader: &mut dyn Reader,
        settings: &ReadOptions,
        context: &mut LoadContext<'_>,
    ) -> Result<GaussianCapture, CaptureLoadError> {
        let path = context.path().path().to_owned();
        let first = bytes(reader).await?;
        let Imported { scene, lost } = if settings.sequence {
            let frames = frames(&path, first, context).await?;
            codec::read_frames(frames, settings)?
        } else {
            imported(&path, &first, settings, context).await?
        };
        for sentence in lost {
            info!("{}: {sentence}", path.display());
        }
        Ok(GaussianCapture::new(scene.into_runtime()?))
    }

    fn extensions(&self) -> &[&str] {
        static EXTENSIONS: LazyLock<Vec<&'static str>> = LazyLock::new(imported_extensions);
        &EXTENSIONS
    }
}

/// The files beside a capture that have been fetched, and the first that was asked for and has not.
#[derive(Default)]
struct Fetched {
    files: InMemory,
    wanted: Cell<Option<String>>,
}

impl Beside for Fetched {
    fn read(&self, name: &str) -> std::io::Result<Vec<u8>> {
        self.files.read(name).inspect_err(|error| {
            if error.kind() == std::io::ErrorKind::NotFound {
                self.wanted.set(Some(name.to_owned()));
            }
        })
    }
}

/// Reads a capture of another make. Its reader does not wait for files: each that it asks for is fetched, and it starts anew.
async fn imported(
    path: &Path,
    bytes: &[u8],
    settings: &ReadOptions,
    context: &mut LoadContext<'_>,
) -> Result<Imported, CaptureLoadError> {
    let mut fetched = Fetched::default();
    loop {
        let read = codec::read_bytes(path, bytes, &fetched, settings);
        match (read, fetched.wanted.take()) {
            (Err(_), Some(name)) => {
                let file = beside(context, &name);
                let bytes = context.read_asset_bytes(file).await.map_err(|error| {
                    std::io::Error::other(format!("{}, which it names: {error}", name.escape_debug()))
                })?;
                fetched.files.0.insert(name, bytes);
            }
            (read, _) => return Ok(read?),
        }
    }
}

/// Reads the files whose numbers follow that of the first without a gap.
async fn frames(
    path: &Path,
    first: Vec<u8>,
    context: &mut LoadContext<'_>,
) -> Result<Vec<(String, Vec<u8>)>, CaptureLoadError> {
    let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let mut frames = vec![(name, first)];
    while let Some(next) = next_frame(&frames[frames.len() - 1].0) {
        let file = beside(context, &next);
        let Ok(bytes) = context.read_asset_bytes(file).await else { break };
        frames.push((next, bytes));
    }
    Ok(frames)
}

/// Returns the path of a file in the folder of the asset that is loaded.
fn beside(context: &LoadContext<'_>, name: &str) -> AssetPath<'static> {
    let asset = context.path();
    AssetPath::from(asset.path().with_file_name(name)).with_source(asset.source().clone_owned())
}

impl From<CodecErrorKind> for CaptureLoadError {
    fn from(error: CodecErrorKind) -> Self {
        match error {
            CodecErrorKind::Io(error) => Self::Read(error),
            CodecErrorKind::UnknownFormat(message) => Self::UnknownFormat(message),
            CodecErrorKind::Checkpoint(error) => Self::Checkpoint(error),
            CodecErrorKind::Package(error) => Self::Package(error),
            CodecErrorKind::Import(error) => Self::Import(error),
            CodecErrorKind::Gaussian(error) => Self::Gaussian(error),
        }
    }
}

/// Returns the text of `cfg_args` in the folder of a checkpoint; `None` if the file does not exist or cannot be read.
async fn read_cfg_args(context: &mut LoadContext<'_>) -> Option<String> {
    let file = beside(context, "cfg_args");
    let text = context.read_asset_bytes(file).await.ok()?;
    Some(String::from_utf8_lossy(&text).into_owned())
}

/// Reads the whole file: both decoders seek in it.
async fn bytes(reader: &mut dyn Reader) -> std::io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    reader.read_to_end(&mut bytes).await?;
    Ok(bytes)
}
