//! Merging of alike Gaussians of consecutive frames.
//!
//! In: Gaussians at rest, each active in one interval of segments of time, and a tolerance. Out: fewer Gaussians in
//! longer intervals.
//!
//! A frame is the set of Gaussians that begin in one segment. A Gaussian extends the chain at the same place in the
//! previous frame if both are alike; otherwise a chain at any place that is equal in every bit. All members of a chain
//! are compared with the first, which is drawn in place of all of them.

use super::filter::{ActiveSets, TemporalFilter};
use super::sliced::Sliced;
use crate::gaussian::Gaussian;
use std::collections::HashMap;

/// The spherical harmonic of degree 0, the factor on the DC coefficient.
const FIRST_COEFFICIENT: f32 = 0.282_094_8;

/// Merges alike Gaussians. Two Gaussians are alike if their means differ by at most `tolerance` times the root mean
/// square of the scales, their covariances and opacities by at most the fraction `tolerance`, and each color
/// coefficient by at most `tolerance` on the scale of colors from 0 to 1. Returns `None` if the filter does not have
/// intervals for these Gaussians.
pub fn merge_neighbors(sliced: &Sliced, filter: &TemporalFilter, tolerance: f32) -> Option<(Sliced, TemporalFilter)> {
    let ActiveSets::Intervals(intervals) = &filter.sets else { return None };
    filter.check(sliced.gaussians.len()).ok()?;
    let mut frames = vec![Vec::new(); filter.segments as usize];
    for (index, &word) in intervals.iter().enumerate() {
        let (first, last) = (word & 0xffff, word >> 16);
        if first <= last {
            frames[first as usize].push(index);
        }
    }
    let mut chains = Chains { sliced, tolerance, ends: vec![None; intervals.len()] };
    // The chains that end in each segment, in the order of their last members.
    let mut ending: Vec<Vec<usize>> = vec![Vec::new(); frames.len()];
    for (segment, frame) in frames.iter().enumerate() {
        let mut before = match segment.checked_sub(1) {
            Some(before) => std::mem::take(&mut ending[before]),
            None => Vec::new(),
        };
        for (chain, end) in chains.joined(frame, &mut before, intervals) {
            ending[end as usize].push(chain);
        }
    }
    let kept: Vec<u32> =
        (0..intervals.len()).filter(|&index| chains.ends[index].is_some()).map(|index| index as u32).collect();
    let word = |&index: &u32| {
        let index = index as usize;
        intervals[index] & 0xffff | chains.ends[index].unwrap_or_default() << 16
    };
    let sets = ActiveSets::Intervals(kept.iter().map(word).collect());
    let mut harmonics = sliced.harmonics.clone();
    harmonics.values = kept.iter().flat_map(|&index| sliced.harmonics.of(index as usize)).copied().collect();
    let gaussians = kept.iter().map(|&index| sliced.gaussians[index as usize]).collect();
    Some((Sliced { gaussians, harmonics }, TemporalFilter { count: kept.len(), sets, ..filter.clone() }))
}

/// Chains of alike Gaussians, by the index of the first member.
struct Chains<'a> {
    sliced: &'a Sliced,
    tolerance: f32,
    /// The last segment of the chain that begins with each Gaussian; `None` for its other members and for Gaussians
    /// that are never active.
    ends: Vec<Option<u32>>,
}

impl Chains<'_> {
    /// Adds a frame. `before` are the chains that end in the previous segment. Returns the chain of each Gaussian of
    /// the frame, and the segment in which the chain ends.
    fn joined(&mut self, frame: &[usize], before: &mut [usize], intervals: &[u32]) -> Vec<(usize, u32)> {
        let mut taken = vec![false; before.len()];
        let mut chain_of = vec![None; frame.len()];
        for (place, &index) in frame.iter().enumerate() {
            if let Some(&chain) = before.get(place)
                && self.are_alike(chain, index)
            {
                (taken[place], chain_of[place]) = (true, Some(chain));
            }
        }
        let free = before.iter().zip(&taken).filter(|(_, taken)| !**taken).map(|(&chain, _)| chain);
        let mut by_bits: HashMap<u64, Vec<usize>> = HashMap::new();
        for chain in free {
            by_bits.entry(self.hash(chain)).or_default().push(chain);
        }
        let mut joined = Vec::with_capacity(frame.len());
        for (place, &index) in frame.iter().enumerate() {
            let chain = match chain_of[place] {
                Some(chain) => chain,
                None => self.take_equal(&mut by_bits, index).unwrap_or(index),
            };
            let end = intervals[index] >> 16;
            self.ends[chain] = Some(end);
            joined.push((chain, end));
        }
        joined
    }

    /// Removes a chain whose first member is equal to a Gaussian in every bit, and returns it.
    fn take_equal(&self, by_bits: &mut HashMap<u64, Vec<usize>>, index: usize) -> Option<usize> {
        let candidates = by_bits.get_mut(&self.hash(index))?;
        let at = candidates.iter().position(|&chain| self.are_equal(chain, index))?;
        Some(candidates.swap_remove(at))
    }

    fn hash(&self, index: usize) -> u64 {
        let bytes = bytemuck::bytes_of(&self.sliced.gaussians[index]);
        // FNV-1a, over words.
        let words = bytes.as_chunks::<4>().0.iter().map(|word| u64::from(u32::from_le_bytes(*word)));
        words.fold(0xcbf2_9ce4_8422_2325, |hash, word| (hash ^ word).wrapping_mul(0x0100_0000_01b3))
    }

    fn are_equal(&self, a: usize, b: usize) -> bool {
        let Sliced { gaussians, harmonics } = self.sliced;
        let is_same = |a: &[f32], b: &[f32]| bytemuck::cast_slice::<f32, u32>(a) == bytemuck::cast_slice::<f32, u32>(b);
        bytemuck::bytes_of(&gaussians[a]) == bytemuck::bytes_of(&gaussians[b])
            && is_same(harmonics.of(a), harmonics.of(b))
    }

    /// Returns whether two Gaussians are equal, or at rest and alike within the tolerance.
    fn are_alike(&self, a: usize, b: usize) -> bool {
        if self.are_equal(a, b) {
            return true;
        }
        let Sliced { gaussians, harmonics } = self.sliced;
        let (one, other) = (&gaussians[a], &gaussians[b]);
        let is_at_rest = |gaussian: &Gaussian| gaussian.velocity == [0.0; 3] && gaussian.sigma_t == f32::INFINITY;
        if self.tolerance == 0.0 || !is_at_rest(one) || !is_at_rest(other) {
            return false;
        }
        let squared = |values: &[f32]| values.iter().map(|value| value * value).sum::<f32>();
        let difference = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f32>();
        let [xx, _, _, yy, _, zz] = one.covariance;
        let allowed = self.tolerance * self.tolerance;
        let colors = harmonics.of(a).iter().zip(harmonics.of(b));
        difference(&one.mean, &other.mean) <= allowed * (xx + yy + zz) / 3.0
            && difference(&one.covariance, &other.covariance) <= allowed * squared(&one.covariance)
            && (one.opacity - other.opacity).abs() <= self.tolerance * one.opacity
            && colors.map(|(a, b)| (a - b).abs() * FIRST_COEFFICIENT).all(|difference| difference <= self.tolerance)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gaussian::Harmonics;
    use crate::scene::FilterKind;

    /// Returns a flipbook: for each frame the x and the red coefficient of its Gaussians.
    fn flipbook(frames: &[&[(f32, f32)]]) -> (Sliced, TemporalFilter) {
        let (mut gaussians, mut values, mut intervals) = (Vec::new(), Vec::new(), Vec::new());
        for (frame, own) in frames.iter().enumerate() {
            for &(x, red) in *own {
                gaussians.push(Gaussian {
                    mean: [x, 0.0, 0.0],
                    sigma_t: f32::INFINITY,
                    covariance: [0.01, 0.0, 0.0, 0.01, 0.0, 0.01],
                    opacity: 0.5,
                    ..bytemuck::Zeroable::zeroed()
                });
                values.extend([red, 0.0, 0.0]);
                intervals.push((frame | frame << 16) as u32);
            }
        }
        let count = gaussians.len();
        let harmonics = Harmonics { coefficients: 1, degree: 0, degree_t: 0, values };
        let (segments, sets) = (frames.len() as u32, ActiveSets::Intervals(intervals));
        (Sliced { gaussians, harmonics }, TemporalFilter { kind: FilterKind::Window, segments, count, sets })
    }

    /// Returns x and interval of each Gaussian after merging.
    fn merged(frames: &[&[(f32, f32)]], tolerance: f32) -> Vec<(f32, u32, u32)> {
        let (sliced, filter) = flipbook(frames);
        let (sliced, filter) = merge_neighbors(&sliced, &filter, tolerance).expect("a filter of intervals");
        assert_eq!(filter.check(sliced.gaussians.len()), Ok(()), "the filter is that of the Gaussians left");
        assert!(sliced.harmonics.is_consistent(sliced.gaussians.len()), "each Gaussian left has its color");
        let ActiveSets::Intervals(words) = filter.sets else { panic!("intervals") };
        sliced
            .gaussians
            .iter()
            .zip(words)
            .map(|(gaussian, word)| (gaussian.mean[0], word & 0xffff, word >> 16))
            .collect()
    }

    #[test]
    fn equal_gaussians_of_consecutive_frames_become_one() {
        let frames: [&[(f32, f32)]; 4] =
            [&[(1.0, 0.1), (2.0, 0.2)], &[(1.0, 0.1), (2.5, 0.2)], &[(1.0, 0.1), (2.0, 0.2)], &[(3.0, 0.1)]];
        let expected = [(1.0, 0, 2), (2.0, 0, 0), (2.5, 1, 1), (2.0, 2, 2), (3.0, 3, 3)];
        assert_eq!(merged(&frames, 0.0), expected, "only equal Gaussians of consecutive frames are merged");
    }

    #[test]
    fn equal_gaussians_are_found_at_any_place_of_the_frame_before() {
        let frames: [&[(f32, f32)]; 3] =
            [&[(1.0, 0.1), (2.0, 0.2), (2.0, 0.2)], &[(2.0, 0.2), (1.0, 0.1), (4.0, 0.0)], &[(2.0, 0.2), (2.0, 0.2)]];
        let expected = [(1.0, 0, 1), (2.0, 0, 2), (2.0, 0, 0), (4.0, 1, 1), (2.0, 2, 2)];
        let mut found = merged(&frames, 0.0);
        found.sort_by(|a, b| (a.1, a.0).partial_cmp(&(b.1, b.0)).expect("numbers"));
        let mut sorted = expected.to_vec();
        sorted.sort_by(|a, b| (a.1, a.0).partial_cmp(&(b.1, b.0)).expect("numbers"));
        assert_eq!(found.len(), sorted.len(), "the number of merged Gaussians: {found:?}");
        assert!(
            found.contains(&(1.0, 0, 1)) && found.contains(&(2.0, 0, 2)),
            "each Gaussian extends one chain only: {found:?}"
        );
    }

    #[test]
    fn a_chain_stays_within_the_tolerance_of_its_first() {
        // Scales of 0.1: a step of 0.004 is 0.04 of them.
        let frames: Vec<Vec<(f32, f32)>> = (0..6).map(|frame| vec![(frame as f32 * 0.004, 0.0)]).collect();
        let frames: Vec<&[(f32, f32)]> = frames.iter().map(Vec::as_slice).collect();
        let intervals: Vec<(u32, u32)> = merged(&frames, 0.1).iter().map(|&(_, first, last)| (first, last)).collect();
        assert_eq!(intervals, [(0, 2), (3, 5)], "three steps are more than a tenth of the scale");
        assert_eq!(merged(&frames, 0.0).len(), 6, "no two Gaussians are equal");
        let colors: [&[(f32, f32)]; 2] = [&[(1.0, 0.0)], &[(1.0, 0.5)]];
        assert_eq!((merged(&colors, 0.1).len(), merged(&colors, 0.2).len()), (2, 1), "a difference of 0.14 in red");
    }

    #[test]
    fn the_same_gaussians_are_drawn_at_every_time() {
        let mut random = crate::scene::random::Random::new(3);
        let pool: Vec<(f32, f32)> = (0..20).map(|_| (random.unit(), random.unit())).collect();
        let frames: Vec<Vec<(f32, f32)>> =
            (0..30).map(|_| (0..15).map(|_| pool[(random.unit() * 20.0) as usize]).collect()).collect();
        let frames: Vec<&[(f32, f32)]> = frames.iter().map(Vec::as_slice).collect();
        let found = merged(&frames, 0.0);
        assert!(found.len() < 400, "many of 450 are merged: {}", found.len());
        for (frame, own) in frames.iter().enumerate() {
            let frame = frame as u32;
            let mut drawn: Vec<f32> =
                found.iter().filter(|(_, first, last)| (*first..=*last).contains(&frame)).map(|(x, ..)| *x).collect();
            let mut expected: Vec<f32> = own.iter().map(|(x, _)| *x).collect();
            drawn.sort_by(f32::total_cmp);
            expected.sort_by(f32::total_cmp);
            assert_eq!(drawn, expected, "the Gaussians drawn in frame {frame}");
        }
    }
}
