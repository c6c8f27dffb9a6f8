//! Layouts of Gaussians on curved paths: Spacetime Gaussians without a decoder ("lite"), and the interchange PLY of
//! `.sogst` with an acceleration.
//!
//! In: the table of a file. Out: lifespans, and the [`Bend`]s of the paths.

use super::layout::Layout;
use super::splats::rows;
use super::table::{Table, row};
use crate::codec::import::columns::{Columns, Motion, Played, coefficient};
use crate::codec::import::cubic::{Bend, sigma_of_width, spacetime_clip};
use crate::codec::import::error::ImportError;
use crate::codec::options::ReadOptions;

/// Reads the lifespans and the velocities of Spacetime Gaussians, whose clip goes from 0 to 1.
///
/// # Errors
/// A property that is missing.
pub(super) fn lifespans(
    table: &Table<'_>,
    options: &ReadOptions,
    lost: &mut Vec<String>,
) -> Result<(Vec<Motion>, Played), ImportError> {
    let velocity = table.numbered::<3>("motion")?;
    let [center, scale] = table.all(["trbf_center", "trbf_scale"])?;
    let motion = rows(table, |index| Motion {
        velocity: row(&velocity, index),
        mean_t: center.f32(index),
        sigma_t: sigma_of_width(scale.f32(index).exp()),
    });
    Ok((motion, spacetime_clip(options, lost)))
}

/// Reads how paths differ from straight lines; `None` for layouts of straight lines.
///
/// # Errors
/// A property that is missing.
pub(super) fn bends(layout: Layout, table: &Table<'_>) -> Result<Option<Vec<Bend>>, ImportError> {
    match layout {
        Layout::Spacetime => {
            let (motion, turn) = (table.numbered::<9>("motion")?, table.numbered::<4>("omega")?);
            let bend = |index| {
                let [_, _, _, second @ .., a, b, c] = row(&motion, index);
                Bend { second, third: [a, b, c], turn: row(&turn, index) }
            };
            Ok(Some(rows(table, bend)))
        }
        Layout::SogstCurved => {
            let acceleration = table.all(["ax", "ay", "az"])?;
            Ok(Some(rows(table, |index| Bend { second: row(&acceleration, index), ..Bend::default() })))
        }
        _ => Ok(None),
    }
}

/// Changes the colors of Spacetime Gaussians, which are red, green and blue from 0 to 1, to coefficients.
pub(super) fn decode_colors(columns: &mut Columns) {
    columns.harmonics.values.iter_mut().for_each(|value| *value = coefficient(*value));
}
