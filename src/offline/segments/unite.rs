//! The capture of chunks.
//!
//! In: all chunks of a capture, in order. Out: the capture, with the Gaussians in the order of the chunks; a packed one
//! is the package that was cut.

use super::error::{SegmentsError, Shared};
use super::forms::append;
use super::segment::Segment;
use crate::offline::work::{Progress, proceed};
use crate::scene::{ActiveSets, GaussianScene, TemporalFilter};

/// Returns the capture of chunks. Begins the task "uniting".
///
/// # Errors
/// No chunk, packed Gaussians that are no chunks, chunks of different captures, by name.
pub fn unite(chunks: Vec<Segment>, progress: &mut dyn Progress) -> Result<GaussianScene, SegmentsError> {
    chunks.iter().filter(|chunk| !chunk.has_runs()).try_for_each(Segment::require_unpacked)?;
    progress.begin("uniting", chunks.len());
    let mut chunks = chunks.into_iter();
    let Some(Segment { path: first, scene: mut all }) = chunks.next() else { return Err(SegmentsError::Nothing) };
    let mut filters: Vec<TemporalFilter> = all.filter.take().into_iter().collect();
    let mut count = 1;
    for Segment { path, scene } in chunks {
        proceed(progress)?;
        let differs = |what| Err(SegmentsError::Differs { path: path.clone(), first: first.clone(), what });
        if scene.trained_with != all.trained_with || scene.playback != all.playback {
            return differs(Shared::Settings);
        }
        if !append(&mut all.form, scene.form) {
            return differs(Shared::Form);
        }
        count += 1;
        filters.extend(scene.filter);
        let is_alike = |filter: &TemporalFilter| {
            let usual = &filters[0];
            (filter.kind, filter.segments) == (usual.kind, usual.segments)
        };
        if !filters.is_empty() && (filters.len() != count || !filters.iter().all(is_alike)) {
            return differs(Shared::Filter);
        }
        progress.advance();
    }
    all.filter = concatenated(&filters);
    progress.finish();
    Ok(all)
}

/// Returns the filter of the Gaussians of several filters of one number of segments; `None` if there is none.
fn concatenated(filters: &[TemporalFilter]) -> Option<TemporalFilter> {
    let TemporalFilter { kind, segments, .. } = *filters.first()?;
    let count = filters.iter().map(|filter| filter.count).sum();
    let intervals: Option<Vec<&Vec<u32>>> = filters
        .iter()
        .map(|filter| match &filter.sets {
            ActiveSets::Intervals(words) => Some(words),
            ActiveSets::Bits(_) => None,
        })
        .collect();
    if let Some(intervals) = intervals {
        let sets = ActiveSets::Intervals(intervals.into_iter().flatten().copied().collect());
        return Some(TemporalFilter { kind, segments, count, sets });
    }
    let words = TemporalFilter::words(count);
    let mut bits = vec![0; words * segments as usize];
    let mut first = 0;
    for filter in filters {
        for segment in 0..segments {
            for index in (0..filter.count).filter(|&index| filter.is_active(segment, index)) {
                let to = first + index;
                bits[segment as usize * words + to / 32] |= 1 << (to % 32);
            }
        }
        first += filter.count;
    }
    Some(TemporalFilter { kind, segments, count, sets: ActiveSets::Bits(bits) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::offline::work::NoProgress;
    use crate::scene::FilterKind;
    use crate::scene::synth::{SynthSettings, synthesize};
    use std::path::PathBuf;

    fn chunk(seed: u64) -> Segment {
        let scene = synthesize(&SynthSettings { count: 40, seed, ..SynthSettings::default() });
        Segment { path: PathBuf::from(format!("{seed}.gs4d")), scene }
    }

    #[test]
    fn filters_of_both_forms_are_concatenated() {
        let filter = |count, sets| TemporalFilter { kind: FilterKind::Support, segments: 2, count, sets };
        let bits = filter(33, ActiveSets::Bits(vec![1, 1, u32::MAX, 0]));
        let intervals = filter(2, ActiveSets::Intervals(vec![0, 1 | 1 << 16]));
        let both = concatenated(&[bits, intervals.clone()]).expect("two filters");
        assert_eq!(both.check(35), Ok(()), "a filter of all");
        assert_eq!(both.to_bits(), [1, 0b011, u32::MAX, 0b100], "the Gaussians of the second follow");
        let twice = concatenated(&[intervals.clone(), intervals]).expect("two filters");
        assert_eq!(twice.sets, ActiveSets::Intervals(vec![0, 1 | 1 << 16, 0, 1 | 1 << 16]), "intervals stay intervals");
    }

    #[test]
    fn chunks_of_other_captures_are_named() {
        let united = unite(vec![chunk(1), chunk(2)], &mut NoProgress).expect("one set of settings");
        assert_eq!((united.len(), united.check()), (80, Ok(())), "the Gaussians of both");
        let refusal = |change: fn(&mut GaussianScene)| {
            let mut other = chunk(2);
            change(&mut other.scene);
            unite(vec![chunk(1), other], &mut NoProgress).expect_err("refused").to_string()
        };
        let message = refusal(|scene| scene.trained_with.time_interval = [0.0, 2.0]);
        assert!(message.contains("2.gs4d: its set of settings is not that of 1.gs4d"), "another clock: {message}");
        let message = refusal(|scene| {
            let sets = ActiveSets::Intervals(vec![0; 40]);
            scene.filter = Some(TemporalFilter { kind: FilterKind::Support, segments: 1, count: 40, sets });
        });
        assert!(message.contains("its temporal filter"), "a filter of one: {message}");
    }
}
