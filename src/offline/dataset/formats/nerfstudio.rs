//! nerfstudio: a single `transforms.json`.
//!
//! In: a folder. Out: the views of all frames with their splits, and the file of points. Splits are lists of paths
//! (`train_filenames`, `test_filenames`, `val_filenames`), or an entry `split` of each frame.

use super::camera_file::{CameraFile, SINGLE};
use super::files::{OnDisk, with_slashes};
use super::undivided::Undivided;
use crate::codec::text::is_obeyed;
use crate::offline::dataset::cameras::placing::Placed;
use crate::offline::dataset::{CameraOptions, DatasetError, Split};
use serde_json::Value;
use std::borrow::Cow;
use std::collections::HashMap;
use std::path::Path;

/// The lists of the splits.
const LISTS: [(&str, Split); 3] =
    [("train_filenames", Split::Train), ("test_filenames", Split::Test), ("val_filenames", Split::Val)];
/// The entry that names the file of points.
const POINTS: &str = "ply_file_path";
/// The values of a frame's entry `split`.
const NAMES: [(&str, Split); 3] = [("train", Split::Train), ("test", Split::Test), ("val", Split::Val)];

/// Returns whether a folder has the file.
pub(crate) fn is_there(folder: &Path) -> bool {
    folder.join(SINGLE).is_file()
}

/// Reads the views of a folder.
pub(crate) fn read(folder: &Path, options: &CameraOptions) -> Result<Undivided, DatasetError> {
    let source = folder.join(SINGLE);
    let file = CameraFile::read(&source)?;
    let Placed { views, origin, notes } = file.views(&CameraOptions { time_interval: None, ..*options })?;
    let mut listed: HashMap<Cow<'_, str>, Split> = HashMap::new();
    for (list, split) in LISTS {
        let names = file.entry(list).and_then(Value::as_array).map_or(&[][..], Vec::as_slice);
        listed.extend(names.iter().filter_map(Value::as_str).map(|name| (plain(name), split)));
    }
    let split = |(path, split): (Option<&str>, Option<&str>)| {
        let of_frame = split.and_then(|split| NAMES.iter().find(|(name, _)| *name == split));
        path.and_then(|path| listed.get(&*plain(path)).copied()).or(of_frame.map(|(_, split)| *split))
    };
    let splits: Vec<Option<Split>> = file.splits().map(split).collect();
    let splits = splits.iter().any(Option::is_some).then_some(splits);
    let points = file.entry(POINTS).and_then(Value::as_str);
    if points.is_some_and(|path| path.contains(is_obeyed)) {
        let reason = format!("{POINTS} has control characters: rename the file of points, and correct the entry");
        return Err(DatasetError::Unusable { path: source, reason });
    }
    let points = points.map(|path| OnDisk::default().find(folder, &*with_slashes(path)));
    Ok(Undivided { source, views, splits, clock: file.clock(), points, notes, origin })
}

/// Returns a path with slashes, without `./` before it.
fn plain(path: &str) -> Cow<'_, str> {
    match with_slashes(path) {
        Cow::Borrowed(path) => Cow::Borrowed(path.strip_prefix("./").unwrap_or(path)),
        Cow::Owned(path) => Cow::Owned(path.strip_prefix("./").map(str::to_owned).unwrap_or(path)),
    }
}
