//! The folder of intermediate results, from which interrupted work resumes.
//!
//! In: a fingerprint of everything that a result depends on, and the result as bytes. Out: the same bytes; `None`, so
//! that the stage runs again, if the fingerprint is another or the bytes are damaged.
//!
//! Each fingerprint includes that of the previous stage, so that a change invalidates all later results.

use crate::codec::CodecError;
use crate::offline::{Progress, write_beside};
use std::fs::{self, File};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

/// First bytes of every stored result.
const MAGIC: [u8; 4] = *b"GS4W";
/// Version of the stored results: other versions count as absent.
const VERSION: u32 = 1;
/// Bytes of the header: magic, version, fingerprint, checksum of the body.
const HEAD: usize = 16;

/// A 32-bit checksum of everything that a result depends on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Fingerprint(pub u32);

impl Fingerprint {
    /// Returns the fingerprint of the contents of these files, in this order.
    ///
    /// # Errors
    /// The first file that cannot be read, by name.
    pub fn of_files(paths: &[&Path]) -> Result<Self, CodecError> {
        let mut hasher = crc32fast::Hasher::new();
        for path in paths {
            hash_file(path, &mut hasher)
                .map_err(|error| CodecError { path: path.to_path_buf(), kind: error.into() })?;
        }
        Ok(Self(hasher.finalize()))
    }

    /// Returns the fingerprint of this one and of `settings`.
    pub fn and(self, settings: &str) -> Self {
        let mut hasher = crc32fast::Hasher::new();
        hasher.update(&self.0.to_le_bytes());
        hasher.update(settings.as_bytes());
        Self(hasher.finalize())
    }
}

fn hash_file(path: &Path, hasher: &mut crc32fast::Hasher) -> io::Result<()> {
    let mut file = File::open(path)?;
    let mut length = 0u64;
    let mut block = vec![0; 1 << 16];
    loop {
        let count = file.read(&mut block)?;
        if count == 0 {
            break;
        }
        length += count as u64;
        hasher.update(&block[..count]);
    }
    // The length separates the files: their bytes are hashed one after the other.
    hasher.update(&length.to_le_bytes());
    Ok(())
}

/// The folder of intermediate results.
#[derive(Debug, Clone)]
pub struct Work {
    folder: PathBuf,
}

impl Work {
    /// Returns the folder beside the package `out` whose name ends in `ending` as well (`OUT.bake`), created if it does not exist.
    ///
    /// # Errors
    /// The folder cannot be created.
    pub fn beside(out: &Path, ending: &str) -> Result<Self, CodecError> {
        let mut name = out.file_name().unwrap_or_default().to_owned();
        name.push(ending);
        let folder = out.with_file_name(name);
        fs::create_dir_all(&folder).map_err(|error| CodecError { path: folder.clone(), kind: error.into() })?;
        Ok(Self { folder })
    }

    /// Returns the path of the folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Returns a stored result; `None` if there is none, or if it is damaged or has another fingerprint.
    pub fn load(&self, name: &str, fingerprint: Fingerprint) -> Option<Vec<u8>> {
        let bytes = fs::read(self.folder.join(name)).ok()?;
        let (head, body) = bytes.split_at_checked(HEAD)?;
        (head == self::head(fingerprint, body)).then(|| body.to_vec())
    }

    /// Stores a result, whole or not at all.
    ///
    /// # Errors
    /// A folder that cannot be written to, a full disk.
    pub fn store(
        &self,
        name: &str,
        fingerprint: Fingerprint,
        body: &[u8],
        progress: &mut dyn Progress,
    ) -> Result<(), CodecError> {
        progress.uninterrupted(&mut || {
            write_beside(&self.folder.join(name), |file| {
                file.write_all(&head(fingerprint, body))?;
                file.write_all(body)
            })
        })
    }

    /// Removes the folder if nothing was stored.
    pub fn remove_if_empty(&self) {
        // `remove_dir` does not remove a folder that has contents.
        let _ = fs::remove_dir(&self.folder);
    }

    /// Removes the folder and what is in it.
    ///
    /// # Errors
    /// The folder or its contents cannot be removed.
    pub fn remove(self) -> Result<(), CodecError> {
        fs::remove_dir_all(&self.folder).map_err(|error| CodecError { path: self.folder.clone(), kind: error.into() })
    }
}

fn head(fingerprint: Fingerprint, body: &[u8]) -> [u8; HEAD] {
    let mut head = [0; HEAD];
    head[..4].copy_from_slice(&MAGIC);
    head[4..8].copy_from_slice(&VERSION.to_le_bytes());
    head[8..12].copy_from_slice(&fingerprint.0.to_le_bytes());
    head[12..].copy_from_slice(&crc32fast::hash(body).to_le_bytes());
    head
}

/// Returns the little-endian bytes of words.
pub fn bytes(words: &[u32]) -> Vec<u8> {
    words.iter().flat_map(|word| word.to_le_bytes()).collect()
}

/// Returns the words of little-endian bytes. A remainder of fewer than four bytes is ignored.
pub fn words(bytes: &[u8]) -> Vec<u32> {
    bytes.as_chunks().0.iter().map(|&four| u32::from_le_bytes(four)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::offline::NoProgress;

    #[test]
    fn results_come_back_for_the_same_fingerprint_alone() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let out = folder.path().join("scene.gs4d");
        fs::write(&out, b"input").expect("the folder can be written to");
        let inputs = Fingerprint::of_files(&[&out]).expect("the file is there");
        let work = Work::beside(&out, ".bake").expect("the folder can be made");
        let (settings, others) = (inputs.and("ratio 0.8"), inputs.and("ratio 0.5"));
        let stored = work.store("kept", settings, b"some bytes", &mut NoProgress);
        stored.expect("the folder can be written to");
        assert_eq!(work.load("kept", settings).as_deref(), Some(b"some bytes".as_slice()), "the same inputs");
        assert_eq!(work.load("kept", others), None, "other settings");
        assert_eq!(work.load("filter", settings), None, "never stored");
        let path = work.folder().join("kept");
        let mut bytes = fs::read(&path).expect("stored");
        bytes[HEAD + 2] ^= 1;
        fs::write(&path, &bytes).expect("the folder can be written to");
        assert_eq!(work.load("kept", settings), None, "a changed byte");
        fs::write(&path, &bytes[..7]).expect("the folder can be written to");
        assert_eq!(work.load("kept", settings), None, "cut off");
        work.remove().expect("the folder can be removed");
        assert_eq!(fs::read_dir(folder.path()).expect("the folder").count(), 1, "nothing stays behind");
    }

    #[test]
    fn fingerprints_depend_on_every_file() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let file = |name: &str, bytes: &[u8]| {
            let path = folder.path().join(name);
            fs::write(&path, bytes).expect("the folder can be written to");
            path
        };
        let (ab, c, a, bc) = (file("ab", b"ab"), file("c", b"c"), file("a", b"a"), file("bc", b"bc"));
        let of = |paths: &[&Path]| Fingerprint::of_files(paths).expect("the files are there");
        assert_ne!(of(&[&ab, &c]), of(&[&a, &bc]), "borders between files count");
        assert_ne!(of(&[&ab, &c]), of(&[&c, &ab]), "and so does their order");
        let gone = Fingerprint::of_files(&[&folder.path().join("gone")]).expect_err("not there").to_string();
        assert!(gone.contains("gone"), "the file is named: {gone}");
    }
}
