//! Captures of the player splaTV (`.splatv`).
//!
//! In: the bytes of a file: a description in JSON, then 64 bytes for each splat in cubic motion. Out: [`Imported`].

use super::columns::{Columns, Motion, coefficient, logit};
use super::cubic::{Bend, imported, sigma_of_width, spacetime_clip};
use super::error::ImportError;
use super::imported::Imported;
use super::source::Source;
use crate::codec::json;
use crate::codec::options::ReadOptions;
use crate::codec::start::Start;
use half::f16;
use serde::Deserialize;

/// Extensions of these files.
pub(crate) const EXTENSIONS: &[&str] = &["splatv"];
/// The first bytes.
const MAGIC: [u8; 4] = 0x674b_u32.to_le_bytes();
/// Bytes of the record of a splat.
const RECORD: usize = 64;

/// A part of the file, as its description lists it.
#[derive(Deserialize)]
struct Part {
    r#type: String,
    size: u64,
}

/// Returns whether a file that starts so is such a capture.
pub(crate) fn is_of(start: &Start) -> bool {
    start.bytes.starts_with(&MAGIC)
}

/// Reads a capture.
///
/// # Errors
/// A file that is cut within its description, has no splats, or has splats that cannot be drawn; invalid options.
pub(crate) fn read(source: &Source<'_>, options: &ReadOptions) -> Result<Imported, ImportError> {
    let cut = || ImportError::damaged("it is cut within its description: copy it again");
    let rest = source.bytes.strip_prefix(&MAGIC).ok_or_else(cut)?;
    let (length, rest) = rest.split_first_chunk::<4>().ok_or_else(cut)?;
    let (description, mut data) = rest.split_at_checked(u32::from_le_bytes(*length) as usize).ok_or_else(cut)?;
    let parts: Vec<Part> = json::parse(description)
        .map_err(|reason| ImportError::damaged(format!("its description is damaged: {reason}")))?;
    for Part { r#type, size } in parts {
        let length = usize::try_from(size).unwrap_or(usize::MAX).min(data.len());
        let (own, others) = data.split_at(length);
        if r#type == "splat" {
            // The size counts whole rows of a texture; the last row is cut after the last splat, or filled with zeros.
            let records = own.as_chunks::<RECORD>().0;
            let mut columns = Columns::with_capacity(records.len(), 0);
            let mut bends = Vec::with_capacity(records.len());
            records.iter().for_each(|record| push(record, &mut columns, &mut bends));
            let mut lost = Vec::new();
            let played = spacetime_clip(options, &mut lost);
            return imported(columns, bends, played, options, lost);
        }
        data = others;
    }
    Err(ImportError::unsupported("it has no part of the type \"splat\": nothing to draw"))
}

/// Appends the splat of a record, unless it has an alpha of 0.
fn push(record: &[u8; RECORD], columns: &mut Columns, bends: &mut Vec<Bend>) {
    let floats = record.as_chunks::<4>().0;
    let halves = record.as_chunks::<2>().0;
    let [red, green, blue, alpha] = floats[7].map(|byte| f32::from(byte) / 255.0);
    if alpha == 0.0 {
        return;
    }
    let half = |index: usize| f16::from_le_bytes(halves[index]).to_f32();
    let three = |index: usize| [0, 1, 2].map(|lane| half(index + lane));
    let four = |index: usize| [0, 1, 2, 3].map(|lane| half(index + lane));
    columns.mean.push([0, 1, 2].map(|lane| f32::from_le_bytes(floats[lane])));
    // The player's matrix of a quaternion of length 0 is the identity, and its files have many of them.
    let rotation = four(6);
    columns.rotation.push(if rotation == [0.0; 4] { [1.0, 0.0, 0.0, 0.0] } else { rotation });
    columns.log_scale.push(three(10).map(f32::ln));
    columns.opacity_logit.push(logit(alpha));
    columns.harmonics.values.extend([red, green, blue].map(coefficient));
    columns.motion.push(Motion { velocity: three(16), mean_t: half(30), sigma_t: sigma_of_width(half(31)) });
    bends.push(Bend { second: three(19), third: three(22), turn: four(26) });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::codec::import::source::InMemory;
    use crate::scene::{Form, GaussianScene, SceneForm, UpAxis};

    /// Returns the record of a red splat with these factors of its motion.
    fn record(motion: [f32; 9], turn: f32, width: f32) -> Vec<u8> {
        let mut bytes: Vec<u8> = [1.0f32, 2.0, 3.0].iter().flat_map(|value| value.to_le_bytes()).collect();
        let mut add =
            |values: &[f32]| bytes.extend(values.iter().flat_map(|&value| f16::from_f32(value).to_le_bytes()));
        add(&[1.0, 0.0, 0.0, 0.0, 0.1, 0.2, 0.4, 0.0]);
        bytes.extend([255, 0, 0, 128]);
        let mut add =
            |values: &[f32]| bytes.extend(values.iter().flat_map(|&value| f16::from_f32(value).to_le_bytes()));
        add(&motion);
        add(&[0.0, 0.0, 0.0, 0.0, turn, 0.5, width]);
        bytes
    }

    fn file(parts: &str, data: &[u8]) -> Vec<u8> {
        let mut bytes = MAGIC.to_vec();
        bytes.extend((parts.len() as u32).to_le_bytes());
        bytes.extend(parts.bytes());
        bytes.extend(data);
        bytes
    }

    fn read_file(bytes: &[u8], options: &ReadOptions) -> Result<Imported, ImportError> {
        read(&Source { bytes, beside: &InMemory::default() }, options)
    }

    const PARTS: &str = r#"[{"type":"splat","size":4096,"texwidth":4096,"texheight":1,"cameras":[]}]"#;
    const STRAIGHT: [f32; 9] = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    const CURVED: [f32; 9] = [1.0, 0.0, 0.0, 0.0, 8.0, 0.0, 0.0, 0.0, 16.0];

    fn gaussians(scene: &GaussianScene) -> &[crate::gaussian::Gaussian] {
        let SceneForm::Ready(Form::Sliced(sliced)) = &scene.form else { panic!("moving splats are sliced") };
        &sliced.gaussians
    }

    #[test]
    fn a_straight_path_is_one_gaussian_with_the_values_of_its_splat() {
        let found =
            read_file(&file(PARTS, &record(STRAIGHT, 0.0, 0.5)), &ReadOptions::default()).expect("a whole file");
        let [one] = gaussians(&found.scene) else { panic!("one piece") };
        let near = |found: f32, expected: f32| (found - expected).abs() < 2e-3;
        assert_eq!((one.mean, one.mean_t), ([1.0, 2.0, 3.0], 0.5), "where it is at the middle of its life");
        assert!(near(one.velocity[0], 1.0) && one.velocity[1..] == [0.0; 2], "its velocity: {:?}", one.velocity);
        assert!(near(one.sigma_t, 0.5 / 2.0_f32.sqrt()), "exp(−(d/s)²) is a deviation of s/√2: {}", one.sigma_t);
        assert!(near(one.covariance[0].sqrt(), 0.1) && near(one.covariance[5].sqrt(), 0.4), "scales are linear");
        assert!(near(one.opacity, 128.0 / 255.0), "its opacity");
        assert_eq!(found.scene.playback.up, UpAxis::NegY, "y points down");
        let color = &found.scene.form;
        let SceneForm::Ready(Form::Sliced(sliced)) = color else { panic!("sliced") };
        assert!(near(sliced.harmonics.values[0] * 0.282_094_8 + 0.5, 1.0), "red");
    }

    #[test]
    fn a_cubic_path_is_followed_within_the_tolerance() {
        let bytes = file(PARTS, &record(CURVED, 0.3, f32::INFINITY));
        let found = read_file(&bytes, &ReadOptions::default()).expect("a whole file");
        let (filter, all) = (found.scene.filter.as_ref().expect("pieces have a filter"), gaussians(&found.scene));
        assert!(all.len() > 4, "{} pieces", all.len());
        for step in 0..=100 {
            let (time, since) = (step as f32 / 100.0, step as f32 / 100.0 - 0.5);
            let segment = filter.segment_of(time, [0.0, 1.0]);
            let active: Vec<usize> = (0..all.len()).filter(|&index| filter.is_active(segment, index)).collect();
            let [index] = active[..] else { panic!("one piece at {time}: {active:?}") };
            let expected = glam::Vec3::new(1.0 + since, 2.0 + 8.0 * since * since, 3.0 + 16.0 * since * since * since);
            let distance = all[index].mean_at(time).distance(expected);
            assert!(distance < 0.25 * 0.2 + 1e-3, "{distance} from the path at {time}");
        }
        let finer = ReadOptions { tolerance: Some(0.02), ..ReadOptions::default() };
        let finer = read_file(&bytes, &finer).expect("a whole file");
        assert!(gaussians(&finer.scene).len() > 2 * all.len(), "a smaller tolerance needs more pieces");
        let said = found.lost.join(" ");
        for part in ["straight pieces", "rotation of a piece is constant", "--duration"] {
            assert!(said.contains(part), "{part:?} is stated: {said}");
        }
    }

    #[test]
    fn widths_too_large_for_their_format_are_splats_of_all_times() {
        for width in [f32::INFINITY, f32::NAN] {
            let found = read_file(&file(PARTS, &record(STRAIGHT, 0.0, width)), &ReadOptions::default()).expect("whole");
            assert_eq!(gaussians(&found.scene)[0].sigma_t, f32::INFINITY, "a width of {width}");
        }
    }

    #[test]
    fn rows_after_the_last_splat_and_half_a_record_are_left_out() {
        let mut data = record(STRAIGHT, 0.0, 0.5);
        data.extend([0; 200]);
        let found = read_file(&file(PARTS, &data), &ReadOptions::default()).expect("a whole file");
        assert_eq!(found.scene.len(), 1, "one splat");
        data.splice(..0, record([f32::INFINITY; 9], 0.0, 0.5));
        let found = read_file(&file(PARTS, &data), &ReadOptions::default()).expect("a whole file");
        assert_eq!(found.scene.len(), 1, "a splat whose motion is not finite is left out");
        assert!(found.lost.iter().any(|lost| lost.starts_with("1 of 2 Gaussians")), "and stated: {:?}", found.lost);
    }

    #[test]
    fn a_quaternion_of_length_0_is_no_rotation() {
        let mut data = record(STRAIGHT, 0.0, 0.5);
        data[12..20].fill(0);
        let found = read_file(&file(PARTS, &data), &ReadOptions::default()).expect("a whole file");
        let covariance = gaussians(&found.scene)[0].covariance;
        assert!((covariance[0].sqrt() - 0.1).abs() < 1e-3 && covariance[1] == 0.0, "axes of space: {covariance:?}");
    }

    #[test]
    fn damaged_files_are_refused() {
        let whole = file(PARTS, &record(STRAIGHT, 0.0, 0.5));
        for length in 0..whole.len() {
            assert!(read_file(&whole[..length], &ReadOptions::default()).is_err(), "cut at {length} bytes");
        }
        for parts in ["[]", "{}", r#"[{"type":"mesh","size":64}]"#, r#"[{"type":"splat","size":0}]"#] {
            assert!(read_file(&file(parts, &[7; 64]), &ReadOptions::default()).is_err(), "{parts}");
        }
        let other = r#"[{"type":"mesh","size":18446744073709551615},{"type":"splat","size":64}]"#;
        assert!(read_file(&file(other, &[7; 64]), &ReadOptions::default()).is_err(), "no splats are left");
    }
}
