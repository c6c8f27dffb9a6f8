//! A file in memory that is read in steps, for programs that must go on meanwhile, as a page in a browser.
//!
//! In: the name and the bytes of a file, and [`ReadOptions`]. Out: after some steps, a [`GaussianScene`]. Packages are read in small steps, files of
//! other makes in one.

use super::error::{CodecError, CodecErrorKind};
use super::format::{self, Format, Read};
use super::import::source::{InMemory, Source};
use super::import::{ImportError, Imported};
use super::options::ReadOptions;
use super::package::{self, PackageError, Reading};
use super::start::Start;
use crate::scene::GaussianScene;
use std::io::Cursor;
use std::path::{Path, PathBuf};

/// A file that is being read.
///
/// # Examples
///
/// ```
/// use bevy_gs4d::codec::{Loading, ReadOptions};
///
/// let bytes = std::fs::read(concat!(env!("CARGO_MANIFEST_DIR"), "/assets/toybox.gs4d"))?;
/// let mut loading = Loading::new("toybox.gs4d", bytes, &ReadOptions::default())?;
/// while loading.advance(1 << 20)? {
///     // A page draws here, and shows the progress.
///     assert!((0.0..=1.0).contains(&loading.progress()), "a part of the file");
/// }
/// let scene = loading.finish()?;
/// assert_eq!(scene.len(), 45_000, "all Gaussians");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Loading {
    path: PathBuf,
    options: ReadOptions,
    state: State,
}

enum State {
    Package(Box<Reading<Cursor<Vec<u8>>>>),
    /// A file of another make, and how it is read.
    Other(Vec<u8>, ReadBytes),
    /// Its scene.
    Read(Box<GaussianScene>),
}

type ReadBytes = fn(&Source<'_>, &ReadOptions) -> Result<Imported, ImportError>;

impl Loading {
    /// Recognizes the format of a file by its contents, or by the extension of its name, and reads the header of a package.
    ///
    /// # Errors
    /// Bytes of an unknown format; a damaged header; options that are invalid.
    pub fn new(name: &str, bytes: Vec<u8>, options: &ReadOptions) -> Result<Self, CodecError> {
        let path = PathBuf::from(name);
        let state = State::of(&path, bytes, options).map_err(|kind| CodecError { path: path.clone(), kind })?;
        Ok(Self { path, options: options.clone(), state })
    }

    /// Does one step. For a package it decompresses or stores about `bytes` at most. Returns whether there is more to do.
    ///
    /// # Errors
    /// As [`load`](super::load).
    pub fn advance(&mut self, bytes: usize) -> Result<bool, CodecError> {
        let mut advance = || match &mut self.state {
            State::Package(reading) => Ok(reading.advance(bytes)?),
            State::Other(bytes, read) => {
                let source = Source { bytes, beside: &InMemory::default() };
                self.state = State::Read(Box::new(read(&source, &self.options)?.scene));
                Ok(true)
            }
            State::Read(_) => Ok(false),
        };
        advance().map_err(|kind| CodecError { path: self.path.clone(), kind })
    }

    /// Returns the part of the file that has been read, 0 to 1.
    pub fn progress(&self) -> f32 {
        match &self.state {
            State::Package(reading) => reading.progress(),
            State::Other(..) => 0.0,
            State::Read(_) => 1.0,
        }
    }

    /// Does all remaining steps, and returns the scene.
    ///
    /// # Errors
    /// As [`load`](super::load).
    pub fn finish(mut self) -> Result<GaussianScene, CodecError> {
        while self.advance(usize::MAX)? {}
        let finish = || match self.state {
            State::Package(reading) => Ok(reading.finish_with(&self.options)?),
            State::Read(scene) => Ok(*scene),
            State::Other(..) => Err(CodecErrorKind::UnknownFormat(format::unknown())),
        };
        finish().map_err(|kind| CodecError { path: self.path, kind })
    }
}

impl State {
    fn of(path: &Path, bytes: Vec<u8>, options: &ReadOptions) -> Result<Self, CodecErrorKind> {
        if bytes.starts_with(&package::MAGIC) {
            options.check().map_err(PackageError::from)?;
            return Ok(Self::Package(Box::new(Reading::new(Cursor::new(bytes))?)));
        }
        match Format::of(&Start::of(&mut Cursor::new(&bytes), path)?).map(|format| format.read) {
            Some(Read::Bytes(read)) => Ok(Self::Other(bytes, read)),
            Some(Read::File(_) | Read::Folder(_)) | None => Err(CodecErrorKind::UnknownFormat(format::unknown())),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BUNDLED: &[u8] = include_bytes!("../../assets/toybox.gs4d");

    fn loading(bytes: &[u8]) -> Result<GaussianScene, CodecError> {
        let mut loading = Loading::new("toybox.gs4d", bytes.to_vec(), &ReadOptions::default())?;
        let mut before = 0.0;
        while loading.advance(10_007)? {
            assert!(loading.progress() >= before, "the progress does not go back");
            before = loading.progress();
        }
        assert_eq!(loading.progress(), 1.0, "all has been read");
        loading.finish()
    }

    #[test]
    fn a_package_that_is_read_in_steps_is_the_package() {
        let at_once = package::read(Cursor::new(BUNDLED)).expect("the bundled capture is intact");
        assert!(loading(BUNDLED).expect("it is read in steps") == at_once, "every value is the same");
    }

    #[test]
    fn a_damaged_file_is_refused_with_its_name() {
        let mut damaged = BUNDLED.to_vec();
        let last = damaged.len() - 1;
        damaged[last] ^= 1;
        for (bytes, expected) in [(&damaged[..], "checksum"), (&BUNDLED[..9_000], "cut off"), (b"other", "neither")] {
            let message = loading(bytes).expect_err("it is refused").to_string();
            assert!(message.starts_with("toybox.gs4d: ") && message.contains(expected), "{message}");
        }
    }
}
