//! Copies: components that the parts of a capture have from its entity.
//!
//! In: a component that changes how a capture is drawn. Out: the same on each of its [`CapturePart`]s.

use crate::plugin::component::CapturePart;
use bevy::app::{App, PostUpdate};
use bevy::camera::visibility::VisibilitySystems;
use bevy::ecs::component::Component;
use bevy::ecs::entity::Entity;
use bevy::ecs::hierarchy::ChildOf;
use bevy::ecs::query::{With, Without};
use bevy::ecs::schedule::IntoScheduleConfigs;
use bevy::ecs::schedule::common_conditions::any_with_component;
use bevy::ecs::system::{Commands, Query};

/// Makes the parts of captures in chunk files have a component of their capture's entity.
pub(crate) fn copy_to_parts<C: Component + Clone + PartialEq>(app: &mut App) {
    let copies = copy::<C>.run_if(any_with_component::<CapturePart>).before(VisibilitySystems::CalculateBounds);
    app.add_systems(PostUpdate, copies);
}

fn copy<C: Component + Clone + PartialEq>(
    parts: Query<(Entity, &ChildOf, Option<&C>), With<CapturePart>>,
    captures: Query<&C, Without<CapturePart>>,
    mut commands: Commands,
) {
    for (part, ChildOf(capture), own) in &parts {
        match (captures.get(*capture).ok(), own) {
            (Some(wanted), own) if own != Some(wanted) => {
                commands.entity(part).try_insert(wanted.clone());
            }
            (None, Some(_)) => {
                commands.entity(part).try_remove::<C>();
            }
            (Some(_) | None, _) => {}
        }
    }
}
