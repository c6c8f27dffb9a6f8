//! The properties of 3DGS, which most layouts have.
//!
//! In: a table with means, scales, rotations, opacities and colors by the names of the original trainer. Out:
//! [`Columns`] of Gaussians at rest.

use super::header::Comments;
use super::origin::{Places, place};
use super::table::{Column, Table, row};
use crate::codec::import::columns::{Columns, coefficient, logit};
use crate::codec::import::error::ImportError;
use crate::gaussian::Harmonics;
use rayon::prelude::*;

/// Fewest rows of a thread.
const ROWS: usize = 4096;
/// The properties of colors without coefficients.
pub(super) const PLAIN: [&str; 3] = ["red", "green", "blue"];

/// Reads Gaussians at rest, with the origin that is given or follows from their places. Sentences are added to `lost`.
///
/// # Errors
/// A property that is missing; coefficients of no known degree.
pub(super) fn columns(
    table: &Table<'_>,
    comments: &Comments,
    origin: Option<[f64; 3]>,
    lost: &mut Vec<String>,
) -> Result<Columns, ImportError> {
    let (mean, scale) = (table.all(["x", "y", "z"])?, table.numbered::<3>("scale")?);
    let (rotation, [opacity]) = (table.numbered::<4>("rot")?, table.all(["opacity"])?);
    let log_scale = rows(table, |index| row(&scale, index));
    let at = |index| place(&mean, index);
    let places = Places { count: table.len(), is_double: mean.iter().all(Column::is_double), at: &at };
    let origin = places.origin(&log_scale, origin, lost);
    let mut columns = Columns {
        mean: rows(table, |index| places.mean(index, origin)),
        log_scale,
        rotation: rows(table, |index| row(&rotation, index)),
        opacity_logit: rows(table, |index| opacity.f32(index)),
        harmonics: harmonics(table, lost)?,
        origin,
        mip_filter: is_antialiased(comments),
        ..Columns::default()
    };
    if let Some(filter) = table.column("filter_3D") {
        fuse(&mut columns, filter);
    }
    Ok(columns)
}

/// Returns one value for each row.
pub(super) fn rows<T: Send>(table: &Table<'_>, value: impl Fn(usize) -> T + Sync + Send) -> Vec<T> {
    (0..table.len()).into_par_iter().with_min_len(ROWS).map(value).collect()
}

/// Reads the colors. Coefficients above degree 0 lie channel after channel in the file.
fn harmonics(table: &Table<'_>, lost: &mut Vec<String>) -> Result<Harmonics, ImportError> {
    if has_plain_colors(table) {
        return plain_colors(table);
    }
    let first = table.numbered::<3>("f_dc")?;
    let (stored, degree) = degree(table.counted("f_rest"))?;
    let coefficients = (degree as usize + 1).pow(2);
    if stored >= coefficients {
        lost.push("Color of degree 4 is left out: colors are of degree 3 at most.".to_owned());
    }
    let names = (0..3).flat_map(|channel| (0..coefficients - 1).map(move |k| channel * stored + k));
    let rest = names.map(|number| table.required(&format!("f_rest_{number}"))).collect::<Result<Vec<_>, _>>()?;
    let mut values = vec![0.0; table.len() * coefficients * 3];
    values.par_chunks_exact_mut(coefficients * 3).with_min_len(ROWS).enumerate().for_each(|(index, colors)| {
        for (channel, column) in first.iter().enumerate() {
            colors[channel] = column.f32(index);
        }
        for (channel, columns) in rest.chunks_exact((coefficients - 1).max(1)).enumerate() {
            for (k, column) in columns.iter().enumerate() {
                colors[(k + 1) * 3 + channel] = column.f32(index);
            }
        }
    });
    Ok(Harmonics { coefficients, degree, degree_t: 0, values })
}

/// Returns whether the colors are red, green and blue, as nerfstudio writes them on demand, in place of coefficients.
pub(super) fn has_plain_colors(table: &Table<'_>) -> bool {
    !table.has("f_dc_0") && PLAIN.iter().all(|name| table.has(name))
}

/// Reads colors from 0 to 1 or, in bytes, to 255 as coefficients of degree 0.
fn plain_colors(table: &Table<'_>) -> Result<Harmonics, ImportError> {
    let colors = table.all(PLAIN)?;
    let rgb = rows(table, |index| colors.map(|column| coefficient(column.share(index))));
    Ok(Harmonics { coefficients: 1, degree: 0, degree_t: 0, values: rgb.into_flattened() })
}

/// Returns the coefficients above degree 0 that a file with this number of `f_rest` properties has for each channel,
/// and the degree that is read.
pub(super) fn degree(rest: usize) -> Result<(usize, u32), ImportError> {
    match rest {
        0 => Ok((0, 0)),
        9 => Ok((3, 1)),
        24 => Ok((8, 2)),
        45 => Ok((15, 3)),
        72 => Ok((24, 3)),
        _ => Err(ImportError::damaged(format!(
            "has {rest} properties f_rest, which is no degree of color (0, 9, 24 and 45 are degrees 0 to 3)"
        ))),
    }
}

/// Adds the variance of the 3D filter of Mip-Splatting; opacities decrease by the ratio of the volumes.
fn fuse(columns: &mut Columns, filter: Column<'_>) {
    let all = columns.log_scale.par_iter_mut().zip(&mut columns.opacity_logit).enumerate();
    all.for_each(|(index, (log_scale, opacity_logit))| {
        let filter = f64::from(filter.f32(index));
        let mut factor = 1.0;
        for value in log_scale {
            let scale = f64::from(*value).exp();
            let wider = scale.hypot(filter);
            if wider > 0.0 {
                factor *= scale / wider;
            }
            *value = wider.ln() as f32;
        }
        let opacity = 1.0 / (1.0 + (-f64::from(*opacity_logit)).exp());
        *opacity_logit = logit((opacity * factor) as f32);
    });
}

/// Returns whether the header states training with the screen-space filter of Mip-Splatting; the last comment decides.
pub(super) fn is_antialiased(comments: &Comments) -> bool {
    let states = |comment: &String| {
        let one = Comments(vec![comment.to_ascii_lowercase()]);
        let mode = one.value("splatrendermode").map(|mode| mode == "mip");
        mode.or_else(|| one.value("antialiased").map(|flag| flag == "1" || flag == "true"))
    };
    comments.0.iter().rev().find_map(states).unwrap_or(false)
}
