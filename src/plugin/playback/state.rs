//! The state of a playback from frame to frame.
//!
//! In: the result of a step of [`advance`](super::advance). Out: a [`PlaybackState`], for the next step.

use super::span::Span;
use bevy::asset::UntypedAssetId;
use bevy::ecs::component::Component;
use bevy::ecs::entity::Entity;

/// The state of a [`Playback`](super::Playback) after the last step. Default: before the first step.
#[derive(Component, Debug, Default, Clone)]
pub(crate) struct PlaybackState {
    /// The played capture or timeline; `None` before the first step.
    pub(super) asset: Option<UntypedAssetId>,
    /// The reached phase, without the rounding of [`Playback::time`](super::Playback::time).
    pub(super) phase: f64,
    /// The range to which `phase` belongs; `None` before the first step.
    pub(super) span: Option<Span>,
    /// `time`, `returning` and `playing` of the playback after the last step: other values have been set by the game.
    pub(super) time: f32,
    pub(super) returning: bool,
    pub(super) playing: bool,
    /// Whether no time has been played since the last jump: the target of the jump has not been passed yet.
    pub(super) fresh: bool,
    /// Whether a follower has reached its end.
    pub(super) over: bool,
    /// The last step along a shared clock.
    pub(super) follow: Option<Follow>,
    /// Number of jumps, for followers: seeks, and wraps of a loop.
    pub(super) jumps: u32,
    /// The entity that cannot be followed and for which a warning has been logged.
    pub(super) warned_of: Option<Entity>,
}

/// A step along a shared clock. A change of `phase` alone is elapsed time, a change of another field is a jump.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Follow {
    pub(super) clock: Entity,
    pub(super) jumps: u32,
    pub(super) speed: f32,
    pub(super) offset: f32,
    pub(super) phase: f64,
}

impl PlaybackState {
    /// Returns the state before the first step, which is a jump for followers, of another asset on the same entity.
    pub(super) fn restarted(&self) -> Self {
        Self { jumps: self.jumps, warned_of: self.warned_of, ..Self::default() }
    }

    /// [Restarts](Self::restarted) if another asset than before is played. Does not change the time.
    pub(super) fn play_asset(&mut self, asset: UntypedAssetId) {
        if self.asset != Some(asset) {
            *self = Self { asset: Some(asset), ..self.restarted() };
        }
    }

    /// Returns the number of jumps so far: seeks, and wraps of a loop.
    pub(crate) fn jumps(&self) -> u32 {
        self.jumps
    }

    /// Returns whether no time has been played since the first step or the last seek.
    pub(super) fn is_unplayed(&self) -> bool {
        self.span.is_none() || self.fresh
    }

    /// Returns the time, in seconds since the capture's start, without the rounding of
    /// [`Playback::time`](super::Playback::time).
    pub(crate) fn seconds(&self) -> f64 {
        match self.span {
            // In an empty range any time can be sought.
            Some(span) if span.is_still() => self.time.into(),
            // Only a seek leads to the end of a loop: playback wraps there.
            Some(span) if self.is_at_end(&span) => span.end(),
            Some(span) => span.exact(self.phase),
            None => 0.0,
        }
    }

    /// Returns whether the time is at the end of a loop, from where playback continues at the start.
    pub(super) fn is_at_end_of_loop(&self) -> bool {
        self.span.is_some_and(|span| span.repeat().wraps() && self.is_at_end(&span))
    }

    fn is_at_end(&self, span: &Span) -> bool {
        self.time >= span.end() as f32
    }
}
