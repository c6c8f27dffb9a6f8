//! What becomes of loaded captures on the GPU.
//!
//! In: what the render world uploads: captures that are whole there, and why others cannot be. Out: [`Uploads`], shared by both worlds,
//! from which the loading states of entities follow, and when playing begins.

use crate::plugin::component::GaussianCapture;
use bevy::asset::AssetId;
use bevy::ecs::resource::Resource;
use std::collections::{HashMap, HashSet};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// What becomes of loaded captures on the GPU. The main and the render world share it.
#[derive(Resource, Debug, Clone, Default)]
pub struct Uploads(Arc<Mutex<UploadStates>>);

/// The uploads of all captures.
#[derive(Debug, Default)]
pub(super) struct UploadStates {
    /// Whether there is a render world that uploads captures. If not, they are ready once they have been loaded.
    expected: bool,
    /// Captures that are drawn, as they are or as they were before they changed.
    drawn: HashSet<AssetId<GaussianCapture>>,
    /// Captures whose upload has ended since this was last taken.
    finished: HashSet<AssetId<GaussianCapture>>,
    pub(super) failures: HashMap<AssetId<GaussianCapture>, UploadFailure>,
}

/// Why a capture could not be uploaded.
#[derive(Debug)]
pub(super) struct UploadFailure {
    pub(super) error: String,
    /// Whether messages about this attempt have been sent.
    pub(super) reported: bool,
}

impl UploadStates {
    /// Returns whether a capture that has been loaded is also drawn.
    pub(super) fn is_drawn(&self, capture: AssetId<GaussianCapture>) -> bool {
        !self.expected || self.drawn.contains(&capture)
    }

    /// Returns the captures whose upload has ended since the last call; `None` if nothing is uploaded.
    pub(super) fn take_finished(&mut self) -> Option<HashSet<AssetId<GaussianCapture>>> {
        self.expected.then(|| std::mem::take(&mut self.finished))
    }
}

impl Uploads {
    /// Makes captures wait for their upload.
    pub(crate) fn expect(&self) {
        self.lock().expected = true;
    }

    /// Returns whether a capture that has been loaded is still on its way to the GPU, with no older version to be drawn meanwhile.
    pub(crate) fn awaits(&self, capture: AssetId<GaussianCapture>) -> bool {
        let states = self.lock();
        !states.is_drawn(capture) && !states.failures.contains_key(&capture)
    }

    /// Notes that the upload of a capture begins. `is_drawn`: an earlier one is drawn until it ends.
    pub(crate) fn begin(&self, capture: AssetId<GaussianCapture>, is_drawn: bool) {
        let mut states = self.lock();
        states.failures.remove(&capture);
        if is_drawn {
            states.drawn.insert(capture);
        } else {
            states.drawn.remove(&capture);
        }
    }

    /// Notes that a capture is whole on the GPU.
    pub(crate) fn finish(&self, capture: AssetId<GaussianCapture>) {
        let mut states = self.lock();
        states.drawn.insert(capture);
        states.finished.insert(capture);
    }

    /// Notes that the upload that has begun cannot go on.
    pub(crate) fn fail(&self, capture: AssetId<GaussianCapture>, error: String) {
        self.lock().failures.insert(capture, UploadFailure { error, reported: false });
    }

    /// Forgets a capture that is no longer loaded.
    pub(crate) fn forget(&self, capture: AssetId<GaussianCapture>) {
        let mut states = self.lock();
        states.drawn.remove(&capture);
        states.finished.remove(&capture);
        states.failures.remove(&capture);
    }

    pub(super) fn lock(&self) -> MutexGuard<'_, UploadStates> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
