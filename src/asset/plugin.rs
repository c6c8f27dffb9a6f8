//! The plugin of assets: what can be loaded, and who is told.
//!
//! In: an app with Bevy's `AssetPlugin`. Out: the same app, in which captures load and entities know how far theirs has got.

use super::state::{CaptureAssetSystems, keep_states};
use super::{CaptureFailed, CaptureReady, CheckpointLoader, GaussianCapture, PackageLoader};
use bevy::app::{App, Plugin, PreUpdate};
use bevy::asset::{AssetApp, AssetTrackingSystems};
use bevy::ecs::schedule::IntoScheduleConfigs;

/// Loads captures. Part of [`GaussianCapturePlugin`](crate::render::GaussianCapturePlugin).
#[derive(Debug, Default, Clone, Copy)]
pub(crate) struct CaptureAssetPlugin;

impl Plugin for CaptureAssetPlugin {
    fn build(&self, app: &mut App) {
        app.init_asset::<GaussianCapture>()
            .init_asset_loader::<PackageLoader>()
            .init_asset_loader::<CheckpointLoader>()
            .add_message::<CaptureReady>()
            .add_message::<CaptureFailed>()
            .configure_sets(PreUpdate, CaptureAssetSystems.after(AssetTrackingSystems))
            .add_systems(PreUpdate, keep_states.in_set(CaptureAssetSystems));
    }
}
