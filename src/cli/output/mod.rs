//! What the command prints, and how it ends.
//!
//! In: results, failures, progress and signals. Out: one report on standard output, as text or JSON; progress, notes
//! and errors on standard error.

pub(super) mod colliders;
pub(super) mod curve;
pub(super) mod exposures;
pub(super) mod failure;
pub(super) mod interrupt;
pub(super) mod near;
pub(super) mod note;
pub(super) mod obj;
pub(super) mod plain;
pub(super) mod progress;
mod remedy;
pub(super) mod report;
pub(super) mod system;
pub(super) mod table;
