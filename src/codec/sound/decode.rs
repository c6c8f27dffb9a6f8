//! Decoding of sound files.
//!
//! In: the bytes of a file in Ogg Vorbis or WAV. Out: a [`Sound`] of all its frames, or a [`SoundError`]; memory grows
//! with what has been decoded, up to a few times [`Sound::MOST_SAMPLES`]; the decoder's own is checked before.

use super::codebooks::check_codebooks;
use super::{Sound, SoundError};
use crate::codec::CodecError;
use crate::codec::input::read_at_most;
use crate::scene::SoundFile;
use std::io::{Cursor, ErrorKind};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::Arc;
use symphonia::core::codecs::audio::{AudioDecoder, AudioDecoderOptions};
use symphonia::core::errors::Error;
use symphonia::core::formats::probe::Hint;
use symphonia::core::formats::{FormatOptions, FormatReader, TrackType};
use symphonia::core::io::{MediaSourceStream, MediaSourceStreamOptions};
use symphonia::core::meta::MetadataOptions;
use symphonia::default::{get_codecs, get_probe};

/// Decodes a sound file.
///
/// # Errors
/// Another format, a damaged file, a sound that cannot be [played](Sound::new).
pub fn decode(bytes: impl Into<Arc<[u8]>>) -> Result<Sound, SoundError> {
    let bytes = bytes.into();
    // The decoder asserts what a damaged setup of Vorbis does not fulfil (symphonia 0.6.1, `lookup1_values`).
    let decoded = catch_unwind(AssertUnwindSafe(|| decode_unchecked(bytes)));
    decoded.unwrap_or_else(|_| Err(SoundError::Damaged("its decoder cannot go on".to_owned())))
}

/// As [`decode`], but may panic on a damaged file.
fn decode_unchecked(bytes: Arc<[u8]>) -> Result<Sound, SoundError> {
    let stream = MediaSourceStream::new(Box::new(Cursor::new(bytes)), MediaSourceStreamOptions::default());
    let (format_options, meta_options) = (FormatOptions::default(), MetadataOptions::default());
    let format = get_probe().probe(&Hint::new(), stream, format_options, meta_options).map_err(unknown)?;
    let track = format.default_track(TrackType::Audio).ok_or_else(|| SoundError::Unknown("no audio track".into()))?;
    let parameters = track.codec_params.as_ref().and_then(|parameters| parameters.audio());
    let parameters = parameters.ok_or_else(|| SoundError::Unknown("no parameters of an audio track".into()))?;
    check_codebooks(parameters.extra_data.as_deref().unwrap_or_default())?;
    let decoder = get_codecs().make_audio_decoder(parameters, &AudioDecoderOptions::default()).map_err(unknown)?;
    let track = track.id;
    frames(format, decoder, track)
}

/// Reads a sound file whole, after a check that it can be decoded.
///
/// # Errors
/// A file that cannot be read; as [`decode`]. Both with the path.
pub fn read_sound(path: &Path) -> Result<(SoundFile, Sound), CodecError> {
    let bytes = read_at_most(path, SoundFile::MOST_BYTES as u64).map_err(|error| CodecError::at(path, error))?;
    let sound = decode(bytes.as_slice()).map_err(|error| CodecError::at(path, error))?;
    let file = SoundFile::new(&bytes).map_err(|_| CodecError::at(path, SoundError::Empty))?;
    Ok((file, sound))
}

/// Decodes all frames of a track.
fn frames(
    mut format: Box<dyn FormatReader + '_>,
    mut decoder: Box<dyn AudioDecoder>,
    track: u32,
) -> Result<Sound, SoundError> {
    let (mut samples, mut kind, mut packet_samples) = (Vec::new(), None, Vec::new());
    loop {
        let packet = match format.next_packet() {
            Ok(Some(packet)) if packet.track_id == track => packet,
            Ok(Some(_)) => continue,
            Ok(None) => break,
            // A recording that has been cut off: what is there is played.
            Err(Error::IoError(error)) if error.kind() == ErrorKind::UnexpectedEof => break,
            Err(error) => return Err(SoundError::Damaged(error.to_string())),
        };
        let buffer = decoder.decode(&packet).map_err(|error| SoundError::Damaged(error.to_string()))?;
        let own = (buffer.spec().rate(), buffer.spec().channels().count());
        if *kind.get_or_insert(own) != own {
            return Err(SoundError::Damaged("the rate or the channels change within it".to_owned()));
        }
        Sound::check(own.0, own.1)?;
        packet_samples.clear();
        packet_samples.resize(buffer.samples_interleaved(), 0i16);
        buffer.copy_to_slice_interleaved(&mut packet_samples);
        if samples.len() + packet_samples.len() > Sound::MOST_SAMPLES {
            return Err(SoundError::TooLong);
        }
        samples.extend_from_slice(&packet_samples);
    }
    let (rate, channels) = kind.ok_or(SoundError::Empty)?;
    Sound::new(rate, channels, samples)
}

/// Returns the error of a file whose beginning is that of no sound file.
fn unknown(error: Error) -> SoundError {
    SoundError::Unknown(error.to_string())
}
