//! The loader: from files of an asset source to captures.
//!
//! In: the bytes of a file of any format, the other files of its folder that it needs, and [`CaptureLoaderSettings`].
//! Out: a [`GaussianCapture`], or a [`CaptureLoadError`], to which Bevy adds the path.

use super::one_file::{PartSources, ReadFile, read_file};
use super::pause::Pauses;
use crate::codec::format::extensions;
use crate::codec::{CodecError, CodecErrorKind, ImportError, Loading, ReadOptions};
use crate::plugin::component::GaussianCapture;
use bevy::asset::io::{AssetReaderError, Reader};
use bevy::asset::{AssetLoader, AssetPath, LoadContext, ReadAssetBytesError, RenderAssetUsages};
use bevy::log::{info, warn};
use bevy::reflect::TypePath;
use serde::{Deserialize, Serialize};
use std::io::{Error, ErrorKind};
use std::sync::LazyLock;

/// Why a capture could not be loaded.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CaptureLoadError {
    /// The asset source could not deliver the bytes of the file, or of another file that it names.
    #[error("the file could not be read: {0}")]
    Read(#[from] Error),
    /// The file is damaged, is of no known format, or contains a Gaussian that cannot be drawn; or a setting is
    /// invalid.
    #[error(transparent)]
    Invalid(CodecErrorKind),
}

impl From<CodecError> for CaptureLoadError {
    fn from(error: CodecError) -> Self {
        match *error.kind {
            CodecErrorKind::Io(error) | CodecErrorKind::Import(ImportError::Io(error)) => Self::Read(error),
            kind => Self::Invalid(kind),
        }
    }
}

/// Settings of loading a capture, whatever its format: `load_builder().with_settings(|settings: &mut
/// CaptureLoaderSettings| ..)`, or a `.meta` file:
///
/// ```ron
/// (
///     meta_format_version: "1.0",
///     asset: Load(
///         loader: "bevy_gs4d::asset::CaptureLoader",
///         settings: (read: (duration_seconds: Some(4.0), up: Some(neg_y)), asset_usage: ("RENDER_WORLD")),
///     ),
/// )
/// ```
///
/// # Examples
///
/// ```
/// use bevy::asset::RenderAssetUsages;
/// use bevy::prelude::*;
/// use bevy_gs4d::asset::CaptureLoaderSettings;
/// use bevy_gs4d::prelude::*;
///
/// /// Loads a capture whose Gaussians are dropped from memory once they are on the GPU.
/// fn setup(mut commands: Commands, assets: Res<AssetServer>) {
///     let drop_copy = |settings: &mut CaptureLoaderSettings| settings.asset_usage = RenderAssetUsages::RENDER_WORLD;
///     let capture = assets.load_builder().with_settings(drop_copy).load("toybox.gs4d");
///     commands.spawn(GaussianCapture3d(capture));
/// }
/// # bevy::ecs::system::assert_is_system(setup);
/// ```
///
/// A sequence of files:
///
/// ```
/// use bevy::prelude::*;
/// use bevy_gs4d::asset::CaptureLoaderSettings;
/// use bevy_gs4d::prelude::*;
/// use bevy_gs4d::scene::UpAxis;
///
/// fn setup(mut commands: Commands, assets: Res<AssetServer>) {
///     let settings = |settings: &mut CaptureLoaderSettings| {
///         settings.read.up = Some(UpAxis::NegY);
///         settings.read.fps = Some(24.0);
///         settings.read.sequence = true;
///     };
///     let dancer = assets.load_builder().with_settings(settings).load("dancer/frame_0000.ply");
///     commands.spawn((GaussianCapture3d(dancer), Upright));
/// }
/// # bevy::ecs::system::assert_is_system(setup);
/// ```
#[derive(Debug, Default, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CaptureLoaderSettings {
    /// How the capture was trained and is meant to be played, where the file does not say so or the game decides
    /// otherwise: its up axis, frames a second, duration, cut-off and so on. Default: as the file says.
    pub read: ReadOptions,
    /// Where the Gaussians are needed, as in [`GaussianCapture::with_usages`]. With `RenderAssetUsages::RENDER_WORLD`
    /// alone they are dropped from memory once they are on the GPU; the capture can then be neither picked nor saved.
    /// Default: both worlds.
    pub asset_usage: RenderAssetUsages,
}

/// Loads captures as [`GaussianCapture`]s: packages, checkpoints, and files of other makes (PLY, SPZ, SOG, glTF and so
/// on). The contents of a file decide which format it is. Errors: [`CaptureLoadError`].
///
/// Other files of the folder that the file needs are dependencies: when one changes, the capture is loaded again. These
/// are the textures of a SOG, the buffers of a glTF file, the frames of a [sequence](ReadOptions::sequence), and
/// `cfg_args`, the file that the trainer writes into the folder of its checkpoints, for what the settings do not say.
///
/// What the capture does not show of its file, and settings that have no effect on it, are logged.
///
/// An index that chunk files follow in one file is loaded alone where its source can give parts of files: files of a disk, and
/// servers through [`HttpRangesPlugin`](crate::stream::HttpRangesPlugin). From other sources all of the file is loaded, which
/// is logged.
#[derive(Debug, Default, Clone, TypePath)]
#[type_path = "bevy_gs4d::asset"]
pub struct CaptureLoader {
    sources: PartSources,
}

impl CaptureLoader {
    /// Returns the loader of an app whose sources give parts of files as noted.
    pub(super) fn of(sources: PartSources) -> Self {
        Self { sources }
    }
}

impl AssetLoader for CaptureLoader {
    type Asset = GaussianCapture;
    type Settings = CaptureLoaderSettings;
    type Error = CaptureLoadError;

    async fn load(
        &self,
        reader: &mut dyn Reader,
        settings: &CaptureLoaderSettings,
        context: &mut LoadContext<'_>,
    ) -> Result<GaussianCapture, CaptureLoadError> {
        let (path, options) = (context.path().path().to_owned(), &settings.read);
        let mut loading = match read_file(reader, context.path().source(), &self.sources).await? {
            ReadFile::Index(bytes) => Loading::of_index(&path, bytes, options)?,
            ReadFile::Whole(bytes) => Loading::new(&path, bytes, options)?,
            ReadFile::WithoutParts(bytes) => {
                warn!(
                    "{}: its server or source gives no parts of files, so that all {} bytes have been loaded: it is played \
                     whole. Over http and https, HttpRangesPlugin reads parts, if the server does",
                    context.path(),
                    bytes.len()
                );
                Loading::new(&path, bytes, options)?
            }
        };
        while let Some(name) = load_in_steps(&mut loading).await? {
            let file = read_beside(context, &name).await;
            loading.supply(file);
        }
        for sentence in loading.lost() {
            info!("{}: {sentence}", path.display());
        }
        Ok(GaussianCapture::new(loading.finish()?).with_usages(settings.asset_usage))
    }

    fn extensions(&self) -> &[&str] {
        static EXTENSIONS: LazyLock<Vec<&'static str>> = LazyLock::new(extensions);
        &EXTENSIONS
    }
}

/// Does steps, with pauses, until a file of the folder is wanted, whose name it returns, or all are done.
pub(super) async fn load_in_steps(loading: &mut Loading) -> Result<Option<String>, CaptureLoadError> {
    let mut pauses = Pauses::default();
    loop {
        if let Some(name) = loading.wanted() {
            return Ok(Some(name.to_owned()));
        }
        if !loading.advance(Loading::STEP)? {
            return Ok(None);
        }
        pauses.after_step().await;
    }
}

/// Reads a file in the folder of the asset that is loaded.
async fn read_beside(context: &mut LoadContext<'_>, name: &str) -> Result<Vec<u8>, Error> {
    let asset = context.path();
    let file = AssetPath::from(asset.path().with_file_name(name)).with_source(asset.source().clone_owned());
    context.read_asset_bytes(file).await.map_err(|error| {
        let kind = match &error {
            ReadAssetBytesError::AssetReaderError(AssetReaderError::NotFound(_)) => ErrorKind::NotFound,
            _ => ErrorKind::Other,
        };
        Error::new(kind, error.to_string())
    })
}
