//! A chunk file in the file of its index.
//!
//! In: the file of an index in an asset source, where the chunk file is in it. Out: its capture; an error that names
//! both.

use super::loader::{CaptureLoadError, CaptureLoaderSettings, load_in_steps};
use super::one_file::{PIECE, read_more};
use crate::codec::{Loading, ReadOptions};
use crate::plugin::component::GaussianCapture;
use bevy::asset::io::AssetReaderError;
use bevy::asset::{AssetPath, AssetServer, AssetServerMode};
use bevy::tasks::futures_lite::AsyncSeekExt;
use std::io::{Error, ErrorKind, SeekFrom};
use std::ops::Range;

/// Why a chunk file in the file of an index could not be loaded.
#[derive(Debug, thiserror::Error)]
#[error("{file}: chunk file {}: {reason}", .number + 1)]
pub(crate) struct PartError {
    /// The file of the index.
    file: AssetPath<'static>,
    /// The number of the chunk file, from 0.
    number: usize,
    reason: CaptureLoadError,
}

/// Loads a chunk file from its part of the file of an index.
///
/// # Errors
/// A source or a file that cannot be read there, a damaged chunk file.
pub(crate) async fn load_part(
    server: AssetServer,
    file: AssetPath<'static>,
    number: usize,
    range: Range<u64>,
    settings: CaptureLoaderSettings,
) -> Result<GaussianCapture, PartError> {
    let loaded = match read_part(&server, &file, range).await {
        Ok(bytes) => load_bytes(&file, bytes, &settings.read).await.map(|own| own.with_usages(settings.asset_usage)),
        Err(error) => Err(error.into()),
    };
    loaded.map_err(|reason| PartError { file, number, reason })
}

async fn load_bytes(
    file: &AssetPath<'_>,
    bytes: Vec<u8>,
    options: &ReadOptions,
) -> Result<GaussianCapture, CaptureLoadError> {
    let mut loading = Loading::new(file.path(), bytes, options)?;
    while load_in_steps(&mut loading).await?.is_some() {
        loading.supply(Err(Error::new(ErrorKind::NotFound, "it is in one file with the others")));
    }
    Ok(GaussianCapture::new(loading.finish()?))
}

/// Reads a part of a file of an asset source.
async fn read_part(server: &AssetServer, file: &AssetPath<'_>, range: Range<u64>) -> Result<Vec<u8>, Error> {
    let source = server.get_source(file.source().clone()).map_err(Error::other)?;
    let reader = match server.mode() {
        AssetServerMode::Unprocessed => source.reader(),
        AssetServerMode::Processed => source.processed_reader().map_err(Error::other)?,
    };
    let mut reader = reader.read(file.path()).await.map_err(|error| match error {
        AssetReaderError::NotFound(_) => Error::new(ErrorKind::NotFound, "the file is gone"),
        error => Error::other(error),
    })?;
    let seekable = reader.seekable().map_err(Error::other)?;
    seekable.seek(SeekFrom::Start(range.start)).await?;
    let (mut bytes, length) = (Vec::new(), range.end - range.start);
    while (bytes.len() as u64) < length {
        let left = usize::try_from(length - bytes.len() as u64).unwrap_or(usize::MAX).min(PIECE);
        if read_more(&mut *reader, &mut bytes, left).await? < left {
            return Err(Error::new(ErrorKind::UnexpectedEof, "the file ends before it: copy the file again"));
        }
    }
    Ok(bytes)
}
