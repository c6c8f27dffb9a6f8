//! The path of a package to write, and its compression.
//!
//! In: options, the files that are read, a scene. Out: the package on disk.

use crate::cli::output::failure::Failure;
use crate::offline::store::outputs::Files;
use crate::offline::work::{save, write_settings};
use crate::scene::GaussianScene;
use std::path::{Path, PathBuf};
use std::{fs, io};

/// Where to write a package, and how.
#[derive(clap::Args)]
pub(crate) struct PackageArgs {
    /// The package to write (.gs4d). An existing file is replaced when the new one is complete.
    #[arg(value_name = "OUT", required_unless_present = "out_option")]
    out: Option<PathBuf>,
    /// The package to write, as an option.
    #[arg(short = 'o', long = "out", value_name = "OUT", conflicts_with = "out")]
    out_option: Option<PathBuf>,
    /// zstd level, 1 (fast) to 19 (small) [default: 9; of packed captures 19].
    #[arg(long, value_name = "LEVEL", value_parser = clap::value_parser!(i32).range(1..=19))]
    pub level: Option<i32>,
}

impl PackageArgs {
    /// Returns the path to write to.
    ///
    /// # Errors
    /// No path is given.
    pub(crate) fn out(&self) -> Result<&Path, Failure> {
        let out = self.out.as_deref().or(self.out_option.as_deref());
        out.ok_or_else(|| Failure::new("no OUT is given: name the package to write"))
    }

    /// Returns the path to write to, after a check that a package can be written there; `files` are those that the verb
    /// reads.
    ///
    /// # Errors
    /// As [`out`](Self::out), and those of [`Files::check`].
    pub(crate) fn checked_out(&self, files: Files) -> Result<&Path, Failure> {
        let out = self.out()?;
        files.writes(out, "gs4d").check()?;
        Ok(out)
    }

    /// As [`checked_out`](Self::checked_out), for verbs that read the package again or write other files beside it: a
    /// device or a pipe is refused.
    ///
    /// # Errors
    /// As [`checked_out`](Self::checked_out).
    pub(crate) fn checked_file(&self, files: Files) -> Result<&Path, Failure> {
        let out = self.out()?;
        files.writes_regular(out, "gs4d").check()?;
        Ok(out)
    }

    /// Writes the package. Returns its size in bytes.
    ///
    /// # Errors
    /// Errors of the codec.
    pub(crate) fn save(&self, scene: &GaussianScene) -> Result<u64, Failure> {
        let out = self.out()?;
        let settings = write_settings(&scene.form, self.level);
        save(out, scene, &settings)?;
        file_size(out)
    }
}

/// Returns the size of a file, or of the files of a folder, bytes.
///
/// # Errors
/// The file or the folder cannot be accessed.
pub(crate) fn file_size(path: &Path) -> Result<u64, Failure> {
    let at = |error| Failure::at(path, &error);
    let metadata = fs::metadata(path).map_err(at)?;
    if !metadata.is_dir() {
        return Ok(metadata.len());
    }
    let size = |entry: io::Result<fs::DirEntry>| Ok(entry?.metadata()?.len());
    fs::read_dir(path).and_then(|entries| entries.map(size).sum()).map_err(at)
}
