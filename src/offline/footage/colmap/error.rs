//! The errors of COLMAP.
//!
//! In: a step that has failed, cameras that have no pose. Out: a [`ColmapError`], with the remedy.

use crate::offline::dataset::DatasetError;
use crate::offline::work::Interrupted;
use std::io;
use std::path::PathBuf;
use std::process::ExitStatus;

/// The ways to install the program.
const INSTALL: &str = "apt install colmap (Debian, Ubuntu), brew install colmap (macOS), conda install -c conda-forge \
                       colmap (any system), or pip install -U pycolmap (Python, on Linux, macOS and Windows)";
/// What helps where cameras cannot be placed by their pictures.
const REMEDY: &str = "their pictures share too few details with others: put cameras at most 30 degrees apart, hang \
                      patterned cloths or posters where several cameras see them, or add a calibration of the cameras";

/// Why there are no poses or no points.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ColmapError {
    /// The program is not installed.
    #[error("poses are found by COLMAP, which is not installed: {INSTALL}; or add a calibration of the cameras")]
    Missing,
    /// The program cannot be started.
    #[error("{program} cannot be run: {reason}; install it again: {INSTALL}")]
    Run {
        /// Its name and version.
        program: String,
        /// The error of the operating system.
        reason: io::Error,
    },
    /// The program has ended with an error.
    #[error("{program} has failed at {step}, {status}: {said}; try another version: {INSTALL}")]
    Step {
        /// Its name and version.
        program: String,
        /// The step, as the program names it.
        step: &'static str,
        /// How it ended.
        status: ExitStatus,
        /// The last of its messages.
        said: String,
    },
    /// A file for the program cannot be written or read.
    #[error(
        "{}: {reason}; files for COLMAP are in the folder of temporary files, which TMPDIR names: free some space",
        .path.display()
    )]
    Scratch {
        /// The file or the folder.
        path: PathBuf,
        /// The fault.
        reason: io::Error,
    },
    /// There are no two cameras.
    #[error("poses are found by pictures of several cameras, and {cameras} have pictures: add cameras")]
    Few {
        /// Number of cameras with pictures.
        cameras: usize,
    },
    /// Too few cameras could be placed.
    #[error("{program} has placed {placed} of {cameras} cameras, and not {names} ({said}): {REMEDY}")]
    Unplaced {
        /// Its name and version.
        program: String,
        /// The names of the others.
        names: String,
        /// Number of cameras that are placed.
        placed: usize,
        /// Number of cameras with pictures.
        cameras: usize,
        /// The last of its messages.
        said: String,
    },
    /// A model of the program cannot be read.
    #[error("{0}")]
    Dataset(#[from] DatasetError),
    /// The user has interrupted the work.
    #[error("{0}")]
    Interrupted(#[from] Interrupted),
}

/// Returns a sentence about cameras that are left out.
pub(crate) fn left_out(program: &str, names: &str, count: usize) -> String {
    format!("{program} could not place {count} cameras, which are left out ({names}): {REMEDY}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_program_is_named_with_the_commands_that_install_it() {
        let error = ColmapError::Missing.to_string();
        for command in
            ["apt install colmap", "brew install colmap", "conda install -c conda-forge colmap", "install -U pycolmap"]
        {
            assert!(error.contains(command), "{command:?} is not in: {error}");
        }
    }
}
