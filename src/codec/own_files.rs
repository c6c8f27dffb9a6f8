//! The files of a capture.
//!
//! In: the path of a capture. Out: the paths of all files that it is read from: one, or those that a SOG in a folder and
//! a glTF file name. They are known by reading the capture.

use super::import::source::{Beside, InFolder};
use super::options::ReadOptions;
use super::{Opened, open};
use std::collections::BTreeSet;
use std::io;
use std::iter;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

/// The formats that name other files.
const NAMING: [&str; 2] = ["sog", "gltf"];

/// The names of files that have been read, relative to their folder.
type Names = Arc<Mutex<BTreeSet<String>>>;

/// Files in a folder on disk, and which of them have been read.
struct Recorded<'a> {
    folder: InFolder<'a>,
    names: Names,
}

impl Beside for Recorded<'_> {
    fn read(&self, name: &str) -> io::Result<Vec<u8>> {
        let bytes = self.folder.read(name)?;
        self.names.lock().unwrap_or_else(PoisonError::into_inner).insert(name.to_owned());
        Ok(bytes)
    }
}

/// Returns the files that a capture is read from: its own, then those that it names, by name. What is no capture is one
/// file.
pub fn files_of(path: &Path) -> Vec<PathBuf> {
    let names = Names::default();
    let opened = open(path, |folder| Box::new(Recorded { folder: InFolder(folder), names: names.clone() }));
    let Ok(Opened::File(mut found)) = opened else { return vec![path.to_owned()] };
    let own = if path.is_dir() { found.name.clone() } else { path.to_owned() };
    if NAMING.contains(&found.format.id) {
        // What is wrong with a capture is told where its scene is used.
        let _ = found.read(&ReadOptions::default());
    }
    let folder = own.parent().unwrap_or(Path::new("")).to_owned();
    let names = names.lock().unwrap_or_else(PoisonError::into_inner);
    let others: Vec<PathBuf> = names.iter().map(|name| folder.join(name)).collect();
    iter::once(own).chain(others).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    /// A glTF file whose Gaussians are in another file.
    const NAMES_ANOTHER: &str = r#"{
        "asset": {"version": "2.0"},
        "buffers": [{"uri": "a%20b.bin", "byteLength": 4}],
        "meshes": [{"primitives": [{"attributes": {}, "mode": 0, "extensions": {"KHR_gaussian_splatting": {}}}]}]
    }"#;

    #[test]
    fn files_that_a_capture_names_are_its_own() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let at = |name: &str| folder.path().join(name);
        for (name, bytes) in [("a.gltf", NAMES_ANOTHER), ("a b.bin", "1234"), ("other.bin", "1234"), ("c", "text")] {
            fs::write(at(name), bytes).expect("the folder can be written to");
        }
        assert_eq!(files_of(&at("a.gltf")), [at("a.gltf"), at("a b.bin")], "the file and its buffer");
        fs::remove_file(at("a b.bin")).expect("the file exists");
        assert_eq!(files_of(&at("a.gltf")), [at("a.gltf")], "without the buffer");
        assert_eq!(files_of(&at("c")), [at("c")], "no capture");
    }
}
