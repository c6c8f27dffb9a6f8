//! Playheads: where the players of a capture are, and where they go.
//!
//! In: the state of a player. Out: [`Playhead`], plain numbers of any value: those that make no sense are clamped where
//! they are used.

/// Where a player is in a capture, and where it goes.
///
/// A time that is NaN counts as 0, and a time outside of the capture as its nearest end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Playhead {
    /// The time, seconds since the capture's start.
    pub seconds: f64,
    /// Seconds of the capture per second: negative if it is played backwards, also in the returning pass of
    /// [`Turn::Return`]; 0 if the player is paused. A paused player counts as one that plays forwards at speed 1, since
    /// it may be started at any time.
    pub velocity: f64,
    /// The first and the last time that are played, seconds since the capture's start. If the range is empty, only the
    /// player's time is needed, and nothing ahead of it.
    pub range: [f64; 2],
    /// What the player does at the end of the range.
    pub turn: Turn,
    /// Seconds that all it needs may come later; NaN and negative numbers count as 0. A picture that stays, or a time
    /// to which a player may jump, has a small delay: in scarce memory it makes room for what is played.
    pub delay: f64,
}

/// Seconds by which what is played now comes before times at which nothing plays.
const STILL_DELAY: f64 = 1e-3;

impl Playhead {
    /// Returns a time at which nothing plays, in seconds since the capture's start: that of a picture that stays, or one to
    /// which a player may jump.
    pub fn still(seconds: f64) -> Self {
        Self { seconds, velocity: 0.0, range: [seconds; 2], turn: Turn::Stop, delay: STILL_DELAY }
    }
}

/// What a player does at the end of its range.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Turn {
    /// It stops: what is behind it is not needed.
    Stop,
    /// It starts over. The end of the range is the same moment as its start.
    #[default]
    Loop,
    /// It plays back to the other end.
    Return,
}
