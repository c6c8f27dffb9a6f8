//! `activate`: the Gaussians that are active in a segment of time; CPU reference of `shaders/activate.wgsl`.
//!
//! In: a temporal filter and a segment. Out: the indices of its active Gaussians, ascending.

use crate::scene::TemporalFilter;

/// Returns the indices of the active Gaussians of a segment, ascending.
pub fn activate(filter: &TemporalFilter, segment: u32) -> Vec<u32> {
    (0..filter.count as u32).filter(|&index| filter.is_active(segment, index as usize)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{ActiveSets, FilterKind};

    #[test]
    fn the_list_contains_exactly_the_active_gaussians() {
        let (segments, count) = (3, 70);
        let words = TemporalFilter::words(count) * segments as usize;
        // Some bits of each word; bits beyond the last Gaussian have no meaning.
        let bits: Vec<u32> = (0..words as u32).map(|word| 0x9e37_79b9u32.rotate_left(5 * word)).collect();
        let intervals = (0..count as u32).map(|index| (index % 3) | ((index % 4) << 16)).collect();
        for sets in [ActiveSets::Bits(bits), ActiveSets::Intervals(intervals)] {
            let filter = TemporalFilter { kind: FilterKind::Interval, segments, count, sets };
            for segment in 0..segments {
                let list = activate(&filter, segment);
                assert!(list.is_sorted_by(|a, b| a < b), "indices ascend, each once: {list:?}");
                for index in 0..count {
                    let listed = list.contains(&(index as u32));
                    assert_eq!(listed, filter.is_active(segment, index), "Gaussian {index} in segment {segment}");
                }
                assert_eq!(
                    list.len() as u32,
                    filter.active_counts(0..count)[segment as usize],
                    "the list has as many entries as Gaussians are counted"
                );
            }
        }
    }
}
