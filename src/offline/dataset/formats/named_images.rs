//! Images as a camera file names them.
//!
//! In: the folder of a camera file, names of images and masks in it. Out: their paths on disk.

use super::files::{OnDisk, with_slashes};
use super::numbered::IMAGE_EXTENSIONS;
use std::path::{Path, PathBuf};

/// Extensions of images that cannot be decoded: the decoder reports them by name.
const OTHERS: [&str; 8] = ["webp", "tif", "tiff", "bmp", "gif", "heic", "avif", "dng"];

/// The images in the folder of a camera file.
pub(crate) struct NamedImages<'a> {
    folder: &'a Path,
    whole: OnDisk,
    /// Files that are named without an extension. No note mentions their extensions.
    shortened: OnDisk,
}

impl<'a> NamedImages<'a> {
    pub(crate) fn of(folder: &'a Path) -> Self {
        Self { folder, whole: OnDisk::default(), shortened: OnDisk::default() }
    }

    /// Returns the path of an image: its [`named`] path, or that of an existing file which differs in letter case or
    /// extension.
    pub(crate) fn find(&self, name: &str) -> PathBuf {
        let literal = self.folder.join(name);
        // The name of a file may have a backslash, as from an archive that another system has packed.
        if name.contains('\\') && has_extension(name) && literal.is_file() {
            return literal;
        }
        let files = if has_extension(name) { &self.whole } else { &self.shortened };
        files.find(self.folder, named(name))
    }

    /// Returns a sentence about the files whose names on disk differ from the camera file, if there are any.
    pub(crate) fn note(&self) -> Option<String> {
        self.whole.note()
    }
}

/// Returns the name of an image with `/` in place of each `\`, and with `.png` after it unless it ends in the extension
/// of an image.
pub(crate) fn named(name: &str) -> String {
    let slashes = with_slashes(name);
    if has_extension(name) { slashes.into_owned() } else { format!("{slashes}.png") }
}

/// Returns whether a name ends in the extension of an image.
fn has_extension(name: &str) -> bool {
    let extension = Path::new(name).extension().unwrap_or_default();
    IMAGE_EXTENSIONS.iter().chain(&OTHERS).any(|known| extension.eq_ignore_ascii_case(known))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn an_extension_is_appended_only_where_there_is_none() {
        assert_eq!(named("./test/r_000"), "./test/r_000.png", "D-NeRF");
        assert_eq!(named("a/b.JPG"), "a/b.JPG", "any case");
        assert_eq!(named("a/b.jpeg"), "a/b.jpeg", "jpeg");
        assert_eq!(named("a/b.webp"), "a/b.webp", "an image that is not read");
        assert_eq!(named("cam00/frame.001"), "cam00/frame.001.png", "a dot is not an extension");
        assert_eq!(named(r"images\i00"), "images/i00.png", "a path of Windows");
    }

    #[test]
    fn images_are_found_by_names_without_extension_and_with_backslashes() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let at = |name: &str| folder.path().join(name);
        fs::create_dir(at("images")).expect("the folder can be made");
        for name in ["images/a.jpg", "images/a.png", "images/b.JPG", "images/c.webp", "images/d.jpeg"] {
            fs::write(at(name), b"").expect("the folder can be written to");
        }
        let images = NamedImages::of(folder.path());
        assert_eq!(images.find("images/a"), at("images/a.png"), "png first");
        assert_eq!(images.find("images/b"), at("images/b.JPG"), "jpg in capital letters");
        assert_eq!(images.find(r".\images\c"), at("./images/c.webp"), "webp, and backslashes");
        assert_eq!(images.find("images/d"), at("images/d.jpeg"), "jpeg");
        assert_eq!(images.find("images/e"), at("images/e.png"), "a missing image has the usual name");
        assert_eq!(images.note(), None, "names without extension have any");
        assert_eq!(images.find("images/b.png"), at("images/b.JPG"), "another extension than in the camera file");
        assert!(images.note().is_some_and(|note| note.contains("b.JPG")), "the file is named");
    }
}
