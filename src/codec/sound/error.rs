//! Why a sound cannot be used.
//!
//! In: the checks of a sound and of the decoder. Out: [`SoundError`], whose text names the remedy.

/// Why a sound cannot be used.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SoundError {
    /// The bytes are not a sound file that is read.
    #[error("is not a sound in Ogg Vorbis or WAV ({0}); convert it, as by: ffmpeg -i SOUND -ac 2 sound.ogg")]
    Unknown(String),
    /// The file is damaged.
    #[error("is damaged: {0}")]
    Damaged(String),
    /// A number of channels that is not played.
    #[error("has {0} channels, but one or two are played; mix them, as by: ffmpeg -i SOUND -ac 2 sound.ogg")]
    Channels(usize),
    /// A number of frames a second that is not played.
    #[error("has {0} frames a second, but must have 1000 to 384000")]
    Rate(u32),
    /// There are no frames, or the last one is not complete.
    #[error("has no frames, or not all channels of its last one")]
    Empty,
    /// It takes too much memory.
    #[error(
        "is longer than 23 minutes at 48 kHz with two channels; cut it, or use one channel or fewer frames a second"
    )]
    TooLong,
    /// The program cannot decode sounds.
    #[error("cannot be decoded: bevy_gs4d is built without its feature `sound`")]
    NotBuilt,
}
