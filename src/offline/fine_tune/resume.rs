//! The state of training on disk, from which an interrupted run goes on.
//!
//! In: the curve so far, the best parameters, parameters and moments. Out: the same, if they are of the same settings and whole.

use super::run::Best;
use super::{CurvePoint, TrainerState};
use crate::offline::work::{Fingerprint, Work, bytes, words};
use crate::offline::{OfflineError, Progress};
use crate::scene::{FilterKind, TemporalFilter};
use serde::{Deserialize, Serialize};

/// Name of the file.
const FILE: &str = "fine-tune.state";

/// What a run needs to go on.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Checkpoint {
    pub curve: Vec<CurvePoint>,
    pub best: Best,
    pub state: TrainerState,
    /// Steps in which codebooks were trained; `None` before that.
    pub coded: Option<usize>,
}

/// What comes before the buffers.
#[derive(Serialize, Deserialize)]
struct Head {
    curve: Vec<CurvePoint>,
    best: CurvePoint,
    coded: Option<usize>,
    /// Of the state, then of the best.
    states: [StateHead; 2],
}

/// The contents of a state: bytes of each buffer, then those of the neighbors and of the bits of the filter.
#[derive(Serialize, Deserialize)]
struct StateHead {
    sizes: Vec<usize>,
    filter: Option<FilterHead>,
}

/// Kind, segments and Gaussians of a filter.
type FilterHead = (FilterKind, u32, usize);

/// Returns the head of a state, and its buffers.
fn parts(state: &TrainerState) -> (StateHead, Vec<Vec<u8>>) {
    let filter = state.filter.as_ref();
    let bits = filter.map(|filter| bytes(&filter.to_bits()));
    let buffers: Vec<_> = state.buffers.iter().chain([&state.neighbors]).cloned().chain(bits).collect();
    let filter = filter.map(|filter| (filter.kind, filter.segments, filter.count));
    (StateHead { sizes: buffers.iter().map(Vec::len).collect(), filter }, buffers)
}

/// Returns a state from the bytes after the head, and the bytes after the state; `None` if there are too few.
fn state<'a>(head: &StateHead, mut rest: &'a [u8]) -> Option<(TrainerState, &'a [u8])> {
    let mut state = TrainerState::default();
    for &size in &head.sizes {
        let (buffer, left) = rest.split_at_checked(size)?;
        state.buffers.push(buffer.to_vec());
        rest = left;
    }
    if let Some((kind, segments, count)) = head.filter {
        let bits = words(&state.buffers.pop()?);
        let expected = TemporalFilter::words(count).checked_mul(segments as usize)?;
        let filter = (bits.len() == expected).then(|| TemporalFilter::from_bits(kind, segments, count, bits));
        state.filter = Some(filter?);
    }
    state.neighbors = state.buffers.pop()?;
    Some((state, rest))
}

impl Checkpoint {
    /// Stores it, whole or not at all.
    pub fn store(
        &self,
        work: &Work,
        fingerprint: Fingerprint,
        progress: &mut dyn Progress,
    ) -> Result<(), OfflineError> {
        let ((state, buffers), (best, best_buffers)) = (parts(&self.state), parts(&self.best.state));
        let head = Head { curve: self.curve.clone(), best: self.best.point, coded: self.coded, states: [state, best] };
        let head = ron::to_string(&head)?;
        let mut bytes = (head.len() as u64).to_le_bytes().to_vec();
        bytes.extend_from_slice(head.as_bytes());
        buffers.iter().chain(&best_buffers).for_each(|buffer| bytes.extend_from_slice(buffer));
        Ok(work.store(FILE, fingerprint, &bytes, progress)?)
    }

    /// Returns what was stored with the same fingerprint; `None` if there is nothing, or if it is damaged.
    pub fn load(work: &Work, fingerprint: Fingerprint) -> Option<Self> {
        let bytes = work.load(FILE, fingerprint)?;
        let (size, rest) = bytes.split_first_chunk()?;
        let (head, rest) = rest.split_at_checked(usize::try_from(u64::from_le_bytes(*size)).ok()?)?;
        let Head { curve, best, coded, states } = ron::de::from_bytes(head).ok()?;
        let (state_of_run, rest) = state(&states[0], rest)?;
        let (best_state, _) = state(&states[1], rest)?;
        Some(Self { curve, best: Best { point: best, state: best_state }, state: state_of_run, coded })
    }
}
