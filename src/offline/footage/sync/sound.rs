//! The sound of a video, by the program `ffmpeg`, which the crate `ffmpeg-sidecar` starts.
//!
//! In: a video. Out: its sound, or `None` if it has no track of sound. Time 0 is that of frame 0 as frames of videos
//! are decoded: at a constant rate from the start of the file, the first picture repeated until its time. Sound that
//! starts later is preceded by silence; a first picture between two frames is moved to the nearer, and the sound with
//! it.

use super::correlation::RATE;
use crate::offline::dataset::DatasetError;
use crate::offline::dataset::formats::video::{PROGRAM, last_lines};
use ffmpeg_sidecar::command::FfmpegCommand;
use std::ffi::OsStr;
use std::io::{self, ErrorKind, Read};
use std::path::Path;
use std::process::{ChildStderr, ExitStatus};

/// Longest sound, seconds. Clocks of cameras drift apart by 10 to 40 ms in 1,000 s, which more sound would show as a
/// wider peak.
const LONGEST: u32 = 120;
/// Most bytes that are read of the description of a video.
const MOST_DESCRIBED: u64 = 1 << 20;

/// Returns the sound of a video, [`RATE`] samples a second, at most two minutes: one channel, -1 to 1.
///
/// # Errors
/// No program; a video that it cannot read.
pub(crate) fn sound(video: &Path) -> Result<Option<Vec<f32>>, DatasetError> {
    let picture = run(video, &["-v", "info", "-nostats"], &FIRST_PICTURE, described)?;
    let description = Description::of(&picture.messages);
    if !description.has_streams {
        let reason = last_lines(&*picture.messages);
        return Err(unusable(video, format!("ffmpeg cannot read it ({reason}): copy it again")));
    }
    if !description.has_sound {
        return Ok(None);
    }
    let (rate, longest) = (RATE.to_string(), LONGEST.to_string());
    let track = ["-map", "0:a:0", "-t", &longest, "-ac", "1", "-ar", &rate];
    // Silence takes the place of what is missing before the sound and inside.
    let form = ["-af", "aresample=async=1:first_pts=0", "-f", "s16le", "pipe:1"];
    let last = |messages: ChildStderr| last_lines(messages).into_bytes();
    let played = run(video, &["-v", "error"], &[&track[..], &form].concat(), last)?;
    if played.samples.is_empty() && !played.status.success() {
        let reason = String::from_utf8_lossy(&played.messages);
        let remedy = "copy it again, or remove the sound";
        return Err(unusable(video, format!("ffmpeg cannot read its sound ({reason}): {remedy}")));
    }
    let samples = played.samples.as_chunks::<2>().0.iter();
    let samples = samples.map(|bytes| f32::from(i16::from_le_bytes(*bytes)) / 32_768.0).collect();
    Ok(Some(earlier(samples, description.excess())))
}

/// Arguments with which the program describes the first picture.
const FIRST_PICTURE: [&str; 9] = ["-map", "0:V:0", "-frames:v", "1", "-vf", "showinfo", "-f", "null", "-"];

/// What the program has written.
struct Output {
    status: ExitStatus,
    samples: Vec<u8>,
    messages: Vec<u8>,
}

/// Runs the program on a video. `reader` reads all messages, beside the output.
fn run(
    video: &Path,
    before: &[&str],
    after: &[&str],
    reader: impl FnOnce(ChildStderr) -> Vec<u8> + Send,
) -> Result<Output, DatasetError> {
    let failed = |reason| DatasetError::Read { path: video.to_owned(), reason };
    // The protocol is named, since a path may contain a colon.
    let mut input = OsStr::new("file:").to_owned();
    input.push(std::path::absolute(video).map_err(failed)?);
    let mut command = FfmpegCommand::new_with_path(PROGRAM);
    command.args(["-hide_banner", "-nostdin"]).args(before).input(input).args(after);
    let mut child = command.spawn().map_err(|error| match error.kind() {
        ErrorKind::NotFound => unusable(
            video,
            "its sound is read by ffmpeg, which is not installed: apt install ffmpeg (Linux), brew install ffmpeg \
             (macOS) or winget install ffmpeg (Windows)"
                .to_owned(),
        ),
        _ => unusable(video, format!("ffmpeg cannot be started: {error}; install it again")),
    })?;
    drop(child.take_stdin());
    let (output, errors) = (child.take_stdout(), child.take_stderr());
    let mut samples = Vec::new();
    let messages = std::thread::scope(|scope| {
        let messages = scope.spawn(|| errors.map_or(Vec::new(), reader));
        let most = u64::from(2 * RATE * (LONGEST + 1));
        let read = output.map_or(Ok(0), |output| output.take(most).read_to_end(&mut samples));
        read.map(|_| messages.join().unwrap_or_default())
    });
    let messages = messages.map_err(failed)?;
    let status = child.wait().map_err(failed)?;
    Ok(Output { status, samples, messages })
}

/// Reads all messages. Returns the first of them.
fn described(mut messages: impl Read) -> Vec<u8> {
    let mut first = Vec::new();
    let read = messages.by_ref().take(MOST_DESCRIBED).read_to_end(&mut first);
    let rest = io::copy(&mut messages, &mut io::sink());
    if read.and(rest.map(|_| 0)).is_err() { Vec::new() } else { first }
}

/// What the program says of a video.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Description {
    has_streams: bool,
    has_sound: bool,
    /// Time of the first picture, seconds from the start of the file.
    first: Option<f64>,
    /// Frames a second.
    rate: Option<f64>,
}

impl Description {
    fn of(messages: &[u8]) -> Self {
        let messages = String::from_utf8_lossy(messages);
        let mut streams = messages.lines().filter(|line| line.contains("Stream #0:"));
        let first = after(&messages, "pts_time:").and_then(|first| first.parse::<f64>().ok());
        let rate = after(&messages, "frame_rate:").and_then(|rate| {
            let (frames, seconds) = rate.split_once('/')?;
            Some(frames.parse::<f64>().ok()? / seconds.parse::<f64>().ok()?)
        });
        Self {
            has_streams: streams.clone().next().is_some(),
            has_sound: streams.any(|line| line.contains(": Audio: ")),
            first: first.filter(|first| first.is_finite()),
            rate: rate.filter(|rate| (0.1..10_000.0).contains(rate)),
        }
    }

    /// Returns how much later the first picture is than the frame that it becomes, seconds.
    fn excess(&self) -> f64 {
        self.first.zip(self.rate).map_or(0.0, |(first, rate)| first - (first * rate).round() / rate)
    }
}

/// Returns the word after the first of these marks.
fn after<'a>(messages: &'a str, mark: &str) -> Option<&'a str> {
    messages.split_once(mark)?.1.split_whitespace().next()
}

/// Returns sound that is some seconds earlier, or later if they are negative.
fn earlier(mut samples: Vec<f32>, seconds: f64) -> Vec<f32> {
    let count = (seconds.abs() * f64::from(RATE)).round() as usize;
    if seconds > 0.0 {
        samples.split_off(count.min(samples.len()))
    } else {
        let mut padded = vec![0.0; count];
        padded.append(&mut samples);
        padded
    }
}

fn unusable(video: &Path, reason: String) -> DatasetError {
    DatasetError::Unusable { path: video.to_owned(), reason }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What version 5.1 says.
    const SAID: &str = "Input #0, matroska,webm, from 'file:/a.mkv':\n  Stream #0:0: Video: h264 (High), 30 fps\n\
        \x20 Stream #0:1: Audio: aac (LC), 44100 Hz\n[Parsed_showinfo_0 @ 0x1] config in time_base: 1/1000, \
        frame_rate: 30/1\n[Parsed_showinfo_0 @ 0x1] n:   0 pts:     23 pts_time:0.023   duration: 33\n";

    #[test]
    fn a_picture_between_two_frames_moves_the_sound() {
        let description = Description::of(SAID.as_bytes());
        assert!(description.has_streams && description.has_sound, "{description:?}");
        // The picture at 0.023 s becomes frame 1, at 0.0333 s.
        let excess = description.excess();
        assert!((excess - (0.023 - 1.0 / 30.0)).abs() < 1e-9, "{excess}");
        assert_eq!(earlier(vec![1.0, 2.0], -2.0 / f64::from(RATE)), [0.0, 0.0, 1.0, 2.0], "later");
        assert_eq!(earlier(vec![1.0, 2.0], 1.0 / f64::from(RATE)), [2.0], "earlier");
    }

    #[test]
    fn a_video_without_sound_is_told_from_no_video() {
        let silent = Description::of(SAID.replace("Audio", "Subtitle").as_bytes());
        assert!(silent.has_streams && !silent.has_sound, "{silent:?}");
        let broken = Description::of(b"file:/a.mkv: Invalid data found when processing input\n");
        assert!(!broken.has_streams, "{broken:?}");
        assert_eq!(broken.excess(), 0.0, "nothing is known");
    }
}
