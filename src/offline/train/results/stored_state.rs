//! The state of training on disk, from which an interrupted run goes on.
//!
//! In: the curve so far, the best parameters, parameters and moments. Out: these again, if the file is whole and of the
//! same settings.

use super::best_parameters::Best;
use super::outcome::CurvePoint;
use crate::offline::store::results::{Key, Store};
use crate::offline::store::stored::{Stored, Text};
use crate::offline::train::error::TrainError;
use crate::offline::train::settings::FineTuneSettings;
use crate::offline::train::trainer::TrainerState;
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

/// A stored state, from which a run goes on.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Checkpoint {
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
    /// Returns what was stored with the same key; `None` if there is nothing, or if it is damaged.
    fn load(store: &Store, key: Key) -> Option<Self> {
        let stored = Stored::decode(&store.load(FILE, key)?)?;
        let (Text(Head { curve, best, coded }), (of_run, of_best)): (Text<Head>, (StoredState, StoredState)) = stored;
        Some(Self { curve, best: Best { point: best, state: state(of_best)? }, state: state(of_run)?, coded })
    }
}

/// Where a run stores its state.
#[derive(Clone, Copy)]
pub(crate) struct Saves<'a> {
    resume: Resume<'a>,
    key: Key,
}

impl<'a> Saves<'a> {
    /// Returns where a run with these settings stores its state.
    pub(crate) fn new(resume: Resume<'a>, settings: &FineTuneSettings) -> Self {
        Self { resume, key: resume.key.and(&format!("{settings:?}")) }
    }

    /// Returns the folder of the state.
    pub(crate) fn folder(self) -> &'a Path {
        self.resume.store.folder()
    }

    /// Returns whether the state is stored after this step.
    pub(crate) fn are_due(self, step: usize) -> bool {
        step.is_multiple_of(self.resume.every.max(1))
    }

    /// Stores a checkpoint, whole or not at all: its curve, its best parameters, its state, and the steps in which
    /// codebooks were trained.
    ///
    /// # Errors
    /// A folder that cannot be written to, a full disk.
    pub(crate) fn store(
        self,
        curve: &[CurvePoint],
        best: &Best,
        state: &TrainerState,
        coded: Option<usize>,
    ) -> Result<(), TrainError> {
        let head = Head { curve: curve.to_vec(), best: best.point, coded };
        let bytes = (Text(head), (stored_state(state), stored_state(&best.state))).encode()?;
        Ok(self.resume.store.store(FILE, self.key, &bytes)?)
    }

    /// Returns the checkpoint that was stored; `None` if there is none.
    pub(crate) fn load(self) -> Option<Checkpoint> {
        Checkpoint::load(self.resume.store, self.key)
    }
}
