//! One of several equal shares of a list.
//!
//! In: `I/N`, the weights of the items of a list. Out: the items of the share, which follow one another in the list. The shares of all shards
//! are the list.

use serde::{Deserialize, Serialize};
use std::fmt;
use std::ops::Range;
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

    /// Returns the items of this shard of a list with these weights. The shares follow one another, and the weight of each differs from an
    /// equal share by at most that of one item.
    pub fn share(self, weights: &[usize]) -> Range<usize> {
        let total = sum(weights);
        let (index, count) = (u128::from(self.index), u128::from(self.count));
        // An item belongs to the shard in which the middle of its weight lies.
        let first_of = |shard: u128| {
            let mut before = 0;
            let is_before = |weight: &&usize| {
                let middle = 2 * before + **weight as u128;
                before += **weight as u128;
                middle * count < 2 * total * shard
            };
            weights.iter().take_while(is_before).count()
        };
        let end = if index + 1 == count { weights.len() } else { first_of(index + 1) };
        first_of(index).min(end)..end
    }
}

fn sum(weights: &[usize]) -> u128 {
    weights.iter().map(|&weight| weight as u128).sum()
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
    fn shares_follow_one_another_and_are_nearly_equal() {
        for weights in [vec![1; 600], vec![20; 30], vec![1, 50, 1, 1, 1, 40, 2], vec![3], Vec::new(), vec![0; 5]] {
            for count in [1, 2, 3, 4, 7, 100] {
                let mut end = 0;
                for shard in Shard::all(count) {
                    let share = shard.share(&weights);
                    assert_eq!(share.start, end, "{shard} of {weights:?} begins where the one before ends");
                    end = share.end;
                    let weight = weights[share].iter().sum::<usize>() as f64;
                    let (equal, most) =
                        (weights.iter().sum::<usize>() as f64 / f64::from(count), weights.iter().max().unwrap_or(&0));
                    assert!((weight - equal).abs() <= *most as f64, "{shard} of {weights:?} weighs {weight}");
                }
                assert_eq!(end, weights.len(), "the last of {count} shards ends with the list");
            }
        }
    }
}
