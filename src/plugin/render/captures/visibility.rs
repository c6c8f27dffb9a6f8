//! Visibility: updates the bounds of each placed capture at its current time, for frustum culling.
//!
//! In: loaded captures, their playback, the pictures of those in chunk files. Out: an `Aabb` on each entity, in capture space, written after a change.

use crate::plugin::component::{GaussianCapture, GaussianCapture3d, StreamedPicture};
use crate::plugin::playback::Playback;
use crate::scene::Bounds;
use bevy::asset::Assets;
use bevy::camera::primitives::Aabb;
use bevy::ecs::change_detection::DetectChangesMut;
use bevy::ecs::entity::Entity;
use bevy::ecs::system::{Commands, Query, Res};
use bevy::log::debug_span;

/// Updates the boxes. Runs after playback has advanced and before Bevy decides which entities a camera sees.
pub(in crate::plugin::render) fn update_bounds(
    captures: Res<Assets<GaussianCapture>>,
    mut placed: Query<(Entity, &GaussianCapture3d, &Playback, Option<&StreamedPicture>, Option<&mut Aabb>)>,
    mut commands: Commands,
) {
    let _span = debug_span!("gs4d/bounds").entered();
    for (entity, handle, playback, picture, known) in &mut placed {
        let Some(capture) = captures.get(&handle.0) else { continue };
        let bounds = match picture.filter(|_| capture.scene().chunks.is_some()) {
            Some(picture) => picture.bounds,
            None => capture.bounds_at(playback.time),
        };
        match (aabb_of(capture, bounds), known) {
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

/// Returns the box of a capture with these bounds. `None` for a capture with an environment map, which every camera sees,
/// and for a capture without finite bounds; such captures are never culled.
fn aabb_of(capture: &GaussianCapture, bounds: Option<Bounds>) -> Option<Aabb> {
    let bounds = bounds.filter(|_| capture.scene().environment.is_none())?;
    (bounds.min.is_finite() && bounds.max.is_finite()).then(|| Aabb::from_min_max(bounds.min, bounds.max))
}
