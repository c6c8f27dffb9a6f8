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
    mut attempts: Local<Attempts>,
) {
    let _span = debug_span!("gs4d/states").entered();
    let mut changed: HashSet<AssetId<GaussianCapture>> = HashSet::new();
    for change in changes.read() {
        match change {
            AssetEvent::Added { id } => attempts.succeeded(*id),
            AssetEvent::Modified { id } => {
                attempts.succeeded(*id);
                changed.insert(*id);
            }
            AssetEvent::Removed { .. } | AssetEvent::Unused { .. } | AssetEvent::LoadedWithDependencies { .. } => {}
        }
    }
    let mut failed: HashMap<AssetId<GaussianCapture>, String> = HashMap::new();
    for failure in failures.read() {
        if !attempts.failed_again(failure.id, loaded.contains(failure.id)) {
            failed.insert(failure.id, describe(&failure.path, &failure.error));
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
            let is_known = state.has_failed() && !failed.contains_key(&id) && !capture.is_changed();
            if !is_known {
                let error = match server.get_path(id) {
                    Some(path) => describe(path, &error),
                    None => error.to_string(),
                };
                state.set_if_neq(CaptureState::Failed(error.clone()));
                announcer.failed(entity, error);
            }
        } else {
            state.set_if_neq(CaptureState::Loading);
        }
    }
}

/// Distinguishes the two failures of one reload: Bevy repeats a failed reload at once, and only the first failure is
/// reported.
#[derive(Default)]
pub(super) struct Attempts {
    /// Captures that have failed to load, so that further failures are of reloads.
    failed: HashSet<AssetId<GaussianCapture>>,
    /// Captures whose reload has failed once.
    repeating: HashSet<AssetId<GaussianCapture>>,
}

impl Attempts {
    /// Records that a load or a reload succeeded.
    fn succeeded(&mut self, id: AssetId<GaussianCapture>) {
        self.failed.remove(&id);
        self.repeating.remove(&id);
    }

    /// Records that a load or a reload failed. Returns whether this was the second attempt of a reload. `is_loaded`: an
    /// earlier load succeeded.
    fn failed_again(&mut self, id: AssetId<GaussianCapture>, is_loaded: bool) -> bool {
        let is_reload = !self.failed.insert(id) || is_loaded;
        is_reload && !self.repeating.insert(id) && self.repeating.remove(&id)
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

/// Sends a message once for each attempt to upload a capture that failed, and sets the state of its entities, unless an older version of
/// it is still drawn.
pub(super) fn report_upload_failures(
    uploads: Res<Uploads>,
    mut captures: Query<(Entity, &GaussianCapture3d, &mut CaptureState)>,
    mut announcer: Announcer,
) {
    let mut uploads = uploads.lock();
    if uploads.failures.is_empty() {
        return;
    }
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
    fn a_failed_reload_counts_once_and_the_next_one_again() {
        let mut attempts = Attempts::default();
        let id = AssetId::default();
        let mut failures = |is_loaded| [(); 2].map(|()| attempts.failed_again(id, is_loaded));
        assert_eq!(failures(true), [false, true], "two attempts of one reload");
        assert_eq!(failures(true), [false, true], "and of the next");
        attempts.succeeded(id);
        assert!(!attempts.failed_again(id, false), "a first load is tried once");
        assert!(!attempts.failed_again(id, false), "so that this is a reload");
        assert!(attempts.failed_again(id, false), "which is tried twice");
    }
}
