//! Files that a dataset names.
//!
//! In: names of files, paths. Out: the paths on disk, also where a name has backslashes, another letter case or another
//! extension; an error that names the first few files that do not exist, and their number.

use super::numbered::{IMAGE_EXTENSIONS, entries};
use crate::codec::text::{is_obeyed, printable};
use crate::offline::dataset::error::DatasetError;
use std::borrow::Cow;
use std::cell::RefCell;
use std::collections::HashMap;
use std::ffi::OsStr;
use std::path::{Component, Path, PathBuf};
use std::rc::Rc;

/// Most missing images that an error names.
const MISSING_LISTED: usize = 4;
/// Another extension of images that cannot be decoded, so that the decoder names the file.
const NOT_DECODED: &str = "webp";

/// The name of the file of points with which the original begins.
const POINTS: &str = "points3d.ply";

/// Checks that all files exist; the error names the first few missing files.
pub(crate) fn require_files<'a>(files: impl Iterator<Item = &'a PathBuf>) -> Result<(), DatasetError> {
    let (mut first, mut missing, mut total) = (Vec::new(), 0, 0);
    for file in files {
        total += 1;
        if !file.is_file() {
            missing += 1;
            if first.len() < MISSING_LISTED {
                first.push(file.clone());
            }
        }
    }
    if missing == 0 { Ok(()) } else { Err(DatasetError::MissingImages { first, missing, total }) }
}

/// Returns the file of points beside the cameras, from which the original begins, if it is there.
pub(crate) fn points_beside(folder: &Path) -> Option<PathBuf> {
    Some(folder.join(POINTS)).filter(|points| points.is_file())
}

/// Returns whether a text from a file is the plain name of a file or a folder: without a path and control characters.
pub(crate) fn is_plain(name: &str) -> bool {
    let mut parts = Path::new(name).components();
    let is_single = matches!((parts.next(), parts.next()), (Some(Component::Normal(part)), None) if part == name);
    is_single && !name.contains('\\') && !name.contains(is_obeyed)
}

/// Returns a name with `/` in place of each backslash, as programs on Windows write it.
pub(crate) fn with_slashes(name: &str) -> Cow<'_, str> {
    if name.contains('\\') { Cow::Owned(name.replace('\\', "/")) } else { Cow::Borrowed(name) }
}

/// Returns the text of bytes in UTF-8, else in Latin-1, as older programs write names.
pub(crate) fn utf8_or_latin1(bytes: &[u8]) -> Cow<'_, str> {
    match std::str::from_utf8(bytes) {
        Ok(text) => Cow::Borrowed(text),
        Err(_) => Cow::Owned(bytes.iter().copied().map(char::from).collect()),
    }
}

/// The files of folders by their names in small letters. A folder is listed at most once, and only if a name is not on
/// disk as it is written.
#[derive(Default)]
pub(crate) struct OnDisk {
    folders: RefCell<HashMap<PathBuf, Rc<Listing>>>,
    /// The number of files that have been found by another name, and the first of them: its name, and its path.
    renamed: RefCell<(usize, Option<(PathBuf, PathBuf)>)>,
}

/// The entries of a folder: for each name in small letters, the paths that differ in case alone.
type Listing = HashMap<String, Vec<PathBuf>>;

impl OnDisk {
    /// Returns the path of a file inside a folder: that of its name if it exists; else that of the file whose name
    /// differs in letter case or, of an image or a name without extension, in its extension. Returns the path by the
    /// name if there is no such file, or several.
    pub(crate) fn find(&self, folder: &Path, name: impl AsRef<Path>) -> PathBuf {
        let name = name.as_ref();
        let exact = folder.join(name);
        if exact.is_file() {
            return exact;
        }
        let Some(found) = self.other_name(folder, name) else { return exact };
        let mut renamed = self.renamed.borrow_mut();
        renamed.0 += 1;
        renamed.1.get_or_insert_with(|| (name.to_owned(), found.clone()));
        found
    }

    /// Returns a sentence about the files that were found by another name than they have, if there are any.
    pub(crate) fn note(&self) -> Option<String> {
        let renamed = self.renamed.borrow();
        let (count, Some((name, path))) = &*renamed else { return None };
        let found = path.file_name().unwrap_or_default();
        let (name, found) = (printable(&name.to_string_lossy()), printable(&found.to_string_lossy()));
        let files =
            if *count == 1 { "1 file has another name".to_owned() } else { format!("{count} files have other names") };
        Some(format!("{files} on disk, in letter case, extension or encoding: {name} is {found}"))
    }

    /// Returns the only file whose path differs from the name in letter case or extension alone.
    fn other_name(&self, folder: &Path, name: &Path) -> Option<PathBuf> {
        let parent = name.parent()?.components().try_fold(folder.to_owned(), |at, part| self.inner(at, part))?;
        let listing = self.listing(&parent);
        let wanted = lower(name.file_name()?);
        let only_file = |name: &str| match listing.get(name).map(Vec::as_slice) {
            Some([path]) if path.is_file() => Some(path.clone()),
            _ => None,
        };
        let stem = match wanted.rsplit_once('.') {
            Some((stem, extension)) if IMAGE_EXTENSIONS.contains(&extension) || extension == NOT_DECODED => stem,
            _ => wanted.as_str(),
        };
        let extensions = IMAGE_EXTENSIONS.into_iter().chain([NOT_DECODED]);
        only_file(&wanted)
            .or_else(|| extensions.map(|other| format!("{stem}.{other}")).find_map(|name| only_file(&name)))
    }

    /// Returns a folder inside a folder, by its name in any case.
    fn inner(&self, at: PathBuf, part: Component) -> Option<PathBuf> {
        let exact = at.join(part);
        if exact.is_dir() {
            return Some(exact);
        }
        match self.listing(&at).get(&lower(part.as_os_str())).map(Vec::as_slice) {
            Some([path]) if path.is_dir() => Some(path.clone()),
            _ => None,
        }
    }

    /// Returns the entries of a folder; none if it cannot be read.
    fn listing(&self, folder: &Path) -> Rc<Listing> {
        if let Some(known) = self.folders.borrow().get(folder) {
            return Rc::clone(known);
        }
        let mut listing = Listing::new();
        for path in entries(folder).unwrap_or_default() {
            if let Some(name) = path.file_name() {
                listing.entry(lower(name)).or_default().push(path);
            }
        }
        let listing = Rc::new(listing);
        self.folders.borrow_mut().insert(folder.to_owned(), Rc::clone(&listing));
        listing
    }
}

/// Returns a name in small letters. A name that is not UTF-8 is read as Latin-1.
fn lower(name: &OsStr) -> String {
    utf8_or_latin1(name.as_encoded_bytes()).to_lowercase()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[cfg(target_os = "linux")]
    #[test]
    fn files_are_found_by_names_of_another_case_or_extension() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let at = |name: &str| folder.path().join(name);
        for name in ["Images/IMG_01.JPG", "images2/a.png", "images2/a.jpg", "images2/b.webp", "images2/frame.001.jpeg"]
        {
            fs::create_dir_all(at(name).parent().expect("a folder")).expect("the folder can be made");
            fs::write(at(name), b"").expect("the folder can be written to");
        }
        let files = OnDisk::default();
        let found = |name: &str| files.find(folder.path(), name);
        assert_eq!(found("images2/a.jpg"), at("images2/a.jpg"), "the file of the name");
        assert_eq!(files.note(), None, "it has its name");
        assert_eq!(found("images/img_01.jpg"), at("Images/IMG_01.JPG"), "another case of folder and file");
        assert_eq!(found("images2/a.exr"), at("images2/a.png"), "another extension, the first of the known ones");
        assert_eq!(found("images2/b"), at("images2/b.webp"), "a name without extension");
        assert_eq!(found("images2/frame.001"), at("images2/frame.001.jpeg"), "a dot is not an extension");
        assert_eq!(found("none/a.png"), at("none/a.png"), "no such folder");
        assert_eq!(found(""), at(""), "no name");
        let note = files.note().expect("four files have other names");
        assert!(note.starts_with("4 files") && note.ends_with("images/img_01.jpg is IMG_01.JPG"), "{note}");
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_file_of_two_names_in_other_case_is_not_found() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        for name in ["a.PNG", "A.png"] {
            fs::write(folder.path().join(name), b"").expect("the folder can be written to");
        }
        let files = OnDisk::default();
        assert_eq!(files.find(folder.path(), "a.png"), folder.path().join("a.png"), "either file may be meant");
        assert_eq!(files.find(folder.path(), "A.png"), folder.path().join("A.png"), "the name of one of them");
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn names_in_latin_1_are_those_in_utf_8() {
        use std::os::unix::ffi::OsStrExt;
        let folder = tempfile::tempdir().expect("a temporary folder");
        let raw = folder.path().join(OsStr::from_bytes(b"caf\xe9.png"));
        assert_eq!(utf8_or_latin1(b"caf\xe9.png"), "caf\u{e9}.png", "Latin-1");
        assert_eq!(utf8_or_latin1("caf\u{e9}.png".as_bytes()), "caf\u{e9}.png", "UTF-8");
        if fs::write(&raw, b"").is_ok() {
            assert_eq!(OnDisk::default().find(folder.path(), "caf\u{e9}.png"), raw, "the bytes on disk are Latin-1");
        }
    }

    #[test]
    fn plain_names_have_no_paths_and_no_control_characters() {
        for name in ["a", "0_00001", "camera 1", "a.b", "..a"] {
            assert!(is_plain(name), "{name:?} is a file or a folder");
        }
        for name in ["", ".", "..", "/", "/a", "a/", "a/b", "../a", r"a\b", "a\u{1b}[2J", "a\0"] {
            assert!(!is_plain(name), "{name:?} is no plain name");
        }
    }

    #[test]
    fn backslashes_are_slashes() {
        assert_eq!(with_slashes(r"images\a\i00.png"), "images/a/i00.png", "a path of Windows");
        assert!(matches!(with_slashes("images/i00.png"), Cow::Borrowed(_)), "another path is unchanged");
    }
}
