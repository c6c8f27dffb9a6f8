//! The loading state of an entity's capture.
//!
//! In: results of the systems in [`CaptureAssetSystems`]. Out: [`CaptureState`], a component that games read.

use super::failure::CaptureFailure;
use bevy::ecs::component::Component;
use bevy::ecs::reflect::ReflectComponent;
use bevy::ecs::schedule::SystemSet;
use bevy::reflect::Reflect;
use bevy::reflect::std_traits::ReflectDefault;

/// The loading state of an entity's capture: on every entity with a [`GaussianCapture3d`](crate::GaussianCapture3d).
///
/// [`CaptureAssetSystems`] updates it; setting it does not affect loading. Default: [`Loading`](Self::Loading).
///
/// # Examples
///
/// ```
/// use bevy::prelude::*;
/// use bevy_gs4d::prelude::*;
///
/// /// A run condition: whether all captures have been loaded.
/// fn all_ready(states: Query<&CaptureState>) -> bool {
///     states.iter().all(|state| *state == CaptureState::Ready)
/// }
/// # bevy::ecs::system::assert_is_system(all_ready);
/// ```
#[derive(Component, Reflect, Debug, Default, Clone, PartialEq, Eq)]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
#[type_path = "bevy_gs4d::asset"]
#[non_exhaustive]
pub enum CaptureState {
    /// Not loaded, or not completely uploaded to the GPU. Nothing is drawn.
    #[default]
    Loading,
    /// Loaded and drawn; without a renderer, loaded. While another version is loaded and uploaded, the old one is
    /// drawn.
    Ready,
    /// Could not be loaded or uploaded. `AssetServer::reload`, or a change of a file that Bevy watches, loads the
    /// capture again.
    Failed(CaptureFailure),
}

impl CaptureState {
    pub(super) fn is_ready(&self) -> bool {
        match self {
            Self::Ready => true,
            Self::Loading | Self::Failed(_) => false,
        }
    }

    pub(super) fn has_failed(&self) -> bool {
        match self {
            Self::Failed(_) => true,
            Self::Loading | Self::Ready => false,
        }
    }
}

/// The set of the systems that update each [`CaptureState`] and send its messages: in `PreUpdate`, after Bevy's
/// `AssetTrackingSystems`.
#[derive(SystemSet, Debug, Clone, PartialEq, Eq, Hash)]
pub struct CaptureAssetSystems;
