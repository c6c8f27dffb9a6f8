//! The encoder of a build without the feature `fourdgs`.
//!
//! In: Gaussians. Out: an error with the line that builds a command with the feature.

use crate::codec::export::clip::Clip;
use crate::codec::export::error::ExportError;
use crate::codec::import::columns::Columns;

/// Refuses to write a file.
///
/// # Errors
/// Always.
pub(crate) fn encode(_: &Columns, _: &Clip) -> Result<(Vec<u8>, Vec<String>), ExportError> {
    Err(ExportError::Unsupported(
        "this build does not write .4dgs files: build with `--features fourdgs`, or use the command gs4d".to_owned(),
    ))
}
