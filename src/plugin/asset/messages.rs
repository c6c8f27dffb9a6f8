//! What loading tells the game.
//!
//! In: what became of an entity's capture. Out: each of these both as a message, to be read by a system with a `MessageReader`, and as
//! an event on that entity, to be observed: `commands.entity(capture).observe(|failed: On<CaptureFailed>| ..)`.
//!
//! They are sent in `PreUpdate`, in [`CaptureAssetSystems`](super::CaptureAssetSystems) and, for what the GPU refuses, after it: whatever
//! runs in `Update` reads them in the same frame.

use super::GaussianCapture;
use bevy::asset::AssetId;
use bevy::ecs::entity::Entity;
use bevy::ecs::event::EntityEvent;
use bevy::ecs::message::{Message, MessageWriter};
use bevy::ecs::system::{Commands, SystemParam};

/// Its capture is there and drawn: it has been loaded, loaded again after its file changed (or changed in memory), or the entity was
/// given another one that is there already. Said at the latest one frame after the capture first shows.
#[derive(Message, EntityEvent, Debug, Clone, PartialEq)]
pub struct CaptureReady {
    /// The entity with the capture.
    pub entity: Entity,
    /// The capture.
    pub capture: AssetId<GaussianCapture>,
}

/// Its capture could not be loaded, or this GPU cannot draw it. If it had been loaded before and its file changed, what was there is still drawn.
///
/// Bevy logs the same error, whether this is read or not.
#[derive(Message, EntityEvent, Debug, Clone, PartialEq)]
pub struct CaptureFailed {
    /// The entity with the capture.
    pub entity: Entity,
    /// The file, what is wrong with it and, where there is one, the remedy.
    pub error: String,
}

/// Tells the game.
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

    pub(crate) fn failed(&mut self, entity: Entity, error: String) {
        send(&mut self.commands, &mut self.failed, CaptureFailed { entity, error });
    }
}

/// Says something both ways.
pub(crate) fn send<'t, E>(commands: &mut Commands, writer: &mut MessageWriter<E>, event: E)
where
    E: Message + EntityEvent<Trigger<'t>: Default> + Clone,
{
    writer.write(event.clone());
    commands.trigger(event);
}
