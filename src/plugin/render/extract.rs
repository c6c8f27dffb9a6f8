//! Extract: the captures and the cameras' settings of this frame.
//!
//! In (main world): entities with a loaded capture, their transform, playback and settings; the settings of cameras. Out (render
//! world): [`ExtractedCaptures`] and [`ExtractedViewSettings`], by entity of the main world.

use super::settings::{CaptureSettings, CaptureViewSettings};
use crate::plugin::component::{GaussianCapture, GaussianCapture3d};
use crate::plugin::playback::{ClipFade, Playback};
use crate::view::Appearance;
use bevy::asset::{AssetId, Assets};
use bevy::camera::Camera;
use bevy::camera::visibility::ViewVisibility;
use bevy::ecs::entity::Entity;
use bevy::ecs::query::With;
use bevy::ecs::resource::Resource;
use bevy::ecs::system::{Query, Res, ResMut};
use bevy::log::debug_span;
use bevy::render::Extract;
use bevy::render::sync_world::{MainEntity, MainEntityHashMap};
use bevy::transform::components::GlobalTransform;
use glam::Affine3A;

/// The captures of this frame, seen by a camera or not. The memory is kept from frame to frame.
#[derive(Resource, Default)]
pub(super) struct ExtractedCaptures(pub(super) MainEntityHashMap<ExtractedCapture>);

/// One entity with a loaded capture.
pub(super) struct ExtractedCapture {
    pub(super) asset: AssetId<GaussianCapture>,
    pub(super) world_from_capture: Affine3A,
    /// Seconds since the capture's start.
    pub(super) seconds: f32,
    /// Whether its temporal filter is used.
    pub(super) filtered: bool,
    pub(super) appearance: Appearance,
    /// The finest level of detail that is drawn.
    pub(super) finest_level: u8,
    /// Whether any camera sees it.
    pub(super) seen: bool,
}

impl ExtractedCapture {
    /// Returns whether nothing of it shows, wherever it is seen from.
    pub(super) fn is_faded_out(&self) -> bool {
        self.appearance.opacity <= 0.0
    }
}

/// How cameras draw captures, for those with settings.
#[derive(Resource, Default)]
pub(super) struct ExtractedViewSettings(pub(super) MainEntityHashMap<CaptureViewSettings>);

type Placed = (
    Entity,
    &'static GaussianCapture3d,
    &'static CaptureSettings,
    &'static Playback,
    &'static GlobalTransform,
    &'static ViewVisibility,
    Option<&'static ClipFade>,
);

pub(super) fn extract_captures(
    mut extracted: ResMut<ExtractedCaptures>,
    assets: Extract<Res<Assets<GaussianCapture>>>,
    captures: Extract<Query<Placed>>,
) {
    let _span = debug_span!("gs4d/extract").entered();
    extracted.0.clear();
    for (entity, capture, settings, playback, transform, visibility, fade) in &captures {
        if !assets.contains(&capture.0) {
            continue;
        }
        let placed = ExtractedCapture {
            asset: capture.0.id(),
            world_from_capture: transform.affine(),
            seconds: playback.time,
            filtered: settings.filter,
            appearance: settings.appearance(fade.copied().unwrap_or_default().0),
            finest_level: settings.finest_level,
            seen: visibility.get(),
        };
        extracted.0.insert(entity.into(), placed);
    }
}

pub(super) fn extract_view_settings(
    mut extracted: ResMut<ExtractedViewSettings>,
    cameras: Extract<Query<(Entity, &CaptureViewSettings), With<Camera>>>,
) {
    extracted.0.clear();
    extracted.0.extend(cameras.iter().map(|(camera, settings)| (MainEntity::from(camera), *settings)));
}
