//! Extract: copies the captures that cast shadows.
//!
//! In (main world): captures with [`CastsShadows`] and without Bevy's `NotShadowCaster`, their bounds, layers and ranges;
//! the extracted captures. Out (render world): [`ExtractedCasters`]; the extracted captures marked as casters, so that
//! their active lists are updated even if no camera sees them.

use super::casts::{CastsShadows, ShadowResolution};
use crate::plugin::component::{GaussianCapture, GaussianCapture3d, StreamedPicture};
use crate::plugin::pbr::in_range::{InRange, Ranges};
use crate::plugin::playback::Playback;
use crate::plugin::render::ExtractedCaptures;
use bevy::asset::Assets;
use bevy::camera::primitives::Aabb;
use bevy::camera::visibility::{InheritedVisibility, RenderLayers};
use bevy::ecs::entity::Entity;
use bevy::ecs::query::{With, Without};
use bevy::ecs::resource::Resource;
use bevy::ecs::system::{Query, Res, ResMut};
use bevy::light::NotShadowCaster;
use bevy::render::Extract;
use bevy::render::sync_world::MainEntity;
use glam::Affine3A;

/// The captures that cast shadows this frame. The memory is kept from frame to frame.
#[derive(Resource, Default)]
pub(super) struct ExtractedCasters(pub(super) Vec<Caster>);

/// The entities that cast shadows: Bevy's component has precedence over the component of this crate.
type Casting = (With<CastsShadows>, Without<NotShadowCaster>);

/// Returns whether any capture of the main world casts shadows.
pub(super) fn any_casts(captures: Extract<Query<(), Casting>>) -> bool {
    !captures.is_empty()
}

/// Returns whether any capture casts shadows.
pub(super) fn any_caster(casters: Res<ExtractedCasters>) -> bool {
    !casters.0.is_empty()
}

/// One capture that casts shadows.
pub(super) struct Caster {
    pub(super) entity: MainEntity,
    pub(super) resolution: ShadowResolution,
    /// Distance of its shadow behind its surface, world units.
    pub(super) bias: f32,
    /// Its bounds at the current time, in capture space.
    pub(super) bounds: Aabb,
    pub(super) world_from_capture: Affine3A,
    pub(super) layers: RenderLayers,
    pub(super) in_range: InRange,
}

type Placed = (
    Entity,
    &'static GaussianCapture3d,
    &'static CastsShadows,
    &'static Playback,
    &'static InheritedVisibility,
    Option<&'static Aabb>,
    Option<&'static RenderLayers>,
    Option<&'static StreamedPicture>,
);

pub(super) fn extract_casters(
    mut casters: ResMut<ExtractedCasters>,
    mut extracted: ResMut<ExtractedCaptures>,
    assets: Extract<Res<Assets<GaussianCapture>>>,
    captures: Extract<Query<Placed, Casting>>,
    ranges: Extract<Ranges>,
) {
    casters.0.clear();
    for (entity, capture, settings, playback, visibility, bounds, layers, picture) in &captures {
        let entity = MainEntity::from(entity);
        let Some(placed) = extracted.0.get_mut(&entity).filter(|placed| visibility.get() && !placed.is_faded_out())
        else {
            continue;
        };
        let Some(asset) = assets.get(&capture.0) else { continue };
        // A capture with an environment map has no box, since cameras never cull it, but its Gaussians have bounds.
        let known = || {
            let bounds = picture.map_or_else(|| asset.bounds_at(playback.time), |picture| picture.bounds)?;
            (bounds.min.is_finite() && bounds.max.is_finite()).then(|| Aabb::from_min_max(bounds.min, bounds.max))
        };
        let Some(bounds) = bounds.copied().or_else(known) else { continue };
        let in_range = ranges.of(entity.id());
        if in_range.is_nowhere() {
            continue;
        }
        let extent = picture.map_or(asset.extent(), |picture| picture.extent);
        (placed.seen, placed.casts) = (true, true);
        casters.0.push(Caster {
            entity,
            resolution: settings.resolution,
            bias: settings.distance(extent, &placed.world_from_capture),
            bounds,
            world_from_capture: placed.world_from_capture,
            layers: layers.cloned().unwrap_or_default(),
            in_range,
        });
    }
}
