//! The objects that an input URL stands for.
//!
//! In: a place. Out: an object and those that belong beside it, or all objects of a folder, with their versions.

use super::place::Place;
use super::store_error::StoreError;
use crate::codec::text::printable;
use futures_util::TryStreamExt;
use object_store::{Error, ObjectMeta, ObjectStoreExt};
use std::collections::HashSet;
use std::time::{SystemTime, UNIX_EPOCH};

/// Files that are read together with a file of another name: the settings of a trainer beside its checkpoint.
const BESIDE: [(&str, &str); 1] = [(".pth", "cfg_args")];

/// An object of an input.
pub(super) struct Listed {
    /// The object.
    pub place: Place,
    /// Its path in the folder of the input, with `/` between parts.
    pub relative: String,
    /// Its properties.
    pub meta: ObjectMeta,
}

impl Listed {
    /// Returns the version of the object: other bytes have another version. An object without one is new each time.
    pub(super) fn version(&self) -> String {
        let ObjectMeta { e_tag, last_modified, size, .. } = &self.meta;
        match (e_tag, last_modified.timestamp()) {
            (Some(tag), _) => format!("{size} {tag}"),
            (None, 0) => {
                let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
                format!("{size} at {}", now.as_nanos())
            }
            (None, modified) => format!("{size} of {modified}"),
        }
    }
}

/// Returns the object of a place, with those that belong beside it; if there is none, the objects of the folder of this name.
///
/// # Errors
/// There is neither, a name cannot be that of a file, or the store fails.
pub(super) async fn list(place: &Place) -> Result<Vec<Listed>, StoreError> {
    if !place.is_folder {
        match place.store.head(&place.key).await {
            Ok(meta) => {
                let object = Listed { place: place.clone(), relative: place.name().to_owned(), meta };
                return with_neighbors(object).await;
            }
            Err(Error::NotFound { .. }) if place.lists => {}
            Err(error) => return Err(StoreError::of(&place.url, &error)),
        }
    }
    if !place.lists {
        return Err(StoreError::new(&place.url, "servers do not list folders: name a file, or a folder of s3://"));
    }
    let found: Vec<ObjectMeta> =
        place.store.list(Some(&place.key)).try_collect().await.map_err(|error| StoreError::of(&place.url, &error))?;
    // Some tools make an object for a folder.
    let objects = found.into_iter().filter(|meta| meta.size > 0 || !meta.location.as_ref().ends_with('/'));
    let listed: Vec<Listed> = objects.map(|meta| listed(place, meta)).collect::<Result<_, _>>()?;
    if listed.is_empty() {
        let reason = "there is neither a file nor a folder of this name: check the bucket and the key";
        return Err(StoreError::new(&place.url, reason));
    }
    check_names(place, &listed)?;
    Ok(listed)
}

fn listed(place: &Place, meta: ObjectMeta) -> Result<Listed, StoreError> {
    let inside: Vec<String> = meta
        .location
        .prefix_match(&place.key)
        .map_or_else(Vec::new, |parts| parts.map(|part| part.as_ref().to_owned()).collect());
    let relative = [&[place.name().to_owned()][..], &inside].concat().join("/");
    // On any system: neither a drive nor a folder above.
    if inside.is_empty() || inside.iter().any(|part| part == ".." || part.contains(['\\', ':', '\0'])) {
        let name = printable(meta.location.as_ref());
        return Err(StoreError::new(
            &place.url,
            format!("has an object of the name {name}, which cannot be a file: rename it"),
        ));
    }
    Ok(Listed { place: place.beside(&relative), relative, meta })
}

/// Checks that no object is a file and a folder at once.
fn check_names(place: &Place, listed: &[Listed]) -> Result<(), StoreError> {
    let files: HashSet<&str> = listed.iter().map(|object| object.relative.as_str()).collect();
    let ancestors = |relative: &'_ str| {
        relative.match_indices('/').map(|(at, _)| relative.get(..at).unwrap_or_default().to_owned()).collect::<Vec<_>>()
    };
    match listed.iter().flat_map(|object| ancestors(&object.relative)).find(|folder| files.contains(folder.as_str())) {
        Some(name) => {
            Err(StoreError::new(&place.url, format!("has a file and a folder of the name {name}: rename one")))
        }
        None => Ok(()),
    }
}

async fn with_neighbors(object: Listed) -> Result<Vec<Listed>, StoreError> {
    let (first, mut all) = (object.place.clone(), vec![object]);
    for (_, beside) in BESIDE.iter().filter(|(ending, _)| first.name().ends_with(ending)) {
        let place = first.beside(beside);
        match place.store.head(&place.key).await {
            Ok(meta) => all.push(Listed { place, relative: (*beside).to_owned(), meta }),
            // Who may not list a bucket is refused what does not exist.
            Err(Error::NotFound { .. } | Error::PermissionDenied { .. }) => {}
            Err(error) => return Err(StoreError::of(&place.url, &error)),
        }
    }
    Ok(all)
}
