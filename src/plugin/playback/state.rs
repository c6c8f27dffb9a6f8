//! The state of a playback from frame to frame.
//!
//! In: what [`advance`](super::advance) leaves after a step. Out: a [`PlaybackState`], which the next step continues.

use super::span::Span;
use bevy::asset::UntypedAssetId;
use bevy::ecs::component::Component;
use bevy::ecs::entity::Entity;

/// The state of a [`Playback`](super::Playback) after the last step. Default: before the first step.
#[derive(Component, Debug, Default, Clone)]
pub(super) struct PlaybackState {
    /// The capture or the timeline that is played; `None` before the first step.
    pub(super) asset: Option<UntypedAssetId>,
    /// How far it has played, without the rounding of [`Playback::time`](super::Playback::time).
    pub(super) phase: f64,
    /// The range that `phase` is measured in; `None` before the first step.
    pub(super) span: Option<Span>,
    /// `time`, `returning` and `playing` of the playback after the last step: if they differ now, the game has set
    /// them.
    pub(super) time: f32,
    pub(super) returning: bool,
    pub(super) playing: bool,
    /// Whether nothing has been played since the last jump: the moment jumped to has not been passed yet.
    pub(super) fresh: bool,
    /// Whether a shared clock has carried it to its end.
    pub(super) over: bool,
    /// The last step along a shared clock.
    pub(super) follow: Option<Follow>,
    /// Number of its jumps, for those that follow it: seeks, and passes of a loop, which end where they do not begin.
    pub(super) jumps: u32,
    /// The entity that it should follow and cannot, of which the log has been told.
    pub(super) warned_of: Option<Entity>,
}

/// A step along a shared clock. While everything but `phase` stays the same, time passes; otherwise it jumps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Follow {
    pub(super) clock: Entity,
    pub(super) jumps: u32,
    pub(super) speed: f32,
    pub(super) offset: f32,
    pub(super) phase: f64,
}

impl PlaybackState {
    /// Returns the state before the first step of something else on the same entity. Those that follow it see a jump.
    pub(super) fn anew(&self) -> Self {
        Self { jumps: self.jumps, warned_of: self.warned_of, ..Self::default() }
    }

    /// Begins [`anew`](Self::anew) if another asset than before is played. The time is the game's to set.
    pub(super) fn play_asset(&mut self, asset: UntypedAssetId) {
        if self.asset != Some(asset) {
            *self = Self { asset: Some(asset), ..self.anew() };
        }
    }

    /// Returns whether no time has passed yet since its first moment, or the one that was last sought.
    pub(super) fn is_unplayed(&self) -> bool {
        self.span.is_none() || self.fresh
    }

    /// Returns the time, in seconds since the capture's start, without the rounding of
    /// [`Playback::time`](super::Playback::time).
    pub(super) fn seconds(&self) -> f64 {
        match self.span {
            // Reached by a seek: playing never stops at the end of a loop.
            Some(span) if self.is_at_end(&span) => span.end(),
            Some(span) => span.exact(self.phase),
            None => 0.0,
        }
    }

    /// Returns whether it is at the end of a loop, from where playing continues at the start.
    pub(super) fn is_at_end_of_loop(&self) -> bool {
        self.span.is_some_and(|span| span.repeat().wraps() && self.is_at_end(&span))
    }

    fn is_at_end(&self, span: &Span) -> bool {
        self.time >= span.end() as f32
    }
}
