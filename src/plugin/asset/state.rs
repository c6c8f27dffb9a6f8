//! The state of loading, on each entity.
//!
//! In: the handle of a [`GaussianCapture3d`], what Bevy's asset server knows of it, and what it has said since the last frame. Out:
//! [`CaptureState`], and the messages [`CaptureReady`](super::CaptureReady) and [`CaptureFailed`](super::CaptureFailed).
//!
//! What is among the assets is ready, whatever the server says: when a capture that has been loaded fails to load again, the server
//! calls it failed, but Bevy leaves the old one in its place.

use super::messages::Announcer;
use super::{CaptureLoadError, GaussianCapture};
use crate::plugin::asset::UploadFailures;
use crate::plugin::component::GaussianCapture3d;
use bevy::asset::io::AssetReaderError;
use bevy::asset::{AssetEvent, AssetId, AssetLoadError, AssetLoadFailedEvent, AssetServer, Assets, LoadState};
use bevy::ecs::change_detection::{DetectChanges, DetectChangesMut, Ref};
use bevy::ecs::component::Component;
use bevy::ecs::entity::Entity;
use bevy::ecs::message::MessageReader;
use bevy::ecs::reflect::ReflectComponent;
use bevy::ecs::schedule::SystemSet;
use bevy::ecs::system::{Query, Res};
use bevy::log::debug_span;
use bevy::reflect::Reflect;
use bevy::reflect::std_traits::ReflectDefault;
use std::collections::{HashMap, HashSet};
use std::fmt::Display;

/// How far an entity's capture has got. Kept up to date in [`CaptureAssetSystems`]; setting it has no effect on loading.
#[derive(Component, Reflect, Debug, Default, Clone, PartialEq, Eq)]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
pub enum CaptureState {
    /// It is not there yet. Nothing is drawn.
    #[default]
    Loading,
    /// It is there, and drawn.
    Ready,
    /// It could not be loaded, for this reason (file, fault and, where there is one, remedy). Loaded again, by `AssetServer::reload`
    /// or because Bevy watches the file, it can become ready.
    Failed(String),
}

/// Where each [`CaptureState`] is brought up to date and its messages are sent: in `PreUpdate`, after assets have arrived.
#[derive(SystemSet, Debug, Clone, PartialEq, Eq, Hash)]
pub struct CaptureAssetSystems;

/// Brings the states up to date.
pub(super) fn keep_states(
    server: Res<AssetServer>,
    loaded: Res<Assets<GaussianCapture>>,
    mut changes: MessageReader<AssetEvent<GaussianCapture>>,
    mut failures: MessageReader<AssetLoadFailedEvent<GaussianCapture>>,
    rejected: Res<UploadFailures>,
    mut captures: Query<(Entity, Ref<GaussianCapture3d>, &mut CaptureState)>,
    mut announcer: Announcer,
) {
    let _span = debug_span!("gs4d/states").entered();
    let changed: HashSet<AssetId<GaussianCapture>> = changes.read().filter_map(modified).collect();
    let failed: HashMap<AssetId<GaussianCapture>, String> =
        failures.read().map(|failure| (failure.id, describe(&failure.path, &failure.error))).collect();
    for (entity, capture, mut state) in &mut captures {
        let id = capture.0.id();
        if rejected.contains(id) {
            // Rendering has said so, but not that loading another one in its place failed.
            if let Some(error) = failed.get(&id) {
                announcer.failed(entity, error.clone());
            }
            continue;
        }
        if loaded.contains(id) {
            if *state != CaptureState::Ready || changed.contains(&id) || capture.is_changed() {
                state.set_if_neq(CaptureState::Ready);
                announcer.ready(entity, id);
            }
            // Loading it again failed.
            if let Some(error) = failed.get(&id) {
                announcer.failed(entity, error.clone());
            }
        } else if let Some(LoadState::Failed(error)) = server.get_load_state(id) {
            let is_old =
                matches!(*state, CaptureState::Failed(_)) && !failed.contains_key(&id) && !capture.is_changed();
            if !is_old {
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
