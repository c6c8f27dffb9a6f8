//! A capture in chunk files, on the disk.
//!
//! In: the path of its index. Out: a [`Take`], which says how large the files are, and one of its files, around which
//! the camera orbits. Both are read past the link, before anything is measured.

use crate::common::asset_path;
use crate::figures::mebibytes;
use bevy::asset::io::file::FileAssetReader;
use bevy::prelude::*;
use bevy_gs4d::asset::GaussianCapture;
use bevy_gs4d::codec::{self, ReadOptions};
use bevy_gs4d::scene::{ChunkTable, GaussianScene};
use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// How an index is made, for errors.
const REMEDY: &str = "`gs4d split long.gs4d -o chunks` writes chunks/index.gs4d";

/// A capture in chunk files.
pub struct Take {
    /// The path of the index.
    pub index: PathBuf,
    /// The duration at speed 1.
    pub seconds: f32,
    table: Arc<ChunkTable>,
}

impl Take {
    /// Reads the index of an argument of the command line.
    ///
    /// # Errors
    /// No argument; a file that cannot be read, or is no index.
    pub fn open(argument: &str) -> Result<Self> {
        if argument.is_empty() {
            return Err(format!("name the index of a capture in chunk files: {REMEDY}").into());
        }
        // An absolute path replaces the folder.
        let index = FileAssetReader::get_base_path().join("assets").join(asset_path(argument));
        let scene = read(&index)?;
        let seconds = scene.playback.duration_seconds;
        let table = scene.chunks.ok_or_else(|| format!("{argument}: not an index of chunk files; {REMEDY}"))?;
        Ok(Self { index, seconds, table })
    }

    /// Reads the file with the most Gaussians among those of the first layer.
    ///
    /// # Errors
    /// No files, a file that cannot be read.
    pub fn sample(&self) -> Result<GaussianCapture> {
        let files = &self.table.files;
        let first = files.iter().enumerate().filter(|(_, file)| file.layer == 0);
        let largest = first.max_by_key(|(_, file)| file.gaussians).map(|(number, _)| number);
        let number = largest.ok_or_else(|| format!("{}: an index without files", self.index.display()))?;
        let scene = read(&self.index.with_file_name(ChunkTable::file_name(number, files.len())))?;
        Ok(GaussianCapture::new(scene.into_runtime()?))
    }

    /// Returns the megabits a second of the layers up to one, over the whole capture.
    fn rate(&self, layer: u32) -> f64 {
        8e-6 * self.table.bytes_up_to(layer) as f64 / f64::from(self.seconds)
    }
}

impl fmt::Display for Take {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { index, seconds, table } = self;
        let (files, layers, last) = (table.files.len(), table.layers(), table.layers().saturating_sub(1));
        let size = mebibytes(table.bytes_up_to(last));
        write!(f, "{}: {seconds} s in {files} files of {layers} layers, {size:.1} MiB", index.display())?;
        write!(f, ": {:.1} Mbit/s, the first layer {:.1}", self.rate(last), self.rate(0))
    }
}

fn read(file: &Path) -> Result<GaussianScene> {
    // The text of the error, which names the file.
    Ok(codec::load(file, &ReadOptions::default()).map_err(|error| error.to_string())?)
}
