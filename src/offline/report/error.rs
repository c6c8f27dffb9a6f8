//! The errors of `report`.
//!
//! In: the error of a part. Out: [`ReportError`].

use crate::codec::CodecError;

/// Why the report of a bake cannot be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReportError {
    /// The report cannot be written as JSON.
    #[error("{0}")]
    Json(#[from] serde_json::Error),
    /// A file cannot be written.
    #[error("{0}")]
    Codec(#[from] CodecError),
}
