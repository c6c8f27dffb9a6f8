//! Extract: what is to be drawn this frame.
//!
//! In (main world): visible entities with a capture, their transform and playback. Out (render world): [`ExtractedCaptures`].

use super::{CaptureSettings, GaussianCapture3d};
use crate::asset::GaussianCapture;
use crate::playback::Playback;
use bevy::asset::{AssetId, Assets};
use bevy::camera::visibility::InheritedVisibility;
use bevy::ecs::resource::Resource;
use bevy::ecs::system::{Query, Res, ResMut};
use bevy::render::Extract;
use bevy::transform::components::GlobalTransform;
use glam::Affine3A;

/// The captures of this frame, whatever camera will see them. The memory is kept from frame to frame.
#[derive(Resource, Default)]
pub(super) struct ExtractedCaptures(pub(super) Vec<ExtractedCapture>);

/// One entity with a loaded capture.
pub(super) struct ExtractedCapture {
    pub(super) asset: AssetId<GaussianCapture>,
    pub(super) world_from_capture: Affine3A,
    /// In the capture's own unit.
    pub(super) time: f32,
    /// Whether its temporal filter is used.
    pub(super) filtered: bool,
}

pub(super) fn extract_captures(
    mut extracted: ResMut<ExtractedCaptures>,
    assets: Extract<Res<Assets<GaussianCapture>>>,
    captures: Extract<Query<(&GaussianCapture3d, &CaptureSettings, &Playback, &GlobalTransform, &InheritedVisibility)>>,
) {
    extracted.0.clear();
    for (capture, settings, playback, transform, visibility) in &captures {
        if !visibility.get() {
            continue;
        }
        if let Some(loaded) = assets.get(&capture.0) {
            extracted.0.push(ExtractedCapture {
                asset: capture.0.id(),
                world_from_capture: transform.affine(),
                time: loaded.time_at(playback.time),
                filtered: settings.filter,
            });
        }
    }
}
