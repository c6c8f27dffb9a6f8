//! From files to objects.
//!
//! In: the files that a verb has written, and the place of the output. Out: objects, each of which replaces an existing one when it is complete. That
//! of the output itself is the last: where it is, the files beside it are, too.

use super::cache::Staging;
use super::place::Place;
use super::store_error::StoreError;
use object_store::{ObjectStoreExt, PutPayload, WriteMultipart};
use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

/// Bytes above which an object is sent in parts.
const LARGE: u64 = 32 << 20;
/// Bytes of a part.
const PART: usize = 8 << 20;
/// Number of parts that are sent at a time.
const AT_A_TIME: usize = 4;

/// Why a file was not uploaded.
enum UploadError {
    Store(object_store::Error),
    Disk(io::Error),
}

impl From<io::Error> for UploadError {
    fn from(error: io::Error) -> Self {
        Self::Disk(error)
    }
}

impl From<object_store::Error> for UploadError {
    fn from(error: object_store::Error) -> Self {
        Self::Store(error)
    }
}

/// Uploads what a verb has written for the output at `place`. Returns the URLs.
///
/// # Errors
/// The first file that cannot be uploaded.
pub(super) async fn upload(staging: &Staging, place: &Place) -> Result<Vec<String>, StoreError> {
    let mut files = staging.files().map_err(|error| StoreError::new(&place.url, error))?;
    files.sort_by_key(|file| file == place.name());
    let mut urls = Vec::new();
    for file in files {
        let target = place.beside(&file);
        send(&staging.folder.join(&file), &target).await.map_err(|error| match error {
            UploadError::Store(error) => StoreError::of(&target.url, &error),
            UploadError::Disk(error) => StoreError::new(&target.url, format!("its copy cannot be read: {error}")),
        })?;
        urls.push(target.url);
    }
    Ok(urls)
}

async fn send(path: &Path, target: &Place) -> Result<(), UploadError> {
    let mut file = File::open(path)?;
    if file.metadata()?.len() <= LARGE {
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes)?;
        target.store.put(&target.key, PutPayload::from(bytes)).await?;
        return Ok(());
    }
    let mut parts = WriteMultipart::new_with_chunk_size(target.store.put_multipart(&target.key).await?, PART);
    let sent = send_parts(&mut file, &mut parts).await;
    match sent {
        Ok(()) => {
            parts.finish().await?;
            Ok(())
        }
        Err(error) => {
            // What has been sent is no object. Stores remove it after some days where it cannot be removed now.
            let _ = parts.abort().await;
            Err(error)
        }
    }
}

async fn send_parts(file: &mut File, parts: &mut WriteMultipart) -> Result<(), UploadError> {
    let mut bytes = vec![0; PART];
    loop {
        let read = file.read(&mut bytes)?;
        if read == 0 {
            return Ok(());
        }
        parts.wait_for_capacity(AT_A_TIME).await?;
        parts.write(bytes.get(..read).unwrap_or_default());
    }
}
