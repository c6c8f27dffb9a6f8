//! `.splat` files: 32 bytes for each Gaussian at rest, without a header.
//!
//! In: the bytes of a file, whose length is a multiple of 32. Out: its scene: mean and scales as floats, color and opacity as four bytes, the rotation
//! (w, x, y, z) as four bytes around 128. Color is not view-dependent.

use super::columns::{Columns, Played, coefficient, logit};
use super::drawable::keep_drawable;
use super::error::ImportError;
use super::imported::Imported;
use super::source::Source;
use crate::codec::options::ReadOptions;
use crate::scene::UpAxis;

/// Bytes of a Gaussian.
const RECORD: usize = 32;

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
        let float = |index: usize| {
            record
                .get(index * 4..)
                .and_then(|bytes| bytes.first_chunk())
                .map_or(0.0, |&bytes| f32::from_le_bytes(bytes))
        };
        let [red, green, blue, opacity] = [24, 25, 26, 27].map(|byte| f32::from(record[byte]) / 255.0);
        columns.mean.push([0, 1, 2].map(float));
        columns.log_scale.push([3, 4, 5].map(|index| float(index).ln()));
        columns.harmonics.values.extend([red, green, blue].map(coefficient));
        columns.opacity_logit.push(logit(opacity));
        columns.rotation.push([28, 29, 30, 31].map(|byte| (f32::from(record[byte]) - 128.0) / 128.0));
    }
    let lost = keep_drawable(&mut columns).into_iter().collect();
    Ok(Imported { scene: columns.into_scene(Played::still(UpAxis::NegY), options)?, lost })
}
