//! The timeline as a file.
//!
//! In: the text of a `*.timeline.ron`, in the format that the [module](super) describes. Out: a [`Timeline`] whose
//! captures and sounds have begun to load, or a [`TimelineError`], to which Bevy adds the path.

use super::asset::{Timeline, Track};
use super::clip::Clip;
use super::error::InvalidTimeline;
use super::sound_clip::SoundClip;
use crate::plugin::component::{GaussianCapture, SoundTrack};
use crate::plugin::playback::markers::Marker;
use bevy::asset::io::Reader;
use bevy::asset::{AssetLoader, AssetPath, Handle, LoadContext, ParseAssetPathError};
use bevy::reflect::TypePath;
use ron::extensions::Extensions;
use serde::Deserialize;

/// Why a timeline could not be loaded.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TimelineError {
    /// The asset source could not deliver the bytes.
    #[error("the file could not be read: {0}")]
    Read(#[from] std::io::Error),
    /// The text is not a timeline. The message names the line and the column.
    #[error("not a timeline, at line and column {0}")]
    Syntax(#[from] ron::error::SpannedError),
    /// The path of a capture or of a sound cannot be parsed.
    #[error("file {path:?}: {reason}")]
    Path {
        /// The path, as written.
        path: String,
        /// The fault of the path.
        reason: ParseAssetPathError,
    },
    /// The path of a capture or of a sound is empty, absolute, or leads out of the asset folder.
    #[error("file {path:?} is not in the asset folder; write a path relative to that folder, such as \"toybox.gs4d\"")]
    Outside {
        /// The path, as written.
        path: String,
    },
    /// The timeline is invalid.
    #[error(transparent)]
    Invalid(#[from] InvalidTimeline),
}

/// Loads timelines, `.timeline.ron`. Errors: [`TimelineError`].
#[derive(Debug, Default, TypePath)]
#[type_path = "bevy_gs4d::playback"]
pub struct TimelineLoader;

impl AssetLoader for TimelineLoader {
    type Asset = Timeline;
    type Settings = ();
    type Error = TimelineError;

    async fn load(
        &self,
        reader: &mut dyn Reader,
        _settings: &(),
        context: &mut LoadContext<'_>,
    ) -> Result<Timeline, TimelineError> {
        let mut bytes = Vec::new();
        reader.read_to_end(&mut bytes).await?;
        let (timeline, sounds) = read(&bytes, |path| context.load(path))?;
        let sounds = sounds.into_iter().map(|SoundFile { file, start, volume }| {
            let sound: Handle<SoundTrack> = context.load(asset_path(&file)?);
            Ok::<_, TimelineError>(SoundClip { sound, start, volume })
        });
        let sounds = sounds.collect::<Result<_, _>>()?;
        Ok(timeline.with_sounds(sounds)?)
    }

    fn extensions(&self) -> &[&str] {
        &["timeline.ron"]
    }
}

#[derive(Deserialize)]
#[serde(rename = "Timeline", deny_unknown_fields)]
struct TimelineFile {
    #[serde(default)]
    tracks: Vec<TrackFile>,
    #[serde(default)]
    markers: Vec<MarkerFile>,
    #[serde(default)]
    sounds: Vec<SoundFile>,
    #[serde(default)]
    duration: Option<f32>,
}

#[derive(Deserialize)]
#[serde(rename = "Track", deny_unknown_fields)]
struct TrackFile {
    name: String,
    clips: Vec<ClipFile>,
}

#[derive(Deserialize)]
#[serde(rename = "Clip", deny_unknown_fields)]
struct ClipFile {
    capture: String,
    start: f32,
    #[serde(rename = "in", default)]
    first: f32,
    #[serde(rename = "out")]
    last: f32,
    #[serde(default = "normal_speed")]
    speed: f32,
    #[serde(default)]
    fade_in: f32,
    #[serde(default)]
    fade_out: f32,
}

#[derive(Deserialize)]
#[serde(rename = "Marker", deny_unknown_fields)]
struct MarkerFile {
    time: f32,
    name: String,
}

#[derive(Debug, Deserialize)]
#[serde(rename = "Sound", deny_unknown_fields)]
struct SoundFile {
    file: String,
    #[serde(default)]
    start: f32,
    #[serde(default = "full_volume")]
    volume: f32,
}

fn normal_speed() -> f32 {
    1.0
}

fn full_volume() -> f32 {
    1.0
}

/// Parses the text of a file. `load` returns the handle of a capture. Returns the timeline without its sounds, and
/// these.
fn read(
    bytes: &[u8],
    mut load: impl FnMut(AssetPath<'static>) -> Handle<GaussianCapture>,
) -> Result<(Timeline, Vec<SoundFile>), TimelineError> {
    let options = ron::Options::default().with_default_extension(Extensions::IMPLICIT_SOME);
    let file: TimelineFile = options.from_bytes(bytes)?;
    let mut tracks = Vec::new();
    for TrackFile { name, clips } in file.tracks {
        let mut track = Track { name, clips: Vec::new() };
        for clip in clips {
            track.clips.push(Clip {
                capture: load(asset_path(&clip.capture)?),
                start: clip.start,
                range: [clip.first, clip.last],
                speed: clip.speed,
                fade: [clip.fade_in, clip.fade_out],
            });
        }
        tracks.push(track);
    }
    let markers = file.markers.into_iter().map(|MarkerFile { time, name }| Marker { time, name }).collect();
    Ok((Timeline::new(tracks, markers, file.duration)?, file.sounds))
}

/// Parses the path of a capture or of a sound. Rejects paths that lead out of the asset folder, at which Bevy would
/// panic.
fn asset_path(path: &str) -> Result<AssetPath<'static>, TimelineError> {
    let parsed = AssetPath::try_parse(path).map_err(|reason| TimelineError::Path { path: path.to_owned(), reason })?;
    if parsed.path().as_os_str().is_empty() || parsed.is_unapproved() {
        return Err(TimelineError::Outside { path: path.to_owned() });
    }
    Ok(parsed.into_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read_text(text: &str) -> Result<Timeline, TimelineError> {
        read(text.as_bytes(), |_| Handle::default()).map(|(timeline, _)| timeline)
    }

    #[test]
    fn a_file_is_read_with_its_defaults() {
        let text = r#"(
            tracks: [
                (name: "left", clips: [
                    (capture: "toybox.gs4d", start: 0, in: 0.5, out: 2.5),
                    (capture: "more/toybox.gs4d", start: 2, out: 1, speed: -0.5, fade_in: 0.5, fade_out: 0.25),
                ]),
            ],
            markers: [(time: 2.0, name: "cut")],
            sounds: [(file: "song.ogg"), (file: "bang.wav", start: 2.5, volume: 0.25)],
            duration: 10.0,
        )"#;
        let mut loaded = Vec::new();
        let (timeline, sounds) = read(text.as_bytes(), |path| {
            loaded.push(path.to_string());
            Handle::default()
        })
        .expect("the timeline is valid");
        assert_eq!(loaded, ["toybox.gs4d", "more/toybox.gs4d"], "the captures of both clips are loaded");
        let clips = &timeline.tracks()[0].clips;
        assert_eq!(
            (clips[0].range, clips[0].speed, clips[0].fade),
            ([0.5, 2.5], 1.0, [0.0; 2]),
            "fields that are left out have their defaults"
        );
        assert_eq!(
            (clips[1].range, clips[1].speed, clips[1].fade),
            ([0.0, 1.0], -0.5, [0.5, 0.25]),
            "given fields are read"
        );
        assert_eq!(timeline.markers(), [Marker { time: 2.0, name: "cut".into() }], "the marker is read");
        let sounds: Vec<_> = sounds.iter().map(|sound| (sound.file.as_str(), sound.start, sound.volume)).collect();
        assert_eq!(sounds, [("song.ogg", 0.0, 1.0), ("bang.wav", 2.5, 0.25)], "the sounds are read");
        assert_eq!(timeline.duration_seconds(), 10.0, "the duration is read");
    }

    #[test]
    fn errors_of_invalid_text_have_line_and_column() {
        for text in
            ["", "(", "(tracks: 3)", "(trakcs: [])", "\u{1f4a5}", "(tracks: [(name: \"a\", clips: [(start: 0)])])"]
        {
            let message = read_text(text).expect_err("the text is invalid").to_string();
            assert!(message.contains("line and column 1:"), "the error of {text:?} has its position: {message}");
        }
        let message = read_text("(tracks: [(name: \"a\", clips: [(capture: \"x\", start: 0, out: 1, sped: 2)])])");
        let message = message.expect_err("the field is unknown").to_string();
        assert!(
            message.contains("sped") && message.contains("speed"),
            "the unknown field and the known fields are named: {message}"
        );
        assert!(read(&[0xff, 0xfe, b'('], |_| Handle::default()).is_err(), "bytes that are not UTF-8 are an error");
    }

    #[test]
    fn captures_outside_the_asset_folder_are_refused() {
        for path in ["", "/etc/toybox.gs4d", "../toybox.gs4d", "a/../../toybox.gs4d", "toybox.gs4d#", "://toybox.gs4d"]
        {
            let clip = format!("(capture: {path:?}, start: 0, out: 1)");
            let refused = read_text(&format!("(tracks: [(name: \"a\", clips: [{clip}])])"));
            let message = refused.expect_err("the path is invalid").to_string();
            assert!(message.contains(&format!("{path:?}")), "the error names {path:?}: {message}");
        }
    }

    #[test]
    fn invalid_timelines_are_refused() {
        let refused = read_text("(tracks: [(name: \"a\", clips: [(capture: \"x.gs4d\", start: 0, in: 2, out: 1)])])");
        assert!(
            matches!(refused, Err(TimelineError::Invalid(InvalidTimeline::Number { .. }))),
            "out before in is invalid: {refused:?}"
        );
        assert!(
            matches!(read_text("()"), Err(TimelineError::Invalid(InvalidTimeline::Empty))),
            "an empty timeline is invalid"
        );
    }
}
