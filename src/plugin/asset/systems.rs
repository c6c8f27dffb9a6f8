//! The systems that keep loading states up to date.
//!
//! In: the handle of a [`GaussianCapture3d`], what Bevy's asset server reports about it, and the uploads that failed. Out:
//! [`CaptureState`], and the messages [`CaptureReady`](super::messages::CaptureReady) and
//! [`CaptureFailed`](super::messages::CaptureFailed).
//!
//! A capture among the assets is ready, whatever the server reports: when a capture that has been loaded fails to load again, the
//! server reports it as failed, but Bevy keeps the old one.

use super::loader::CaptureLoadError;
use super::messages::Announcer;
use super::state::CaptureState;
use super::upload_failures::UploadFailures;
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
use std::time::{Duration, Instant};

/// Updates the state of every entity with a capture, and sends messages about changes.
pub(super) fn update_states(
    server: Res<AssetServer>,
    loaded: Res<Assets<GaussianCapture>>,
    mut changes: MessageReader<AssetEvent<GaussianCapture>>,
    mut failures: MessageReader<AssetLoadFailedEvent<GaussianCapture>>,
    rejected: Res<UploadFailures>,
    mut captures: Query<(Entity, Ref<GaussianCapture3d>, &mut CaptureState)>,
    mut announcer: Announcer,
    mut repeated: Local<RecentFailures>,
) {
    let _span = debug_span!("gs4d/states").entered();
    let changed: HashSet<AssetId<GaussianCapture>> = changes.read().filter_map(modified).collect();
    let mut failed: HashMap<AssetId<GaussianCapture>, String> =
        failures.read().map(|failure| (failure.id, describe(&failure.path, &failure.error))).collect();
    failed.retain(|id, error| repeated.is_new(*id, error));
    for (entity, capture, mut state) in &mut captures {
        let id = capture.0.id();
        if rejected.contains(id) {
            // The failed upload is reported elsewhere, but not a failure to load the capture again.
            if let Some(error) = failed.get(&id) {
                announcer.failed(entity, error.clone());
            }
            continue;
        }
        if loaded.contains(id) {
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

/// Failures of the last moments. Bevy tries a reload that failed a second time at once, and its failure is the same one.
#[derive(Default)]
pub(super) struct RecentFailures(HashMap<AssetId<GaussianCapture>, (Instant, String)>);

impl RecentFailures {
    /// How long a failure like the one before counts as its repetition.
    const REPETITION: Duration = Duration::from_millis(500);

    /// Whether a failure is not the repetition of the last one.
    fn is_new(&mut self, id: AssetId<GaussianCapture>, error: &str) -> bool {
        let now = Instant::now();
        self.0.retain(|_, (then, _)| now.duration_since(*then) < Self::REPETITION);
        let known = self.0.insert(id, (now, error.to_owned()));
        known.is_none_or(|(_, last)| last != error)
    }
}

fn modified(event: &AssetEvent<GaussianCapture>) -> Option<AssetId<GaussianCapture>> {
    match event {
        AssetEvent::Modified { id } => Some(*id),
        _ => None,
    }
}

/// File, fault and remedy, without the names of loaders and types that Bevy puts before them.
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

/// Sets the state of every entity whose capture could not be uploaded, and sends a message once for each attempt.
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
        let Some(failure) = failures.get(&capture.0.id()) else { continue };
        if state.set_if_neq(CaptureState::Failed(failure.error.clone())) || !failure.reported {
            announcer.failed(entity, failure.error.clone());
        }
    }
    failures.values_mut().for_each(|failure| failure.reported = true);
}
