//! A capture in chunk files, on the disk.
//!
//! In: the path of its index, or of the file of the index and all chunk files. Out: a [`Take`], which says how large
//! the files are, and one of its files, around which the camera orbits. Both are read past the link, before anything is
//! measured.

use crate::common::asset_path;
use crate::figures::mebibytes;
use bevy::asset::io::file::FileAssetReader;
use bevy::prelude::*;
use bevy_gs4d::asset::GaussianCapture;
use bevy_gs4d::codec::package::Following;
use bevy_gs4d::codec::{CodecError, Loading, ReadOptions};
use bevy_gs4d::scene::{ChunkTable, ColorCodebooks, RuntimeScene};
use std::fmt;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// How an index is made, for errors.
const REMEDY: &str =
    "`gs4d split long.gs4d -o chunks` writes chunks/index.gs4d, and with `-o one.gs4d` all in one file";

/// A capture in chunk files.
pub struct Take {
    /// The path of the index.
    pub index: PathBuf,
    /// The duration at speed 1.
    pub seconds: f32,
    table: Arc<ChunkTable>,
    codebooks: Option<Arc<ColorCodebooks>>,
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
        let scene = read_index(&index)?;
        let seconds = scene.playback.duration_seconds;
        let codebooks = scene.form.coded_colors().map(|colors| colors.codebooks.clone());
        let table = scene.chunks.ok_or_else(|| format!("{argument}: not an index of chunk files; {REMEDY}"))?;
        Ok(Self { index, seconds, table, codebooks })
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
        let beside = self.index.with_file_name(ChunkTable::file_name(number, files.len()));
        let bytes = match self.table.range(number) {
            Some(range) => bytes_of(&self.index, range)?,
            None => bytes_of(&beside, 0..u64::MAX)?,
        };
        let options = ReadOptions { codebooks: self.codebooks.clone(), ..ReadOptions::default() };
        Ok(GaussianCapture::new(finished(Loading::new(&beside, bytes, &options))?))
    }

    /// Returns the megabits a second of the layers up to one, over the whole capture.
    fn rate(&self, layer: u32) -> f64 {
        8e-6 * self.table.bytes_up_to(layer) as f64 / f64::from(self.seconds)
    }
}

impl fmt::Display for Take {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { index, seconds, table, .. } = self;
        let (files, layers, last) = (table.files.len(), table.layers(), table.layers().saturating_sub(1));
        let size = mebibytes(table.bytes_up_to(last));
        write!(f, "{}: {seconds} s in {files} files of {layers} layers, {size:.1} MiB", index.display())?;
        write!(f, ": {:.1} Mbit/s, the first layer {:.1}", self.rate(last), self.rate(0))
    }
}

/// Reads an index, without the chunk files that may follow it.
fn read_index(file: &Path) -> Result<RuntimeScene> {
    let mut length = 1 << 16;
    let mut bytes = bytes_of(file, 0..length)?;
    while Following::of(&bytes) == Following::Undecided && bytes.len() as u64 == length {
        length *= 2;
        bytes = bytes_of(file, 0..length)?;
    }
    let options = ReadOptions::default();
    finished(match Following::of(&bytes) {
        Following::From(first) => Loading::of_index(file, bytes_of(file, 0..first)?, &options),
        _ => Loading::new(file, bytes_of(file, 0..u64::MAX)?, &options),
    })
}

/// Returns a part of a file, up to its end.
fn bytes_of(path: &Path, range: Range<u64>) -> Result<Vec<u8>> {
    let named = |error: std::io::Error| format!("{}: {error}", path.display());
    let mut file = File::open(path).map_err(named)?;
    file.seek(SeekFrom::Start(range.start)).map_err(named)?;
    let mut bytes = Vec::new();
    file.take(range.end - range.start).read_to_end(&mut bytes).map_err(named)?;
    Ok(bytes)
}

fn finished(loading: Result<Loading, CodecError>) -> Result<RuntimeScene> {
    // The text of the error, which names the file.
    Ok(loading.and_then(Loading::finish).map_err(|error| error.to_string())?)
}
