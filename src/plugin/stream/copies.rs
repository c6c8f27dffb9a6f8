//! Copies: components that the parts of a capture have from its entity.
//!
//! In: a component that changes how a capture is drawn, with values or without. Out: the same on each of its
//! [`CapturePart`]s.

use crate::plugin::component::CapturePart;
use bevy::app::{App, PostUpdate};
use bevy::camera::visibility::VisibilitySystems;
use bevy::ecs::component::Component;
use bevy::ecs::entity::Entity;
use bevy::ecs::hierarchy::ChildOf;
#[cfg(feature = "pbr")]
use bevy::ecs::query::Has;
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

/// Makes the parts of captures in chunk files have a component without values if their capture's entity has it.
#[cfg(feature = "pbr")]
pub(crate) fn mark_parts<C: Component + Default>(app: &mut App) {
    let marks = mark::<C>.run_if(any_with_component::<CapturePart>).before(VisibilitySystems::CalculateBounds);
    app.add_systems(PostUpdate, marks);
}

#[cfg(feature = "pbr")]
fn mark<C: Component + Default>(
    parts: Query<(Entity, &ChildOf, Has<C>), With<CapturePart>>,
    captures: Query<Has<C>, Without<CapturePart>>,
    mut commands: Commands,
) {
    for (part, ChildOf(capture), is_marked) in &parts {
        match (captures.get(*capture), is_marked) {
            (Ok(true), false) => {
                commands.entity(part).try_insert(C::default());
            }
            (Ok(false), true) => {
                commands.entity(part).try_remove::<C>();
            }
            (Ok(_) | Err(_), _) => {}
        }
    }
}

#[cfg(all(test, feature = "pbr"))]
mod tests {
    use super::*;
    use bevy::light::NotShadowReceiver;

    #[test]
    fn parts_have_the_components_without_values_of_their_capture() {
        let mut app = App::new();
        mark_parts::<NotShadowReceiver>(&mut app);
        let [capture, other] = [(); 2].map(|()| app.world_mut().spawn_empty().id());
        let part = |capture| (CapturePart::default(), ChildOf(capture));
        let [own, others] = [capture, other].map(|capture| app.world_mut().spawn(part(capture)).id());
        let marked = |app: &App| [own, others].map(|part| app.world().get::<NotShadowReceiver>(part).is_some());
        app.world_mut().entity_mut(capture).insert(NotShadowReceiver);
        app.update();
        assert_eq!(marked(&app), [true, false], "the parts of the capture that has it");
        app.world_mut().entity_mut(capture).remove::<NotShadowReceiver>();
        app.update();
        assert_eq!(marked(&app), [false; 2], "and no longer has it");
    }
}
