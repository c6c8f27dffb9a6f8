//! One job of a bake: a stage, which one machine runs, given the results of the stages before it.
//!
//! In: the name of a stage. Out: a [`Job`]; the names under which its results are stored.

use crate::offline::store::shard::Shard;

/// The stages that are jobs, by name, in order. The job `report` also evaluates.
pub(crate) const JOB_STAGES: [(&str, &str); 8] = [
    ("train", "train"),
    ("score", "score"),
    ("prune", "prune"),
    ("rounds", "rounds"),
    ("fine-tune", "fine-tune"),
    ("mask", "mask"),
    ("compress", "compress"),
    ("report", "report"),
];

/// A job of a bake.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Job {
    /// Name of the stage, one of [`JOB_STAGES`].
    pub stage: &'static str,
    /// How the stage score is done.
    pub scoring: Scoring,
}

/// How the stage score is done. Default: by one job.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) enum Scoring {
    /// Every view is scored.
    #[default]
    Whole,
    /// The views of a shard are scored, and their sums stored.
    Shard(Shard),
    /// The stored sums of this number of shards are put together.
    Merge(u32),
}

/// Returns the name under which the sums of a shard of the stage score are stored.
pub(crate) fn shard_name(shard: Shard) -> String {
    format!("score-{}-of-{}", shard.index(), shard.count())
}
