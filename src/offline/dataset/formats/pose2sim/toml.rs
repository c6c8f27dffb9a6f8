//! Calibrations in TOML, as Pose2Sim and Anipose write them.
//!
//! In: a file with a table for each camera: `name`, `size`, `matrix`, `distortions`, `rotation` (a rotation vector),
//! `translation`, `fisheye`. Out: the cameras.

use crate::codec::text::{printable, without_mark};
use crate::offline::dataset::cameras::distortion::Distortion;
use crate::offline::dataset::cameras::lens::checked_size;
use crate::offline::dataset::cameras::opencv;
use crate::offline::dataset::formats::files::utf8_or_latin1;
use crate::offline::dataset::formats::footage::{Calibration, RigCamera};
use crate::offline::dataset::{DatasetError, FrameProblem};
use std::path::Path;
use toml_edit::{Document, Item, TableLike, Value};

/// The entry without which a table is no camera.
const MATRIX: &str = "matrix";

/// Reads a calibration.
///
/// # Errors
/// A file that cannot be read, is no TOML or has no cameras; an entry that is missing or wrong.
pub(super) fn read(path: &Path) -> Result<Calibration, DatasetError> {
    let unusable = |reason: String| DatasetError::Unusable { path: path.to_owned(), reason };
    let bytes = Calibration::bytes(path)?;
    let text = utf8_or_latin1(without_mark(&bytes));
    let document = Document::parse(&*text).map_err(|error| {
        let before = error.span().and_then(|span| text.as_bytes().get(..span.start)).unwrap_or_default();
        let line = before.iter().filter(|byte| **byte == b'\n').count() + 1;
        unusable(format!("line {line}: no TOML, {}: write it again with Pose2Sim", printable(error.message())))
    })?;
    let tables = document.as_table().iter().filter_map(|(key, item)| Some((key, item.as_table_like()?)));
    let cameras = tables.filter(|(_, table)| table.contains_key(MATRIX)).map(|(key, table)| {
        camera(key, table).map_err(|reason| unusable(format!("camera [{}]: {reason}", printable(key))))
    });
    let cameras = cameras.collect::<Result<Vec<_>, _>>()?;
    if cameras.is_empty() {
        let reason = format!("no table in it has a {MATRIX}: it is no calibration, as Pose2Sim writes it");
        return Err(unusable(reason));
    }
    Ok(Calibration { source: path.to_owned(), cameras, notes: Vec::new() })
}

/// Returns the camera of a table, which has the name of the table unless it has its own.
fn camera(key: &str, table: &dyn TableLike) -> Result<RigCamera, String> {
    let named = |problem: FrameProblem| problem.to_string();
    let size = match numbers(table, "size")? {
        None => None,
        Some(sides) => {
            let [width, height] = exactly(sides, "size")?;
            Some(checked_size(width, height).map_err(named)?)
        }
    };
    let matrix: [f64; 9] = required(table, MATRIX)?;
    let (rotation, translation) = (required(table, "rotation")?, required(table, "translation")?);
    let coefficients = numbers(table, "distortions")?.unwrap_or_default();
    let fisheye = table.get("fisheye").and_then(Item::as_bool).unwrap_or(false);
    let distortion = if fisheye { fisheye_distortion(&coefficients) } else { opencv::distortion(&coefficients) };
    Ok(RigCamera {
        name: table.get("name").and_then(Item::as_str).unwrap_or(key).to_owned(),
        size,
        world_to_camera: opencv::pose_of_vector(rotation, translation).map_err(named)?,
        lens: opencv::own_lens(&matrix).map_err(named)?,
        distortion: distortion.map_err(named)?,
    })
}

/// Returns the distortion of a fisheye lens: k1 to k4, and zeros.
fn fisheye_distortion(coefficients: &[f64]) -> Result<Distortion, FrameProblem> {
    match coefficients {
        &[k1, k2, k3, k4, ref rest @ ..] if rest.iter().all(|value| *value == 0.0) => {
            Ok(Distortion { fisheye: true, radial: [k1, k2, k3, k4], ..Distortion::default() })
        }
        [] => Ok(Distortion { fisheye: true, ..Distortion::default() }),
        _ => Err(FrameProblem::Coefficients(coefficients.len())),
    }
}

/// Returns the numbers of an entry, which must be there.
fn required<const N: usize>(table: &dyn TableLike, name: &str) -> Result<[f64; N], String> {
    exactly(numbers(table, name)?.ok_or_else(|| format!("it has no {name}: add it"))?, name)
}

fn exactly<const N: usize>(numbers: Vec<f64>, name: &str) -> Result<[f64; N], String> {
    numbers.try_into().map_err(|numbers: Vec<f64>| format!("its {name} has {} numbers, not {N}", numbers.len()))
}

/// Returns the numbers of an entry, which are a list, or lists in a list, row by row.
fn numbers(table: &dyn TableLike, name: &str) -> Result<Option<Vec<f64>>, String> {
    let Some(item) = table.get(name) else { return Ok(None) };
    let array = item.as_array().ok_or_else(|| format!("its {name} is no list of numbers"))?;
    let mut numbers = Vec::new();
    for value in array.iter() {
        match value.as_array() {
            Some(row) => numbers.extend(row.iter().map(number)),
            None => numbers.push(number(value)),
        }
    }
    let numbers: Option<Vec<f64>> = numbers.into_iter().collect();
    numbers.map(Some).ok_or_else(|| format!("its {name} has a value that is no finite number"))
}

fn number(value: &Value) -> Option<f64> {
    let number = value.as_float().or_else(|| value.as_integer().map(|whole| whole as f64));
    number.filter(|number| number.is_finite())
}
