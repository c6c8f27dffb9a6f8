//! Records of an app's events, by observers and by readers of messages, whose records must be equal.
//!
//! In: an app and the types of events to record. Out: the events as texts, in the order in which observers received
//! them.

use bevy::ecs::schedule::ScheduleLabel;
use bevy::prelude::*;
use bevy_gs4d::asset::CaptureFailed;
use std::fmt::Debug;
use std::sync::{Arc, Mutex, PoisonError};

/// The events that observers have received, in order.
#[derive(Resource, Default)]
pub struct Observed(pub Vec<String>);

/// The events that readers have received, grouped by type.
#[derive(Resource, Default)]
struct Read(Vec<String>);

/// Records one type of event. The reader runs in `schedule`; it receives events sent later in a frame in the next
/// frame.
pub fn record<E: Message + EntityEvent + Debug>(app: &mut App, schedule: impl ScheduleLabel) {
    app.init_resource::<Observed>().init_resource::<Read>();
    app.add_observer(|event: On<E>, mut observed: ResMut<Observed>| observed.0.push(debug(event.event())));
    app.add_systems(schedule, |mut reader: MessageReader<E>, mut read: ResMut<Read>| {
        read.0.extend(reader.read().map(debug));
    });
}

/// Formats an event as text.
pub fn debug(message: &impl Debug) -> String {
    format!("{message:?}")
}

/// Returns the events since the last call. Observers and readers must have received the same events.
pub fn take_events(app: &mut App) -> Vec<String> {
    let observed = std::mem::take(&mut app.world_mut().resource_mut::<Observed>().0);
    let mut read = std::mem::take(&mut app.world_mut().resource_mut::<Read>().0);
    let mut sorted = observed.clone();
    sorted.sort();
    read.sort();
    assert_eq!(sorted, read, "observers and readers receive the same events");
    observed
}

/// Collects the failures of captures from now on.
pub fn failures_of(app: &mut App) -> Arc<Mutex<Vec<CaptureFailed>>> {
    let failures = Arc::new(Mutex::new(Vec::new()));
    let sink = failures.clone();
    app.add_observer(move |failure: On<CaptureFailed>| {
        sink.lock().unwrap_or_else(PoisonError::into_inner).push(failure.event().clone());
    });
    failures
}
