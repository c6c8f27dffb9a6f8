//! From an object to a file.
//!
//! In: an object and its version. Out: its bytes as a file, complete or not at all. Large objects are read by ranges, several at a time, all of the
//! same version; a range that arrives incomplete is read again.

use super::listing::Listed;
use super::store_error::StoreError;
use crate::codec::CodecErrorKind;
use crate::offline::temporary_file;
use futures_util::{StreamExt, TryStreamExt, stream};
use object_store::{Error, GetOptions, GetRange, ObjectStoreExt};
use std::fs::File;
use std::io::{self, Seek, SeekFrom, Write};
use std::ops::Range;
use std::path::Path;
use std::time::Duration;

/// Bytes of a range.
const RANGE: u64 = 8 << 20;
/// Number of ranges that are read at a time.
const AT_A_TIME: usize = 6;
/// Number of attempts to read a range, besides those of the client for a request.
const ATTEMPTS: u32 = 4;
/// Time before the second attempt; it doubles.
const WAIT: Duration = Duration::from_millis(200);

/// Why an object was not fetched.
pub(super) enum FetchError {
    /// The store.
    Store(Error),
    /// The disk.
    Disk(io::Error),
    /// The disk, when the file was complete.
    Place(CodecErrorKind),
}

impl From<io::Error> for FetchError {
    fn from(error: io::Error) -> Self {
        Self::Disk(error)
    }
}

/// Fetches an object to `path`.
///
/// # Errors
/// The store fails, the object is replaced meanwhile, or the disk cannot be written to.
pub(super) async fn fetch(object: &Listed, path: &Path) -> Result<(), StoreError> {
    let url = &object.place.url;
    let fetched = async {
        let mut part = temporary_file::create(path.to_owned())?;
        match ranges(object, &mut part.file).await {
            // A server that does not know ranges sends the whole.
            Err(FetchError::Store(Error::NotSupported { .. })) => whole(object, &mut part.file).await?,
            other => other?,
        }
        part.file.sync_all()?;
        temporary_file::replace(vec![(part, path.to_owned())], false).map_err(|error| FetchError::Place(error.kind))
    };
    fetched.await.map_err(|error: FetchError| match error {
        FetchError::Store(error) => StoreError::of(url, &error),
        FetchError::Disk(error) => StoreError::new(url, format!("its copy cannot be written: {error}")),
        FetchError::Place(error) => StoreError::new(url, format!("its copy cannot be written: {error}")),
    })
}

async fn ranges(object: &Listed, file: &mut File) -> Result<(), FetchError> {
    let size = object.meta.size;
    let starts = (0..size).step_by(RANGE as usize);
    let reads = starts.map(|start| read(object, start..size.min(start + RANGE)));
    let mut reads = stream::iter(reads).buffer_unordered(AT_A_TIME);
    while let Some((start, bytes)) = reads.try_next().await? {
        file.seek(SeekFrom::Start(start))?;
        file.write_all(&bytes)?;
    }
    Ok(())
}

/// Reads a range. Returns where it begins, and its bytes.
async fn read(object: &Listed, range: Range<u64>) -> Result<(u64, Vec<u8>), FetchError> {
    let mut wait = WAIT;
    for _ in 1..ATTEMPTS {
        match attempt(object, range.clone()).await {
            Err(FetchError::Store(Error::Generic { .. })) => tokio::time::sleep(wait).await,
            other => return Ok((range.start, other?)),
        }
        wait *= 2;
    }
    Ok((range.start, attempt(object, range).await?))
}

async fn attempt(object: &Listed, range: Range<u64>) -> Result<Vec<u8>, FetchError> {
    // A single range is the whole, which every server sends.
    let is_whole = range == (0..object.meta.size);
    let options = GetOptions {
        range: (!is_whole).then_some(GetRange::Bounded(range.clone())),
        if_match: object.meta.e_tag.clone(),
        ..GetOptions::default()
    };
    let sent = object.place.store.get_opts(&object.place.key, options).await.map_err(FetchError::Store)?;
    let bytes = sent.bytes().await.map_err(FetchError::Store)?;
    match bytes.len() as u64 == range.end - range.start {
        true => Ok(bytes.to_vec()),
        false => Err(incomplete(bytes.len())),
    }
}

/// Reads a whole object, in pieces as they arrive.
async fn whole(object: &Listed, file: &mut File) -> Result<(), FetchError> {
    let sent = object.place.store.get(&object.place.key).await.map_err(FetchError::Store)?;
    let (mut pieces, mut length) = (sent.into_stream(), 0);
    file.set_len(0)?;
    file.seek(SeekFrom::Start(0))?;
    while let Some(piece) = pieces.try_next().await.map_err(FetchError::Store)? {
        length += piece.len();
        file.write_all(&piece)?;
    }
    if length as u64 == object.meta.size { Ok(()) } else { Err(incomplete(length)) }
}

fn incomplete(length: usize) -> FetchError {
    FetchError::Store(Error::Generic { store: "gs4d", source: format!("only {length} bytes arrived").into() })
}
