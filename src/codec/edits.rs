//! A list of edits on disk.
//!
//! In: a path. Out: its [`EditList`]; an error that names the file, the line and the remedy.

use super::error::CodecError;
use super::input::read_at_most;
use super::text::without_mark;
use crate::scene::edit::EditList;
use crate::scene::edit::list::MOST_BYTES;
use std::path::Path;

/// Bytes of the mark of UTF-8, which some editors write.
const MARK: usize = 3;

/// Reads a list of edits.
///
/// # Errors
/// A file that cannot be read or is not a list of edits.
pub fn read_edits(path: &Path) -> Result<EditList, CodecError> {
    let text = read_at_most(path, (MOST_BYTES + MARK) as u64).map_err(|error| CodecError::at(path, error))?;
    EditList::parse(without_mark(&text)).map_err(|error| CodecError::at(path, error))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn a_list_is_read_with_a_mark_and_errors_name_the_file() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("edits.ron");
        let write = |bytes: &[u8]| fs::write(&path, bytes).expect("the folder can be written to");
        write(b"\xef\xbb\xbf[keep_sphere(center: (0, 0, 0), radius: 1)]");
        assert_eq!(read_edits(&path).expect("a list").edits.len(), 1, "an editor has written the mark of UTF-8");
        write(b"[\n  keep_sphere(center: (0, 0, 0), radius: -1)\n]");
        let message = read_edits(&path).expect_err("a radius below 0").to_string();
        assert!(message.contains("edits.ron: line 2, column "), "the place of the fault: {message}");
        write(&vec![b' '; MOST_BYTES + 100]);
        let message = read_edits(&path).expect_err("too long").to_string();
        assert!(message.contains("edits.ron: has more than"), "the size is limited: {message}");
        let message = read_edits(folder.path()).expect_err("a folder").to_string();
        assert!(message.contains("is a folder"), "a folder is not read: {message}");
    }
}
