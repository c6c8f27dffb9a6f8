//! Extract: copies the captures and the cameras' settings of this frame.
//!
//! In (main world): entities with a loaded capture, their transform, playback and settings; the settings of cameras.
//! Out (render world): [`ExtractedCaptures`] and [`ExtractedViewSettings`], by entity of the main world.

use crate::plugin::component::{GaussianCapture, GaussianCapture3d, StreamedPicture};
use crate::plugin::playback::{ClipFade, Playback};
use crate::plugin::render::settings::{CaptureSettings, CaptureViewSettings};
use crate::renderer::GpuCapture;
use crate::scene::Bounds;
use crate::view::Appearance;
use bevy::asset::{AssetId, Assets};
use bevy::camera::Camera;
use bevy::camera::visibility::ViewVisibility;
use bevy::ecs::change_detection::DetectChanges;
use bevy::ecs::entity::Entity;
use bevy::ecs::query::With;
use bevy::ecs::resource::Resource;
use bevy::ecs::system::{Query, Res, ResMut};
use bevy::log::debug_span;
use bevy::render::Extract;
use bevy::render::sync_world::{MainEntity, MainEntityHashMap};
use bevy::transform::components::GlobalTransform;
use glam::{Affine3A, Vec3};

/// The captures of this frame, including captures that no camera sees. The memory is kept from frame to frame.
#[derive(Resource, Default)]
pub(crate) struct ExtractedCaptures(pub(crate) MainEntityHashMap<ExtractedCapture>);

/// One entity with a loaded capture.
pub(crate) struct ExtractedCapture {
    pub(crate) asset: AssetId<GaussianCapture>,
    pub(crate) world_from_capture: Affine3A,
    /// The center of its bounds at this time, in world space.
    pub(in crate::plugin::render) center: Vec3,
    /// Seconds since the capture's start.
    pub(crate) seconds: f32,
    /// Whether no Gaussian is drawn: those of the first picture have not been loaded.
    pub(crate) is_blank: bool,
    /// Whether its temporal filter is used.
    pub(crate) filtered: bool,
    /// Without thinning, which depends on the view.
    pub(crate) appearance: Appearance,
    /// Whether its Gaussians are anti-aliased; see [`CaptureSettings::antialias`].
    pub(in crate::plugin::render) antialias: bool,
    /// The finest level of detail that is drawn.
    pub(crate) finest_level: u8,
    /// Its priority in the budget.
    pub(crate) priority: f32,
    /// Whether any camera sees it, or may see its shadow.
    pub(crate) seen: bool,
    /// Whether it casts shadows.
    pub(crate) casts: bool,
}

impl ExtractedCapture {
    /// Returns whether its opacity is 0, so that it is not visible from anywhere.
    pub(crate) fn is_faded_out(&self) -> bool {
        self.appearance.opacity <= 0.0
    }

    /// Returns whether the Gaussians that are drawn are listed: those of a temporal filter, if it is used, or those that are
    /// there of a capture in chunk files.
    pub(crate) fn is_listed(&self, capture: &GpuCapture) -> bool {
        self.filtered || capture.paged_bytes().is_some()
    }
}

/// The settings of cameras that have a [`CaptureViewSettings`].
#[derive(Resource, Default)]
pub(crate) struct ExtractedViewSettings(pub(crate) MainEntityHashMap<CaptureViewSettings>);

type Placed = (
    Entity,
    &'static GaussianCapture3d,
    &'static CaptureSettings,
    &'static Playback,
    &'static GlobalTransform,
    &'static ViewVisibility,
    Option<&'static ClipFade>,
    Option<&'static StreamedPicture>,
);

/// Returns whether a resource of the main world has changed or been added since the last extraction, or does not exist.
pub(in crate::plugin::render) fn has_changed<R: Resource>(resource: Extract<Option<Res<R>>>) -> bool {
    resource.as_ref().is_none_or(|resource| resource.is_changed())
}

pub(crate) fn extract_captures(
    mut extracted: ResMut<ExtractedCaptures>,
    assets: Extract<Res<Assets<GaussianCapture>>>,
    captures: Extract<Query<Placed>>,
) {
    let _span = debug_span!("gs4d/extract").entered();
    extracted.0.clear();
    for (entity, capture, settings, playback, transform, visibility, fade, picture) in &captures {
        let Some(loaded) = assets.get(&capture.0) else { continue };
        let is_streamed = loaded.scene().chunks.is_some();
        let picture = is_streamed.then(|| picture.copied().unwrap_or_default());
        let bounds = picture.map_or_else(|| loaded.bounds_at(playback.time), |picture| picture.bounds);
        let center = |bounds: Bounds| transform.transform_point((bounds.min + bounds.max) / 2.0);
        let placed = ExtractedCapture {
            asset: capture.0.id(),
            world_from_capture: transform.affine(),
            center: bounds.map_or(transform.translation(), center),
            seconds: StreamedPicture::drawn(picture.as_ref(), is_streamed, playback.time),
            is_blank: picture.is_some_and(|picture| picture.seconds.is_none()),
            filtered: settings.filter,
            antialias: settings.antialias,
            appearance: settings.appearance(fade.copied().unwrap_or_default().0),
            finest_level: settings.finest_level,
            priority: settings.priority,
            seen: visibility.get(),
            casts: false,
        };
        extracted.0.insert(entity.into(), placed);
    }
}

/// Returns whether any camera of the main world has settings, or had settings in the previous frame.
pub(in crate::plugin::render) fn any_view_settings(
    cameras: Extract<Query<(), With<CaptureViewSettings>>>,
    extracted: Res<ExtractedViewSettings>,
) -> bool {
    !(cameras.is_empty() && extracted.0.is_empty())
}

pub(in crate::plugin::render) fn extract_view_settings(
    mut extracted: ResMut<ExtractedViewSettings>,
    cameras: Extract<Query<(Entity, &CaptureViewSettings), With<Camera>>>,
) {
    extracted.0.clear();
    extracted.0.extend(cameras.iter().map(|(camera, settings)| (MainEntity::from(camera), *settings)));
}
