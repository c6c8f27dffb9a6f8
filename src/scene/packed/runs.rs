//! Runs: packed Gaussians in the order of chunk files.
//!
//! In: the Gaussians that are drawn within some stretches of time, by importance ([`Part`]). Out: [`Runs`], a part of a
//! packed scene that says which of its blocks are in which chunk file, so that the scene can be cut without a change of
//! its values.

use super::lanes::BLOCK;
use crate::scene::chunk_table::ChunkTable;
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// The Gaussians of a chunk file, before they are packed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Part {
    /// The first and the last stretch of time.
    pub stretches: [u32; 2],
    /// Its layer: 0 has the most important Gaussians of its stretches.
    pub layer: u32,
    /// The indices of its Gaussians, ascending.
    pub gaussians: Vec<u32>,
}

/// The runs of a packed scene: the layers one after the other, in each the parts by their stretches of time.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Runs {
    /// Number of stretches of time into which the capture is cut, of equal length.
    pub stretches: u32,
    /// The parts, in the order of their Gaussians.
    pub parts: Vec<RunPart>,
}

/// The packed Gaussians that are only drawn within some stretches of time, of one layer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(from = "Entry", into = "Entry")]
pub struct RunPart {
    /// The first and the last stretch of time.
    pub stretches: [u32; 2],
    /// Its layer: 0 has the most important Gaussians of its stretches.
    pub layer: u32,
    /// Number of Gaussians up to its end, of the whole scene: a multiple of [`BLOCK`], but of the last part.
    pub end: usize,
}

/// A part as it is stored: first and last stretch, layer, end.
#[derive(Serialize, Deserialize)]
struct Entry(u32, u32, u32, usize);

impl From<Entry> for RunPart {
    fn from(Entry(first, last, layer, end): Entry) -> Self {
        Self { stretches: [first, last], layer, end }
    }
}

impl From<RunPart> for Entry {
    fn from(part: RunPart) -> Self {
        Self(part.stretches[0], part.stretches[1], part.layer, part.end)
    }
}

impl Runs {
    /// Returns each part and the indices of its Gaussians.
    pub fn ranges(&self) -> impl Iterator<Item = (&RunPart, Range<usize>)> {
        let starts = std::iter::once(0).chain(self.parts.iter().map(|part| part.end));
        self.parts.iter().zip(starts).map(|(part, start)| (part, start..part.end))
    }

    /// Returns the numbers of Gaussians up to the ends of the layers but the last.
    pub fn layers(&self) -> Vec<usize> {
        self.parts.windows(2).filter(|pair| pair[0].layer != pair[1].layer).map(|pair| pair[0].end).collect()
    }

    /// Checks that the parts are all of `count` Gaussians, in order.
    ///
    /// # Errors
    /// A description of the first fault.
    pub fn check(&self, count: usize) -> Result<(), &'static str> {
        if !(1..=ChunkTable::MOST_STRETCHES).contains(&self.stretches) {
            return Err("runs whose number of stretches is not 1 to 10000");
        }
        if self.parts.len() > ChunkTable::MOST_FILES {
            return Err("runs of more than 99999 parts");
        }
        let is_of_stretches =
            |part: &RunPart| part.stretches[0] <= part.stretches[1] && part.stretches[1] < self.stretches;
        if !self.parts.iter().all(is_of_stretches) {
            return Err("a run whose stretches of time do not exist, or are not in order");
        }
        if !self.parts.is_sorted_by_key(|part| part.layer)
            || self.parts.iter().any(|p| p.layer >= ChunkTable::MOST_LAYERS)
        {
            return Err("runs whose layers are not in order, or are above 15");
        }
        let is_whole = |part: &RunPart| part.end.is_multiple_of(BLOCK) || part.end == count;
        let is_in_order =
            self.parts.is_sorted_by(|a, b| a.end < b.end) && self.parts.first().is_none_or(|part| part.end > 0);
        if !is_in_order || !self.parts.iter().all(is_whole) || self.parts.last().map_or(0, |part| part.end) != count {
            return Err("runs that are not ascending numbers of whole blocks, up to the number of Gaussians");
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn runs() -> Runs {
        let part = |first, last, layer, end| RunPart { stretches: [first, last], layer, end };
        Runs {
            stretches: 4,
            parts: vec![part(0, 0, 0, 256), part(0, 3, 0, 768), part(0, 0, 1, 1024), part(2, 3, 1, 1030)],
        }
    }

    #[test]
    fn parts_have_ranges_and_layers_have_ends() {
        let ranges: Vec<Range<usize>> = runs().ranges().map(|(_, range)| range).collect();
        assert_eq!(ranges, [0..256, 256..768, 768..1024, 1024..1030], "one after the other");
        assert_eq!(runs().layers(), [768], "the end of the first of two layers");
        let text = ron::to_string(&runs()).expect("numbers can be written");
        assert!(text.contains("(0,3,0,768)"), "short: {text}");
        assert_eq!(ron::from_str::<Runs>(&text), Ok(runs()), "and read again");
    }

    #[test]
    fn faulty_runs_are_refused() {
        assert_eq!(runs().check(1030), Ok(()), "good runs");
        assert!(runs().check(1031).is_err(), "of another number of Gaussians");
        let faults: [fn(&mut Runs); 8] = [
            |runs| runs.stretches = 0,
            |runs| runs.stretches = 3,
            |runs| runs.parts[1].stretches = [3, 0],
            |runs| runs.parts[0].layer = 1,
            |runs| runs.parts[3].layer = 16,
            |runs| runs.parts[0].end = 255,
            |runs| runs.parts[0].end = 0,
            |runs| runs.parts[1].end = 1280,
        ];
        for (number, fault) in faults.into_iter().enumerate() {
            let mut bad = runs();
            fault(&mut bad);
            assert!(bad.check(1030).is_err(), "fault {number}");
        }
    }
}
