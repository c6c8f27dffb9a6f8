//! Captures inside of a zip archive that is itself no format of captures.
//!
//! In: an archive. Out: the names of the captures in it, by their contents; the bytes of one, and the other files of its folder. All that is unpacked is
//! limited by the [`Budget`] of the archive.

use super::budget::Budget;
use super::format::{FORMATS, Format};
use super::hidden::is_hidden;
use super::import::source::{Beside, checked, named};
use super::input::Input;
use super::start::{FIRST, Start, ZIP, extension};
use std::borrow::Cow;
use std::ffi::OsStr;
use std::io::{self, Read};
use std::path::Path;
use std::sync::Mutex;
use zip::ZipArchive;

/// The name of the file that a streamed SOG is read from; the other captures of its folder are its parts.
const STREAMED: &str = "lod-meta.json";

/// An archive.
pub(super) struct Archive {
    zip: ZipArchive<Input>,
    budget: Budget,
}

/// What an archive has.
#[derive(Debug, Default, PartialEq, Eq)]
pub(super) struct Contents {
    /// The names of the captures.
    pub captures: Vec<String>,
    /// The names of all other files, without those of systems.
    pub others: Vec<String>,
    /// Why the first entry that cannot be unpacked cannot.
    pub fault: Option<String>,
}

/// The files of a folder of an archive.
pub(super) struct InArchive {
    archive: Mutex<Archive>,
    /// The folder, empty or with a slash at its end.
    folder: String,
}

impl Archive {
    /// Opens an archive whose file has `length` bytes.
    ///
    /// # Errors
    /// A damaged archive.
    pub(super) fn open(input: Input, length: u64) -> zip::result::ZipResult<Self> {
        Ok(Self { zip: ZipArchive::new(input)?, budget: Budget::of(length) })
    }

    /// Looks into every entry.
    pub(super) fn contents(&mut self) -> Contents {
        let mut found = Contents::default();
        for index in 0..self.zip.len() {
            match self.start(index) {
                Ok(Some((name, start))) if is_capture(&start) => found.captures.push(name),
                Ok(Some((name, _))) => found.others.push(name),
                Ok(None) => {}
                Err(error) => {
                    found.fault.get_or_insert_with(|| error.to_string());
                }
            }
        }
        let streamed = found.captures.iter().filter(|name| name.rsplit('/').next() == Some(STREAMED));
        if let Some(streamed) = streamed.min_by_key(|name| name.len()).cloned() {
            let folder = folder_of(&streamed).to_owned();
            found.captures.retain(|name| *name == streamed || !name.starts_with(&folder));
        }
        found
    }

    /// Returns the name and the first bytes of an entry; `None` of a folder and of a file of a system.
    fn start(&mut self, index: usize) -> io::Result<Option<(String, Start)>> {
        let entry = self.zip.by_index(index).map_err(io::Error::other)?;
        let name = entry.name().map(Cow::into_owned).map_err(io::Error::other)?;
        if name.ends_with('/') || name.split('/').any(|part| is_hidden(OsStr::new(part))) {
            return Ok(None);
        }
        let length = entry.size();
        let mut bytes = Vec::new();
        entry.take(FIRST).read_to_end(&mut bytes)?;
        let extension = extension(Path::new(&name));
        Ok(Some((name, Start { bytes, length, extension, ..Start::default() })))
    }

    /// Returns the bytes of a file.
    ///
    /// # Errors
    /// A file that is not there, is damaged, or would take too much memory.
    pub(super) fn read(&mut self, name: &str) -> io::Result<Vec<u8>> {
        let absent = || io::Error::new(io::ErrorKind::NotFound, "there is no such file in the archive");
        let index = self.zip.index_for_name(name).ok_or_else(absent)?;
        let entry = self.zip.by_index(index).map_err(io::Error::other)?;
        let length = entry.size();
        self.budget.unpack_stated(entry, length).map_err(|error| io::Error::other(error.to_string()))
    }

    /// Returns the files beside a file.
    pub(super) fn beside(self, name: &str) -> InArchive {
        InArchive { archive: Mutex::new(self), folder: folder_of(name).to_owned() }
    }
}

impl Beside for InArchive {
    fn read(&self, name: &str) -> io::Result<Vec<u8>> {
        let path = format!("{}{}", self.folder, checked(name)?);
        let mut archive = self.archive.lock().map_err(|_| io::Error::other("the archive is not whole"))?;
        archive.read(&path).map_err(|error| named(name, error))
    }
}

/// Returns whether a file that starts so is a capture. Of an archive in the archive only its name tells.
fn is_capture(start: &Start) -> bool {
    if start.bytes.starts_with(ZIP) {
        return FORMATS.iter().any(|format| format.extensions.contains(&&*start.extension));
    }
    Format::of(start).is_some()
}

/// Returns the folder of a file, empty or with a slash at its end.
fn folder_of(name: &str) -> &str {
    name.rfind('/').map_or("", |slash| &name[..=slash])
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{Cursor, Write};
    use zip::ZipWriter;
    use zip::write::SimpleFileOptions;

    const META: &[u8] = br#"{"version": 2, "count": 1, "means": {"mins": [0, 0, 0]}}"#;
    const STREAM: &[u8] = br#"{"version": 1, "lodLevels": 2, "filenames": []}"#;

    fn archive(entries: &[(&str, &[u8])]) -> Archive {
        let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
        for (name, bytes) in entries {
            zip.start_file(*name, SimpleFileOptions::default()).expect("an entry is begun");
            zip.write_all(bytes).expect("an entry is written");
        }
        let bytes = zip.finish().expect("the archive is finished").into_inner();
        let length = bytes.len() as u64;
        Archive::open(Input::of(bytes), length).expect("an archive")
    }

    #[test]
    fn captures_are_found_by_their_contents() {
        let mut found = archive(&[
            ("a/scene.ply", b"ply\nformat ascii 1.0\n"),
            ("a/readme.txt", b"hello"),
            ("a/other", b"ply\r\n"),
            ("__MACOSX/a/._scene.ply", b"ply\n"),
            ("a/.DS_Store", b"ply\n"),
        ])
        .contents();
        found.captures.sort();
        assert_eq!(found.captures, ["a/other", "a/scene.ply"], "by contents, without files of systems");
        assert_eq!((found.others, found.fault), (vec!["a/readme.txt".to_owned()], None), "other files");
    }

    #[test]
    fn the_parts_of_a_streamed_sog_are_no_captures_of_their_own() {
        let entries =
            [("x/0_0/meta.json", META), ("x/lod-meta.json", STREAM), ("x/1_0/meta.json", META), ("y/meta.json", META)];
        assert_eq!(archive(&entries).contents().captures, ["x/lod-meta.json", "y/meta.json"], "its parts are left out");
    }

    #[test]
    fn files_beside_a_file_are_those_of_its_folder() {
        let files = archive(&[("x/meta.json", META), ("x/a/b.webp", b"1"), ("c.webp", b"2")]).beside("x/meta.json");
        assert_eq!(files.read("a/b.webp").expect("is there"), b"1", "in a folder of its folder");
        assert!(files.read("../c.webp").is_err(), "names do not leave the folder");
        assert_eq!(files.read("c.webp").expect_err("elsewhere").kind(), io::ErrorKind::NotFound, "not in its folder");
        assert!(files.has("a/b.webp") && !files.has("c.webp"), "which files there are");
    }
}
