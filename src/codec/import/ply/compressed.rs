//! Compressed PLY, of `SuperSplat`: 16 bytes for each Gaussian, in chunks of 256 with a box of values each.
//!
//! In: the tables `chunk`, `vertex` and, for view-dependent color, `sh`. Out: [`Columns`] of Gaussians at rest.

use super::header::Comments;
use super::origin::{Places, place};
use super::splats::{degree, is_antialiased, rows};
use super::table::{Column, Table, row};
use crate::codec::import::columns::{Columns, coefficient, logit};
use crate::codec::import::error::ImportError;
use crate::gaussian::Harmonics;
use rayon::prelude::*;
use std::f32::consts::SQRT_2;

/// Gaussians of a chunk.
const CHUNK: usize = 256;

/// Reads Gaussians at rest, with the origin that is given or follows from their places. Sentences are added to `lost`.
///
/// # Errors
/// Chunks, or colors, of another number of Gaussians; a property that is missing.
pub(super) fn columns(
    tables: &[Table<'_>],
    vertex: &Table<'_>,
    comments: &Comments,
    origin: Option<[f64; 3]>,
    lost: &mut Vec<String>,
) -> Result<Columns, ImportError> {
    let named = |name: &str| tables.iter().find(|table| table.name == name);
    let chunk = named("chunk").ok_or_else(|| ImportError::damaged("is a compressed PLY without its element chunk"))?;
    let (count, chunks) = (vertex.len(), chunk.len());
    if chunks != count.div_ceil(CHUNK) {
        return Err(ImportError::damaged(format!("has {chunks} chunks of 256 Gaussians, but {count} Gaussians")));
    }
    let low = chunk.all(["min_x", "min_y", "min_z"])?;
    let high = chunk.all(["max_x", "max_y", "max_z"])?;
    let scale_low = chunk.all(["min_scale_x", "min_scale_y", "min_scale_z"])?;
    let scale_high = chunk.all(["max_scale_x", "max_scale_y", "max_scale_z"])?;
    let [position, rotation, scale, color] =
        vertex.all(["packed_position", "packed_rotation", "packed_scale", "packed_color"])?;
    let in_box = |word: u32, low: [f32; 3], high: [f32; 3]| -> [f32; 3] {
        let parts = parts(word);
        std::array::from_fn(|axis| low[axis] + parts[axis] * (high[axis] - low[axis]))
    };
    let log_scale =
        rows(vertex, |index| in_box(scale.u32(index), row(&scale_low, index / CHUNK), row(&scale_high, index / CHUNK)));
    let at = |index: usize| -> [f64; 3] {
        let parts = parts(position.u32(index)).map(f64::from);
        let (low, high) = (place(&low, index / CHUNK), place(&high, index / CHUNK));
        std::array::from_fn(|axis| low[axis] + parts[axis] * (high[axis] - low[axis]))
    };
    let places = Places { count, is_double: low.iter().all(Column::is_double), at: &at };
    let origin = places.origin(&log_scale, origin, lost);
    Ok(Columns {
        mean: rows(vertex, |index| match origin == [0.0; 3] {
            true => in_box(position.u32(index), row(&low, index / CHUNK), row(&high, index / CHUNK)),
            false => places.mean(index, origin),
        }),
        log_scale,
        rotation: rows(vertex, |index| quaternion(rotation.u32(index))),
        opacity_logit: rows(vertex, |index| logit(bytes(color.u32(index))[3])),
        harmonics: harmonics(tables, chunk, color, count)?,
        origin,
        mip_filter: is_antialiased(comments),
        ..Columns::default()
    })
}

/// Reads the colors of `count` Gaussians: red, green and blue in a word, in the boxes of the chunks if there are any;
/// higher degrees in a table of their own.
fn harmonics(
    tables: &[Table<'_>],
    chunk: &Table<'_>,
    color: Column<'_>,
    count: usize,
) -> Result<Harmonics, ImportError> {
    // Older files have no boxes of colors: their colors are from 0 to 1.
    let colors = if chunk.has("min_r") {
        Some((chunk.all(["min_r", "min_g", "min_b"])?, chunk.all(["max_r", "max_g", "max_b"])?))
    } else {
        None
    };
    let sh = tables.iter().find(|table| table.name == "sh");
    let (stored, degree) = sh.map_or(Ok((0, 0)), |sh| degree(sh.counted("f_rest")))?;
    let coefficients = (degree as usize + 1).pow(2);
    let mut rest = Vec::new();
    if let Some(sh) = sh {
        if sh.len() != count {
            return Err(ImportError::damaged(format!("has {} rows of colors, but {count} Gaussians", sh.len())));
        }
        let numbers = (0..3).flat_map(|channel| (0..coefficients - 1).map(move |k| channel * stored + k));
        rest = numbers.map(|number| sh.required(&format!("f_rest_{number}"))).collect::<Result<_, _>>()?;
    }
    let mut values = vec![0.0; count * coefficients * 3];
    values.par_chunks_exact_mut(coefficients * 3).enumerate().for_each(|(index, values)| {
        let mut rgb = bytes(color.u32(index));
        if let Some((low, high)) = &colors {
            let (low, high) = (row(low, index / CHUNK), row(high, index / CHUNK));
            for channel in 0..3 {
                rgb[channel] = low[channel] + rgb[channel] * (high[channel] - low[channel]);
            }
        }
        for channel in 0..3 {
            values[channel] = coefficient(rgb[channel]);
        }
        for (channel, columns) in rest.chunks_exact((coefficients - 1).max(1)).enumerate() {
            for (k, column) in columns.iter().enumerate() {
                values[(k + 1) * 3 + channel] = rest_value(column.u32(index));
            }
        }
    });
    Ok(Harmonics { coefficients, degree, degree_t: 0, values })
}

/// Returns the three fractions, from 0 to 1, in 11, 10 and 11 bits of a word.
fn parts(word: u32) -> [f32; 3] {
    [(word >> 21) as f32 / 2047.0, (word >> 11 & 1023) as f32 / 1023.0, (word & 2047) as f32 / 2047.0]
}

/// Returns the four fractions, from 0 to 1, in the bytes of a word, the highest byte first.
fn bytes(word: u32) -> [f32; 4] {
    word.to_be_bytes().map(|byte| f32::from(byte) / 255.0)
}

/// Returns the quaternion w, x, y, z of three components in 10 bits each and the index of the fourth, which is the
/// largest, in the highest two bits.
fn quaternion(word: u32) -> [f32; 4] {
    let largest = (word >> 30) as usize;
    let mut components = [20, 10, 0].map(|shift| ((word >> shift & 1023) as f32 / 1023.0 - 0.5) * SQRT_2).into_iter();
    let mut quaternion = [0.0; 4];
    let mut left = 1.0;
    for (index, to) in quaternion.iter_mut().enumerate() {
        if index != largest {
            *to = components.next().unwrap_or(0.0);
            left -= *to * *to;
        }
    }
    quaternion[largest] = left.max(0.0).sqrt();
    quaternion
}

/// Returns a coefficient above degree 0 from its byte. The ends are exact, the others are the middles of their steps.
fn rest_value(byte: u32) -> f32 {
    let part = match byte {
        0 => 0.0,
        255.. => 1.0,
        byte => (byte as f32 + 0.5) / 256.0,
    };
    (part - 0.5) * 8.0
}
