//! The repeat modes: the behavior at the end of the played range.
//!
//! In: a mode. Out: [`Repeat`], and the properties of its modes that the arithmetic of playback uses.

use bevy::reflect::Reflect;
use bevy::reflect::std_traits::ReflectDefault;

/// The behavior when the range has been played to its end.
///
/// Default: [`Loop`](Self::Loop).
///
/// # Examples
///
/// ```
/// use bevy_gs4d::playback::Repeat;
/// use bevy_gs4d::prelude::*;
///
/// /// Returns the time one second after 1.5 s in a capture of 2 s.
/// fn time_after(repeat: Repeat) -> f32 {
///     let mut playback = Playback { time: 1.5, repeat, ..Playback::default() };
///     playback.advance(1.0, 2.0);
///     playback.time
/// }
///
/// assert_eq!(time_after(Repeat::Once), 2.0, "stopped at the end");
/// assert_eq!(time_after(Repeat::Loop), 0.5, "started over");
/// assert_eq!(time_after(Repeat::PingPong), 1.5, "reversed at the end");
/// ```
#[derive(Reflect, Debug, Default, Clone, Copy, PartialEq, Eq, Hash)]
#[reflect(Default, Debug, Clone, PartialEq)]
#[type_path = "bevy_gs4d::playback"]
#[non_exhaustive]
pub enum Repeat {
    /// Stops at the last moment of the range; played backwards, at the first.
    Once,
    /// Starts over. The end of the range is the same moment as its start.
    #[default]
    Loop,
    /// Reverses at each end of the range.
    PingPong,
}

impl Repeat {
    /// Returns whether playing stops at the end of the range.
    pub(super) fn stops(self) -> bool {
        match self {
            Self::Once => true,
            Self::Loop | Self::PingPong => false,
        }
    }

    /// Returns whether the end of the range is the same moment as its start.
    pub(super) fn wraps(self) -> bool {
        match self {
            Self::Loop => true,
            Self::Once | Self::PingPong => false,
        }
    }

    /// Returns whether every second pass runs in the opposite direction.
    pub(super) fn turns_round(self) -> bool {
        match self {
            Self::PingPong => true,
            Self::Once | Self::Loop => false,
        }
    }
}
