//! A bake as jobs for many machines.
//!
//! In: the settings of a bake, its scene and views. Out: the jobs, and the results of shards put together.
//!
//! | file | subject |
//! |---|---|
//! | `job` | one job: a stage, or a shard of it |
//! | `plan` | all jobs of a bake, with what they need and what they wait for |
//! | `merged_scores` | the stored sums of all shards of the stage score, put together |

pub(crate) mod job;
pub(crate) mod merged_scores;
pub(crate) mod plan;
