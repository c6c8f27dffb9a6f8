//! Sounds: what is heard beside a capture.
//!
//! In: a sound file, Ogg Vorbis or WAV, by [`decode`] (feature `sound`), or samples made in code. Out: a [`Sound`],
//! whose samples can be read at any position, forward and backward.

#[cfg(feature = "sound")]
mod codebooks;
#[cfg(feature = "sound")]
mod decode;
mod error;

#[cfg(feature = "sound")]
pub use decode::{decode, read_sound};
pub use error::SoundError;

use std::fmt::{self, Debug, Formatter};
use std::sync::Arc;

/// A decoded sound. Clones share the samples.
#[derive(Clone, PartialEq)]
pub struct Sound {
    /// Frames a second.
    rate: u32,
    /// One or two samples for each frame.
    channels: usize,
    /// Interleaved.
    samples: Arc<[i16]>,
}

impl Sound {
    /// Most samples of a sound: 256 MiB, which are 23 minutes of two channels at 48 kHz.
    pub const MOST_SAMPLES: usize = 128 << 20;
    /// Frames a second that a sound may have.
    pub const RATES: [u32; 2] = [1000, 384_000];

    /// Creates a sound of interleaved samples of one or two channels, with `rate` frames a second.
    ///
    /// # Errors
    /// Another number of channels, a rate outside of [`RATES`](Self::RATES), no frames, too many of them, or a last
    /// frame that is not complete.
    pub fn new(rate: u32, channels: usize, samples: impl Into<Arc<[i16]>>) -> Result<Self, SoundError> {
        let samples: Arc<[i16]> = samples.into();
        Self::check(rate, channels)?;
        if samples.is_empty() || !samples.len().is_multiple_of(channels) {
            return Err(SoundError::Empty);
        }
        match samples.len() {
            0..=Self::MOST_SAMPLES => Ok(Self { rate, channels, samples }),
            _ => Err(SoundError::TooLong),
        }
    }

    /// Checks the kind of samples.
    fn check(rate: u32, channels: usize) -> Result<(), SoundError> {
        let [lowest, highest] = Self::RATES;
        if !(1..=2).contains(&channels) {
            return Err(SoundError::Channels(channels));
        }
        if (lowest..=highest).contains(&rate) { Ok(()) } else { Err(SoundError::Rate(rate)) }
    }

    /// Returns the frames a second.
    pub fn rate(&self) -> u32 {
        self.rate
    }

    /// Returns the number of channels, 1 or 2.
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// Returns the number of frames.
    pub fn frames(&self) -> usize {
        self.samples.len() / self.channels
    }

    /// Returns the duration in seconds.
    pub fn seconds(&self) -> f64 {
        self.frames() as f64 / f64::from(self.rate)
    }

    /// Returns whether both are clones of one sound.
    #[cfg_attr(not(feature = "bevy"), expect(dead_code, reason = "only the plugin plays sounds"))]
    pub(crate) fn is_clone_of(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.samples, &other.samples)
    }

    /// Returns the left and the right sample, -1 to 1, at a position in seconds: on the line between the frames around
    /// it. Outside of the sound, and at NaN, both are 0.
    pub fn at(&self, seconds: f64) -> [f32; 2] {
        let position = seconds * f64::from(self.rate);
        if !(position > -1.0 && position < self.frames() as f64) {
            return [0.0; 2];
        }
        let (first, between) = (position.floor(), (position - position.floor()) as f32);
        let [before, after] = [first as i64, first as i64 + 1].map(|frame| self.frame(frame));
        [0, 1].map(|side| before[side] + (after[side] - before[side]) * between)
    }

    /// Returns the samples of a frame; 0 outside of the sound.
    fn frame(&self, index: i64) -> [f32; 2] {
        let first = usize::try_from(index).ok().and_then(|index| index.checked_mul(self.channels));
        let Some(frame) = first.and_then(|first| self.samples.get(first..first + self.channels)) else {
            return [0.0; 2];
        };
        let side = |side: usize| f32::from(frame[side.min(self.channels - 1)]) / 32768.0;
        [side(0), side(1)]
    }
}

impl Debug for Sound {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "Sound({} Hz, {} channels, {} frames)", self.rate, self.channels, self.frames())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_are_read_between_frames_and_are_silent_outside() {
        let sound = Sound::new(1000, 2, vec![16384, -16384, 8192, 0]).expect("two frames");
        assert_eq!((sound.frames(), sound.seconds()), (2, 0.002), "two frames at 1 kHz");
        assert_eq!(sound.at(0.0), [0.5, -0.5], "the first frame");
        assert_eq!(sound.at(0.0005), [0.375, -0.25], "half way to the second");
        assert_eq!(sound.at(0.0015), [0.125, 0.0], "half way to the silence behind it");
        assert_eq!(sound.at(-0.0005), [0.25, -0.25], "half way from the silence before it");
        for outside in [-1.0, 0.002, 9.0, f64::NAN, f64::INFINITY, f64::MIN, f64::MAX] {
            assert_eq!(sound.at(outside), [0.0; 2], "silence at {outside} s");
        }
        assert_eq!(Sound::MOST_SAMPLES / 2 / 48_000 / 60, 23, "the minutes that the error of longer sounds names");
        let mono = Sound::new(8000, 1, vec![-32768]).expect("one frame");
        assert_eq!(mono.at(0.0), [-1.0; 2], "one channel is heard on both sides");
    }

    #[test]
    fn sounds_that_cannot_be_played_are_refused() {
        let message = |rate, channels, samples: &[i16]| {
            Sound::new(rate, channels, samples).expect_err("the sound is invalid").to_string()
        };
        assert!(message(48_000, 6, &[0; 6]).contains("6 channels"), "the number of channels is named");
        assert!(message(10, 1, &[0]).contains("10 frames a second"), "the rate is named");
        assert!(message(48_000, 2, &[]).contains("no frames"), "an empty sound is refused");
        assert!(message(48_000, 2, &[0; 3]).contains("no frames"), "half a frame is refused");
    }
}
