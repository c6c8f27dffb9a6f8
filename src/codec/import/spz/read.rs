//! The Gaussians of an SPZ file.
//!
//! In: the [`Payload`] of a file. Out: [`Columns`], right, up, back; of a file a scene, and what it does not show.

use super::axes::to_right_up_back;
use super::payload::{Column, Payload};
use crate::codec::import::Imported;
use crate::codec::import::columns::{Columns, Played, logit};
use crate::codec::import::error::ImportError;
use crate::codec::import::placed::place;
use crate::codec::import::source::Source;
use crate::codec::options::ReadOptions;
use crate::scene::UpAxis;
use glam::DAffine3;

/// The factor of colors: a channel byte is 255 (0.15 c + 0.5).
const COLOR: f32 = 0.15;

/// Reads a file.
///
/// # Errors
/// A file that is damaged, cut or of an unknown version; invalid options.
pub(crate) fn read(source: &Source<'_>, options: &ReadOptions) -> Result<Imported, ImportError> {
    let (columns, lost) = columns(source.bytes)?;
    Ok(Imported { scene: columns.into_scene(Played::still(UpAxis::PosY), options)?, lost })
}

/// Returns the Gaussians of a file, and what they do not show.
///
/// # Errors
/// As [`read`].
pub(crate) fn columns(file: &[u8]) -> Result<(Columns, Vec<String>), ImportError> {
    let payload = Payload::of(file)?;
    let mut columns = Columns { mip_filter: payload.is_antialiased, ..decode(&payload) };
    let Some(axes) = to_right_up_back(payload.system) else {
        return Err(ImportError::damaged(format!("coordinate system {}, of which 16 exist", payload.system)));
    };
    place(&mut columns, &DAffine3::from_mat3(axes))?;
    let mut lost = Vec::new();
    if payload.degree > 3 {
        lost.push(format!(
            "The colors of degree 4, 9 coefficients of each of {} Gaussians, are left out.",
            payload.count
        ));
    }
    Ok((columns, lost))
}

/// Returns the Gaussians along the axes of the file.
fn decode(payload: &Payload) -> Columns {
    let degree = payload.degree.min(3);
    let mut columns = Columns::with_capacity(payload.count, degree as u32);
    let table = |value: fn(f32) -> f32| -> [f32; 256] { std::array::from_fn(|byte| value(byte as f32)) };
    let step = (-f64::from(payload.fractional_bits)).exp2();
    columns.mean.extend(
        payload
            .column(Column::Positions)
            .chunks_exact(9)
            .map(|bytes| std::array::from_fn(|axis| (f64::from(signed(&bytes[axis * 3..axis * 3 + 3])) * step) as f32)),
    );
    let logits = table(|byte| logit(byte / 255.0));
    columns.opacity_logit.extend(payload.column(Column::Alphas).iter().map(|&byte| logits[usize::from(byte)]));
    let scales = table(|byte| byte / 16.0 - 10.0);
    let scale = |bytes: &[u8]| std::array::from_fn(|axis| scales[usize::from(bytes[axis])]);
    columns.log_scale.extend(payload.column(Column::Scales).chunks_exact(3).map(scale));
    let rotations = payload.column(Column::Rotations).chunks_exact(payload.width(Column::Rotations));
    if payload.version < 3 {
        columns.rotation.extend(rotations.map(three_components));
    } else {
        columns.rotation.extend(rotations.map(smallest_three));
    }
    let colors = table(|byte| (byte / 255.0 - 0.5) / COLOR);
    let rest = table(|byte| (byte - 128.0) / 128.0);
    let stored = payload.coefficients() * 3;
    let kept = (columns.harmonics.coefficients - 1) * 3;
    let harmonics = payload.column(Column::Harmonics);
    let values = &mut columns.harmonics.values;
    for (index, color) in payload.column(Column::Colors).chunks_exact(3).enumerate() {
        values.extend(color.iter().map(|&byte| colors[usize::from(byte)]));
        let own = harmonics.get(index * stored..index * stored + kept).unwrap_or_default();
        values.extend(own.iter().map(|&byte| rest[usize::from(byte)]));
    }
    columns
}

/// Returns the signed number in three bytes.
fn signed(bytes: &[u8]) -> i32 {
    i32::from_le_bytes([0, bytes[0], bytes[1], bytes[2]]) >> 8
}

/// Returns the rotation w, x, y, z of x, y, z in three bytes.
fn three_components(bytes: &[u8]) -> [f32; 4] {
    let [x, y, z] = std::array::from_fn(|axis| f32::from(bytes[axis]) / 127.5 - 1.0);
    let w = (1.0 - x * x - y * y - z * z).max(0.0).sqrt();
    [w, x, y, z]
}

/// Returns the rotation w, x, y, z of the smallest three of x, y, z, w: the index of the largest in two bits, then a
/// sign and nine bits for each of the others.
fn smallest_three(bytes: &[u8]) -> [f32; 4] {
    let mut word = u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]);
    let largest = (word >> 30) as usize;
    let mut components = [0.0_f32; 4];
    let mut squares = 0.0;
    for index in (0..4).rev().filter(|&index| index != largest) {
        let magnitude = (word & 511) as f32 / 511.0 * std::f32::consts::FRAC_1_SQRT_2;
        components[index] = if word & 512 == 0 { magnitude } else { -magnitude };
        squares += magnitude * magnitude;
        word >>= 10;
    }
    components[largest] = (1.0 - squares).max(0.0).sqrt();
    let [x, y, z, w] = components;
    [w, x, y, z]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::codec::import::source::InMemory;
    use crate::codec::import::spz::is_of;
    use crate::codec::start::Start;
    use crate::scene::SceneForm;
    use flate2::Compression;
    use flate2::write::GzEncoder;
    use glam::{DMat3, DQuat, DVec3};
    use std::io::{Cursor, Write};
    use std::path::Path;

    /// Bytes of the columns of a Gaussian before its harmonics: version 2, then versions 3 and 4.
    const ROTATIONS: [&[u8]; 2] = [&[255, 127, 127], &[0xff, 0x05, 0x80, 0x40]];

    /// A file of this version, degree and number of Gaussians, which differ in their positions.
    fn file(version: u32, degree: u8, count: u32, system: Option<u32>) -> Vec<u8> {
        let coefficients = [0, 3, 8, 15, 24][usize::from(degree)];
        let mut columns: Vec<Vec<u8>> = vec![Vec::new(); 6];
        for index in 0..count {
            for axis in [4096 + index as i32, -1, -(1 << 23)] {
                columns[0].extend(&axis.to_le_bytes()[..3]);
            }
            columns[1].push(51);
            columns[2].extend([0, 255, 128]);
            columns[3].extend([0, 160, 176]);
            columns[4].extend(ROTATIONS[usize::from(version > 2)]);
            columns[5].extend((0..coefficients * 3).map(|value| 128 + value as u8));
        }
        let flags = 1 | if system.is_some() { 2 } else { 0 };
        let mut head = [&b"NGSP"[..], &version.to_le_bytes(), &count.to_le_bytes()].concat();
        head.extend([degree, 12, flags, 0]);
        // A record of an unknown type comes first.
        let records: Vec<u8> = system.map_or_else(Vec::new, |system| {
            let system = system.to_le_bytes();
            [&[7, 0, 0, 0, 1, 0, 0, 0, 9][..], &0xadbe_0003_u32.to_le_bytes(), &[4, 0, 0, 0], &system].concat()
        });
        if version < 4 {
            let payload = [head, columns.concat(), records].concat();
            let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
            encoder.write_all(&payload).expect("memory");
            return encoder.finish().expect("memory");
        }
        let streams = if degree == 0 { 5 } else { 6 };
        head[15] = streams;
        head.extend((32 + records.len() as u32).to_le_bytes());
        head.extend([0; 12]);
        head.extend(records);
        let columns = &columns[..usize::from(streams)];
        let frames: Vec<Vec<u8>> =
            columns.iter().map(|column| zstd::bulk::compress(column, 3).expect("a frame")).collect();
        for (frame, column) in frames.iter().zip(columns) {
            head.extend((frame.len() as u64).to_le_bytes());
            head.extend((column.len() as u64).to_le_bytes());
        }
        [head, frames.concat()].concat()
    }

    /// The payload of a file of version 2 or 3.
    fn unzipped(file: &[u8]) -> Vec<u8> {
        let mut payload = Vec::new();
        std::io::Read::read_to_end(&mut flate2::read::GzDecoder::new(file), &mut payload).expect("gzip");
        payload
    }

    fn start(bytes: &[u8]) -> Start {
        Start::of(&mut Cursor::new(bytes), Path::new("a.bin")).expect("memory")
    }

    #[test]
    fn every_version_holds_the_same_gaussians() {
        for version in 2..=4 {
            for degree in 0..=3 {
                let bytes = file(version, degree, 2, None);
                assert!(is_of(&start(&bytes)), "version {version} is recognized");
                let (columns, lost) = columns(&bytes).expect("a file");
                assert_eq!(columns.mean[1], [4097.0 / 4096.0, -1.0 / 4096.0, -2048.0], "24-bit numbers with a sign");
                assert!((columns.opacity_logit[0] - 0.25_f32.ln()).abs() < 1e-5, "51 of 255 is the opacity 0.2");
                assert_eq!(columns.log_scale[1], [-10.0, 0.0, 1.0], "sixteenths from -10");
                let colors = columns.harmonics.of(1);
                let expected = [-0.5 / 0.15, 0.5 / 0.15, 0.5 / 255.0 / 0.15];
                assert!(colors.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6), "{colors:?}, not {expected:?}");
                assert_eq!(colors.len(), (usize::from(degree) + 1).pow(2) * 3, "coefficients of degree {degree}");
                for (index, value) in colors[3..].iter().enumerate() {
                    assert_eq!(*value, index as f32 / 128.0, "value {index} behind degree 0");
                }
                let [w, x, y, z] = columns.rotation[0];
                assert!((w * w + x * x + y * y + z * z - 1.0).abs() < 0.01, "a rotation of length 1");
                assert!(columns.mip_filter, "the flag of the filter of Mip-Splatting is read");
                assert!(lost.is_empty(), "nothing is lost: {lost:?}");
            }
        }
    }

    #[test]
    fn rotations_of_both_encodings_are_w_x_y_z() {
        let [w, x, y, z] = three_components(ROTATIONS[0]);
        assert!(x == 1.0 && w == 0.0 && y.abs() < 0.01 && z.abs() < 0.01, "a half turn about x: {w} {x} {y} {z}");
        // y is the largest; x is +511/511, z is -(256/511), w is 3/511 of the square root of one half.
        let word = (1_u32 << 30) | 511 << 20 | (512 + 256) << 10 | 3;
        let half = std::f32::consts::FRAC_1_SQRT_2;
        let found = smallest_three(&word.to_le_bytes());
        let (w, x, z) = (3.0 / 511.0 * half, half, -256.0 / 511.0 * half);
        let expected = [w, x, (1.0 - w * w - x * x - z * z).sqrt(), z];
        assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6), "{found:?}, not {expected:?}");
    }

    /// The covariance of the first Gaussian.
    fn covariance(columns: &Columns) -> DMat3 {
        let [w, x, y, z] = columns.rotation[0].map(f64::from);
        let scale = DVec3::from(columns.log_scale[0].map(|scale| f64::from(scale).exp()));
        let factor = DMat3::from_quat(DQuat::from_xyzw(x, y, z, w).normalize()) * DMat3::from_diagonal(scale);
        factor * factor.transpose()
    }

    #[test]
    fn a_mirrored_coordinate_system_is_mirrored_back() {
        for version in 2..=4 {
            let (plain, _) = columns(&file(version, 3, 2, Some(4))).expect("RUB");
            let (unstated, _) = columns(&file(version, 3, 2, None)).expect("no record");
            assert_eq!(plain, unstated, "RUB is the default");
            // LUB: x to the left.
            let (mirrored, _) = columns(&file(version, 3, 2, Some(3))).expect("LUB");
            let [x, y, z] = plain.mean[1];
            assert_eq!(mirrored.mean[1], [-x, y, z], "x changes its sign");
            let axes = DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0));
            let expected = axes * covariance(&plain) * axes;
            assert!(covariance(&mirrored).abs_diff_eq(expected, 1e-5), "{}, not {expected}", covariance(&mirrored));
            for (k, is_odd) in [(1, false), (2, false), (3, true), (4, true), (5, false), (7, true), (15, true)] {
                let (found, sign) = (mirrored.harmonics.of(1)[k * 3 + 1], if is_odd { -1.0 } else { 1.0 });
                assert_eq!(found, sign * plain.harmonics.of(1)[k * 3 + 1], "coefficient {k}");
            }
            assert!(columns(&file(version, 0, 1, Some(17))).is_err(), "there is no system 17");
        }
    }

    #[test]
    fn the_band_of_degree_4_is_left_out_and_stated() {
        for version in 2..=4 {
            let (found, lost) = columns(&file(version, 4, 3, None)).expect("a file of degree 4");
            let (expected, _) = columns(&file(version, 3, 3, None)).expect("a file of degree 3");
            assert_eq!(found, expected, "the first three degrees");
            assert!(lost.iter().any(|lost| lost.contains("degree 4")), "the loss is stated: {lost:?}");
        }
    }

    #[test]
    fn a_file_that_is_cut_anywhere_is_refused() {
        for version in 2..=4 {
            for degree in [0, 1] {
                let whole = file(version, degree, 3, Some(1));
                for length in 0..whole.len() {
                    let found = columns(&whole[..length]);
                    assert!(found.is_err(), "version {version}, {length} of {} bytes", whole.len());
                }
            }
        }
        let payload = unzipped(&file(2, 1, 3, None));
        assert!(columns(&payload).is_ok(), "a payload without gzip is read");
        for length in 0..payload.len() {
            assert!(columns(&payload[..length]).is_err(), "{length} of {} bytes without gzip", payload.len());
        }
    }

    #[test]
    fn a_count_beyond_the_contents_of_the_file_is_refused() {
        for version in 2..=4 {
            for count in [4, 5, 70_000, u32::MAX] {
                let whole = file(version, 3, 3, None);
                let mut bytes = if version < 4 { unzipped(&whole) } else { whole };
                bytes[8..12].copy_from_slice(&count.to_le_bytes());
                let message = columns(&bytes).expect_err("3 Gaussians").to_string();
                let names_it = message.contains("Gaussians");
                assert!(names_it, "version {version}, {count} Gaussians: {message}");
                if version < 4 {
                    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
                    encoder.write_all(&bytes).expect("memory");
                    assert!(columns(&encoder.finish().expect("memory")).is_err(), "also inside gzip");
                }
            }
        }
    }

    #[test]
    fn other_versions_are_refused_by_their_number() {
        for version in [0, 1, 5] {
            let mut bytes = file(4, 0, 1, None);
            bytes[4] = version;
            let message = columns(&bytes).expect_err("unknown").to_string();
            assert!(message.contains(&format!("version {version}")), "the message names the version: {message}");
        }
    }

    #[test]
    fn up_is_y_unless_an_option_replaces_it() {
        let bytes = file(4, 1, 1, None);
        let beside = InMemory::default();
        let source = Source { bytes: &bytes, beside: &beside };
        for (up, expected) in [(None, UpAxis::PosY), (Some(UpAxis::NegY), UpAxis::NegY)] {
            let scene = read(&source, &ReadOptions { up, ..ReadOptions::default() }).expect("a file").scene;
            assert_eq!(scene.playback.up, expected, "the axis that points up");
            assert!(scene.trained_with.mip_filter, "the filter of the file is drawn");
            assert!(matches!(scene.form, SceneForm::Trained(_)), "Gaussians at rest are in the trained form");
        }
    }
}
