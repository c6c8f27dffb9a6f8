//! The asset plugin: the loaders, the loading state of entities, and its messages.
//!
//! In: an app with Bevy's `AssetPlugin`. Out: the same app, in which captures load and every entity with one has a [`CaptureState`].

use super::loader::{CheckpointLoader, ImportLoader, PackageLoader};
use super::messages::{CaptureFailed, CaptureReady};
use super::state::{CaptureAssetSystems, CaptureState};
use super::systems::{any_upload_failure, report_upload_failures, update_states};
use super::uploads::Uploads;
use crate::plugin::component::{GaussianCapture, GaussianCapture3d, Upright, stand_upright};
use bevy::app::{App, Plugin, PostUpdate, PreUpdate};
use bevy::asset::{AssetApp, AssetTrackingSystems};
use bevy::ecs::schedule::IntoScheduleConfigs;
use bevy::ecs::schedule::common_conditions::any_with_component;
use bevy::transform::TransformSystems;

/// Loads captures. Part of [`GaussianCapturePlugin`](crate::GaussianCapturePlugin).
#[derive(Debug, Default, Clone, Copy)]
pub(crate) struct CaptureAssetPlugin;

impl Plugin for CaptureAssetPlugin {
    fn build(&self, app: &mut App) {
        app.init_asset::<GaussianCapture>()
            .init_resource::<Uploads>()
            .register_required_components::<GaussianCapture3d, CaptureState>()
            .init_asset_loader::<PackageLoader>()
            .init_asset_loader::<CheckpointLoader>()
            .init_asset_loader::<ImportLoader>()
            .add_message::<CaptureReady>()
            .add_message::<CaptureFailed>()
            .configure_sets(PreUpdate, CaptureAssetSystems.after(AssetTrackingSystems))
            // A capture stands upright before `CaptureReady` is sent.
            .add_systems(
                PreUpdate,
                (stand_upright.run_if(any_with_component::<Upright>), update_states)
                    .chain()
                    .in_set(CaptureAssetSystems),
            )
            // An entity spawned during this frame with a loaded capture stands upright in its first frame.
            .add_systems(
                PostUpdate,
                stand_upright.run_if(any_with_component::<Upright>).before(TransformSystems::Propagate),
            )
            .add_systems(PreUpdate, report_upload_failures.run_if(any_upload_failure).after(CaptureAssetSystems));
    }
}
