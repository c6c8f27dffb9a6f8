//! `.ply4d` of `bevy_gaussian_splatting`: native 4D Gaussians, with activated values.
//!
//! In: the table of a file. Out: [`Trained`] with the trainer's raw parameters.

use super::origin::{Places, place};
use super::splats::rows;
use super::table::{Column, Table, row};
use crate::codec::import::columns::logit;
use crate::codec::import::error::ImportError;
use crate::gaussian::{Harmonics, Parameters};
use crate::scene::Trained;
use rayon::prelude::*;

/// Scales are raised to this one: the logarithm of 0 is not finite.
const SMALLEST: f32 = 1e-12;

/// Reads native 4D Gaussians. Also returns the origin of their means, which is given or follows from their places;
/// sentences about it are added to `lost`.
///
/// # Errors
/// A property that is missing; coefficients of no known degree.
pub(super) fn trained(
    table: &Table<'_>,
    origin: Option<[f64; 3]>,
    lost: &mut Vec<String>,
) -> Result<(Trained, [f64; 3]), ImportError> {
    let (mean, [mean_t]) = (table.all(["x", "y", "z"])?, table.all(["t"])?);
    let (scale, [scale_t]) = (table.all(["sx", "sy", "sz"])?, table.all(["st"])?);
    // The property that is called x is the first component, w.
    let left = table.all(["rot_x", "rot_y", "rot_z", "rot_w"])?;
    let right = table.all(["rot_r_x", "rot_r_y", "rot_r_z", "rot_r_w"])?;
    let [opacity] = table.all(["opacity"])?;
    let log = |scale: f32| scale.max(SMALLEST).ln();
    let log_scale = rows(table, |index| row(&scale, index).map(log));
    let at = |index| place(&mean, index);
    let places = Places { count: table.len(), is_double: mean.iter().all(Column::is_double), at: &at };
    let origin = places.origin(&log_scale, origin, lost);
    let parameters = Parameters {
        mean: rows(table, |index| places.mean(index, origin)),
        mean_t: rows(table, |index| mean_t.f32(index)),
        log_scale,
        log_scale_t: rows(table, |index| log(scale_t.f32(index))),
        rotation_l: rows(table, |index| row(&left, index)),
        rotation_r: rows(table, |index| row(&right, index)),
        opacity_logit: rows(table, |index| logit(opacity.f32(index))),
    };
    Ok((Trained { parameters, harmonics: harmonics(table)? }, origin))
}

fn harmonics(table: &Table<'_>) -> Result<Harmonics, ImportError> {
    let coefficients = table.counted("feat_r");
    let (degree, degree_t) = match coefficients {
        1 => (0, 0),
        4 => (1, 0),
        9 => (2, 0),
        16 => (3, 0),
        32 => (3, 1),
        48 => (3, 2),
        _ => {
            return Err(ImportError::damaged(format!(
                "has {coefficients} properties feat_r, which is no degree of color (1, 4, 9, 16, 32 or 48)"
            )));
        }
    };
    let names = (0..coefficients).flat_map(|k| ["r", "g", "b"].map(|channel| format!("feat_{channel}_{k}")));
    let columns = names.map(|name| table.required(&name)).collect::<Result<Vec<_>, _>>()?;
    let mut values = vec![0.0; table.len() * coefficients * 3];
    values.par_chunks_exact_mut(coefficients * 3).enumerate().for_each(|(index, colors)| {
        for (value, column) in colors.iter_mut().zip(&columns) {
            *value = column.f32(index);
        }
    });
    Ok(Harmonics { coefficients, degree, degree_t, values })
}
