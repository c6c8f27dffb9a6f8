//! The files of a capture of the SOG family.
//!
//! In: a zip archive in memory, or the files beside a file. Out: the bytes of a file by its name. The unpacked size of
//! the entries is limited by the [`Budget`] of the archive.

use crate::codec::budget::Budget;
use crate::codec::import::ImportError;
use crate::codec::import::source::Beside;
use crate::codec::text::printable;
use std::io::Cursor;
use zip::ZipArchive;

/// Files by name.
pub(super) struct Files<'a> {
    place: Place<'a>,
}

enum Place<'a> {
    Archive {
        zip: ZipArchive<Cursor<&'a [u8]>>,
        budget: Budget,
    },
    Beside {
        files: &'a dyn Beside,
        /// The folder of the names, empty or with a slash at its end.
        folder: String,
    },
}

impl<'a> Files<'a> {
    /// Returns the entries of a zip archive.
    ///
    /// # Errors
    /// Bytes that are no archive.
    pub(super) fn of_archive(bytes: &'a [u8]) -> Result<Self, ImportError> {
        let zip = ZipArchive::new(Cursor::new(bytes)).map_err(|error| {
            ImportError::damaged(format!("its zip archive is damaged: {error}; copy the file again"))
        })?;
        Ok(Self { place: Place::Archive { zip, budget: Budget::of(bytes.len() as u64) } })
    }

    /// Returns the files of a folder, whose path is relative to that of `files`.
    pub(super) fn beside(files: &'a dyn Beside, folder: &str) -> Self {
        let folder = if folder.is_empty() { String::new() } else { format!("{folder}/") };
        Self { place: Place::Beside { files, folder } }
    }

    /// Announces files that are read soon, before any of them is decoded.
    ///
    /// # Errors
    /// As [`Beside::announce`].
    pub(super) fn announce<'n>(&self, names: impl IntoIterator<Item = &'n str>) -> Result<(), ImportError> {
        let Place::Beside { files, folder } = &self.place else { return Ok(()) };
        let names: Vec<String> = names.into_iter().map(|name| format!("{folder}{name}")).collect();
        Ok(files.announce(&names)?)
    }

    /// Returns the bytes of a file.
    ///
    /// # Errors
    /// A file that is not there or cannot be read; an entry that is damaged or unpacks to too many bytes.
    pub(super) fn read(&mut self, name: &str) -> Result<Vec<u8>, ImportError> {
        let (zip, budget) = match &mut self.place {
            Place::Beside { files, folder } => return Ok(files.read(&format!("{folder}{name}"))?),
            Place::Archive { zip, budget } => (zip, budget),
        };
        let shown = printable(name);
        let damaged = |reason: String| ImportError::damaged(format!("its file {shown} {reason}"));
        let index = zip.index_for_name(name).ok_or_else(|| damaged("is missing; copy the file again".to_owned()))?;
        let entry = zip.by_index(index).map_err(|error| damaged(format!("cannot be unpacked: {error}")))?;
        let size = entry.size();
        budget.unpack_stated(entry, size).map_err(|error| damaged(error.to_string()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::codec::import::source::InMemory;
    use std::io::Write;
    use zip::write::SimpleFileOptions;
    use zip::{CompressionMethod, ZipWriter};

    fn archive(entries: &[(&str, &[u8])], method: CompressionMethod) -> Vec<u8> {
        let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
        for (name, bytes) in entries {
            let options = SimpleFileOptions::default().compression_method(method);
            zip.start_file(*name, options).and_then(|()| Ok(zip.write_all(bytes)?)).expect("an entry is written");
        }
        zip.finish().expect("the archive is finished").into_inner()
    }

    #[test]
    fn stored_and_deflated_entries_are_read() {
        for method in [CompressionMethod::Stored, CompressionMethod::Deflated] {
            let bytes = archive(&[("a/b", b"one"), ("c", b"two")], method);
            let mut files = Files::of_archive(&bytes).expect("an archive");
            assert_eq!(files.read("c").expect("is there"), b"two", "{method:?}");
            assert_eq!(files.read("a/b").expect("is there"), b"one", "{method:?}, in a folder");
            let message = files.read("d").expect_err("is not there").to_string();
            assert!(message.contains("d is missing"), "the message names the file: {message}");
        }
    }

    #[test]
    fn an_archive_that_unpacks_to_many_times_its_size_is_refused() {
        let zeros = vec![0; 900_000];
        let mut bytes = archive(&[("a", &zeros), ("b", &zeros[1..])], CompressionMethod::Deflated);
        // The second entry states 805 MB.
        let stated = 899_999_u32.to_le_bytes();
        for at in 0..bytes.len() - stated.len() {
            if bytes[at..].starts_with(&stated) {
                bytes[at..at + stated.len()].copy_from_slice(&0x3000_0000_u32.to_le_bytes());
            }
        }
        let mut files = Files::of_archive(&bytes).expect("an archive");
        assert_eq!(files.read("a").map(|bytes| bytes.len()).ok(), Some(zeros.len()), "below the limit");
        let message = files.read("b").expect_err("above the limit").to_string();
        assert!(message.starts_with("its file b takes 805306368 bytes or more"), "file and claim: {message}");
    }

    #[test]
    fn a_changed_byte_of_an_entry_is_found() {
        let mut bytes = archive(&[("a", b"bytes of an entry")], CompressionMethod::Stored);
        let at = bytes.windows(5).position(|window| window == b"entry").expect("the entry is stored");
        bytes[at] ^= 1;
        let mut files = Files::of_archive(&bytes).expect("the directory is intact");
        assert!(files.read("a").is_err(), "the checksum differs");
    }

    #[test]
    fn files_of_a_folder_are_read_by_their_names_in_it() {
        let files = InMemory([("0_0/a".to_owned(), vec![1]), ("b".to_owned(), vec![2])].into());
        assert_eq!(Files::beside(&files, "0_0").read("a").ok(), Some(vec![1]), "in a folder");
        assert_eq!(Files::beside(&files, "").read("b").ok(), Some(vec![2]), "beside the file");
        assert!(Files::beside(&files, "0_0").read("../b").is_err(), "names do not leave the folder");
    }
}
