//! Merging the stored scores of the shards of the stage score.
//!
//! In: the folder of results of a bake, the number of shards. Out: the scores of all views.

use super::BakeError;
use super::job::shard_name;
use crate::offline::prune::PruneError;
use crate::offline::score::Scores;
use crate::offline::store::results::{Key, Store};
use crate::offline::store::shard::Shard;
use crate::offline::store::stored::Stored;

/// Merges the stored scores of all shards, for a scene of `count` Gaussians.
///
/// # Errors
/// A shard that has not been scored with the same inputs.
pub(crate) fn merged_scores(store: &Store, count: usize, shards: u32, key: Key) -> Result<Scores, BakeError> {
    let mut merged: Option<Scores> = None;
    for shard in Shard::all(shards) {
        let scores = store.load(&shard_name(shard), key).and_then(|bytes| Scores::decode(&bytes));
        let missing = || BakeError::MissingShard { folder: store.folder().to_owned(), shard };
        let scores = scores.filter(|scores| scores.len() == count).ok_or_else(missing)?;
        match &mut merged {
            Some(merged) => merged.merge(&scores),
            None => merged = Some(scores),
        }
    }
    Ok(merged.ok_or(PruneError::NoScore)?.whole()?)
}
