//! Captures that this GPU cannot draw.
//!
//! In: the captures that the render world could not upload, and why. Out: [`UploadFailures`], shared by both worlds.

use crate::plugin::component::GaussianCapture;
use bevy::asset::AssetId;
use bevy::ecs::resource::Resource;
use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Captures that have been loaded but could not be uploaded. The main and the render world share it.
#[derive(Resource, Debug, Clone, Default)]
pub struct UploadFailures(Arc<Mutex<HashMap<AssetId<GaussianCapture>, UploadFailure>>>);

/// Why a capture could not be uploaded.
#[derive(Debug)]
pub(super) struct UploadFailure {
    pub(super) error: String,
    /// Whether messages about this attempt have been sent.
    pub(super) reported: bool,
}

impl UploadFailures {
    /// Returns whether a capture is among them: its entities have then failed, although it has been loaded.
    pub(super) fn contains(&self, capture: AssetId<GaussianCapture>) -> bool {
        self.lock().contains_key(&capture)
    }

    pub(crate) fn insert(&self, capture: AssetId<GaussianCapture>, error: String) {
        self.lock().insert(capture, UploadFailure { error, reported: false });
    }

    pub(crate) fn remove(&self, capture: AssetId<GaussianCapture>) {
        self.lock().remove(&capture);
    }

    pub(super) fn lock(&self) -> MutexGuard<'_, HashMap<AssetId<GaussianCapture>, UploadFailure>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
