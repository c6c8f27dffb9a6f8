//! The axis of a PLY file that points up.
//!
//! In: the comments of a header. Out: the axis that they name: `gs4d.up +z` in files of this crate, `Vertical Axis: z`
//! in those of nerfstudio and Brush, `Vertical axis: 0 0 1` in newer ones of Brush.

use super::header::Comments;
use crate::scene::UpAxis;

/// The comment with the axis that points up in files of this crate.
pub(crate) const UP: &str = "gs4d.up";
/// The comment of nerfstudio and Brush, in lower case.
const VERTICAL: &str = "vertical axis:";

/// Returns the axis that points up; `None` without such a comment.
pub(super) fn up(comments: &Comments) -> Option<UpAxis> {
    use UpAxis::{NegX, NegY, NegZ, PosX, PosY, PosZ};
    let of_name = |name: &str| [PosX, NegX, PosY, NegY, PosZ, NegZ].into_iter().find(|&up| up.name() == name);
    comments.value(UP).and_then(of_name).or_else(|| comments.0.iter().rev().find_map(|comment| vertical(comment)))
}

/// Returns the axis of the comment of nerfstudio and Brush: a letter, which has no sign (y points down in files of
/// trainers), or in newer files of Brush the vector that points up, whose nearest axis is taken.
fn vertical(comment: &str) -> Option<UpAxis> {
    match comment.to_ascii_lowercase().strip_prefix(VERTICAL)?.trim() {
        "x" => Some(UpAxis::PosX),
        "y" => Some(UpAxis::NegY),
        "z" => Some(UpAxis::PosZ),
        vector => nearest(vector),
    }
}

/// Returns the axis nearest to a vector of three numbers; `None` for other texts.
fn nearest(vector: &str) -> Option<UpAxis> {
    let is_separator = |character: char| character.is_whitespace() || ",[]()".contains(character);
    let numbers = vector.split(is_separator).filter(|part| !part.is_empty()).map(str::parse::<f32>);
    let vector: [f32; 3] = numbers.collect::<Result<Vec<f32>, _>>().ok()?.try_into().ok()?;
    let axis = (0..3).max_by(|&a, &b| vector[a].abs().total_cmp(&vector[b].abs()))?;
    let [negative, positive] =
        [[UpAxis::NegX, UpAxis::PosX], [UpAxis::NegY, UpAxis::PosY], [UpAxis::NegZ, UpAxis::PosZ]][axis];
    let length = vector[axis];
    (length.is_finite() && length != 0.0).then_some(if length < 0.0 { negative } else { positive })
}
