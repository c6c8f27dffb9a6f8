//! Visibility: updates the bounds of each placed capture at its current time, for frustum culling.
//!
//! In: loaded captures and their playback. Out: an `Aabb` on each entity, in capture space, written after a change.

use crate::plugin::component::{GaussianCapture, GaussianCapture3d};
use crate::plugin::playback::Playback;
use bevy::asset::Assets;
use bevy::camera::primitives::Aabb;
use bevy::ecs::change_detection::DetectChangesMut;
use bevy::ecs::entity::Entity;
use bevy::ecs::system::{Commands, Query, Res};
use bevy::log::debug_span;

/// Updates the boxes. Runs after playback has advanced and before Bevy decides which entities a camera sees.
pub(in crate::plugin::render) fn update_bounds(
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

/// Returns the box at `seconds` since the start. `None` for a capture with an environment map, which every camera sees,
/// and for a capture without finite bounds; such captures are never culled.
fn aabb_at(capture: &GaussianCapture, seconds: f32) -> Option<Aabb> {
    if capture.scene().environment.is_some() {
        return None;
    }
    let bounds = capture.bounds_at(seconds)?;
    (bounds.min.is_finite() && bounds.max.is_finite()).then(|| Aabb::from_min_max(bounds.min, bounds.max))
}
