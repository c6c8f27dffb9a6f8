//! The asset plugin: the loader, the processor, the loading state of entities, and its messages.
//!
//! In: an app with Bevy's `AssetPlugin`. Out: the same app, in which captures load and every entity with one has a
//! [`CaptureState`].

use super::loader::CaptureLoader;
use super::messages::{CaptureFailed, CaptureReady};
use super::one_file::PartSources;
use super::processor;
#[cfg(feature = "sound")]
use super::sound_loader::SoundLoader;
use super::state::{CaptureAssetSystems, CaptureState};
use super::systems::{any_upload_failure, report_upload_failures, update_states};
use super::uploads::Uploads;
use crate::plugin::component::{GaussianCapture, GaussianCapture3d, SoundTrack, Upright, stand_upright};
use bevy::app::{App, Plugin, PostUpdate, PreUpdate};
use bevy::asset::{AssetApp, AssetServer, AssetTrackingSystems};
use bevy::ecs::schedule::IntoScheduleConfigs;
use bevy::ecs::schedule::common_conditions::any_with_component;
use bevy::log::warn;
use bevy::transform::TransformSystems;

/// Loads captures. Part of [`GaussianCapturePlugins`](crate::GaussianCapturePlugins); all other parts but
/// [`StereoPlugin`](crate::stereo::StereoPlugin) need it.
#[derive(Debug, Default, Clone, Copy)]
pub struct CaptureAssetPlugin;

impl Plugin for CaptureAssetPlugin {
    fn build(&self, app: &mut App) {
        if app.world().contains_resource::<AssetServer>() {
            add(app);
        }
    }

    /// Bevy's `AssetPlugin` may have been added later than this plugin. Only now Bevy's log exists for certain.
    fn finish(&self, app: &mut App) {
        if app.world().contains_resource::<Uploads>() {
            return;
        }
        if app.world().contains_resource::<AssetServer>() {
            warn!(
                "GaussianCapturePlugins were added before Bevy's AssetPlugin; they were set up only when the app started: add them \
                 after DefaultPlugins or, in an app without them, after AssetPlugin"
            );
            add(app);
        } else {
            warn!(
                "GaussianCapturePlugins need Bevy's AssetPlugin, which this app does not have, so that no capture is loaded: \
                 add DefaultPlugins, or AssetPlugin itself"
            );
        }
    }
}

fn add(app: &mut App) {
    let sources = app.world().get_resource::<PartSources>().cloned().unwrap_or_default();
    app.init_asset::<GaussianCapture>()
        .init_asset::<SoundTrack>()
        .init_resource::<Uploads>()
        .register_required_components::<GaussianCapture3d, CaptureState>()
        .register_asset_loader(CaptureLoader::of(sources))
        .add_message::<CaptureReady>()
        .add_message::<CaptureFailed>()
        .configure_sets(PreUpdate, CaptureAssetSystems.after(AssetTrackingSystems))
        // A capture stands upright before `CaptureReady` is sent.
        .add_systems(
            PreUpdate,
            (stand_upright.run_if(any_with_component::<Upright>), update_states).chain().in_set(CaptureAssetSystems),
        )
        // An entity spawned during this frame with a loaded capture stands upright in its first frame.
        .add_systems(
            PostUpdate,
            stand_upright.run_if(any_with_component::<Upright>).before(TransformSystems::Propagate),
        )
        .add_systems(PreUpdate, report_upload_failures.run_if(any_upload_failure).after(CaptureAssetSystems));
    #[cfg(feature = "sound")]
    app.init_asset_loader::<SoundLoader>();
    processor::register(app);
}
