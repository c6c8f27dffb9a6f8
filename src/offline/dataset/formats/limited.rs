//! Files that are read whole.
//!
//! In: a path, the most bytes that the file may have. Out: its bytes.

use crate::offline::dataset::DatasetError;
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// Reads a file of at most so many bytes, of which `what` is the name in the error.
///
/// # Errors
/// A file that cannot be read, or has more bytes.
pub(crate) fn bytes(path: &Path, most: u64, what: &str) -> Result<Vec<u8>, DatasetError> {
    let mut bytes = Vec::new();
    let read = File::open(path).and_then(|file| file.take(most.saturating_add(1)).read_to_end(&mut bytes));
    read.map_err(|reason| DatasetError::Read { path: path.to_owned(), reason })?;
    if bytes.len() as u64 <= most {
        return Ok(bytes);
    }
    let reason = format!("it has more than {most} bytes, and is no {what}: put the right file there");
    Err(DatasetError::Unusable { path: path.to_owned(), reason })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_have_at_most_the_bytes_that_are_allowed() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("a.yml");
        std::fs::write(&path, [7u8; 5]).expect("the folder can be written to");
        assert_eq!(bytes(&path, 5, "calibration").expect("five bytes"), [7; 5], "all bytes");
        let error = bytes(&path, 4, "calibration").expect_err("a byte too many").to_string();
        assert!(error.contains("a.yml: it has more than 4 bytes, and is no calibration"), "{error}");
        let error = bytes(&folder.path().join("b.yml"), 4, "calibration").expect_err("no file").to_string();
        assert!(error.contains("b.yml: cannot be read"), "{error}");
    }
}
