//! The systems that keep loading states up to date.
//!
//! In: the handle of a [`GaussianCapture3d`], what Bevy's asset server reports about it, and what becomes of it on the GPU. Out:
//! [`CaptureState`], and the messages [`CaptureReady`](super::messages::CaptureReady) and
//! [`CaptureFailed`](super::messages::CaptureFailed).
//!
//! A capture among the assets that is drawn is ready, whatever the server reports: when a capture that has been loaded fails to load
//! again, the server reports it as failed, but Bevy keeps the old one.

use super::loader::CaptureLoadError;
use super::messages::Announcer;
use super::state::CaptureState;
use super::uploads::Uploads;
use crate::plugin::component::{GaussianCapture, GaussianCapture3d};
use bevy::asset::io::AssetReaderError;
use bevy::asset::{AssetEvent, AssetId, AssetLoadError, AssetLoadFailedEvent, AssetServer, Assets, LoadState};
use bevy::ecs::change_detection::{DetectChanges, DetectChangesMut, Ref};
use bevy::ecs::entity::Entity;
use bevy::ecs::message::MessageReader;
use bevy::ecs::system::{Local, Query, Res};
use bevy::log::debug_span;
use std::collections::{HashMap, HashSet};
use std::fmt::Display;

/// Updates the state of every entity with a capture, and sends messages about changes.
pub(super) fn update_states(
    server: Res<AssetServer>,
    loaded: Res<Assets<GaussianCapture>>,
    mut changes: MessageReader<AssetEvent<GaussianCapture>>,
    mut failures: MessageReader<AssetLoadFailedEvent<GaussianCapture>>,
    uploads: Res<Uploads>,
    mut captures: Query<(Entity, Ref<GaussianCapture3d>, &mut CaptureState)>,
    mut announcer: Announcer,
    mut told: Local<Told>,
) {
    let _span = debug_span!("gs4d/states").entered();
    let mut changed: HashSet<AssetId<GaussianCapture>> = HashSet::new();
    for change in changes.read() {
        match change {
            AssetEvent::Added { id } => told.succeeded(*id),
            AssetEvent::Modified { id } => {
                told.succeeded(*id);
                changed.insert(*id);
            }
            AssetEvent::Removed { id } => told.succeeded(*id),
            AssetEvent::Unused { .. } | AssetEvent::LoadedWithDependencies { .. } => {}
        }
    }
    let mut failed: HashMap<AssetId<GaussianCapture>, String> = HashMap::new();
    for failure in failures.read() {
        let error = describe(&failure.path, &failure.error);
        if told.is_new(failure.id, &error) {
            failed.insert(failure.id, error);
        }
    }
    let mut uploads = uploads.lock();
    // A capture that changes is ready again once the new one is drawn.
    if let Some(finished) = uploads.take_finished() {
        changed = finished;
    }
    for (entity, capture, mut state) in &mut captures {
        let id = capture.0.id();
        if loaded.contains(id) && !uploads.is_drawn(id) {
            // A failed upload is reported elsewhere, but not a failure to load the capture again.
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
            // Loading it again failed.
            if let Some(error) = failed.get(&id) {
                announcer.failed(entity, error.clone());
            }
        } else if let Some(LoadState::Failed(error)) = server.get_load_state(id) {
            let is_new = failed.contains_key(&id) || capture.is_changed();
            if is_new || !state.has_failed() {
                let error = match server.get_path(id) {
                    Some(path) => describe(path, &error),
                    None => error.to_string(),
                };
                state.set_if_neq(CaptureState::Failed(error.clone()));
                if is_new {
                    announcer.failed(entity, error);
                }
            }
        } else {
            state.set_if_neq(CaptureState::Loading);
        }
    }
}

/// What has been told of failures to load. Bevy repeats a failed reload at once, watched files may change several times in one save, and
/// a game may try again every second: a failure is told once, until the capture loads or fails in another way.
#[derive(Default)]
pub(super) struct Told(HashMap<AssetId<GaussianCapture>, String>);

impl Told {
    /// Records that a capture has been loaded, or is gone.
    fn succeeded(&mut self, id: AssetId<GaussianCapture>) {
        self.0.remove(&id);
    }

    /// Records a failure. Returns whether it has not been told yet.
    fn is_new(&mut self, id: AssetId<GaussianCapture>, error: &str) -> bool {
        self.0.insert(id, error.to_owned()).is_none_or(|told| told != error)
    }
}

/// Returns file, fault and remedy, without the names of loaders and types that Bevy puts before them.
fn describe(path: impl Display, error: &AssetLoadError) -> String {
    match error {
        AssetLoadError::AssetReaderError(AssetReaderError::NotFound(file)) => format!(
            "{path}: there is no file {}; check the name, and that it lies in the folder of the app's assets",
            file.display()
        ),
        AssetLoadError::AssetLoaderError(error) => match error.error().downcast_ref::<CaptureLoadError>() {
            Some(fault) => format!("{path}: {fault}"),
            None => format!("{path}: {}", error.error()).trim_end().to_owned(),
        },
        _ => format!("{path}: {error}"),
    }
}

/// Returns whether any capture could not be uploaded.
pub(super) fn any_upload_failure(uploads: Res<Uploads>) -> bool {
    !uploads.lock().failures.is_empty()
}

/// Sends a message once for each attempt to upload a capture that failed, and sets the state of its entities, unless an older version of
/// it is still drawn.
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
    fn a_failure_is_told_once_until_something_changes() {
        let mut told = Told::default();
        let id = AssetId::default();
        let mut is_new = |error| told.is_new(id, error);
        assert_eq!(["cut off"; 3].map(&mut is_new), [true, false, false], "however often it is tried");
        assert_eq!(["gone", "gone", "cut off"].map(&mut is_new), [true, false, true], "another one is told");
        told.succeeded(id);
        assert!(told.is_new(id, "cut off"), "and the same one after a success");
    }
}
