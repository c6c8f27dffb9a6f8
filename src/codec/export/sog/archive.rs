//! A zip archive of uncompressed files.
//!
//! In: files by name, in their order. Out: the archive. Its headers have no fields of variable length but the name, so
//! that the offset of each file is known before the archive is written.

use std::io::{self, Cursor, Write};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipWriter};

/// Bytes of the header before a file, without its name.
const HEADER: usize = 30;

/// A file of an archive.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Entry {
    pub name: String,
    pub bytes: Vec<u8>,
}

impl Entry {
    /// Returns the number of bytes of the file and its header.
    pub(super) fn size(&self) -> usize {
        HEADER + self.name.len() + self.bytes.len()
    }
}

/// Writes an archive.
///
/// # Errors
/// Errors of the writer; more than 4 GiB.
pub(super) fn write<'e>(entries: impl IntoIterator<Item = &'e Entry>, writer: &mut dyn Write) -> io::Result<()> {
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Stored)
        .last_modified_time(DateTime::default());
    for entry in entries {
        zip.start_file(entry.name.as_str(), options)?;
        zip.write_all(&entry.bytes)?;
    }
    writer.write_all(zip.finish()?.get_ref())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn offsets_are_known_before_the_archive_is_written() {
        let entry = |name: &str, bytes: &[u8]| Entry { name: name.to_owned(), bytes: bytes.to_vec() };
        let entries = [entry("meta.json", b"{}"), entry("a/b.webp", b"one"), entry("c", b"")];
        let mut bytes = Vec::new();
        write(&entries, &mut bytes).expect("memory can be written");
        let mut offset = 0;
        for entry in &entries {
            let header = &bytes[offset..];
            assert_eq!(header[..4], *b"PK\x03\x04", "{} begins at {offset}", entry.name);
            assert_eq!(header[6] & 8, 0, "{} has its size in the header before it", entry.name);
            assert_eq!(header[18..22], (entry.bytes.len() as u32).to_le_bytes(), "the size of {}", entry.name);
            assert_eq!(header[28..30], [0, 0], "{} has no further fields", entry.name);
            offset += entry.size();
        }
        assert_eq!(bytes[offset..offset + 4], *b"PK\x01\x02", "the directory follows");
    }
}
