//! TSOG of version 4, with or without the playback profile of OpsiClear: SOG with a timeline.
//!
//! In: `meta.json` and its textures. Out: a scene, y up: frames as a temporal filter, or motion and lifespans.

use super::files::Files;
use super::meta::{self, Images, Wide};
use super::sog2::invisible;
use super::splats::{self, Layout};
use super::textures::{self, Texture};
use crate::codec::import::columns::{Motion, Played};
use crate::codec::import::{ImportError, Imported, assumed};
use crate::codec::options::ReadOptions;
use crate::codec::text::printable;
use crate::scene::{ActiveSets, FilterKind, MAX_SEGMENTS, TemporalFilter, UpAxis};
use rayon::prelude::*;
use serde::Deserialize;
use serde_json::Value;

/// The profile that is known, and its version.
const PROFILE: (&str, u64) = ("org.opsiclear.tsog-playback", 1);
/// Frames a second of a clip that does not state them.
const FPS: f64 = 30.0;
/// Frames of a continuous clip that does not state its duration, less one.
const FRAMES: f64 = 299.0;

/// The fields beside those of SOG.
#[derive(Debug, Clone, Deserialize)]
struct Fields {
    profile: Option<Profile>,
    timeline: Option<Timeline>,
    temporal: Option<Temporal>,
    fps: Option<f64>,
    #[serde(default)]
    playback: Playback,
    audio: Option<Audio>,
}

#[derive(Debug, Clone, Deserialize)]
struct Profile {
    id: String,
    version: u64,
}

#[derive(Debug, Clone, Deserialize)]
struct Timeline {
    #[serde(rename = "type")]
    kind: u64,
    /// Number of frames and codes of a frame, of type 0.
    #[serde(rename = "N")]
    frames: Option<u64>,
    delta: Option<u64>,
    /// Limits of the temporal mean and of the temporal deviation, of type 1.
    mins: Option<[f64; 2]>,
    maxs: Option<[f64; 2]>,
    files: [String; 2],
}

/// Attributes that change over time. All but the mean are refused: the capture would look different without them.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
struct Temporal {
    means: Option<Velocity>,
}

#[derive(Debug, Clone, Deserialize)]
struct Velocity {
    mins: [[f64; 3]; 1],
    maxs: [[f64; 3]; 1],
    /// One texture of 8 bits, or two of the low and the high bytes of 16 bits.
    files: Vec<String>,
}

#[derive(Debug, Clone, Default, Deserialize)]
struct Playback {
    duration: Option<f64>,
    fps: Option<f64>,
    rate: Option<f64>,
}

#[derive(Debug, Clone, Deserialize)]
struct Audio {
    file: String,
}

/// A timeline that has been checked.
enum Moving {
    /// Gaussians at rest, at every time.
    Still,
    /// Frames of so many codes, one after another.
    Frames { frames: u32, codes: u32 },
    /// Lifespans, and motion if there is any.
    Continuous { mins: [f64; 2], maxs: [f64; 2], velocity: Option<Velocity> },
}

/// Reads a scene.
///
/// # Errors
/// Another version, profile or timeline; a file that is missing or damaged; invalid options.
pub(super) fn read(files: &mut Files, meta: &Value, options: &ReadOptions) -> Result<Imported, ImportError> {
    options.check()?;
    let fields: Fields = meta::part("meta.json", meta)?;
    if let Some(Profile { id, version }) = &fields.profile
        && (id.as_str(), *version) != PROFILE
    {
        let id = printable(id);
        return Err(ImportError::unsupported(format!(
            "a TSOG of the profile {id}, version {version}, and only {}, version {}, is known",
            PROFILE.0, PROFILE.1
        )));
    }
    let images: Images = meta::part("meta.json", meta)?;
    let count = images.count;
    let layout = Layout::of_images(images)?;
    let moving = moving(&fields)?;
    let mut names: Vec<&str> = layout.names().collect();
    let common = names.len();
    if let (Moving::Frames { .. } | Moving::Continuous { .. }, Some(timeline)) = (&moving, &fields.timeline) {
        names.extend(timeline.files.iter().map(String::as_str));
    }
    if let Moving::Continuous { velocity: Some(velocity), .. } = &moving {
        names.extend(velocity.files.iter().map(String::as_str));
    }
    let centroids = layout.centroids(files)?;
    let encoded = textures::read(files, names)?;
    let count = textures::check_count(count, &encoded)?;
    let decoded = textures::decode(&encoded, count)?;
    let (attributes, times) = decoded.split_at(common);
    let kept = splats::visible(attributes, 0..count);
    let mut columns = layout.columns(attributes, &centroids, &kept)?;
    match (&moving, times) {
        (Moving::Frames { frames, codes }, [low, high, ..]) => {
            columns.filter = Some(windows(*frames, *codes, low, high, &kept));
        }
        (Moving::Continuous { mins, maxs, velocity }, [low, high, speeds @ ..]) => {
            let times =
                Wide { mins: [mins[0], mins[1], 0.0], maxs: [maxs[0], maxs[1], 0.0], files: Default::default() };
            columns.motion = kept
                .par_iter()
                .map(|&i| {
                    let [mean_t, sigma_t, _] = times.linear(low.at(i), high.at(i)).map(|value| value as f32);
                    let velocity = velocity.as_ref().map_or([0.0; 3], |velocity| velocity.at(speeds, i));
                    Motion { velocity, mean_t, sigma_t }
                })
                .collect();
        }
        _ => {}
    }
    let mut lost: Vec<String> = invisible(count - kept.len(), count).into_iter().collect();
    if let Some(audio) = &fields.audio {
        lost.push(format!(
            "Its sound, {}, is not played: unpack it and play it beside the capture.",
            printable(&audio.file)
        ));
    }
    if let Some(rate) = fields.playback.rate.filter(|&rate| rate != 1.0) {
        lost.push(format!("It is meant to be played at {rate} times its speed: set the speed of the playback."));
    }
    let duration_seconds = duration(&fields, &moving, options)?;
    let is_stated = fields.playback.duration.is_some();
    let has_speed = fields.playback.fps.or(fields.fps).is_some();
    match &moving {
        Moving::Frames { frames, .. } if !is_stated && !has_speed => lost.extend(assumed::speed(frames, options)),
        Moving::Continuous { .. } if !is_stated => lost.extend(assumed::duration(duration_seconds, options)),
        _ => {}
    }
    let played = Played { duration_seconds, ..Played::still(UpAxis::PosY) };
    Ok(Imported { scene: columns.into_scene(played, options)?, lost })
}

/// Returns the timeline.
///
/// # Errors
/// Another type; fields of it that are missing or contradict each other.
fn moving(fields: &Fields) -> Result<Moving, ImportError> {
    let damaged = |reason: &str| ImportError::damaged(format!("its meta.json has a timeline {reason}"));
    let velocity = fields.temporal.as_ref().and_then(|temporal| temporal.means.clone());
    let Some(timeline) = &fields.timeline else {
        return if velocity.is_none() { Ok(Moving::Still) } else { Err(damaged("of motion, but none of time")) };
    };
    match timeline.kind {
        0 => {
            let frames = timeline.frames.filter(|&frames| (1..=1 << 16).contains(&frames));
            let frames = frames.ok_or_else(|| damaged("whose number of frames N is not from 1 to 65536"))?;
            if frames > u64::from(MAX_SEGMENTS) {
                return Err(ImportError::unsupported(format!(
                    "a TSOG of {frames} frames; {MAX_SEGMENTS} are the most"
                )));
            }
            if timeline.delta != Some(65536 / frames) {
                return Err(damaged("whose delta does not fit its number of frames"));
            }
            Ok(Moving::Frames { frames: frames as u32, codes: (65536 / frames) as u32 })
        }
        1 => {
            let (Some(mins), Some(maxs)) = (timeline.mins, timeline.maxs) else {
                return Err(damaged("of type 1 without mins and maxs"));
            };
            if velocity.as_ref().is_some_and(|velocity| !(1..=2).contains(&velocity.files.len())) {
                return Err(damaged("with motion of neither one texture nor two"));
            }
            Ok(Moving::Continuous { mins, maxs, velocity })
        }
        kind => {
            Err(ImportError::unsupported(format!("a TSOG with a timeline of type {kind}, and only 0 and 1 are known")))
        }
    }
}

impl Velocity {
    /// Returns the velocity of a Gaussian, capture units per clip.
    fn at(&self, textures: &[Texture], index: u32) -> [f32; 3] {
        let ([mins], [maxs]) = (self.mins, self.maxs);
        let velocity = match textures {
            [low, high] => Wide { mins, maxs, files: Default::default() }.linear(low.at(index), high.at(index)),
            [codes] => {
                let codes = codes.at(index);
                std::array::from_fn(|axis| mins[axis] + (maxs[axis] - mins[axis]) * f64::from(codes[axis]) / 255.0)
            }
            _ => [0.0; 3],
        };
        velocity.map(|component| component as f32)
    }
}

/// Returns the frame of each Gaussian as a window of time.
fn windows(frames: u32, codes: u32, low: &Texture, high: &Texture, kept: &[u32]) -> TemporalFilter {
    let window = |&index: &u32| {
        let code = u32::from(u16::from_le_bytes([low.at(index)[0], high.at(index)[0]]));
        let frame = (code / codes).min(frames - 1);
        frame | frame << 16
    };
    TemporalFilter {
        kind: FilterKind::Window,
        segments: frames,
        count: kept.len(),
        sets: ActiveSets::Intervals(kept.par_iter().map(window).collect()),
    }
}

/// Returns the seconds of the clip: of the options, else of the file, stated or from its number of frames.
///
/// # Errors
/// A duration or frames a second that are not positive.
fn duration(fields: &Fields, moving: &Moving, options: &ReadOptions) -> Result<f32, ImportError> {
    if let Some(seconds) = options.duration_seconds {
        return Ok(seconds);
    }
    let fps = options.fps.map(f64::from).or(fields.playback.fps).or(fields.fps).unwrap_or(FPS);
    let seconds = match (moving, fields.playback.duration) {
        (Moving::Still, _) => return Ok(0.0),
        (Moving::Frames { frames, .. }, None) => f64::from(*frames) / fps,
        (Moving::Frames { frames, .. }, Some(_)) if options.fps.is_some() => f64::from(*frames) / fps,
        (Moving::Continuous { .. }, None) => FRAMES / fps,
        (_, Some(duration)) => duration,
    };
    let seconds = seconds as f32;
    if seconds.is_finite() && seconds > 0.0 {
        Ok(seconds)
    } else {
        Err(ImportError::damaged(format!(
            "its meta.json has a duration of {seconds} seconds; --duration sets another one"
        )))
    }
}
