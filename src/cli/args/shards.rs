//! Work in shards.
//!
//! In: `--shard I/N`, or `--merge PART...`. Out: which shard to compute, or the parts to put together.

use super::Given;
use super::effects::Need;
use crate::cli::output::failure::Failure;
use crate::offline::store::shard::Shard;
use std::path::{Path, PathBuf};

/// The shards of a computation.
#[derive(clap::Args)]
#[command(next_help_heading = "Shards")]
pub(crate) struct ShardArgs {
    /// Compute only shard I of N, 0/N to N-1/N, and write its part to OUT; an existing part of the same inputs is kept.
    #[arg(long, value_name = "I/N", conflicts_with = "merge")]
    shard: Option<Shard>,
    /// Put the parts of all shards together instead of computing: the result is that of one computation.
    #[arg(long, value_name = "PART", num_args = 1..)]
    merge: Vec<PathBuf>,
}

/// The extension of parts.
pub(crate) const PART: &str = "gs4p";

/// Which portion of a computation to do.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Portion<'a> {
    /// All of it.
    All,
    /// One shard.
    Shard(Shard),
    /// None: these are the parts of all shards.
    Parts(&'a [PathBuf]),
}

impl ShardArgs {
    /// Returns the portion to do.
    pub(crate) fn portion(&self) -> Portion<'_> {
        match self.shard {
            Some(shard) => Portion::Shard(shard),
            None if self.merge.is_empty() => Portion::All,
            None => Portion::Parts(&self.merge),
        }
    }

    /// Returns the parts to read.
    pub(crate) fn parts(&self) -> &[PathBuf] {
        &self.merge
    }

    /// Returns the path of a part to write.
    ///
    /// # Errors
    /// No path is given.
    pub(crate) fn out<'a>(&self, out: Option<&'a Path>) -> Result<&'a Path, Failure> {
        out.ok_or_else(|| Failure::new("no OUT is given: name the part to write, with -o"))
    }

    /// Checks that no option that has an effect only on the whole computation is given with `--shard`.
    ///
    /// # Errors
    /// The first such option.
    pub(crate) fn check(&self, given: &Given) -> Result<(), Failure> {
        given.require(Need::Whole, self.shard.is_none())
    }
}
