//! The messages about streaming.
//!
//! In: a change of whether the most important Gaussians of a time are there, or why they may never be. Out: each
//! message in two ways: as a message for a `MessageReader`, and as an event on that entity for observers.

use crate::plugin::asset::{CaptureFailed, CaptureFailure, send};
use bevy::ecs::entity::Entity;
use bevy::ecs::event::EntityEvent;
use bevy::ecs::message::{Message, MessageWriter};
use bevy::ecs::system::{Commands, SystemParam};

/// The most important Gaussians of an entity's time are not there: its capture is drawn as [`OnUnderrun`] says.
///
/// [`OnUnderrun`]: super::OnUnderrun
#[derive(Message, EntityEvent, Debug, Clone, PartialEq)]
pub struct CaptureBuffering {
    /// The entity with the capture.
    pub entity: Entity,
    /// Its time, seconds since the capture's start.
    pub seconds: f32,
}

/// The most important Gaussians of an entity's time are there again, or for its first picture.
#[derive(Message, EntityEvent, Debug, Clone, PartialEq)]
pub struct CaptureBuffered {
    /// The entity with the capture.
    pub entity: Entity,
    /// Its time, seconds since the capture's start.
    pub seconds: f32,
}

/// An entity's playback waits, since the most important Gaussians of its time are not there. Sent after
/// [`CaptureBuffering`], and not before the first picture.
#[derive(Message, EntityEvent, Debug, Clone, PartialEq)]
pub struct CaptureStalled {
    /// The entity with the capture.
    pub entity: Entity,
    /// The time at which it waits, seconds since the capture's start.
    pub seconds: f32,
}

/// Sends the messages about streaming.
#[derive(SystemParam)]
pub(super) struct Announcer<'w, 's> {
    commands: Commands<'w, 's>,
    buffering: MessageWriter<'w, CaptureBuffering>,
    buffered: MessageWriter<'w, CaptureBuffered>,
    stalled: MessageWriter<'w, CaptureStalled>,
    failed: MessageWriter<'w, CaptureFailed>,
}

impl Announcer<'_, '_> {
    pub(super) fn buffering(&mut self, entity: Entity, seconds: f32) {
        send(&mut self.commands, &mut self.buffering, CaptureBuffering { entity, seconds });
    }

    pub(super) fn buffered(&mut self, entity: Entity, seconds: f32) {
        send(&mut self.commands, &mut self.buffered, CaptureBuffered { entity, seconds });
    }

    pub(super) fn stalled(&mut self, entity: Entity, seconds: f32) {
        send(&mut self.commands, &mut self.stalled, CaptureStalled { entity, seconds });
    }

    pub(super) fn failed(&mut self, entity: Entity, error: CaptureFailure) {
        send(&mut self.commands, &mut self.failed, CaptureFailed { entity, error });
    }
}
