//! A file in memory that is read in steps, for programs that must go on meanwhile, as a page in a browser.
//!
//! In: the name and the bytes of a file, and [`ReadOptions`]. Out: after some steps, a [`GaussianScene`]. Packages are read in small steps, files of
//! other makes in one.

use super::error::{CodecError, CodecErrorKind};
use super::format::{self, Format, Read};
use super::import::source::InMemory;
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
    /// A file of another make, and its scene once it has been read.
    Other(Vec<u8>, Option<GaussianScene>),
}

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
            State::Other(_, Some(_)) => Ok(false),
            State::Other(bytes, scene) => {
                let bytes = std::mem::take(bytes);
                let beside = InMemory::default();
                *scene = Some(super::read_bytes(&self.path, &bytes, &beside, &self.options)?.scene);
                Ok(true)
            }
        };
        advance().map_err(|kind| CodecError { path: self.path.clone(), kind })
    }

    /// Returns the part of the file that has been read, 0 to 1.
    pub fn progress(&self) -> f32 {
        match &self.state {
            State::Package(reading) => reading.progress(),
            State::Other(_, scene) => f32::from(u8::from(scene.is_some())),
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
            State::Other(_, scene) => scene.ok_or_else(|| CodecErrorKind::UnknownFormat(format::unknown())),
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
            Some(Read::Bytes(_)) => Ok(Self::Other(bytes, None)),
            Some(Read::File(_) | Read::Folder(_)) | None => Err(CodecErrorKind::UnknownFormat(format::unknown())),
        }
    }
}
