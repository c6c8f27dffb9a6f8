//! Sound files.
//!
//! In: a tone as Ogg Vorbis, made by ffmpeg; WAV files made here; files that are damaged or of other kinds. Out: proof
//! that the samples are those of the tone, and that every other file is refused by one sentence.

use crate::support::ogg::set_checksums;
use crate::support::random::Random;
use crate::support::wave::wave;
use bevy_gs4d::codec::sound::{SoundError, decode, read_sound};
use std::f64::consts::TAU;
use std::fs;
use std::path::Path;

/// Half a second of 440 Hz at 0.5 on the left and of 660 Hz at 0.25 on the right, 22,050 frames a second:
/// `ffmpeg -f lavfi -i "aevalsrc=0.5*sin(2*PI*440*t)|0.25*sin(2*PI*660*t):s=22050:d=0.5" -c:a libvorbis -q:a 2 tone.ogg`
const TONE: &[u8] = include_bytes!("sounds/tone.ogg");

#[test]
fn ogg_vorbis_is_decoded_at_its_times() {
    let sound = decode(TONE).expect("a good file");
    assert_eq!((sound.rate(), sound.channels()), (22_050, 2), "the kind of the samples");
    assert!((sound.seconds() - 0.5).abs() < 0.001, "half a second, not {} s", sound.seconds());
    // The error and the power of the samples at times between frames, away from the ends.
    let mut sums = [[0.0; 2]; 2];
    for step in 0..1000 {
        let seconds = 0.02 + 0.46 * f64::from(step) / 1000.0;
        let tone = [(440.0, 0.5), (660.0, 0.25)].map(|(hertz, level)| level * (TAU * hertz * seconds).sin());
        for (side, (found, expected)) in sound.at(seconds).into_iter().zip(tone).enumerate() {
            sums[side][0] += (f64::from(found) - expected).powi(2);
            sums[side][1] += expected.powi(2);
        }
    }
    for [error, power] in sums {
        let decibels = 10.0 * (power / error).log10();
        assert!(decibels > 30.0, "the tone is {decibels:.1} dB above its error");
    }
}

#[test]
fn wav_is_decoded_sample_by_sample() {
    let samples: Vec<i16> = (0..2000).map(|index| (index * 31 % 2000 - 1000) as i16).collect();
    for (channels, rate) in [(1u16, 8000), (2, 48_000)] {
        let sound = decode(wave(channels, rate, &samples)).expect("a good file");
        assert_eq!((sound.rate(), sound.channels()), (rate, channels.into()), "the kind of the samples");
        assert_eq!(sound.frames(), 2000 / usize::from(channels), "the number of frames");
        for frame in [0, 1, 500, 999] {
            let left = f32::from(samples[frame * usize::from(channels)]) / 32768.0;
            assert_eq!(sound.at(frame as f64 / f64::from(rate))[0], left, "frame {frame} of {channels} channels");
        }
    }
}

#[test]
fn other_files_are_refused_with_the_remedy() {
    let six = wave(6, 48_000, &[0; 600]);
    assert_eq!(decode(six).expect_err("six channels"), SoundError::Channels(6), "more channels than are played");
    assert_eq!(decode(wave(1, 48_000, &[])).expect_err("no frames"), SoundError::Empty, "a file without frames");
    for (bytes, what) in [(&b""[..], "no bytes"), (b"ID3\x04 a song in another format", "another format")] {
        let message = decode(bytes).expect_err(what).to_string();
        assert!(message.contains("ffmpeg -i SOUND"), "{what}: the remedy is in the message: {message}");
    }
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("song.ogg");
    let message = |path: &Path| read_sound(path).expect_err("the file is invalid").to_string();
    assert!(message(&path).contains("song.ogg"), "a file that does not exist is named");
    fs::write(&path, b"no sound").expect("the folder can be written to");
    assert!(message(&path).contains("song.ogg: is not a sound"), "the file is named: {}", message(&path));
    fs::write(&path, TONE).expect("the folder can be written to");
    let (file, sound) = read_sound(&path).expect("a good file");
    assert_eq!((file.bytes(), sound), (TONE, decode(TONE).expect("a good file")), "the bytes, and what they are");
}

#[test]
fn damaged_files_never_panic() {
    let mut random = Random::new(7);
    let (mut refused, mut accepted) = (0, 0);
    for _ in 0..1500 {
        let mut bytes = TONE.to_vec();
        for _ in 0..1 + random.below(4) {
            let at = random.below(bytes.len());
            bytes[at] = random.bits() as u8;
        }
        if random.below(2) == 0 {
            bytes.truncate(random.below(bytes.len()));
        }
        set_checksums(&mut bytes);
        match decode(bytes) {
            Ok(_) => accepted += 1,
            Err(_) => refused += 1,
        }
    }
    assert!(refused > 10 && accepted > 10, "{refused} files are refused, {accepted} are played");
}
