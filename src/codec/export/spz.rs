//! SPZ files of version 3, which readers of versions 2, 3 and 4 all read: one stream of gzip.
//!
//! In: [`Columns`] at rest. Out: 20 bytes for each Gaussian and one for each further value of its color, before gzip;
//! +Y up. Gaussians beyond [`farthest`] are left out before.

use super::clip::Clip;
use super::y_up::y_up;
use crate::codec::import::columns::Columns;
use flate2::Compression;
use flate2::write::GzEncoder;
use glam::Vec4;
use std::io::{self, BufWriter, Write};

/// The largest position in steps, which has 24 bits with the sign.
const LARGEST: f32 = 8_388_607.0;

/// Most fractional bits of a position. Other writers use 12, chosen for larger Gaussians.
const FRACTIONAL_BITS: u8 = 16;

/// Sufficient number of position steps in the size of the median Gaussian.
const STEPS: f32 = 4.0;
/// At most one of this many Gaussians may be left out so that the others have such steps.
const FEW: usize = 100;

/// The flag of files trained with the screen-space filter of Mip-Splatting.
const ANTIALIASED: u8 = 1;

/// Returns the farthest coordinate that a file of these Gaussians holds, capture units: the largest of 24 bits with
/// steps fine enough for the median Gaussian, or with steps of 1 unit if more than a few Gaussians are beyond.
pub(super) fn farthest(columns: &Columns) -> f32 {
    let size = |scales: &[f32; 3]| scales.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    let mut sizes: Vec<f32> = columns.log_scale.iter().map(size).collect();
    let middle = sizes.len() / 2;
    if sizes.is_empty() {
        return LARGEST;
    }
    let median = sizes.select_nth_unstable_by(middle, f32::total_cmp).1.exp();
    let bits = (STEPS / median).log2().ceil().clamp(0.0, f32::from(FRACTIONAL_BITS));
    let limit = LARGEST / bits.exp2();
    let beyond = columns.mean.iter().filter(|mean| !mean.iter().all(|value| value.abs() <= limit)).count();
    if beyond * FEW <= columns.len() { limit } else { LARGEST }
}

/// Writes Gaussians at rest.
///
/// # Errors
/// Errors of the writer; more than 2³² Gaussians; a position beyond 8 million units.
pub(super) fn write(columns: &Columns, clip: &Clip, writer: &mut dyn Write) -> io::Result<()> {
    let invalid = |reason: &str| io::Error::new(io::ErrorKind::InvalidInput, reason);
    let columns = &*y_up(columns, clip.up)?;
    let count = u32::try_from(columns.len()).map_err(|_| invalid("an SPZ file has at most 4294967295 Gaussians"))?;
    let largest = columns.mean.as_flattened().iter().fold(0.0_f32, |most, value| most.max(value.abs()));
    let fits = |bits: &u8| largest * f32::from(*bits).exp2() <= LARGEST;
    let fractional_bits = (0..=FRACTIONAL_BITS).rev().find(fits);
    let fractional_bits = fractional_bits.ok_or_else(|| invalid("an SPZ file has no position beyond 8388607 units"))?;
    let mut writer = BufWriter::new(GzEncoder::new(writer, Compression::default()));
    writer.write_all(b"NGSP")?;
    writer.write_all(&3_u32.to_le_bytes())?;
    writer.write_all(&count.to_le_bytes())?;
    let flags = if columns.mip_filter { ANTIALIASED } else { 0 };
    writer.write_all(&[columns.harmonics.degree as u8, fractional_bits, flags, 0])?;
    let factor = f32::from(fractional_bits).exp2();
    for value in columns.mean.as_flattened() {
        let fixed = (value * factor).round().clamp(-LARGEST, LARGEST) as i32;
        writer.write_all(&fixed.to_le_bytes()[..3])?;
    }
    for logit in &columns.opacity_logit {
        writer.write_all(&[byte(255.0 / (1.0 + (-logit).exp()))])?;
    }
    let colors = |index: usize| columns.harmonics.of(index);
    for index in 0..columns.len() {
        for value in &colors(index)[..3] {
            writer.write_all(&[byte(255.0 * (0.15 * value + 0.5))])?;
        }
    }
    for log_scale in columns.log_scale.as_flattened() {
        writer.write_all(&[byte((log_scale + 10.0) * 16.0)])?;
    }
    for rotation in &columns.rotation {
        writer.write_all(&smallest_three(*rotation).to_le_bytes())?;
    }
    for index in 0..columns.len() {
        for (place, &value) in colors(index).iter().enumerate().skip(3) {
            // The precision of the format's own library: 5 bits of degree 1, 4 of the others.
            let step = if place < 4 * 3 { 8.0 } else { 16.0 };
            writer.write_all(&[byte(((value * 128.0 + 128.0) / step).round() * step)])?;
        }
    }
    writer.into_inner()?.finish()?.flush()
}

/// Returns the byte nearest to a value.
fn byte(value: f32) -> u8 {
    value.round().clamp(0.0, 255.0) as u8
}

/// Returns the index of the largest of x, y, z, w in two bits, then a sign and nine bits for each of the others.
fn smallest_three([w, x, y, z]: [f32; 4]) -> u32 {
    let components = Vec4::new(x, y, z, w).normalize_or(Vec4::W);
    let largest = components.abs().max_position();
    let components = if components[largest] < 0.0 { -components } else { components };
    (0..4).filter(|&index| index != largest).fold(largest as u32, |word, index| {
        let component = components[index];
        let magnitude = (component.abs() * std::f32::consts::SQRT_2 * 511.0).round().min(511.0) as u32;
        word << 10 | u32::from(component < 0.0) << 9 | magnitude
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::codec::export::samples;
    use crate::codec::import::spz;
    use crate::scene::UpAxis;

    fn written(columns: &Columns, up: UpAxis) -> Vec<u8> {
        let mut bytes = Vec::new();
        write(columns, &samples::clip(up), &mut bytes).expect("memory");
        bytes
    }

    #[test]
    fn a_file_that_is_read_back_has_the_same_gaussians() {
        for degree in 0..=3 {
            let columns = samples::columns(20, degree);
            let (found, lost) = spz::columns(&written(&columns, UpAxis::PosY)).expect("a file");
            assert!(lost.is_empty(), "nothing is lost: {lost:?}");
            samples::assert_alike(
                &found,
                &columns,
                &samples::Tolerance {
                    mean: 1e-5,
                    log_scale: 0.0314,
                    rotation: 0.004,
                    opacity: 0.002,
                    color: 0.0132,
                    harmonics: 0.0626,
                },
            );
        }
    }

    #[test]
    fn another_axis_is_rotated_to_y_with_the_colors() {
        let columns = samples::columns(20, 3);
        let (found, _) = spz::columns(&written(&columns, UpAxis::NegY)).expect("a file");
        for (found, mean) in found.mean.iter().zip(&columns.mean) {
            let differ = [found[0] - mean[0], found[1] + mean[1], found[2] + mean[2]];
            assert!(differ.iter().all(|differ| differ.abs() < 1e-5), "half a turn about x: {found:?} from {mean:?}");
        }
        let (value, expected) = (found.harmonics.of(3)[3], -columns.harmonics.of(3)[3]);
        assert!((value - expected).abs() < 0.04, "the harmonic along y is negated: {value}, not {expected}");
    }

    #[test]
    fn far_positions_reduce_the_fractional_bits() {
        let mut columns = samples::columns(2, 0);
        columns.mean[0][1] = -5000.0;
        let (found, _) = spz::columns(&written(&columns, UpAxis::PosY)).expect("a file");
        assert_eq!(found.mean[0][1], -5000.0, "a position beyond 128 units");
        columns.mean[0][1] = 1e9;
        let refused = write(&columns, &samples::clip(UpAxis::PosY), &mut Vec::new());
        assert!(refused.is_err(), "a position beyond 24 bits");
    }

    #[test]
    fn few_far_positions_do_not_reduce_the_fractional_bits() {
        let with_far = |count: usize, far: usize| {
            let mut columns = samples::columns(count, 0);
            columns.log_scale = vec![[-6.0, -4.0, -5.0]; count];
            columns.mean.iter_mut().take(far).for_each(|mean| mean[2] = -1e6);
            farthest(&columns)
        };
        // e^-4 is 0.018: 4 steps need 8 fractional bits.
        assert_eq!(with_far(300, 0), 8_388_607.0 / 256.0, "fine steps");
        assert_eq!(with_far(300, 3), 8_388_607.0 / 256.0, "3 of 300 are left out");
        assert_eq!(with_far(300, 4), 8_388_607.0, "more are kept, with coarser steps");
        assert_eq!(farthest(&Columns::default()), 8_388_607.0, "no Gaussians");
    }

    #[test]
    fn the_filter_of_mip_splatting_is_a_flag_of_the_file() {
        for mip_filter in [false, true] {
            let columns = Columns { mip_filter, ..samples::columns(3, 0) };
            let (found, _) = spz::columns(&written(&columns, UpAxis::NegY)).expect("a file");
            assert_eq!(found.mip_filter, mip_filter, "the flag is read back");
        }
    }
}
