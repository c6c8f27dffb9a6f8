//! Changes to files, by their format.
//!
//! In: a seed, another seed, random numbers. Out: a file with errors.

pub mod archive;
pub mod bytes;
pub mod gaussians;
pub mod jpeg;
pub mod numbers;
pub mod pickle;
pub mod png;
pub mod text;
pub mod words;

use crate::support::random::Random;
use std::ops::Range;

impl Random {
    /// Returns true once in `count` times.
    pub fn one_in(&mut self, count: usize) -> bool {
        self.below(count) == 0
    }

    /// Returns one of the items, at least one.
    pub fn pick<'a, T>(&mut self, items: &'a [T]) -> &'a T {
        &items[self.below(items.len())]
    }

    /// Returns a range within `0..length`, more often short than long.
    pub fn part(&mut self, length: usize) -> Range<usize> {
        let start = self.below(length + 1);
        let left = length - start;
        let longest = if self.one_in(3) { left } else { left.min(16) };
        start..start + self.below(longest + 1)
    }
}

/// Drops, repeats or moves items of a list, or takes one from another list.
pub fn change_list<T: Clone>(items: &mut Vec<T>, others: &[T], random: &mut Random) {
    let (at, to) = (random.below(items.len()), random.below(items.len() + 1));
    match random.below(5) {
        0 if !items.is_empty() => drop(items.remove(at)),
        1 if !items.is_empty() => items.insert(to, items[at].clone()),
        2 if !items.is_empty() => {
            let with = random.below(items.len());
            items.swap(at, with);
        }
        3 => items.truncate(to),
        _ if !others.is_empty() => items.insert(to, random.pick(others).clone()),
        _ => {}
    }
}
