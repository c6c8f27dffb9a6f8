//! The state of training on disk, from which an interrupted run goes on.
//!
//! In: the curve so far, the best parameters, parameters and moments. Out: the same, if they are of the same settings and whole.

use super::run::Best;
use super::{CurvePoint, TrainerState};
use crate::offline::work::{Fingerprint, Work};
use crate::offline::{OfflineError, Progress};
use serde::{Deserialize, Serialize};

/// Name of the file.
const FILE: &str = "fine-tune.state";

/// What a run needs to go on.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Checkpoint {
    pub curve: Vec<CurvePoint>,
    pub best: Best,
    pub state: TrainerState,
}

/// What comes before the buffers.
#[derive(Serialize, Deserialize)]
struct Head {
    curve: Vec<CurvePoint>,
    best: CurvePoint,
    /// Bytes of each buffer: of the state, its neighbors, then of the best.
    sizes: Vec<usize>,
}

impl Checkpoint {
    /// Stores it, whole or not at all.
    pub fn store(
        &self,
        work: &Work,
        fingerprint: Fingerprint,
        progress: &mut dyn Progress,
    ) -> Result<(), OfflineError> {
        let TrainerState { buffers, neighbors } = &self.state;
        let buffers: Vec<&Vec<u8>> = buffers.iter().chain([neighbors]).chain(&self.best.state).collect();
        let sizes = buffers.iter().map(|buffer| buffer.len()).collect();
        let head = Head { curve: self.curve.clone(), best: self.best.point, sizes };
        let head = ron::to_string(&head)?;
        let mut bytes = (head.len() as u64).to_le_bytes().to_vec();
        bytes.extend_from_slice(head.as_bytes());
        buffers.iter().for_each(|buffer| bytes.extend_from_slice(buffer));
        Ok(work.store(FILE, fingerprint, &bytes, progress)?)
    }

    /// Returns what was stored with the same fingerprint; `None` if there is nothing, or if it is damaged.
    pub fn load(work: &Work, fingerprint: Fingerprint) -> Option<Self> {
        let bytes = work.load(FILE, fingerprint)?;
        let (size, rest) = bytes.split_first_chunk()?;
        let (head, mut rest) = rest.split_at_checked(usize::try_from(u64::from_le_bytes(*size)).ok()?)?;
        let Head { curve, best, sizes } = ron::de::from_bytes(head).ok()?;
        let mut buffers = Vec::new();
        for size in sizes {
            let (buffer, left) = rest.split_at_checked(size)?;
            buffers.push(buffer.to_vec());
            rest = left;
        }
        let best_state: [Vec<u8>; 6] = (buffers.len() == 13).then(|| buffers.split_off(7))?.try_into().ok()?;
        let neighbors = buffers.pop()?;
        let state = TrainerState { buffers: buffers.try_into().ok()?, neighbors };
        Some(Self { curve, best: Best { point: best, state: best_state }, state })
    }
}
