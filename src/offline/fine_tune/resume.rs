//! The state of training on disk, from which an interrupted run goes on.
//!
//! In: the curve so far, the best parameters, parameters and moments. Out: the same, if they are of the same settings and whole.

use super::best::Best;
use super::outcome::CurvePoint;
use super::settings::FineTuneSettings;
use super::state::TrainerState;
use crate::offline::OfflineError;
use crate::offline::store::{Key, Store};
use crate::offline::stored::{Stored, Text};
use crate::scene::TemporalFilter;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Name of the file.
const FILE: &str = "fine-tune.state";

/// Where the state of training is stored, and what it depends on.
#[derive(Debug, Clone, Copy)]
pub struct Resume<'a> {
    /// The folder.
    pub store: &'a Store,
    /// Everything that the result depends on besides the settings.
    pub key: Key,
    /// A state is stored at evaluations whose step is a multiple of this.
    pub every: usize,
}

/// What a run needs to go on.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Checkpoint {
    pub curve: Vec<CurvePoint>,
    pub best: Best,
    pub state: TrainerState,
    /// Steps in which codebooks were trained; `None` before that.
    pub coded: Option<usize>,
}

/// The part of a checkpoint that is stored as text.
#[derive(Serialize, Deserialize)]
struct Head {
    curve: Vec<CurvePoint>,
    best: CurvePoint,
    coded: Option<usize>,
}

/// The sizes of the buffers, the buffers one after the other, the neighbors and the filter.
type StoredState = (Text<Vec<usize>>, (Vec<u8>, (Vec<u8>, Option<TemporalFilter>)));

fn stored_state(state: &TrainerState) -> StoredState {
    let sizes = state.buffers.iter().map(Vec::len).collect();
    (Text(sizes), (state.buffers.concat(), (state.neighbors.clone(), state.filter.clone())))
}

/// Returns the state; `None` if the sizes are not those of the buffers.
fn state((Text(sizes), (buffers, (neighbors, filter))): StoredState) -> Option<TrainerState> {
    let mut state = TrainerState { buffers: Vec::new(), neighbors, filter };
    let mut rest = &buffers[..];
    for size in sizes {
        let (buffer, left) = rest.split_at_checked(size)?;
        state.buffers.push(buffer.to_vec());
        rest = left;
    }
    rest.is_empty().then_some(state)
}

impl Checkpoint {
    /// Stores it, whole or not at all.
    fn store(&self, store: &Store, key: Key) -> Result<(), OfflineError> {
        let head = Head { curve: self.curve.clone(), best: self.best.point, coded: self.coded };
        let bytes = (Text(head), (stored_state(&self.state), stored_state(&self.best.state))).encode()?;
        Ok(store.store(FILE, key, &bytes)?)
    }

    /// Returns what was stored with the same key; `None` if there is nothing, or if it is damaged.
    fn load(store: &Store, key: Key) -> Option<Self> {
        let stored = Stored::decode(&store.load(FILE, key)?)?;
        let (Text(Head { curve, best, coded }), (of_run, of_best)): (Text<Head>, (StoredState, StoredState)) = stored;
        Some(Self { curve, best: Best { point: best, state: state(of_best)? }, state: state(of_run)?, coded })
    }
}

/// Where a run stores its state.
#[derive(Clone, Copy)]
pub(super) struct Saves<'a> {
    resume: Resume<'a>,
    key: Key,
}

impl<'a> Saves<'a> {
    /// Returns where a run with these settings stores its state.
    pub(super) fn new(resume: Resume<'a>, settings: &FineTuneSettings) -> Self {
        Self { resume, key: resume.key.and(&format!("{settings:?}")) }
    }

    /// Returns the folder of the state.
    pub(super) fn folder(self) -> &'a Path {
        self.resume.store.folder()
    }

    /// Returns whether the state is stored after this step.
    pub(super) fn are_due(self, step: usize) -> bool {
        step.is_multiple_of(self.resume.every.max(1))
    }

    /// Stores a checkpoint.
    pub(super) fn store(self, checkpoint: &Checkpoint) -> Result<(), OfflineError> {
        checkpoint.store(self.resume.store, self.key)
    }

    /// Returns the checkpoint that was stored; `None` if there is none.
    pub(super) fn load(self) -> Option<Checkpoint> {
        Checkpoint::load(self.resume.store, self.key)
    }
}
