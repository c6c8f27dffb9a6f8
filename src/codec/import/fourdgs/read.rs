//! Reading `.4dgs` files.
//!
//! In: the bytes of a file. Out: [`Imported`]: its Gaussians with their motion, lifespans and windows of time. Tracks
//! of objects become straight pieces.

use super::exact::{self, Residuals};
use super::memory;
use super::tracks::{Tracks, pose};
use crate::codec::import::columns::{Columns, Motion, Played, coefficient, logit};
use crate::codec::import::in_pieces::{in_pieces, middle_scale, splitting, statements};
use crate::codec::import::source::Source;
use crate::codec::import::{ImportError, Imported};
use crate::codec::options::ReadOptions;
use crate::codec::text::printable;
use crate::gaussian::SMALLEST_CUTOFF;
use crate::scene::pieces::{Bends, Curve};
use crate::scene::{MAX_SEGMENTS, UpAxis};
use fourdgs::quantization::sh_coefficient;
use fourdgs::{GaussianSet, Scene};
use glam::{DQuat, DVec3};

/// Scales are raised to this one: the logarithm of 0 is not finite.
const SMALLEST_SCALE: f32 = 1e-8;
/// Largest number of equal parts of the duration that is tried so that all windows begin and end between parts.
const MOST_PARTS: u32 = 4096;

/// Reads a capture.
///
/// # Errors
/// A file that is damaged or cut, or of another temporal model than gaussian-birth; invalid options.
pub(crate) fn read(source: &Source<'_>, options: &ReadOptions) -> Result<Imported, ImportError> {
    options.check()?;
    memory::check(source.bytes).map_err(|over| ImportError::damaged(format!("its set of Gaussians {over}")))?;
    let reading = fourdgs::ReadOptions { recover_truncated: false, ..fourdgs::ReadOptions::default() };
    let file = fourdgs::stream_reader::read_from(source.bytes, &reading).map_err(error)?;
    if file.summary_crc_ok == Some(false) {
        return Err(ImportError::damaged("the checksum of its summary is wrong: copy it again"));
    }
    let duration = file.duration_sec as f32;
    if !(duration.is_finite() && duration >= 0.0) {
        return Err(ImportError::damaged(format!("its duration is {duration} seconds")));
    }
    let played = Played {
        up: up(&file),
        time_interval: [0.0, if duration > 0.0 { duration } else { 1.0 }],
        duration_seconds: duration,
        marginal_cutoff: (file.header.cutoff as f32).clamp(SMALLEST_CUTOFF, 0.999),
    };
    let set = &file.gaussians;
    let whole = columns(set, source.bytes)?;
    let interval = options.time_interval.unwrap_or(played.time_interval);
    let tracks = Tracks::of(&file.objects);
    let object = |index: usize| set.object_id.as_ref().and_then(|objects| objects.get(index)).copied().unwrap_or(0);
    let window = |index: usize| [set.win_lo[index], set.win_hi[index]];
    let has_tracks = (0..whole.len()).any(|index| tracks.of_object(object(index)).is_some());
    let has_windows = (0..whole.len()).any(|index| window(index)[0] > interval[0] || window(index)[1] < interval[1]);
    let mut lost = not_shown(&file);
    if !has_tracks && !has_windows {
        return Ok(Imported { scene: whole.into_scene(played, options)?, lost });
    }
    let segments = segments((0..whole.len()).flat_map(window), interval);
    let splitting = splitting(&played, options, segments, Bends::Smoothly)?;
    let pieces = splitting.split(whole.len(), |index| {
        let track = tracks.of_object(object(index));
        let [mean, velocity] =
            [whole.mean[index], whole.motion[index].velocity].map(|value| DVec3::from(value.map(f64::from)));
        let Motion { mean_t, sigma_t, .. } = whole.motion[index];
        let position = move |time: f64| {
            let at = mean + velocity * (time - f64::from(mean_t));
            track.map_or(at, |track| {
                let (rotation, translation) = pose(track, time);
                rotation * at + translation
            })
        };
        Curve { position, mean_t, sigma_t, window: window(index), scale: middle_scale(whole.log_scale[index]) }
    });
    if has_tracks {
        lost.extend(statements(&pieces, whole.len(), splitting.tolerance));
        lost.push(
            "A Gaussian of a moving object has the same rotation throughout a piece, that of its middle.".to_owned(),
        );
    } else if pieces.unseen > 0 {
        lost.push(format!("{} Gaussians are never visible within the duration and are left out.", pieces.unseen));
    }
    if has_windows {
        lost.push(format!(
            "Windows of time are rounded to the nearest boundary of {segments} equal parts of the duration."
        ));
    }
    let sigmas: Vec<f32> = whole.motion.iter().map(|motion| motion.sigma_t).collect();
    let columns = in_pieces(&whole, &sigmas, pieces, |piece| {
        let index = piece.source as usize;
        let Some(track) = tracks.of_object(object(index)) else { return whole.rotation[index] };
        let [w, x, y, z] = whole.rotation[index].map(f64::from);
        let DQuat { x, y, z, w } = pose(track, f64::from(piece.middle())).0 * DQuat::from_xyzw(x, y, z, w);
        [w, x, y, z].map(|value| value as f32)
    });
    Ok(Imported { scene: columns.into_scene(played, options)?, lost })
}

/// Returns the axis that points up: that of the first frame of coordinates, else +y.
fn up(file: &Scene) -> UpAxis {
    match file.provenance.frames.first().map(|frame| frame.up_axis) {
        Some(0) => UpAxis::PosX,
        Some(2) => UpAxis::PosZ,
        Some(3) => UpAxis::NegX,
        Some(4) => UpAxis::NegY,
        Some(5) => UpAxis::NegZ,
        _ => UpAxis::PosY,
    }
}

/// Returns the Gaussians of a file, without windows and tracks. Their colors are exact if this program wrote the file.
fn columns(set: &GaussianSet, file: &[u8]) -> Result<Columns, ImportError> {
    let count = set.count();
    let coded = set.sh.as_deref().unwrap_or(&[]);
    let rest = if coded.is_empty() { 0 } else { set.sh_coefficients };
    let degree = match rest {
        0 => 0,
        3 => 1,
        8 => 2,
        15 => 3,
        _ => return Err(ImportError::damaged(format!("it has {rest} color coefficients above degree 0"))),
    };
    let lengths = [set.positions.len(), set.scales.len(), set.motions.len()];
    let is_consistent = lengths.iter().all(|&length| length == count * 3)
        && [set.rotations.len(), set.colors.len()].iter().all(|&length| length == count * 4)
        && [set.sigma_t.len(), set.win_lo.len(), set.win_hi.len()].iter().all(|&length| length == count)
        && coded.len() == count * rest * 3;
    if !is_consistent {
        return Err(ImportError::damaged("its attributes have different numbers of Gaussians"));
    }
    let residuals = exact::residuals(file, count, rest * 3)?;
    let add = |decoded: f64, part: &dyn Fn(&Residuals) -> f64| (decoded + residuals.as_ref().map_or(0.0, part)) as f32;
    let mut columns = Columns::with_capacity(count, degree);
    columns.mean.extend_from_slice(set.positions.as_chunks().0);
    let scales = set.scales.as_chunks::<3>().0;
    columns.log_scale.extend(scales.iter().map(|scale| scale.map(|scale| scale.max(SMALLEST_SCALE).ln())));
    columns.rotation.extend(set.rotations.as_chunks::<4>().0.iter().map(|&[x, y, z, w]| [w, x, y, z]));
    for (index, &[red, green, blue, opacity]) in set.colors.as_chunks::<4>().0.iter().enumerate() {
        columns.opacity_logit.push(logit(opacity));
        for (channel, value) in [red, green, blue].into_iter().enumerate() {
            let color = add(f64::from(value), &|residuals| residuals.color(index, channel));
            columns.harmonics.values.push(coefficient(color));
        }
        let own = coded.get(index * rest * 3..(index + 1) * rest * 3).unwrap_or(&[]);
        for number in 0..rest {
            for (at, &byte) in own.iter().enumerate().skip(number).step_by(rest) {
                columns.harmonics.values.push(add(sh_coefficient(byte), &|residuals| residuals.coefficient(index, at)));
            }
        }
    }
    columns.motion = (set.motions.as_chunks::<3>().0.iter().zip(&set.mu_t).zip(&set.sigma_t))
        // A Gaussian with a standard deviation of 0 is visible at a single time.
        .map(|((&velocity, &mean_t), &sigma_t)| Motion { velocity, mean_t, sigma_t: sigma_t.max(1e-9) })
        .collect();
    Ok(columns)
}

/// Returns a number of segments at whose boundaries the ends of windows lie, or the largest number if there is none.
fn segments(ends: impl Iterator<Item = f32>, [first, last]: [f32; 2]) -> u32 {
    let part = |end: f32| (f64::from(end) - f64::from(first)) / (f64::from(last) - f64::from(first));
    let mut parts: Vec<f64> = ends.map(part).filter(|part| *part > 0.0 && *part < 1.0).collect();
    parts.sort_unstable_by(f64::total_cmp);
    parts.dedup();
    let is_boundary = |part: f64, count: u32| {
        let position = part * f64::from(count);
        (position - position.round()).abs() < 1e-4
    };
    let found = (1..=MOST_PARTS).find(|&count| parts.iter().all(|&part| is_boundary(part, count)));
    found.map_or(MAX_SEGMENTS, |count| MAX_SEGMENTS / count * count)
}

/// Returns a sentence for each thing of a file that a scene cannot have.
fn not_shown(file: &Scene) -> Vec<String> {
    let mut lost = Vec::new();
    match file.audio_sources.len() {
        0 => {}
        count => lost.push(format!("It has {count} sources of sound, which are left out.")),
    }
    if file.camera.is_some() {
        lost.push("Its camera is left out.".to_owned());
    }
    if let Some(space) =
        file.header.attributes.get("color_space").filter(|space| !space.to_lowercase().contains("srgb"))
    {
        lost.push(format!("Its colors are of the space {}, and are shown as sRGB.", printable(space)));
    }
    lost
}

fn error(error: fourdgs::Error) -> ImportError {
    use fourdgs::Error;
    let message = printable(&error.to_string());
    match error {
        Error::Io(error) => ImportError::Io(error),
        _ if message.contains("keyframe-delta") => ImportError::unsupported(
            "it is a sequence of key-frames (temporal model keyframe-delta): write it with the model gaussian-birth, or as one PLY for each frame",
        ),
        Error::UnsupportedModel(_)
        | Error::UnsupportedCodec(_)
        | Error::UnsupportedVersion(_)
        | Error::UnsupportedOperation(_) => ImportError::unsupported(message),
        _ => ImportError::damaged(message),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::codec::import::source::InMemory;
    use crate::codec::import::testing::gaussians;
    use crate::gaussian::Gaussian;
    use crate::scene::{Form, SceneForm};
    use fourdgs::{SceneExtras, WriteOptions, write_to_vec};

    /// Returns a file of 3 s with 40 Gaussians. Each exists during half a second if `windows` is set.
    fn file(windows: bool, extra: Vec<Vec<u8>>) -> (GaussianSet, Vec<u8>) {
        let mut set = GaussianSet { sh: Some(Vec::new()), sh_coefficients: 3, sh_degree: 1, ..GaussianSet::default() };
        for index in 0..40u8 {
            let x = f32::from(index);
            set.positions.extend([x * 0.1, 1.0, -x * 0.05]);
            set.scales.extend([0.02, 0.03, 0.05]);
            set.rotations.extend([0.0, 0.6, 0.0, 0.8]);
            set.colors.extend([x / 40.0, 0.5, 0.25, 0.75]);
            set.motions.extend([0.3, -0.2, 0.1]);
            set.mu_t.push(x / 16.0);
            set.sigma_t.push(if index % 4 == 0 { f32::INFINITY } else { 0.4 });
            let first = f32::from(index % 6) * 0.5;
            set.win_lo.push(if windows { first } else { 0.0 });
            set.win_hi.push(if windows { first + 0.5 } else { 3.0 });
            set.sh.get_or_insert_default().extend((0..9).map(|number| index + number * 20));
        }
        if !extra.is_empty() {
            set.object_id = Some((0..40).map(|index| index % 2).collect());
        }
        let options = WriteOptions { extra_records: extra, ..WriteOptions::default() };
        let bytes = write_to_vec(&set, 3.0, &options, &SceneExtras::default()).expect("a scene that can be written");
        (set, bytes)
    }

    fn read_file(bytes: &[u8]) -> Result<Imported, ImportError> {
        let source = Source { bytes, beside: &InMemory::default() };
        read(&source, &ReadOptions::default())
    }

    #[test]
    fn gaussians_have_the_state_that_the_format_gives_them() {
        for windows in [false, true] {
            let (_, bytes) = file(windows, Vec::new());
            let found = read_file(&bytes).expect("a whole file");
            let (gaussians, filter) = (gaussians(&found), &found.scene.filter);
            assert_eq!(filter.is_some(), windows, "a filter only for windows");
            assert_eq!(
                (found.scene.trained_with.time_interval, found.scene.playback.duration_seconds),
                ([0.0, 3.0], 3.0),
                "times are seconds"
            );
            let file = fourdgs::read_bytes(&bytes).expect("a whole file");
            for step in 0..29 {
                let time = 0.05 + step as f32 * 0.1;
                let state = file.state_at(f64::from(time)).expect("a time of the scene");
                let is_active = |index: usize| {
                    filter.as_ref().is_none_or(|filter| filter.is_active(filter.segment_of(time, [0.0, 3.0]), index))
                };
                let visible: Vec<&Gaussian> = gaussians
                    .iter()
                    .enumerate()
                    .filter(|(index, gaussian)| is_active(*index) && gaussian.marginal(time) >= 0.05)
                    .map(|(_, gaussian)| gaussian)
                    .collect();
                assert_eq!(visible.len(), state.count(), "at {time} as many are visible");
                // Pieces keep the order of their Gaussians, each of which has at most one.
                for (gaussian, (center, opacity)) in
                    visible.iter().zip(state.centers.as_chunks::<3>().0.iter().zip(&state.opacity))
                {
                    let distance = gaussian.mean_at(time).distance((*center).into());
                    let marginal = gaussian.opacity * gaussian.marginal(time);
                    assert!(
                        distance < 1e-4 && (marginal - opacity).abs() < 1e-4,
                        "at {time}: {distance}, {marginal} for {opacity}"
                    );
                }
            }
        }
    }

    #[test]
    fn colors_have_one_degree_and_windows_fall_on_segments() {
        let (set, bytes) = file(true, Vec::new());
        let found = read_file(&bytes).expect("a whole file");
        let SceneForm::Ready(Form::Sliced(sliced)) = &found.scene.form else { panic!("sliced") };
        let stored = sliced.harmonics.values.len();
        assert_eq!((sliced.harmonics.degree, stored), (1, found.scene.len() * 12), "degree 1");
        let red: Vec<f32> = sliced.harmonics.values.iter().copied().skip(3).step_by(3).take(3).collect();
        let written: Vec<f32> =
            set.sh.iter().flatten().take(3).map(|&byte| -4.0 + 8.0 * f32::from(byte) / 255.0).collect();
        let is_near = red.iter().zip(&written).all(|(a, b)| (a - b).abs() < 0.05);
        assert!(is_near || sliced.gaussians[0].mean[0] > 0.05, "coefficients of red: {red:?} for {written:?}");
        assert_eq!(found.scene.filter.map(|filter| filter.segments % 6), Some(0), "six windows of equal length");
    }

    #[test]
    fn damaged_files_are_refused() {
        let (_, bytes) = file(true, Vec::new());
        for length in (0..bytes.len()).step_by(7) {
            assert!(read_file(&bytes[..length]).is_err(), "cut at {length} of {} bytes", bytes.len());
        }
    }
}
