//! Records of an app's events: by observers and by readers of messages, which must agree.
//!
//! In: an app and the events to record. Out: their texts, in the order in which observers got them.

use bevy::ecs::schedule::ScheduleLabel;
use bevy::prelude::*;
use std::fmt::Debug;

/// What observers have got, in order.
#[derive(Resource, Default)]
pub struct Observed(pub Vec<String>);

/// What readers have got, type by type.
#[derive(Resource, Default)]
struct Read(Vec<String>);

/// Records one kind of event. Its reader runs in `schedule`: what is sent later in a frame it gets in the next.
pub fn record<E: Message + EntityEvent + Debug>(app: &mut App, schedule: impl ScheduleLabel) {
    app.init_resource::<Observed>().init_resource::<Read>();
    app.add_observer(|event: On<E>, mut observed: ResMut<Observed>| observed.0.push(debug(event.event())));
    app.add_systems(schedule, |mut reader: MessageReader<E>, mut read: ResMut<Read>| {
        read.0.extend(reader.read().map(debug));
    });
}

/// An event as text.
pub fn debug(message: &impl Debug) -> String {
    format!("{message:?}")
}

/// Returns the events since the last call. Observers and readers must have got the same.
pub fn take_events(app: &mut App) -> Vec<String> {
    let observed = std::mem::take(&mut app.world_mut().resource_mut::<Observed>().0);
    let mut read = std::mem::take(&mut app.world_mut().resource_mut::<Read>().0);
    let mut sorted = observed.clone();
    sorted.sort();
    read.sort();
    assert_eq!(sorted, read, "observers and readers get the same");
    observed
}
