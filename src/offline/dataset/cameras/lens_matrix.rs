//! Lenses that a camera file has as a matrix.
//!
//! In: the JSON of a frame and of its whole file, which may have a matrix `K`, `intrinsics` or `camera_intrinsics`. Out:
//! the lens of the frame, in pixels.
//!
//! A matrix is a list of rows, or of its nine numbers, row by row or column by column; or fx, fy, cx and cy, as a list
//! or by name.

use super::lens::{LensEntries, OriginalLens};
use super::opencv;
use crate::offline::dataset::FrameProblem;
use glam::DVec2;
use serde_json::Value;

/// The names of the matrix.
const NAMES: [&str; 3] = ["K", "intrinsics", "camera_intrinsics"];
/// The names of its numbers.
const NUMBERS: [&str; 4] = ["fx", "fy", "cx", "cy"];
const FORM: &str =
    "of the lens must be three rows of three numbers, its nine numbers in one list, or fx, fy, cx and cy";

/// Returns the lens of a frame: by its own entries or else its own matrix, then by those of the file.
pub(crate) fn of_frame(
    frame: &Value,
    own: &LensEntries,
    file: &Value,
    shared: &LensEntries,
) -> Result<OriginalLens, FrameProblem> {
    let [of_frame, of_file] = [frame, file].map(|from| matrix(from).map(of_value));
    if let (Some(Ok(lens)), None) = (&of_frame, own.intrinsics()) {
        return Ok(*lens);
    }
    // Where other entries are enough, an entry of another form and the same name is none of a lens.
    match (own.or(shared).lens(), of_frame.or(of_file)) {
        (Err(FrameProblem::NoLens), Some(lens)) => lens,
        (lens, _) => lens,
    }
}

/// Returns the lens of a matrix.
pub(crate) fn of_value(value: &Value) -> Result<OriginalLens, FrameProblem> {
    let numbers = numbers(value).unwrap_or_default();
    if let &[fx, fy, cx, cy] = &numbers[..] {
        return Ok(OriginalLens::Intrinsics { focal: DVec2::new(fx, fy), center: DVec2::new(cx, cy) });
    }
    let matrix = <[f64; 9]>::try_from(numbers).map_err(|_| FrameProblem::Matrix(FORM.into()))?;
    let [a, b, c, d, e, f, g, h, i] = matrix;
    // The last row of a matrix is 0 0 1, so that other numbers there are those of the last column.
    let is_by_columns = [c, f] == [0.0; 2] && [g, h] != [0.0; 2];
    opencv::lens(&if is_by_columns { [a, d, g, b, e, h, c, f, i] } else { matrix })
}

/// Returns the entry of the matrix; `null` is no entry.
fn matrix(of: &Value) -> Option<&Value> {
    NAMES.iter().filter_map(|name| of.get(name)).find(|value| !value.is_null())
}

/// Returns the numbers of a matrix: four, or nine of the first three rows.
fn numbers(value: &Value) -> Option<Vec<f64>> {
    match value {
        Value::Object(entries) => NUMBERS.iter().map(|name| entries.get(*name)?.as_f64()).collect(),
        Value::Array(rows) if rows.first().is_some_and(Value::is_array) && matches!(rows.len(), 3 | 4) => {
            let row = |row: &Value| row.as_array().filter(|row| row.len() == rows.len()).map(|row| row[..3].to_vec());
            let rows: Vec<Vec<Value>> = rows[..3].iter().map(row).collect::<Option<_>>()?;
            rows.concat().iter().map(Value::as_f64).collect()
        }
        Value::Array(numbers) if matches!(numbers.len(), 4 | 9) => numbers.iter().map(Value::as_f64).collect(),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde::Deserialize;
    use serde_json::json;

    /// Returns focal lengths and principal point.
    fn values(lens: OriginalLens) -> [f64; 4] {
        let OriginalLens::Intrinsics { focal, center } = lens else { panic!("intrinsics: {lens:?}") };
        [focal.x, focal.y, center.x, center.y]
    }

    #[test]
    fn every_form_of_a_matrix_is_the_same_lens() {
        for value in [
            json!([[500, 0, 320], [0, 510, 240], [0, 0, 1]]),
            json!([[500, 0, 320, 0], [0, 510, 240, 0], [0, 0, 1, 0], [0, 0, 0, 1]]),
            json!([500, 0, 320, 0, 510, 240, 0, 0, 1]),
            json!([500, 0, 0, 0, 510, 0, 320, 240, 1]),
            json!([500, 510, 320, 240]),
            json!({"fx": 500, "fy": 510, "cx": 320, "cy": 240, "model": "pinhole"}),
        ] {
            let found = of_value(&value).expect("a matrix of a lens");
            assert_eq!(values(found), [500.0, 510.0, 320.0, 240.0], "{value}");
        }
    }

    #[test]
    fn other_values_are_refused() {
        for value in [
            json!(null),
            json!("K"),
            json!([]),
            json!([[500, 0, 320], [0, 510, 240]]),
            json!([[500, 0, 320], [0, 510], [0, 0, 1]]),
            json!([[500, 0, 320], [0, 510, 240], 1]),
            json!([500, 510, 320]),
            json!([500, 510, 320, "240"]),
            json!({"fx": 500, "fy": 510, "cx": 320}),
            json!([[500, 0, 320], [0, 510, 240], [0, 0, 2]]),
            json!([[500, 3, 320], [0, 510, 240], [0, 0, 1]]),
        ] {
            assert!(of_value(&value).is_err(), "{value} is no lens");
        }
    }

    #[test]
    fn what_is_nearer_to_the_frame_counts() {
        let lens = |frame: Value, file: Value| {
            let entries = |of: &Value| LensEntries::deserialize(of).expect("entries of a lens");
            of_frame(&frame, &entries(&frame), &file, &entries(&file))
        };
        let entries = |focal: f64| json!({"fl_x": focal, "fl_y": focal, "cx": 1, "cy": 2});
        let matrix = |focal: f64| json!({"K": [focal, focal, 1, 2]});
        let both = json!({"fl_x": 3, "fl_y": 3, "cx": 1, "cy": 2, "K": [4, 4, 1, 2]});
        for (frame, file, focal) in [
            (matrix(5.0), entries(6.0), 5.0),
            (entries(5.0), matrix(6.0), 5.0),
            (both.clone(), json!({}), 3.0),
            (json!({}), both, 3.0),
            (json!({}), matrix(6.0), 6.0),
            (json!({"K": null}), matrix(6.0), 6.0),
            (json!({"K": "of another kind"}), entries(6.0), 6.0),
        ] {
            let found = lens(frame.clone(), file.clone()).expect("a lens");
            assert_eq!(values(found)[0], focal, "{frame} in {file}");
        }
        let angle = json!({"camera_angle_x": 1.0});
        let found = lens(json!({}), json!({"camera_angle_x": 1.0, "K": [4, 4, 1, 2]})).expect("a lens");
        assert!(matches!(found, OriginalLens::Angle(_)), "the field of view, as the original reads it: {found:?}");
        assert_eq!(values(lens(matrix(5.0), angle).expect("a lens"))[0], 5.0, "the matrix of the frame");
        let error = lens(json!({"K": [1]}), json!({})).expect_err("no lens").to_string();
        assert!(error.contains("three rows of three numbers"), "the form is named: {error}");
        assert!(matches!(lens(json!({}), json!({})), Err(FrameProblem::NoLens)), "no lens at all");
    }
}
