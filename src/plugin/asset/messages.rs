//! The messages about loading.
//!
//! In: a change of an entity's [`CaptureState`](super::CaptureState). Out: each message in two ways: as a message for a
//! `MessageReader`, and as an event on that entity for observers: `commands.entity(capture).observe(|failed:
//! On<CaptureFailed>| ..)`.
//!
//! They are sent in `PreUpdate`, in [`CaptureAssetSystems`](super::CaptureAssetSystems) and, for captures that the GPU
//! cannot draw, after it: systems in `Update` read them in the same frame. Those about chunk files are sent in
//! `Update`.

use super::failure::CaptureFailure;
use crate::plugin::component::GaussianCapture;
use bevy::asset::AssetId;
use bevy::ecs::entity::Entity;
use bevy::ecs::event::EntityEvent;
use bevy::ecs::message::{Message, MessageWriter};
use bevy::ecs::system::{Commands, SystemParam};

/// An entity's capture is loaded, completely uploaded to the GPU and drawn: for the first time, again after its file or
/// the asset changed or the device was lost, or because the entity's handle now names another capture that is already
/// uploaded. Sent at the latest two frames after the capture is first drawn; without a renderer, once it is loaded.
///
/// # Examples
///
/// ```
/// use bevy::prelude::*;
/// use bevy_gs4d::prelude::*;
///
/// /// Stands every capture upright once it is loaded.
/// fn stand_up(ready: On<CaptureReady>, captures: Res<Assets<GaussianCapture>>, mut placed: Query<&mut Transform>) {
///     if let (Some(capture), Ok(mut transform)) = (captures.get(ready.capture), placed.get_mut(ready.entity)) {
///         transform.rotation = capture.upright();
///     }
/// }
///
/// App::new().add_observer(stand_up);
/// ```
#[derive(Message, EntityEvent, Debug, Clone, PartialEq)]
pub struct CaptureReady {
    /// The entity with the capture.
    pub entity: Entity,
    /// The capture.
    pub capture: AssetId<GaussianCapture>,
}

/// An entity's capture could not be loaded, or this GPU cannot draw it. If the capture was drawn before and its file
/// changed, the old capture is still drawn.
///
/// Sent once for each entity until loading succeeds or fails with another error, independent of the number of attempts.
/// Bevy also logs the error of every attempt.
///
/// Of a capture in chunk files also sent, once for each entity, if the most important Gaussians of its time may never
/// be there: they do not fit the budget, or cannot be loaded. Loading goes on, and the state of the entity stays.
///
/// # Examples
///
/// ```
/// use bevy::prelude::*;
/// use bevy_gs4d::prelude::*;
///
/// fn report(mut failures: MessageReader<CaptureFailed>) {
///     for CaptureFailed { entity, error } in failures.read() {
///         warn!("{entity}: {error}");
///     }
/// }
/// # bevy::ecs::system::assert_is_system(report);
/// ```
#[derive(Message, EntityEvent, Debug, Clone, PartialEq)]
pub struct CaptureFailed {
    /// The entity with the capture.
    pub entity: Entity,
    /// The reason. Its text names the file, the fault and, if there is one, the remedy.
    pub error: CaptureFailure,
}

/// Sends the messages about loading.
#[derive(SystemParam)]
pub(crate) struct Announcer<'w, 's> {
    commands: Commands<'w, 's>,
    ready: MessageWriter<'w, CaptureReady>,
    failed: MessageWriter<'w, CaptureFailed>,
}

impl Announcer<'_, '_> {
    pub(crate) fn ready(&mut self, entity: Entity, capture: AssetId<GaussianCapture>) {
        send(&mut self.commands, &mut self.ready, CaptureReady { entity, capture });
    }

    pub(crate) fn failed(&mut self, entity: Entity, error: CaptureFailure) {
        send(&mut self.commands, &mut self.failed, CaptureFailed { entity, error });
    }
}

/// Writes a message and triggers the same event.
pub(crate) fn send<'t, E>(commands: &mut Commands, writer: &mut MessageWriter<E>, event: E)
where
    E: Message + EntityEvent<Trigger<'t>: Default> + Clone,
{
    writer.write(event.clone());
    commands.trigger(event);
}
