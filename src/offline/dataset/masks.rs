//! Masks in a folder `masks/` beside the images.
//!
//! In: the folder of a dataset, the path of an image in it. Out: the mask with the image's name, if there is one.

use std::path::{Component, Path, PathBuf};

/// Name of the folder of masks.
const FOLDER: &str = "masks";
/// Folders of images, in place of which the folder of masks stands.
const IMAGES: [&str; 2] = ["images", "frames"];

/// Returns the mask of an image: `masks/NAME`, `masks/NAME.png`, or `masks/NAME` with the extension `png`.
pub(super) fn beside(folder: &Path, image: &Path) -> Option<PathBuf> {
    let mut parts = image.components().filter(|part| *part != Component::CurDir).peekable();
    if parts.peek().is_some_and(|part| IMAGES.iter().any(|name| part.as_os_str() == *name)) {
        parts.next();
    }
    let mask = folder.join(FOLDER).join(parts.collect::<PathBuf>());
    let mut longer = mask.clone().into_os_string();
    longer.push(".png");
    [mask.with_extension("png"), mask, longer.into()].into_iter().find(|path| path.is_file())
}
