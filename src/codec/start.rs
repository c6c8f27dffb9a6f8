//! The start of a file, by which its format is recognized.
//!
//! In: a seekable reader and the name of the file, or the path of a folder. Out: [`Start`]: its first bytes, its length, its extension, and the names of
//! the entries if it is a zip archive or a folder.

use super::text::without_mark;
use std::borrow::Cow;
use std::fs::DirEntry;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::Path;

/// Number of first bytes.
pub(crate) const FIRST: u64 = 4096;
/// The first bytes of a zip archive with an entry.
pub(crate) const ZIP: &[u8] = b"PK\x03\x04";

/// The start of a file.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) struct Start {
    /// Its first 4096 bytes, or all if there are fewer.
    pub bytes: Vec<u8>,
    /// Number of all its bytes.
    pub length: u64,
    /// Its extension in lower case, without the dot.
    pub extension: String,
    /// The names of the entries of a zip archive or a folder; none of other files, and of archives that are damaged.
    pub entries: Vec<String>,
    /// Whether it is a folder, which has no bytes.
    pub is_folder: bool,
}

impl Start {
    /// Reads the start of a file and returns to its first byte.
    ///
    /// # Errors
    /// Errors of the reader.
    pub(crate) fn of<R: Read + Seek>(reader: &mut R, path: &Path) -> io::Result<Self> {
        let mut bytes = Vec::new();
        let length = reader.seek(SeekFrom::End(0))?;
        reader.rewind()?;
        reader.by_ref().take(FIRST).read_to_end(&mut bytes)?;
        let mut entries = Vec::new();
        if bytes.starts_with(ZIP) {
            reader.rewind()?;
            if let Ok(archive) = zip::ZipArchive::new(&mut *reader) {
                entries = archive.file_names().filter_map(Result::ok).map(Cow::into_owned).collect();
            }
        }
        reader.rewind()?;
        Ok(Self { bytes, length, extension: extension(path), entries, is_folder: false })
    }

    /// Reads the names of the files of a folder.
    ///
    /// # Errors
    /// A folder that cannot be read.
    pub(crate) fn of_folder(path: &Path) -> io::Result<Self> {
        let name = |entry: io::Result<DirEntry>| Ok(entry?.file_name().to_string_lossy().into_owned());
        let entries = path.read_dir()?.map(name).collect::<io::Result<_>>()?;
        Ok(Self { entries, is_folder: true, ..Self::default() })
    }

    /// Returns whether the archive or the folder has an entry of this name in its root.
    pub(crate) fn has_entry(&self, name: &str) -> bool {
        self.entries.iter().any(|entry| entry == name)
    }

    /// Returns whether it begins like an object of JSON.
    pub(crate) fn is_object(&self) -> bool {
        without_mark(&self.bytes).trim_ascii_start().starts_with(b"{")
    }

    /// Returns whether a text is among its first bytes.
    pub(crate) fn mentions(&self, text: &str) -> bool {
        self.bytes.windows(text.len()).any(|window| window == text.as_bytes())
    }
}

/// Returns the extension of a name in lower case, without the dot.
pub(crate) fn extension(path: &Path) -> String {
    path.extension().map(|extension| extension.to_string_lossy().to_lowercase()).unwrap_or_default()
}
