//! The stored results of the shards of the stage score, put together.
//!
//! In: the folder of results of a bake, the number of shards. Out: the scores of all views.

use super::job::shard_name;
use crate::offline::OfflineError;
use crate::offline::score::Scores;
use crate::offline::shard::Shard;
use crate::offline::store::{Key, Store};
use crate::offline::stored::Stored;

/// Puts the stored sums of all shards together, for a scene of `count` Gaussians.
///
/// # Errors
/// A shard that has not been scored with the same inputs.
pub(crate) fn merged_scores(store: &Store, count: usize, shards: u32, key: Key) -> Result<Scores, OfflineError> {
    let mut merged: Option<Scores> = None;
    for shard in Shard::all(shards) {
        let scores = store.load(&shard_name(shard), key).and_then(|bytes| Scores::decode(&bytes));
        let scores = scores.filter(|scores| scores.len() == count).ok_or_else(|| {
            let message = format!(
                "has no result of the shard {shard} of the stage score: run --only score --shard {shard} before"
            );
            OfflineError::at(store.folder(), message)
        })?;
        match &mut merged {
            Some(merged) => merged.merge(&scores),
            None => merged = Some(scores),
        }
    }
    Ok(merged.ok_or(OfflineError::NoScore)?.whole()?)
}
