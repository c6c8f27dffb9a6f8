//! The capture of the chunks that a person names.
//!
//! In: all chunks of a capture with their paths, in order. Out: the capture ([`Union`]); an error that names the file.

use super::error::{SegmentsError, Shared};
use super::segment::Segment;
use crate::offline::work::{Progress, proceed};
use crate::scene::GaussianScene;
use crate::scene::union::{Union, Unlike};

/// Returns the capture of chunks. Begins the task "uniting".
///
/// # Errors
/// No chunk, packed Gaussians that are no chunks, chunks of different captures, by name.
pub fn unite(chunks: Vec<Segment>, progress: &mut dyn Progress) -> Result<GaussianScene, SegmentsError> {
    chunks.iter().filter(|chunk| !chunk.has_runs()).try_for_each(Segment::require_unpacked)?;
    progress.begin("uniting", chunks.len());
    let mut chunks = chunks.into_iter();
    let Some(Segment { path: first, scene }) = chunks.next() else { return Err(SegmentsError::Nothing) };
    let mut all = Union::new(scene);
    for Segment { path, scene } in chunks {
        proceed(progress)?;
        let differs = |what: Unlike| SegmentsError::Differs { path, first: first.clone(), what: what.into() };
        all.append(scene).map_err(differs)?;
        progress.advance();
    }
    progress.finish();
    Ok(all.finish())
}

impl From<Unlike> for Shared {
    fn from(unlike: Unlike) -> Self {
        match unlike {
            Unlike::Settings => Self::Settings,
            Unlike::Form => Self::Form,
            Unlike::Filter => Self::Filter,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::offline::work::NoProgress;
    use crate::scene::synth::{SynthSettings, synthesize};
    use crate::scene::{ActiveSets, FilterKind, TemporalFilter};
    use std::path::PathBuf;

    fn chunk(seed: u64) -> Segment {
        let scene = synthesize(&SynthSettings { count: 40, seed, ..SynthSettings::default() });
        Segment { path: PathBuf::from(format!("{seed}.gs4d")), scene }
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
