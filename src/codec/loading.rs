//! A file in memory that is read in steps, for programs that must go on meanwhile, as a page in a browser.
//!
//! In: the name and the bytes of a file, and [`ReadOptions`]. Out: after some steps, a [`GaussianScene`]; after some more, a [`RuntimeScene`]. Packages are
//! read in small steps, checkpoints and files of other makes in one; all are converted in small steps.

use super::error::{CodecError, CodecErrorKind};
use super::found::Found;
use super::import::source::InMemory;
use super::input::Input;
use super::options::ReadOptions;
use super::package::{self, PackageError, Reading};
use crate::scene::{Conversion, GaussianScene, RuntimeScene};
use std::io::{self, Cursor};
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
    /// A file of another make, or inside of another file.
    Other(Box<Found<'static>>),
    /// Its scene.
    Read(Box<GaussianScene>),
    Converting(Box<Conversion>),
    /// A step has failed.
    Failed,
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
        let advanced = match &mut self.state {
            State::Package(reading) => reading.advance(bytes).map_err(CodecErrorKind::from),
            State::Other(_) => self.read_other().map(|()| true),
            State::Read(_) | State::Converting(_) => Ok(false),
            State::Failed => Err(failed()),
        };
        advanced.map_err(|kind| CodecError { path: self.path.clone(), kind })
    }

    /// Reads a file of another make.
    fn read_other(&mut self) -> Result<(), CodecErrorKind> {
        if let State::Other(found) = std::mem::replace(&mut self.state, State::Failed) {
            self.state = State::Read(Box::new(found.read(&self.options)?.scene));
        }
        Ok(())
    }

    /// Does one step towards a scene that can be drawn: as [`advance`](Self::advance), then as [`GaussianScene::into_runtime`], about `bytes` at most.
    /// Returns whether there is more to do.
    ///
    /// # Errors
    /// As [`load`](super::load); a Gaussian that cannot be drawn.
    pub fn advance_runtime(&mut self, bytes: usize) -> Result<bool, CodecError> {
        if !matches!(self.state, State::Converting(_)) && self.advance(bytes)? {
            return Ok(true);
        }
        let mut advance = || match std::mem::replace(&mut self.state, State::Failed) {
            State::Converting(mut conversion) => {
                let is_more = conversion.advance(bytes)?;
                self.state = State::Converting(conversion);
                Ok(is_more)
            }
            read => {
                self.state = State::Converting(Box::new(Conversion::of(read.scene(&self.options)?)?));
                Ok(true)
            }
        };
        advance().map_err(|kind| CodecError { path: self.path.clone(), kind })
    }

    /// Returns the part of the file that has been read, 0 to 1.
    pub fn progress(&self) -> f32 {
        match &self.state {
            State::Package(reading) => reading.progress(),
            State::Other(_) => 0.0,
            State::Read(_) | State::Converting(_) | State::Failed => 1.0,
        }
    }

    /// Does all remaining steps, and returns the scene; in the form that is drawn, if its conversion has begun.
    ///
    /// # Errors
    /// As [`load`](super::load).
    pub fn finish(mut self) -> Result<GaussianScene, CodecError> {
        while self.advance(usize::MAX)? {}
        self.state.scene(&self.options).map_err(|kind| CodecError { path: self.path, kind })
    }

    /// Does all remaining steps, and returns the scene that can be drawn.
    ///
    /// # Errors
    /// As [`advance_runtime`](Self::advance_runtime).
    pub fn finish_runtime(mut self) -> Result<RuntimeScene, CodecError> {
        while self.advance_runtime(usize::MAX)? {}
        let scene = match self.state {
            State::Converting(conversion) => conversion.finish().map_err(CodecErrorKind::from),
            _ => Err(failed()),
        };
        scene.map_err(|kind| CodecError { path: self.path, kind })
    }
}

fn failed() -> CodecErrorKind {
    io::Error::other("a step before has failed").into()
}

impl State {
    fn of(path: &Path, bytes: Vec<u8>, options: &ReadOptions) -> Result<Self, CodecErrorKind> {
        if bytes.starts_with(&package::MAGIC) {
            options.check().map_err(PackageError::from)?;
            return Ok(Self::Package(Box::new(Reading::new(Cursor::new(bytes))?)));
        }
        Ok(Self::Other(Box::new(Found::of(Input::of(bytes), path, Box::new(InMemory::default()))?)))
    }

    /// Returns the scene, once it has been read.
    fn scene(self, options: &ReadOptions) -> Result<GaussianScene, CodecErrorKind> {
        match self {
            Self::Package(reading) => Ok(reading.finish_with(options)?),
            Self::Read(scene) => Ok(*scene),
            Self::Converting(conversion) => Ok(conversion.finish()?.into()),
            Self::Other(_) | Self::Failed => Err(failed()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::synth::{SynthSettings, synthesize};
    use crate::scene::{SceneForm, Trained};

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
    fn a_scene_that_is_converted_in_steps_is_the_scene() {
        let synth = |degree| synthesize(&SynthSettings { count: 3000, degree, ..SynthSettings::default() });
        let packages = [synth(0), synth(3)].map(|scene| {
            let mut bytes = Vec::new();
            package::write(&mut bytes, &scene, &package::WriteSettings::default()).expect("it can be written");
            bytes
        });
        // Trained Gaussians, and packed ones with levels of detail.
        for bytes in packages.iter().map(Vec::as_slice).chain([BUNDLED]) {
            let loading = || Loading::new("it.gs4d", bytes.to_vec(), &ReadOptions::default()).expect("a package");
            let at_once = package::read(Cursor::new(bytes)).expect("it is intact").into_runtime().expect("drawable");
            for size in [1_000, 1 << 16, usize::MAX] {
                let (mut stepped, mut steps) = (loading(), 0);
                while stepped.advance_runtime(size).expect("it is intact") {
                    steps += 1;
                }
                assert!(steps > 10 || size > 1 << 16, "{steps} steps of {size} bytes");
                assert!(stepped.finish_runtime().expect("it is intact") == at_once, "every value is the same");
            }
            assert!(loading().finish_runtime().expect("it is intact") == at_once, "without a step, too");
        }
    }

    #[test]
    fn a_gaussian_that_cannot_be_drawn_is_named_when_it_is_converted() {
        let mut scene = synthesize(&SynthSettings { count: 3000, ..SynthSettings::default() });
        let SceneForm::Trained(Trained { parameters, .. }) = &mut scene.form else { panic!("a trained scene") };
        parameters.rotation_l[2100] = [0.0; 4];
        let mut bytes = Vec::new();
        package::write(&mut bytes, &scene, &package::WriteSettings::default()).expect("it can be written");
        let mut loading = Loading::new("it.gs4d", bytes, &ReadOptions::default()).expect("a package");
        let refused = loop {
            match loading.advance_runtime(1 << 14) {
                Ok(is_more) => assert!(is_more, "it is refused"),
                Err(error) => break error.to_string(),
            }
        };
        assert!(refused.starts_with("it.gs4d: Gaussian 2100: "), "{refused}");
        assert!(loading.advance_runtime(1).is_err() && loading.finish().is_err(), "it stays refused");
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
