//! The chunks of a `.4dgs` file: groups of Gaussians that a player loads for a part of the duration.
//!
//! In: when each Gaussian is visible, and times at which windows begin and end. Out: the chunks, the longest first. A
//! Gaussian is in the shortest part that contains its life: the whole duration, a part between two of the times, or
//! such a part halved again and again.

use std::collections::BTreeMap;

/// Most halvings of a part.
const DEEPEST: u32 = 6;
/// Fewest Gaussians of a half; those of a smaller half are in the part that was halved.
const FEWEST: usize = 2048;

/// A chunk, with the indices of its Gaussians.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Chunk {
    /// Its part of the duration, seconds.
    pub times: [f64; 2],
    /// How often the part was halved.
    pub level: u32,
    pub members: Vec<usize>,
}

/// A part of the duration: the index of its interval between two bounds, the number of halvings, the index of the half.
type Part = (usize, u32, u32);

/// Returns the chunks. `bounds` are the times in ascending order, the first and the last of the duration included.
pub(super) fn chunks(lives: &[[f64; 2]], bounds: &[f64]) -> Vec<Chunk> {
    let mut parts: BTreeMap<Part, Vec<usize>> = BTreeMap::new();
    let mut all = Vec::new();
    for (index, life) in lives.iter().enumerate() {
        match part(life, bounds) {
            Some(part) => parts.entry(part).or_default().push(index),
            None => all.push(index),
        }
    }
    for level in (1..=DEEPEST).rev() {
        join(&mut parts, level);
    }
    let whole = [bounds.first(), bounds.last()].map(|time| time.copied().unwrap_or_default());
    let mut chunks = vec![Chunk { times: whole, level: 0, members: all }];
    chunks.extend(parts.into_iter().map(|(part, mut members)| {
        members.sort_unstable();
        Chunk { times: times(part, bounds), level: part.1, members }
    }));
    chunks.retain(|chunk| !chunk.members.is_empty());
    chunks.sort_by(|a, b| a.level.cmp(&b.level).then(a.times[0].total_cmp(&b.times[0])));
    chunks
}

/// Returns the shortest part that contains a life; `None` if only the whole duration, or nothing, contains it.
fn part(&[first, last]: &[f64; 2], bounds: &[f64]) -> Option<Part> {
    let number = bounds.partition_point(|&bound| bound <= first).checked_sub(1)?;
    let contains = |part: Part| {
        let [begin, end] = times(part, bounds);
        begin <= first && last <= end
    };
    let mut found = Some((number, 0, 0)).filter(|_| number + 1 < bounds.len()).filter(|&part| contains(part))?;
    while found.1 < DEEPEST {
        let (number, level, half) = found;
        let halves = [half * 2, half * 2 + 1].map(|half| (number, level + 1, half));
        let Some(shorter) = halves.into_iter().find(|&half| contains(half)) else { break };
        found = shorter;
    }
    Some(found)
}

/// Puts the Gaussians of small halves of a level into the parts that were halved.
fn join(parts: &mut BTreeMap<Part, Vec<usize>>, level: u32) {
    let small: Vec<Part> = parts
        .iter()
        .filter(|(part, members)| part.1 == level && members.len() < FEWEST)
        .map(|(&part, _)| part)
        .collect();
    for part in small {
        let members = parts.remove(&part).unwrap_or_default();
        parts.entry((part.0, level - 1, part.2 / 2)).or_default().extend(members);
    }
}

/// Returns the times of a part.
fn times((number, level, half): Part, bounds: &[f64]) -> [f64; 2] {
    let [begin, end] = [number, number + 1].map(|bound| bounds.get(bound).copied().unwrap_or_default());
    let at = |half: u32| begin + (end - begin) * f64::from(half) / f64::from(1u32 << level);
    [at(half), if half + 1 == 1 << level { end } else { at(half + 1) }]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gaussian_is_in_a_chunk_that_contains_its_life() {
        // Enough lives of 0.1 s for chunks of an eighth of the duration; few lives of 0.01 s; lives outside of it.
        let mut lives: Vec<[f64; 2]> = (0..40_000).map(|i| f64::from(i) / 10_000.0).map(|t| [t, t + 0.1]).collect();
        lives.extend((0..100).map(|i| f64::from(i) / 50.0).map(|t| [t, t + 0.01]));
        lives.extend([[-1.0, 0.2], [0.0, 9.0], [7.0, 8.0], [1.0, 0.5]]);
        let chunks = chunks(&lives, &[0.0, 2.0, 4.0]);
        let mut found: Vec<usize> = chunks.iter().flat_map(|chunk| chunk.members.clone()).collect();
        found.sort_unstable();
        assert!(found.into_iter().eq(0..lives.len()), "every Gaussian is in one chunk");
        for chunk in &chunks {
            let [begin, end] = chunk.times;
            for &index in &chunk.members {
                let [first, last] = lives[index];
                let is_inside = begin <= first && last <= end;
                assert!(is_inside || chunk.times == [0.0, 4.0], "{:?} is in {:?}", lives[index], chunk.times);
            }
            assert!(chunk.level == 0 || chunk.members.len() >= FEWEST, "no short part has few Gaussians");
        }
        let shortest = chunks.iter().map(|chunk| chunk.level).max();
        assert!(shortest.is_some_and(|level| level >= 2), "parts are halved: {shortest:?}");
        assert!(chunks.is_sorted_by_key(|chunk| chunk.level), "the longest chunks come first");
    }
}
