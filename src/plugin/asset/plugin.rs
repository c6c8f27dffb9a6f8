//! The plugin of assets: what can be loaded, and who is told.
//!
//! In: an app with Bevy's `AssetPlugin`. Out: the same app, in which captures load and entities know how far theirs has got.

use super::state::{CaptureAssetSystems, keep_states};
use super::upload_failures::{UploadFailures, report_upload_failures};
use super::{CaptureFailed, CaptureReady, CaptureState, CheckpointLoader, GaussianCapture, PackageLoader};
use crate::plugin::component::GaussianCapture3d;
use bevy::app::{App, Plugin, PreUpdate};
use bevy::asset::{AssetApp, AssetTrackingSystems};
use bevy::ecs::schedule::IntoScheduleConfigs;

/// Loads captures. Part of [`GaussianCapturePlugin`](crate::GaussianCapturePlugin).
#[derive(Debug, Default, Clone, Copy)]
pub(crate) struct CaptureAssetPlugin;

impl Plugin for CaptureAssetPlugin {
    fn build(&self, app: &mut App) {
        app.init_asset::<GaussianCapture>()
            .init_resource::<UploadFailures>()
            .register_required_components::<GaussianCapture3d, CaptureState>()
            .init_asset_loader::<PackageLoader>()
            .init_asset_loader::<CheckpointLoader>()
            .add_message::<CaptureReady>()
            .add_message::<CaptureFailed>()
            .configure_sets(PreUpdate, CaptureAssetSystems.after(AssetTrackingSystems))
            .add_systems(PreUpdate, keep_states.in_set(CaptureAssetSystems))
            .add_systems(PreUpdate, report_upload_failures.after(CaptureAssetSystems));
    }
}
