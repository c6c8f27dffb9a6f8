//! The backend: turns the rays of pointers into hits.
//!
//! In: Bevy's map of rays; cameras and captures with layers and `Pickable`. Out: `PointerHits` of each ray that hits.

use super::searches::Searches;
use super::settings::{CapturePickingCamera, CapturePickingSettings};
use crate::plugin::asset::CaptureState;
use crate::plugin::component::GaussianCapture3d;
use crate::plugin::picker::CapturePicker;
use crate::plugin::render::captures::view::CameraLens;
use bevy::camera::visibility::{RenderLayers, ViewVisibility};
use bevy::camera::{Camera, Camera3d};
use bevy::ecs::entity::Entity;
use bevy::ecs::message::MessageWriter;
use bevy::ecs::query::{Has, With};
use bevy::ecs::system::{Query, Res, ResMut};
use bevy::log::debug_span;
use bevy::picking::backend::ray::RayMap;
use bevy::picking::backend::{HitData, PointerHits};
use bevy::picking::{Pickable, PickingSettings};
use bevy::transform::components::GlobalTransform;

/// Returns whether any pointer is over a camera's target, in an app with Bevy's `PickingPlugin`.
pub(super) fn any_ray(rays: Option<Res<RayMap>>) -> bool {
    rays.is_some_and(|rays| rays.iter().next().is_some())
}

/// Casts the rays of this frame and writes the known hits, on large captures possibly those of an earlier frame.
pub(super) fn update_hits(
    picking: Res<PickingSettings>,
    settings: Res<CapturePickingSettings>,
    rays: Res<RayMap>,
    cameras: Query<(&Camera, &GlobalTransform, Has<CapturePickingCamera>, Option<&RenderLayers>), With<Camera3d>>,
    captures: Query<
        (&ViewVisibility, &CaptureState, Option<&Pickable>, Option<&RenderLayers>),
        With<GaussianCapture3d>,
    >,
    picker: CapturePicker,
    mut searches: ResMut<Searches>,
    mut hits: MessageWriter<PointerHits>,
) {
    searches.retain(|ray| picking.is_enabled && rays.map.contains_key(ray));
    if !picking.is_enabled {
        return;
    }
    let _span = debug_span!("gs4d/pointers").entered();
    for (id, ray) in rays.iter() {
        let Ok((camera, transform, is_marked, layers)) = cameras.get(id.camera) else { continue };
        if settings.require_markers && !is_marked {
            continue;
        }
        // A camera without a lens draws no captures.
        let Some(lens) = CameraLens::of(&camera.clip_from_view()) else { continue };
        let layers = layers.cloned().unwrap_or_default();
        let takes_part = |capture: Entity| {
            let Ok((visibility, state, pickable, its_layers)) = captures.get(capture) else { return false };
            // A capture that is not hoverable may still block the captures behind it.
            let matters = pickable.is_none_or(|pickable| pickable.is_hoverable || pickable.should_block_lower);
            // A capture that is still being uploaded, or that the GPU rejected, would be an invisible obstacle.
            let is_drawn = visibility.get() && *state == CaptureState::Ready;
            let is_seen = is_drawn && layers.intersects(&its_layers.cloned().unwrap_or_default());
            is_seen && matters && (pickable.is_some() || !settings.require_markers)
        };
        let blocks = |capture: Entity| {
            let Ok((_, _, pickable, _)) = captures.get(capture) else { return false };
            pickable.is_none_or(|pickable| pickable.should_block_lower)
        };
        let aims = picker.aims(*ray, Some((&lens, transform.affine())), |capture, _| takes_part(capture), blocks);
        let picks: Vec<(Entity, HitData)> = searches
            .hits(*id, aims)
            .into_iter()
            .map(|hit| (hit.entity, HitData::new_with_extra(id.camera, hit.distance, Some(hit.point), None, hit)))
            .collect();
        if !picks.is_empty() {
            hits.write(PointerHits::new(id.pointer, picks, camera.order as f32));
        }
    }
}
