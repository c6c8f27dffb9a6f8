//! The loader of sounds.
//!
//! In: the bytes of a file in Ogg Vorbis or WAV, from any asset source. Out: a [`SoundTrack`], or a [`SoundLoadError`],
//! to which Bevy adds the path.

use crate::codec::sound::{SoundError, decode};
use crate::plugin::component::SoundTrack;
use bevy::asset::io::Reader;
use bevy::asset::{AssetLoader, LoadContext};
use bevy::reflect::TypePath;

/// Why a sound could not be loaded.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SoundLoadError {
    /// The asset source could not deliver the bytes.
    #[error("the file could not be read: {0}")]
    Read(#[from] std::io::Error),
    /// The file cannot be used.
    #[error("the file {0}")]
    Invalid(#[from] SoundError),
}

/// Loads sounds as [`SoundTrack`]s: Ogg Vorbis and WAV. Errors: [`SoundLoadError`].
///
/// Files are loaded by the type of the asset, whatever their names. The extensions of its own are for
/// `AssetMode::Processed`, where a file named `song.ogg` is Bevy's `AudioSource`.
#[derive(Debug, Default, Clone, Copy, TypePath)]
#[type_path = "bevy_gs4d::asset"]
pub struct SoundLoader;

impl AssetLoader for SoundLoader {
    type Asset = SoundTrack;
    type Settings = ();
    type Error = SoundLoadError;

    async fn load(
        &self,
        reader: &mut dyn Reader,
        _settings: &(),
        _context: &mut LoadContext<'_>,
    ) -> Result<SoundTrack, SoundLoadError> {
        let mut bytes = Vec::new();
        reader.read_to_end(&mut bytes).await?;
        Ok(SoundTrack(decode(bytes)?))
    }

    fn extensions(&self) -> &[&str] {
        // A processor of assets finds a loader by the extension alone.
        &["sound.ogg", "sound.wav"]
    }
}
