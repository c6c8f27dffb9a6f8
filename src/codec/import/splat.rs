//! `.splat` files: 32 bytes for each Gaussian at rest, without a header.
//!
//! In: the bytes of a file, whose length is a multiple of 32. Out: its scene: mean and scales as floats, color and
//! opacity as four bytes, the rotation (w, x, y, z) as four bytes around 128. Color is not view-dependent.

use super::columns::{Columns, Played, coefficient, logit};
use super::drawable::keep_drawable;
use super::error::ImportError;
use super::imported::Imported;
use super::source::Source;
use crate::codec::looks;
use crate::codec::options::ReadOptions;
use crate::codec::start::Start;
use crate::scene::UpAxis;

/// Extensions of these files.
pub(crate) const EXTENSIONS: &[&str] = &["splat"];
/// Bytes of a Gaussian.
const RECORD: usize = 32;
/// Largest coordinate, and smallest and largest scale, of a file recognized by its numbers alone, capture units.
const FARTHEST: f32 = 1e6;
const SCALES: [f32; 2] = [1e-9, 1e5];

/// Returns whether a file that starts so is such a file: by its name, unless it is certainly something else, or by its
/// numbers, if each of its first records has plausible ones.
pub(crate) fn is_of(start: &Start) -> bool {
    let is_named = start.extension == "splat" && !start.bytes.is_empty() && !looks::is_other(start);
    let records = start.bytes.as_chunks::<RECORD>().0;
    let is_whole = !records.is_empty() && start.length.is_multiple_of(RECORD as u64);
    is_named || (is_whole && records.iter().all(is_plausible))
}

/// Returns whether the numbers of a record are those of a Gaussian: scales above 0, a rotation near unit length.
fn is_plausible(record: &[u8; RECORD]) -> bool {
    let length = rotation(record).iter().map(|component| component * component).sum::<f32>().sqrt();
    [0, 1, 2].into_iter().all(|index| float(record, index).abs() < FARTHEST)
        && [3, 4, 5].into_iter().all(|index| (SCALES[0]..SCALES[1]).contains(&float(record, index)))
        && (length - 1.0).abs() < 0.05
}

/// Returns a number of a record by its index.
fn float(record: &[u8; RECORD], index: usize) -> f32 {
    record.as_chunks::<4>().0.get(index).map_or(0.0, |&bytes| f32::from_le_bytes(bytes))
}

/// Returns the rotation of a record, w, x, y, z.
fn rotation(record: &[u8; RECORD]) -> [f32; 4] {
    [28, 29, 30, 31].map(|byte| (f32::from(record[byte]) - 128.0) / 128.0)
}

/// Reads a file.
///
/// # Errors
/// A length that is no number of Gaussians; invalid options.
pub(crate) fn read(source: &Source<'_>, options: &ReadOptions) -> Result<Imported, ImportError> {
    let (records, rest) = source.bytes.as_chunks::<RECORD>();
    if !rest.is_empty() {
        return Err(ImportError::damaged(format!(
            "is {} bytes long, no multiple of the 32 bytes of a Gaussian: it is cut, or no .splat file",
            source.bytes.len()
        )));
    }
    let mut columns = Columns::with_capacity(records.len(), 0);
    for record in records {
        let float = |index: usize| float(record, index);
        let [red, green, blue, opacity] = [24, 25, 26, 27].map(|byte| f32::from(record[byte]) / 255.0);
        columns.mean.push([0, 1, 2].map(float));
        columns.log_scale.push([3, 4, 5].map(|index| float(index).ln()));
        columns.harmonics.values.extend([red, green, blue].map(coefficient));
        columns.opacity_logit.push(logit(opacity));
        columns.rotation.push(rotation(record));
    }
    let lost = keep_drawable(&mut columns).into_iter().collect();
    Ok(Imported { scene: columns.into_scene(Played::still(UpAxis::NegY), options)?, lost })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a record with this scale and a rotation of this length.
    fn record(scale: f32, length: f32) -> Vec<u8> {
        let numbers = [1.0, -2.0, 3.0, scale, scale, scale].map(f32::to_le_bytes);
        let half = (128.0 + 64.0 * length) as u8;
        [numbers.as_flattened(), &[200, 100, 50, 255, half, half, half, half]].concat()
    }

    fn start(bytes: &[u8], extension: &str) -> Start {
        let (bytes, length) = (bytes.to_vec(), bytes.len() as u64);
        Start { bytes, length, extension: extension.to_owned(), ..Start::default() }
    }

    #[test]
    fn a_file_is_recognized_by_its_numbers_whatever_its_name() {
        let file = record(0.01, 1.0).repeat(3);
        for extension in ["splat", "bin", "", "ply"] {
            assert!(is_of(&start(&file, extension)), "three Gaussians as .{extension}");
        }
        for (other, about) in [
            (&file[..50], "a record that is cut"),
            (&record(-1.0, 1.0), "a negative scale"),
            (&record(0.01, 0.5), "a rotation that is too short"),
            (&[0; 64], "zeros"),
            (b"", "nothing"),
        ] {
            assert!(!is_of(&start(other, "bin")), "{about} is no .splat file");
        }
    }

    #[test]
    fn a_file_named_splat_with_the_bytes_of_another_format_is_not_recognized() {
        assert!(is_of(&start(&record(-1.0, 0.0), "splat")), "odd numbers");
        for other in
            [&b"<!DOCTYPE html>"[..], b"version https://git-lfs.github.com/spec/v1\n", b"\x89PNG\r\n\x1a\n", b""]
        {
            assert!(!is_of(&start(other, "splat")), "{other:?}");
        }
    }
}
