//! A file to read, and the other files of its folder.
//!
//! In: bytes in memory, a name, the files beside it. Out: [`Source`], from which each format of `import` reads.

use crate::codec::input::read_regular;
use std::collections::BTreeMap;
use std::io;
use std::path::Path;

/// A file to read.
#[derive(Clone, Copy)]
pub(crate) struct Source<'a> {
    pub bytes: &'a [u8],
    /// The other files.
    pub beside: &'a dyn Beside,
}

/// Files beside a file, by their paths relative to its folder.
pub(crate) trait Beside {
    /// Returns the bytes of a file.
    ///
    /// # Errors
    /// A file that is not there or cannot be read; a folder, a pipe or a device; a path that leaves the folder.
    fn read(&self, name: &str) -> io::Result<Vec<u8>>;

    /// Returns whether there is such a file.
    fn has(&self, name: &str) -> bool {
        self.read(name).is_ok()
    }

    /// Announces files that a reader cannot do without, before it decodes any of them: where files are supplied one by
    /// one and the reader begins anew, all are asked for at once. Files that can be read at any time need no
    /// announcement.
    ///
    /// # Errors
    /// A file of which it is known that it is not there or cannot be read; files that have not been supplied yet.
    fn announce(&self, _names: &[String]) -> io::Result<()> {
        Ok(())
    }
}

/// Files beside a file that is kept while it is read in steps.
pub(crate) type Others<'a> = Box<dyn Beside + Send + Sync + 'a>;

/// Files in a folder on disk.
#[derive(Debug, Clone, Copy)]
pub(crate) struct InFolder<'a>(pub &'a Path);

impl Beside for InFolder<'_> {
    fn read(&self, name: &str) -> io::Result<Vec<u8>> {
        read_regular(&self.0.join(checked(name)?)).map_err(|error| named(name, error))
    }

    fn has(&self, name: &str) -> bool {
        checked(name).is_ok_and(|name| self.0.join(name).is_file())
    }
}

/// Files in memory.
#[derive(Debug, Clone, Default)]
pub(crate) struct InMemory(pub BTreeMap<String, Vec<u8>>);

impl Beside for InMemory {
    fn read(&self, name: &str) -> io::Result<Vec<u8>> {
        let found = self.0.get(checked(name)?).cloned();
        found.ok_or_else(|| named(name, io::Error::new(io::ErrorKind::NotFound, "there is no such file")))
    }
}

/// Returns the name, unless it leads out of the folder.
pub(crate) fn checked(name: &str) -> io::Result<&str> {
    let is_inside = !name.is_empty()
        && !name.contains(['\\', ':', '\0'])
        && name.split('/').all(|part| !part.is_empty() && part != "..");
    if is_inside {
        Ok(name)
    } else {
        let name = name.escape_debug();
        Err(io::Error::new(
            io::ErrorKind::InvalidInput,
            format!("\"{name}\" is no file in the folder of the file that names it"),
        ))
    }
}

/// Returns the error of a file with its name.
pub(crate) fn named(name: &str, error: io::Error) -> io::Error {
    io::Error::new(error.kind(), format!("{}, which the file names: {error}", name.escape_debug()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_that_leave_the_folder_are_refused() {
        let files = InMemory(BTreeMap::from([("a/b.webp".to_owned(), vec![1])]));
        assert_eq!(files.read("a/b.webp").expect("a file of a folder inside"), [1], "files of folders inside are read");
        for name in ["../b", "a/../../b", "/etc/passwd", "", "a//b", "c:b", "a\\b"] {
            let found = files.read(name).expect_err("outside");
            assert_eq!(found.kind(), io::ErrorKind::InvalidInput, "{name} leaves the folder: {found}");
        }
        assert_eq!(files.read("c").expect_err("absent").kind(), io::ErrorKind::NotFound, "a file that is not there");
        assert!(files.has("a/b.webp") && !files.has("c"), "which files there are");
    }

    #[test]
    fn of_a_folder_only_files_are_read() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        std::fs::write(folder.path().join("a.bin"), [1]).expect("the folder can be written to");
        std::fs::create_dir(folder.path().join("b")).expect("the folder can be written to");
        let files = InFolder(folder.path());
        assert_eq!(files.read("a.bin").expect("a file"), [1], "a file");
        assert!(
            files.has("a.bin") && !files.has("b") && !files.has("c") && !files.has("../x"),
            "which files there are"
        );
        let message = files.read("b").expect_err("a folder").to_string();
        assert!(message.starts_with("b, which the file names: ") && message.contains("is a folder"), "{message}");
    }
}
