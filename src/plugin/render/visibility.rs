//! Visibility: where each placed capture is at its moment, for frustum culling.
//!
//! In: loaded captures and their playback. Out: an `Aabb` on each entity, in capture space, written only when it changes.

use crate::plugin::asset::GaussianCapture;
use crate::plugin::component::GaussianCapture3d;
use crate::plugin::playback::Playback;
use bevy::asset::Assets;
use bevy::camera::primitives::Aabb;
use bevy::ecs::change_detection::DetectChangesMut;
use bevy::ecs::entity::Entity;
use bevy::ecs::system::{Commands, Query, Res};
use bevy::log::debug_span;

/// Keeps the boxes up with time. After whatever moves playback on, before Bevy asks which entities a camera sees.
pub(super) fn update_bounds(
    captures: Res<Assets<GaussianCapture>>,
    mut placed: Query<(Entity, &GaussianCapture3d, &Playback, Option<&mut Aabb>)>,
    mut commands: Commands,
) {
    let _span = debug_span!("gs4d/bounds").entered();
    for (entity, handle, playback, known) in &mut placed {
        let Some(capture) = captures.get(&handle.0) else { continue };
        match (aabb_at(capture, playback.time), known) {
            (Some(wanted), Some(mut known)) => {
                known.set_if_neq(wanted);
            }
            (Some(wanted), None) => {
                commands.entity(entity).try_insert(wanted);
            }
            (None, Some(_)) => {
                commands.entity(entity).try_remove::<Aabb>();
            }
            (None, None) => {}
        }
    }
}

/// The box at `seconds` since the start; nothing, so that it is never culled, for a capture with an environment map, which shows
/// wherever a camera looks, and for one that is nowhere.
fn aabb_at(capture: &GaussianCapture, seconds: f32) -> Option<Aabb> {
    if capture.scene().environment.is_some() {
        return None;
    }
    let bounds = capture.bounds_at(seconds)?;
    (bounds.min.is_finite() && bounds.max.is_finite()).then(|| Aabb::from_min_max(bounds.min, bounds.max))
}
