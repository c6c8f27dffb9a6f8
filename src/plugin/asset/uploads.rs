//! The upload state of loaded captures.
//!
//! In: the render world's reports: captures whose upload is complete, and the errors of failed uploads. Out:
//! [`Uploads`], shared by both worlds, which decides the loading states of entities and when playback begins.

use super::failure::CaptureFailure;
use crate::plugin::component::GaussianCapture;
use bevy::asset::AssetId;
use bevy::ecs::resource::Resource;
use std::collections::{HashMap, HashSet};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// The upload state of loaded captures. The main and the render world share it.
#[derive(Resource, Debug, Clone, Default)]
pub struct Uploads(Arc<Mutex<UploadStates>>);

/// The uploads of all captures.
#[derive(Debug, Default)]
pub(super) struct UploadStates {
    /// Whether a render world uploads captures. Without one, captures are ready once they have been loaded.
    expected: bool,
    /// Captures that are drawn: their current version, or the one before a change.
    drawn: HashSet<AssetId<GaussianCapture>>,
    /// Captures whose upload has ended since the last [`take_finished`](Self::take_finished).
    finished: HashSet<AssetId<GaussianCapture>>,
    /// Captures in chunk files whose first picture is there.
    streams: HashSet<AssetId<GaussianCapture>>,
    /// Of which capture a chunk file is, and its number.
    files: HashMap<AssetId<GaussianCapture>, (AssetId<GaussianCapture>, usize)>,
    /// Of these files, those that are in the pages of their capture.
    placed: HashSet<AssetId<GaussianCapture>>,
    /// The bytes that the Gaussians of captures in chunk files may take on the GPU, and those of their pages.
    granted: HashMap<AssetId<GaussianCapture>, u64>,
    paged: HashMap<AssetId<GaussianCapture>, u64>,
    pub(super) failures: HashMap<AssetId<GaussianCapture>, UploadFailure>,
}

/// Why a capture could not be uploaded.
#[derive(Debug)]
pub(super) struct UploadFailure {
    pub(super) error: CaptureFailure,
    /// Whether messages about this attempt have been sent.
    pub(super) reported: bool,
}

impl UploadStates {
    /// Returns whether a loaded capture is drawn.
    pub(super) fn is_drawn(&self, capture: AssetId<GaussianCapture>) -> bool {
        !self.expected || self.drawn.contains(&capture)
    }

    /// Returns whether a capture in chunk files has no picture yet.
    pub(super) fn is_blank(&self, id: AssetId<GaussianCapture>, capture: &GaussianCapture) -> bool {
        capture.scene().chunks.is_some() && !self.streams.contains(&id)
    }

    /// Returns the captures whose upload has ended since the last call; `None` without a render world that uploads
    /// captures.
    pub(super) fn take_finished(&mut self) -> Option<HashSet<AssetId<GaussianCapture>>> {
        self.expected.then(|| std::mem::take(&mut self.finished))
    }
}

impl Uploads {
    /// Makes captures wait for their upload.
    pub(crate) fn expect(&self) {
        self.lock().expected = true;
    }

    /// Returns whether a loaded capture is still being uploaded and no older version of it is drawn.
    pub(crate) fn awaits(&self, capture: AssetId<GaussianCapture>) -> bool {
        let states = self.lock();
        !states.is_drawn(capture) && !states.failures.contains_key(&capture)
    }

    /// Returns whether a loaded capture is in chunk files and has no picture yet.
    pub(crate) fn is_blank(&self, id: AssetId<GaussianCapture>, capture: &GaussianCapture) -> bool {
        self.lock().is_blank(id, capture)
    }

    /// Returns whether the upload of a capture has failed.
    pub(crate) fn has_failed(&self, capture: AssetId<GaussianCapture>) -> bool {
        self.lock().failures.contains_key(&capture)
    }

    /// Records that the first picture of a capture in chunk files is there.
    pub(crate) fn show_stream(&self, index: AssetId<GaussianCapture>) {
        self.lock().streams.insert(index);
    }

    /// Records that a capture in chunk files is not streamed any more.
    pub(crate) fn end_stream(&self, index: AssetId<GaussianCapture>) {
        let mut states = self.lock();
        states.streams.remove(&index);
        states.granted.remove(&index);
        states.paged.remove(&index);
    }

    /// Records the bytes that the Gaussians of a capture in chunk files may take on the GPU.
    pub(crate) fn grant(&self, index: AssetId<GaussianCapture>, bytes: u64) {
        self.lock().granted.insert(index, bytes);
    }

    /// Returns the bytes that the Gaussians of a capture in chunk files may take on the GPU; `None` if it is not streamed.
    pub(crate) fn granted(&self, index: AssetId<GaussianCapture>) -> Option<u64> {
        self.lock().granted.get(&index).copied()
    }

    /// Records the bytes of the pages of all captures in chunk files.
    pub(crate) fn set_paged(&self, all: impl Iterator<Item = (AssetId<GaussianCapture>, u64)>) {
        let mut states = self.lock();
        states.paged.clear();
        states.paged.extend(all);
    }

    /// Returns the bytes of the pages of a capture in chunk files; `None` before its first file.
    pub(crate) fn paged(&self, index: AssetId<GaussianCapture>) -> Option<u64> {
        self.lock().paged.get(&index).copied()
    }

    /// Records whether a chunk file is in the pages of its capture.
    pub(crate) fn set_placed(&self, file: AssetId<GaussianCapture>, is_placed: bool) {
        let mut states = self.lock();
        if is_placed {
            states.placed.insert(file);
        } else {
            states.placed.remove(&file);
        }
    }

    /// Returns whether a loaded file of a capture can be drawn: it is in the pages of this capture. Without a render world
    /// that uploads captures, every loaded file counts.
    pub(crate) fn is_placed(&self, file: AssetId<GaussianCapture>, index: AssetId<GaussianCapture>) -> bool {
        let states = self.lock();
        let is_own = states.files.get(&file).is_some_and(|(own, _)| *own == index);
        !states.expected || is_own && states.placed.contains(&file)
    }

    /// Records that a capture that is being loaded is a chunk file of a capture, and its number.
    pub(crate) fn join(&self, file: AssetId<GaussianCapture>, index: AssetId<GaussianCapture>, number: usize) {
        let mut states = self.lock();
        if states.expected {
            states.files.insert(file, (index, number));
        }
    }

    /// Records that a capture is not wanted as a chunk file any more: its pages are free, even if it stays loaded.
    pub(crate) fn leave(&self, file: AssetId<GaussianCapture>) {
        self.lock().files.remove(&file);
    }

    /// Returns the capture of which a capture is a chunk file, and its number.
    pub(crate) fn file_of(&self, file: AssetId<GaussianCapture>) -> Option<(AssetId<GaussianCapture>, usize)> {
        self.lock().files.get(&file).copied()
    }

    /// Records that the upload of a capture begins. `is_drawn`: whether an earlier version is drawn until the upload
    /// ends.
    pub(crate) fn begin(&self, capture: AssetId<GaussianCapture>, is_drawn: bool) {
        let mut states = self.lock();
        states.failures.remove(&capture);
        if is_drawn {
            states.drawn.insert(capture);
        } else {
            states.drawn.remove(&capture);
        }
    }

    /// Records that the upload of a capture is complete.
    pub(crate) fn finish(&self, capture: AssetId<GaussianCapture>) {
        let mut states = self.lock();
        states.drawn.insert(capture);
        states.finished.insert(capture);
    }

    /// Records that the upload of a capture has failed.
    pub(crate) fn fail(&self, capture: AssetId<GaussianCapture>, error: CaptureFailure) {
        self.lock().failures.insert(capture, UploadFailure { error, reported: false });
    }

    /// Removes a capture that is no longer loaded.
    pub(crate) fn forget(&self, capture: AssetId<GaussianCapture>) {
        let mut states = self.lock();
        states.drawn.remove(&capture);
        states.finished.remove(&capture);
        states.failures.remove(&capture);
        states.files.remove(&capture);
        states.placed.remove(&capture);
        states.paged.remove(&capture);
    }

    pub(super) fn lock(&self) -> MutexGuard<'_, UploadStates> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
