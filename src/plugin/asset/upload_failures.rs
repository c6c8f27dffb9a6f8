//! Captures that this GPU cannot draw.
//!
//! In: what the renderer could not upload, from the render world. Out: [`UploadFailures`], shared by both worlds, and the failed state and
//! message on every entity with such a capture.

use super::messages::Announcer;
use super::{CaptureState, GaussianCapture};
use crate::plugin::component::GaussianCapture3d;
use bevy::asset::AssetId;
use bevy::ecs::change_detection::DetectChangesMut;
use bevy::ecs::entity::Entity;
use bevy::ecs::resource::Resource;
use bevy::ecs::system::{Query, Res};
use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Captures that have been loaded but could not be uploaded. Both worlds share it.
#[derive(Resource, Debug, Clone, Default)]
pub struct UploadFailures(Arc<Mutex<HashMap<AssetId<GaussianCapture>, Failure>>>);

/// Why a capture could not be uploaded.
#[derive(Debug)]
struct Failure {
    error: String,
    /// Whether its entities have been told of this attempt.
    told: bool,
}

impl UploadFailures {
    /// Whether a capture is among them: its entities have then failed, although it has been loaded.
    pub(crate) fn contains(&self, capture: AssetId<GaussianCapture>) -> bool {
        self.lock().contains_key(&capture)
    }

    pub(crate) fn insert(&self, capture: AssetId<GaussianCapture>, error: String) {
        self.lock().insert(capture, Failure { error, told: false });
    }

    pub(crate) fn remove(&self, capture: AssetId<GaussianCapture>) {
        self.lock().remove(&capture);
    }

    fn lock(&self) -> MutexGuard<'_, HashMap<AssetId<GaussianCapture>, Failure>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Tells every entity whose capture could not be uploaded, once for each attempt.
pub(super) fn report_upload_failures(
    failures: Res<UploadFailures>,
    mut captures: Query<(Entity, &GaussianCapture3d, &mut CaptureState)>,
    mut announcer: Announcer,
) {
    let mut failures = failures.lock();
    if failures.is_empty() {
        return;
    }
    for (entity, capture, mut state) in &mut captures {
        let Some(Failure { error, told }) = failures.get(&capture.0.id()) else { continue };
        if state.set_if_neq(CaptureState::Failed(error.clone())) || !told {
            announcer.failed(entity, error.clone());
        }
    }
    failures.values_mut().for_each(|failure| failure.told = true);
}
