//! Files that must exist.
//!
//! In: paths. Out: an error that names the first few files that do not exist, and their number.

use super::error::DatasetError;
use std::path::PathBuf;

/// Most missing images that an error names.
const MISSING_LISTED: usize = 4;

/// Checks that all files exist; the error names the first few missing files.
pub(super) fn require_files<'a>(files: impl Iterator<Item = &'a PathBuf>) -> Result<(), DatasetError> {
    let (mut first, mut missing, mut total) = (Vec::new(), 0, 0);
    for file in files {
        total += 1;
        if !file.is_file() {
            missing += 1;
            if first.len() < MISSING_LISTED {
                first.push(file.clone());
            }
        }
    }
    if missing == 0 { Ok(()) } else { Err(DatasetError::MissingImages { first, missing, total }) }
}
