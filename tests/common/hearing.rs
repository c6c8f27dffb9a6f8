//! What apps say, written down: by observers and by readers of messages, who must hear the same.
//!
//! In: an app and the messages to listen to. Out: their texts, in the order in which observers heard them.

use bevy::ecs::schedule::ScheduleLabel;
use bevy::prelude::*;
use std::fmt::Debug;

/// What observers have heard, in order.
#[derive(Resource, Default)]
pub struct Observed(pub Vec<String>);

/// What readers have heard, type by type.
#[derive(Resource, Default)]
struct Read(Vec<String>);

/// Listens to one kind of message. Its reader runs in `schedule`: what is said later in a frame it hears in the next.
pub fn listen<E: Message + EntityEvent + Debug>(app: &mut App, schedule: impl ScheduleLabel) {
    app.init_resource::<Observed>().init_resource::<Read>();
    app.add_observer(|event: On<E>, mut observed: ResMut<Observed>| observed.0.push(debug(event.event())));
    app.add_systems(schedule, |mut reader: MessageReader<E>, mut read: ResMut<Read>| {
        read.0.extend(reader.read().map(debug));
    });
}

/// A message as text.
pub fn debug(message: &impl Debug) -> String {
    format!("{message:?}")
}

/// What has been said since this was last asked: observers and readers must have heard the same.
pub fn said(app: &mut App) -> Vec<String> {
    let observed = std::mem::take(&mut app.world_mut().resource_mut::<Observed>().0);
    let mut read = std::mem::take(&mut app.world_mut().resource_mut::<Read>().0);
    let mut sorted = observed.clone();
    sorted.sort();
    read.sort();
    assert_eq!(sorted, read, "observers and readers hear the same");
    observed
}
