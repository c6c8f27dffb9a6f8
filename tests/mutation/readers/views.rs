//! The views of an accepted camera file or dataset.
//!
//! In: views. Out: an error if a size is not allowed, or if a name is not a file name of its own.

use bevy_gs4d::offline::dataset::{MAX_SIDE, TrainingView};
use std::collections::HashSet;
use std::ffi::OsStr;
use std::path::Path;

/// Checks the sizes of the pictures and the names of views.
///
/// # Errors
/// A size that is not allowed, or a name that another view has or that is not a file name.
pub fn check_views(views: &[TrainingView]) -> Result<(), String> {
    let mut names = HashSet::new();
    for view in views {
        let size = view.camera.size;
        if size.min_element() < 1 || size.max_element() > MAX_SIDE {
            return Err(format!("has pictures of {size} pixels"));
        }
        let plain = Path::new(&view.name).file_name() == Some(OsStr::new(&view.name));
        if !plain || !names.insert(&view.name) {
            return Err(format!("has a view named {:?}, which is no file name or not its own", view.name));
        }
    }
    Ok(())
}
