//! The reader of a build without the feature `fourdgs`.
//!
//! In: a file. Out: an error with the line that builds a command with the feature.

use crate::codec::import::source::Source;
use crate::codec::import::{ImportError, Imported};
use crate::codec::options::ReadOptions;

/// Refuses a file.
///
/// # Errors
/// Always.
pub(crate) fn read(_: &Source<'_>, _: &ReadOptions) -> Result<Imported, ImportError> {
    Err(ImportError::unsupported(
        "a .4dgs file, which this build does not read: build with `--features fourdgs`, or convert it with the command gs4d",
    ))
}
