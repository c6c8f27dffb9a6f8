//! The meaning of subfolders of images: each is a camera with its frames, or a folder without meaning.
//!
//! In: the names of the images of a model. Out: whether folders are cameras, and the sentence that says so.
//!
//! Folders are cameras if one of them is named so (`cam0`, `camera_left`, `frames`, `video2`), or if two of them have
//! the same frames: more than half of their images have the same numbers. Otherwise every image is a picture of a scene
//! at rest.

use crate::codec::text::printable;
use crate::offline::dataset::DatasetError;
use crate::offline::dataset::formats::numbered::{images, number};
use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsString;
use std::path::{Path, PathBuf};

/// The folder of images.
pub(crate) const IMAGES: &str = "images";

/// Names of folders with frames; a number or a word may follow.
const CAMERAS: [&str; 5] = ["camera", "cam", "frames", "frame", "video"];
/// Most folders that a sentence names.
const NAMED: usize = 3;

/// The meaning of subfolders.
pub(crate) struct Layout {
    /// Whether they are cameras, whose images are frames.
    pub is_rig: bool,
    /// The assumption, as a sentence; `None` without subfolders, or if nothing was assumed.
    pub note: Option<String>,
}

/// The identity of a time among the frames of all cameras: the number of a frame, or its stem if it has no number.
type Moment = (Option<u64>, Option<OsString>);

impl Layout {
    /// Returns the meaning of the subfolders of `folder`/images, by the names of the images of the model.
    ///
    /// # Errors
    /// A folder of images that cannot be read.
    pub(crate) fn of<'a>(names: impl Iterator<Item = &'a str>, folder: &Path) -> Result<Self, DatasetError> {
        let mut folders: BTreeMap<&Path, Vec<PathBuf>> = BTreeMap::new();
        for name in names.filter(|name| parent(name) != Path::new("")) {
            folders.entry(parent(name)).or_default().push(PathBuf::from(name));
        }
        if folders.is_empty() {
            return Ok(Self { is_rig: false, note: None });
        }
        let are_named = folders.keys().any(|folder| is_named(folder));
        let is_rig = are_named || have_same_frames(&folders, folder)?;
        let listed: Vec<String> = folders.keys().take(NAMED).map(|path| printable(&path.to_string_lossy())).collect();
        let more = if folders.len() > NAMED { ", ..." } else { "" };
        let shown = format!("images in subfolders ({}{more}; {} in all) are read as", listed.join(", "), folders.len());
        let note = if is_rig {
            let reason = if are_named { "are named so" } else { "have the same frames" };
            format!(
                "{shown} frames of cameras, 30 a second, since subfolders {reason}: --static reads them as pictures of \
                 a scene at rest"
            )
        } else {
            format!(
                "{shown} pictures of a scene at rest: if they are frames of cameras, name the subfolders cam0, cam1 \
                 and so on, also in the model"
            )
        };
        Ok(Self { is_rig, note: Some(note) })
    }

    /// Returns the layout of a scene that is known to be at rest.
    pub(crate) fn at_rest() -> Self {
        Self { is_rig: false, note: None }
    }
}

/// Returns whether a part of a path is the name of a camera.
fn is_named(folder: &Path) -> bool {
    folder.iter().any(|part| {
        let part = part.to_string_lossy().to_lowercase();
        let rest = CAMERAS.iter().find_map(|name| part.strip_prefix(name));
        rest.is_some_and(|rest| !rest.starts_with(char::is_alphabetic))
    })
}

/// Returns whether two folders have the same frames. The frames of a folder of which the model has one image are those
/// on disk.
fn have_same_frames(folders: &BTreeMap<&Path, Vec<PathBuf>>, folder: &Path) -> Result<bool, DatasetError> {
    let mut sets: Vec<BTreeSet<Moment>> = Vec::new();
    for (camera, registered) in folders {
        let on_disk = if registered.len() == 1 { images(&folder.join(IMAGES).join(camera))? } else { Vec::new() };
        let frames = if on_disk.is_empty() { registered } else { &on_disk };
        sets.push(frames.iter().map(|frame| moment(frame)).collect());
    }
    sets.retain(|set| set.len() > 1);
    // Equal sets, and most that are nearly equal, become neighbors.
    sets.sort_unstable();
    Ok(sets.windows(2).any(|pair| 2 * pair[0].intersection(&pair[1]).count() > pair[0].len().max(pair[1].len())))
}

fn moment(frame: &Path) -> Moment {
    let number = number(frame);
    let stem = frame.file_stem().filter(|_| number.is_none()).map(OsString::from);
    (number, stem)
}

/// Returns the folder of an image: the name of its camera, empty if there is none.
pub(crate) fn parent(name: &str) -> &Path {
    Path::new(name).parent().unwrap_or(Path::new(""))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn layout(names: &[&str]) -> Layout {
        let folder = tempfile::tempdir().expect("a temporary folder");
        Layout::of(names.iter().copied(), folder.path()).expect("nothing is read")
    }

    #[test]
    fn folders_are_cameras_by_their_names_or_their_frames() {
        for names in [
            &["cam0/a.png", "other/b.png"][..],
            &["Camera_left/1.png", "x/7.png"],
            &["scan/frames/1.png", "scan/frames/2.png"],
            &["video/1.png", "video/2.png"],
            &["a/0001.png", "a/0002.png", "b/0001.png", "b/0002.png"],
            &["a/x_1.png", "a/x_2.png", "a/x_3.png", "b/y_1.png", "b/y_2.png", "m/7.png"],
            &["a/first.png", "a/last.png", "b/first.png", "b/last.png"],
        ] {
            let Layout { is_rig, note } = layout(names);
            assert!(is_rig, "{names:?} are frames");
            let note = note.expect("it is said");
            assert!(note.contains("frames of cameras") && note.contains("--static"), "{note}");
        }
        for names in [
            &["00/00_00000.png", "00/00_00001.png", "01/01_00002.png", "01/01_00003.png"][..],
            &["campus/1.png", "campus/2.png"],
            &["day1/IMG_1.jpg", "day2/IMG_1.jpg"],
        ] {
            let Layout { is_rig, note } = layout(names);
            assert!(!is_rig, "{names:?} are pictures of a scene at rest");
            assert!(note.is_some_and(|note| note.contains("at rest")), "it is said");
        }
        let Layout { is_rig, note } = layout(&["1.png", "2.png"]);
        assert!(!is_rig && note.is_none(), "nothing is assumed without folders");
    }
}
