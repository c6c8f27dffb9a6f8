//! The systems that update loading states.
//!
//! In: the handle of a [`GaussianCapture3d`], its load state in Bevy's asset server, and its upload state. Out:
//! [`CaptureState`], and the messages [`CaptureReady`](super::messages::CaptureReady) and
//! [`CaptureFailed`](super::messages::CaptureFailed).
//!
//! A capture that is among the assets and drawn is ready, independent of the server's load state: when a reload of a
//! loaded capture fails, the server reports the capture as failed, but Bevy keeps the old one.

use super::failure::CaptureFailure;
use super::messages::Announcer;
use super::state::CaptureState;
use super::uploads::Uploads;
use crate::plugin::component::{GaussianCapture, GaussianCapture3d};
use bevy::asset::{AssetEvent, AssetId, AssetLoadFailedEvent, AssetServer, Assets, LoadState};
use bevy::ecs::change_detection::{DetectChanges, DetectChangesMut, Ref};
use bevy::ecs::entity::Entity;
use bevy::ecs::message::MessageReader;
use bevy::ecs::system::{Local, Query, Res};
use bevy::log::debug_span;
use std::collections::{HashMap, HashSet};

/// Updates the state of every entity with a capture, and sends messages about changes.
pub(super) fn update_states(
    server: Res<AssetServer>,
    loaded: Res<Assets<GaussianCapture>>,
    mut changes: MessageReader<AssetEvent<GaussianCapture>>,
    mut failures: MessageReader<AssetLoadFailedEvent<GaussianCapture>>,
    uploads: Res<Uploads>,
    mut captures: Query<(Entity, Ref<GaussianCapture3d>, &mut CaptureState)>,
    mut announcer: Announcer,
    mut reported: Local<ReportedFailures>,
) {
    let _span = debug_span!("gs4d/states").entered();
    let mut changed: HashSet<AssetId<GaussianCapture>> = HashSet::new();
    for change in changes.read() {
        match change {
            AssetEvent::Added { id } => reported.clear(*id),
            AssetEvent::Modified { id } => {
                reported.clear(*id);
                changed.insert(*id);
            }
            // A capture that has never loaded is unused, but not removed.
            AssetEvent::Removed { id } | AssetEvent::Unused { id } => reported.clear(*id),
            AssetEvent::LoadedWithDependencies { .. } => {}
        }
    }
    let mut failed: HashMap<AssetId<GaussianCapture>, CaptureFailure> = HashMap::new();
    for failure in failures.read() {
        let error = CaptureFailure::of_loading(Some(failure.path.to_string()), &failure.error);
        if reported.is_new(failure.id, &error) {
            failed.insert(failure.id, error);
        }
    }
    let mut uploads = uploads.lock();
    // A changed capture is ready again once its new version is drawn.
    if let Some(finished) = uploads.take_finished() {
        changed = finished;
    }
    for (entity, capture, mut state) in &mut captures {
        let id = capture.0.id();
        let is_drawn = uploads.is_drawn(id) && loaded.get(id).is_none_or(|capture| !uploads.is_blank(id, capture));
        if loaded.contains(id) && !is_drawn {
            // `report_upload_failures` reports failed uploads, but not failed reloads.
            if !uploads.failures.contains_key(&id) {
                state.set_if_neq(CaptureState::Loading);
            }
            if let Some(error) = failed.get(&id) {
                announcer.failed(entity, error.clone());
            }
        } else if loaded.contains(id) {
            if !state.is_ready() || changed.contains(&id) || capture.is_changed() {
                state.set_if_neq(CaptureState::Ready);
                announcer.ready(entity, id);
            }
            // The reload failed; the old version is drawn.
            if let Some(error) = failed.get(&id) {
                announcer.failed(entity, error.clone());
            }
        } else if let Some(error) = failed.get(&id) {
            // Independent of the server's load state: Bevy repeats a failed reload immediately, so it may be loading
            // again.
            state.set_if_neq(CaptureState::Failed(error.clone()));
            announcer.failed(entity, error.clone());
        } else if let Some(LoadState::Failed(error)) = server.get_load_state(id) {
            if capture.is_changed() || !state.has_failed() {
                let path = server.get_path(id).map(|path| path.to_string());
                let error = CaptureFailure::of_loading(path, &error);
                state.set_if_neq(CaptureState::Failed(error.clone()));
                if capture.is_changed() {
                    announcer.failed(entity, error);
                }
            }
        } else {
            state.set_if_neq(CaptureState::Loading);
        }
    }
}

/// The failures to load that have been reported. Bevy repeats a failed reload immediately, a watched file may change
/// several times in one save, and a game may try again every second: each failure is reported once, until the capture
/// loads or fails with another error.
#[derive(Default)]
pub(super) struct ReportedFailures(HashMap<AssetId<GaussianCapture>, CaptureFailure>);

impl ReportedFailures {
    /// Forgets the failure of a capture that has been loaded or removed.
    fn clear(&mut self, id: AssetId<GaussianCapture>) {
        self.0.remove(&id);
    }

    /// Records a failure. Returns whether it has not been reported yet.
    fn is_new(&mut self, id: AssetId<GaussianCapture>, error: &CaptureFailure) -> bool {
        self.0.insert(id, error.clone()).is_none_or(|last| last != *error)
    }
}

/// Returns whether any capture could not be uploaded.
pub(super) fn any_upload_failure(uploads: Res<Uploads>) -> bool {
    !uploads.lock().failures.is_empty()
}

/// Sends a message once for each failed attempt to upload a capture, and sets the state of its entities unless an older
/// version of the capture is still drawn.
pub(super) fn report_upload_failures(
    uploads: Res<Uploads>,
    mut captures: Query<(Entity, &GaussianCapture3d, &mut CaptureState)>,
    mut announcer: Announcer,
) {
    let mut uploads = uploads.lock();
    for (entity, capture, mut state) in &mut captures {
        let id = capture.0.id();
        let Some(failure) = uploads.failures.get(&id) else { continue };
        let is_new = !uploads.is_drawn(id) && state.set_if_neq(CaptureState::Failed(failure.error.clone()));
        if is_new || !failure.reported {
            announcer.failed(entity, failure.error.clone());
        }
    }
    uploads.failures.values_mut().for_each(|failure| failure.reported = true);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failure_is_reported_once_until_the_error_changes_or_loading_succeeds() {
        let mut reported = ReportedFailures::default();
        let id = AssetId::default();
        let mut is_new = |error: &str| reported.is_new(id, &CaptureFailure::NotLoaded(error.to_owned()));
        assert_eq!(["cut off"; 3].map(&mut is_new), [true, false, false], "a repeated error is reported once");
        assert_eq!(["gone", "gone", "cut off"].map(&mut is_new), [true, false, true], "another error is reported");
        reported.clear(id);
        let again = CaptureFailure::NotLoaded("cut off".to_owned());
        assert!(reported.is_new(id, &again), "after a success the same error is reported again");
    }
}
