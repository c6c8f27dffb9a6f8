//! The error of interrupted work.
//!
//! In: nothing. Out: [`Interrupted`], an error of every function that can end early.

/// The user has interrupted the work. Stored results are kept, and the same work resumes from them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("interrupted")]
pub struct Interrupted;
