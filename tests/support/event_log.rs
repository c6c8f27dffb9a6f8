//! Records of an app's events: by observers and by readers of messages, which must agree.
//!
//! In: an app and the events to record. Out: their texts, in the order in which observers received them.

use bevy::ecs::schedule::ScheduleLabel;
use bevy::prelude::*;
use std::fmt::Debug;

/// The events that observers have received, in order.
#[derive(Resource, Default)]
pub struct Observed(pub Vec<String>);

/// The events that readers have received, type by type.
#[derive(Resource, Default)]
struct Read(Vec<String>);

/// Records one kind of event. Its reader runs in `schedule` and receives events that are sent later in a frame in the
/// next one.
pub fn record<E: Message + EntityEvent + Debug>(app: &mut App, schedule: impl ScheduleLabel) {
    app.init_resource::<Observed>().init_resource::<Read>();
    app.add_observer(|event: On<E>, mut observed: ResMut<Observed>| observed.0.push(debug(event.event())));
    app.add_systems(schedule, |mut reader: MessageReader<E>, mut read: ResMut<Read>| {
        read.0.extend(reader.read().map(debug));
    });
}

/// Returns an event as text.
pub fn debug(message: &impl Debug) -> String {
    format!("{message:?}")
}

/// Returns the events since the last call. Observers and readers must have received the same.
pub fn take_events(app: &mut App) -> Vec<String> {
    let observed = std::mem::take(&mut app.world_mut().resource_mut::<Observed>().0);
    let mut read = std::mem::take(&mut app.world_mut().resource_mut::<Read>().0);
    let mut sorted = observed.clone();
    sorted.sort();
    read.sort();
    assert_eq!(sorted, read, "observers and readers get the same");
    observed
}
