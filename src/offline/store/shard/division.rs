//! One of several equal shares of a list.
//!
//! In: `I/N`, the weights of the items of a list. Out: the items of the share. The shares of all shards are the list.

use serde::{Deserialize, Serialize};
use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::fmt;
use std::str::FromStr;

/// Most shards of a computation.
const MOST: u32 = 100_000;

/// One of several shards: `I/N`, from `0/N` to `(N − 1)/N`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "(u32, u32)", into = "(u32, u32)")]
pub struct Shard {
    index: u32,
    count: u32,
}

impl Shard {
    /// The only shard: all of the work.
    pub const WHOLE: Self = Self { index: 0, count: 1 };

    /// Returns every shard of a computation in `count` shards, of which there is at least one.
    pub fn all(count: u32) -> impl Iterator<Item = Self> {
        let count = count.clamp(1, MOST);
        (0..count).map(move |index| Self { index, count })
    }

    /// Returns which of the shards this is, from 0.
    pub fn index(self) -> u32 {
        self.index
    }

    /// Returns the number of shards, at least 1.
    pub fn count(self) -> u32 {
        self.count
    }

    /// Returns the items of this shard of a list with these weights, in order. The shares of all shards are the list,
    /// and their weights differ by at most that of one item. Each item goes to the lightest share so far, so that
    /// neighbors, which take about as long as one another, are in different shares.
    pub fn share(self, weights: &[usize]) -> Vec<usize> {
        let mut shares: BinaryHeap<Reverse<(u128, u32)>> = (0..self.count).map(|index| Reverse((0, index))).collect();
        let mut share = Vec::new();
        for (item, &weight) in weights.iter().enumerate() {
            let Some(mut lightest) = shares.peek_mut() else { break };
            let Reverse((weighs, index)) = &mut *lightest;
            *weighs += weight as u128;
            if *index == self.index {
                share.push(item);
            }
        }
        share
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.index, self.count)
    }
}

impl TryFrom<(u32, u32)> for Shard {
    type Error = &'static str;

    fn try_from((index, count): (u32, u32)) -> Result<Self, Self::Error> {
        let valid = (1..=MOST).contains(&count) && index < count;
        valid
            .then_some(Self { index, count })
            .ok_or("expected I/N, from 0/N to N-1/N, such as 0/4, at most 100000 shards")
    }
}

impl From<Shard> for (u32, u32) {
    fn from(Shard { index, count }: Shard) -> Self {
        (index, count)
    }
}

impl FromStr for Shard {
    type Err = &'static str;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let numbers = text.split_once('/').and_then(|(index, count)| Some((index.parse().ok()?, count.parse().ok()?)));
        numbers.unwrap_or_default().try_into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shards_are_named_by_index_and_count() {
        for text in ["0/1", "3/16", "99999/100000"] {
            assert_eq!(text.parse::<Shard>().map(|shard| shard.to_string()), Ok(text.to_owned()), "a shard");
        }
        for text in ["", "4/4", "1", "1/0", "-1/4", "0/100001", "a/b", "1/2/3"] {
            assert!(text.parse::<Shard>().is_err(), "{text:?} is no shard");
        }
    }

    #[test]
    fn shares_are_the_list_and_nearly_equal() {
        for weights in [vec![1; 600], vec![20; 30], vec![1, 50, 1, 1, 1, 40, 2], vec![3], Vec::new(), vec![0; 5]] {
            for count in [1, 2, 3, 4, 7, 100] {
                let shares: Vec<Vec<usize>> = Shard::all(count).map(|shard| shard.share(&weights)).collect();
                let mut all = shares.concat();
                all.sort_unstable();
                assert_eq!(
                    all,
                    (0..weights.len()).collect::<Vec<_>>(),
                    "{count} shares of {weights:?}: each item once"
                );
                let heavy: Vec<usize> =
                    shares.iter().map(|share| share.iter().map(|&item| weights[item]).sum()).collect();
                let apart = heavy.iter().max().zip(heavy.iter().min()).map_or(0, |(most, least)| most - least);
                let most = weights.iter().max().copied().unwrap_or(0);
                assert!(apart <= most, "{count} shares of {weights:?} weigh {heavy:?}");
                assert!(shares.iter().all(|share| share.is_sorted()), "in the order of the list");
            }
        }
        let second = "1/4".parse::<Shard>().expect("a shard");
        assert_eq!(second.share(&[5; 10]), [1, 5, 9], "neighbors are in different shares");
    }
}
