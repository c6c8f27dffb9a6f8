//! The axis of a PLY file that points up.
//!
//! In: the comments of a header. Out: the axis that they name: `gs4d.up +z` in files of this crate, `Vertical Axis: z`
//! in those of nerfstudio and Brush.

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

/// Returns the axis of the comment of nerfstudio and Brush, which has no sign: y points down in files of trainers.
fn vertical(comment: &str) -> Option<UpAxis> {
    match comment.to_ascii_lowercase().strip_prefix(VERTICAL)?.trim() {
        "x" => Some(UpAxis::PosX),
        "y" => Some(UpAxis::NegY),
        "z" => Some(UpAxis::PosZ),
        _ => None,
    }
}
