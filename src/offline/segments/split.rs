//! A capture as chunk files.
//!
//! In: a capture, and how it is cut; a packed capture has been cut when it was compressed. Out: a file for each layer of each run of
//! Gaussians: a capture with the clock of the whole, of which any player shows what it has. Together they are the whole
//! capture: see `unite`. The index beside them, or before them in one file, has everything but the Gaussians, and the table
//! of the files.

use super::error::SegmentsError;
use super::files::chunks_in;
use super::layers::LayerShares;
use super::parts::{LEAST, lives, parts};
use super::segment::Segment;
use super::sound_beside::{remove_index, write_sound};
use crate::codec::package;
use crate::offline::work::{FileError, Progress, proceed, save, save_chunk, save_one_file, write_settings};
use crate::scene::packed::runs::Part;
use crate::scene::{ChunkFile, ChunkTable, FilterKind, Form, GaussianScene, PackedScene, RunPart, Runs, SceneForm};
use std::collections::HashSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A chunk file.
#[derive(Debug, Clone, PartialEq)]
pub struct Chunk {
    /// The file, or the one file of all.
    pub path: PathBuf,
    /// The times between which its Gaussians are alive, timestamp units.
    pub times: [f64; 2],
    /// Its layer, number of Gaussians and length.
    pub file: ChunkFile,
}

/// The files of a capture that has been cut.
#[derive(Debug, Clone, PartialEq)]
pub struct Chunks {
    /// The index, or the file of the index and all chunk files.
    pub index: PathBuf,
    /// The table of the index.
    pub table: ChunkTable,
    /// The chunk files, in the order of the table.
    pub files: Vec<Chunk>,
}

/// A capture cut into chunks that are not yet written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Split {
    /// By first stretch, the shorter before the longer, those of the same stretches by layer; of a packed capture as in its
    /// runs.
    parts: Vec<Part>,
    /// Number of stretches of time.
    stretches: u32,
}

impl Split {
    /// Cuts a capture into `stretches` stretches of time, 1 to [`ChunkTable::MOST_STRETCHES`], and the Gaussians of each
    /// run of stretches into layers.
    ///
    /// # Errors
    /// A packed capture ([`of_runs`](Self::of_runs)), a Gaussian that cannot be drawn, more than
    /// [`ChunkTable::MOST_FILES`] files.
    pub fn of(segment: &Segment, stretches: u32, shares: &LayerShares) -> Result<Self, SegmentsError> {
        segment.require_unpacked()?;
        let stretches = stretches.clamp(1, ChunkTable::MOST_STRETCHES);
        let scene = &segment.scene;
        let gaussians = scene.gaussians().map_err(|error| segment.at(error))?;
        let lives = lives(&gaussians, scene.filter.as_ref(), &scene.trained_with, stretches);
        let parts = parts(&gaussians, &lives, stretches, shares, LEAST);
        match parts.len() > ChunkTable::MOST_FILES {
            true => Err(SegmentsError::ManyChunks { path: segment.path.clone(), found: parts.len() }),
            false => Ok(Self { parts, stretches }),
        }
    }

    /// Cuts a packed capture as it has been cut when it was compressed: no value changes.
    ///
    /// # Errors
    /// A capture that has no runs, or whose Gaussians have been given longer lifespans since.
    pub fn of_runs(segment: &Segment) -> Result<Self, SegmentsError> {
        let SceneForm::Ready(Form::Packed(PackedScene { runs: Some(runs), .. })) = &segment.scene.form else {
            return Err(SegmentsError::NoRuns { path: segment.path.clone() });
        };
        let Runs { stretches, .. } = *runs;
        let scene = &segment.scene;
        let gaussians = scene.gaussians().map_err(|error| segment.at(error))?;
        // As when it was compressed: a support filter follows from the lifespans.
        let filter = scene.filter.as_ref().filter(|filter| filter.kind != FilterKind::Support);
        let lives = lives(&gaussians, filter, &scene.trained_with, stretches);
        let is_within =
            |[first, last]: [u32; 2], part: &RunPart| part.stretches[0] <= first && last <= part.stretches[1];
        if !runs.ranges().all(|(part, range)| lives[range].iter().all(|life| is_within(*life, part))) {
            return Err(SegmentsError::OtherRuns { path: segment.path.clone() });
        }
        let parts = runs.ranges().map(|(part, range)| {
            let gaussians = (range.start as u32..range.end as u32).collect();
            Part { stretches: part.stretches, layer: part.layer, gaussians }
        });
        Ok(Self { parts: parts.collect(), stretches })
    }

    /// Returns the chunk files that it will be in. The index [`ChunkTable::INDEX`] is written beside them.
    pub fn paths(&self, folder: &Path) -> Vec<PathBuf> {
        let count = self.parts.len();
        (0..count).map(|number| folder.join(ChunkTable::file_name(number, count))).collect()
    }

    /// Returns the number of layers.
    pub fn layers(&self) -> u32 {
        self.parts.iter().map(|part| part.layer + 1).max().unwrap_or_default()
    }

    /// Returns the capture without the layers from `count` on.
    pub fn first_layers(&self, scene: &GaussianScene, count: u32) -> GaussianScene {
        let of_first = self.parts.iter().filter(|part| part.layer < count);
        let mut keep: Vec<u32> = of_first.flat_map(|part| &part.gaussians).copied().collect();
        keep.sort_unstable();
        scene.select(&keep)
    }

    /// Writes the chunk files of the capture into a folder, which exists, and then their index: where it is, all files
    /// are complete. `level` is the zstd level, `None` the usual one. `psnrs` are those of held-out views without a layer,
    /// with the first, with the first two and so on, dB, from which the index has the utilities of the layers; empty if they
    /// were not measured. Begins the task "writing".
    ///
    /// # Errors
    /// Files that cannot be written, a sound of no capture where that of this one belongs, an interruption.
    pub fn write(
        &self,
        segment: &Segment,
        folder: &Path,
        level: Option<i32>,
        psnrs: &[f64],
        progress: &mut dyn Progress,
    ) -> Result<Chunks, SegmentsError> {
        progress.begin("writing", self.parts.len() + 1);
        let (index, settings) = (folder.join(ChunkTable::INDEX), write_settings(&segment.scene.form, level));
        remove_index(folder, segment.scene.sound.as_deref())?;
        let mut files = Vec::with_capacity(self.parts.len());
        for (part, path) in self.parts.iter().zip(self.paths(folder)) {
            proceed(progress)?;
            save_chunk(&path, &chunk_of(&segment.scene, part, files.is_empty()), &settings)?;
            let bytes = fs::metadata(&path).map_err(|error| FileError::at(&path, error))?.len();
            files.push(self.written(&segment.scene, part, path, bytes));
            progress.advance();
        }
        proceed(progress)?;
        let table = self.table(&segment.scene, &files, psnrs);
        write_sound(folder, segment.scene.sound.as_deref())?;
        save(&index, &index_of(&segment.scene, &table), &settings)?;
        progress.advance();
        progress.finish();
        Ok(Chunks { index, table, files })
    }

    /// Writes the index of the capture and its chunk files after it into one file, of which players read parts. Until the
    /// file is written, all chunk files are in memory, compressed. For `level` and `psnrs` see [`write`](Self::write), which
    /// also begins this task.
    ///
    /// # Errors
    /// A capture with a sound, which players would have to read before the first picture; a file that cannot be written, an
    /// interruption.
    pub fn write_one_file(
        &self,
        segment: &Segment,
        path: &Path,
        level: Option<i32>,
        psnrs: &[f64],
        progress: &mut dyn Progress,
    ) -> Result<Chunks, SegmentsError> {
        if segment.scene.sound.is_some() {
            return Err(SegmentsError::Sound { path: segment.path.clone() });
        }
        progress.begin("writing", self.parts.len() + 1);
        let settings = write_settings(&segment.scene.form, level);
        let (mut files, mut bodies) = (Vec::with_capacity(self.parts.len()), Vec::with_capacity(self.parts.len()));
        for part in &self.parts {
            proceed(progress)?;
            let (mut body, chunk) = (Vec::new(), chunk_of(&segment.scene, part, bodies.is_empty()));
            package::write_chunk(&mut body, &chunk, &settings).map_err(|error| FileError::at(path, error))?;
            files.push(self.written(&segment.scene, part, path.to_owned(), body.len() as u64));
            bodies.push(body);
            progress.advance();
        }
        proceed(progress)?;
        let table = self.table(&segment.scene, &files, psnrs);
        save_one_file(path, &index_of(&segment.scene, &table), &bodies, &settings)?;
        let length = fs::metadata(path).map_err(|error| FileError::at(path, error))?.len();
        let first_byte = Some(length - files.iter().map(|chunk| chunk.file.bytes).sum::<u64>());
        progress.advance();
        progress.finish();
        Ok(Chunks { index: path.to_owned(), table: ChunkTable { first_byte, ..table }, files })
    }

    /// Returns what is known of a chunk file that has been written.
    fn written(&self, scene: &GaussianScene, part: &Part, path: PathBuf, bytes: u64) -> Chunk {
        let Part { stretches, layer, ref gaussians } = *part;
        let file = ChunkFile { stretches, layer, gaussians: gaussians.len() as u64, bytes };
        Chunk { path, times: self.times(scene, stretches), file }
    }

    /// Returns the table of files beside their index.
    fn table(&self, scene: &GaussianScene, files: &[Chunk], psnrs: &[f64]) -> ChunkTable {
        let files = || files.iter().map(|chunk| chunk.file);
        ChunkTable {
            stretches: self.stretches,
            gaussian_bytes: scene.gaussian_bytes(),
            files: files().collect(),
            utilities: utilities(psnrs, files()),
            first_byte: None,
        }
    }

    /// Returns the times between which Gaussians of these stretches are alive, timestamp units.
    fn times(&self, scene: &GaussianScene, stretches: [u32; 2]) -> [f64; 2] {
        let [first, last] = scene.trained_with.time_interval.map(f64::from);
        let time = |stretch: u32| first + (last - first) * f64::from(stretch) / f64::from(self.stretches);
        [time(stretches[0]), time(stretches[1] + 1)]
    }
}

/// Returns the scene of a chunk file.
fn chunk_of(scene: &GaussianScene, part: &Part, is_first: bool) -> GaussianScene {
    let mut chunk = scene.select(&part.gaussians);
    // All chunks have one environment map, and the same sockets and colliders, in the first file.
    if !is_first {
        chunk.environment = None;
        chunk.sockets.clear();
        chunk.colliders = None;
    }
    GaussianScene { sound: None, ..chunk }
}

/// Returns the index of a capture in chunk files.
fn index_of(scene: &GaussianScene, table: &ChunkTable) -> GaussianScene {
    let chunks = Some(Arc::new(table.clone()));
    GaussianScene { filter: None, sound: None, chunks, ..scene.select(&[]) }
}

/// Returns the utility of each layer, dB per megabyte of its files, given the PSNR without a layer, with the first, with the
/// first two and so on.
fn utilities(psnrs: &[f64], files: impl Iterator<Item = ChunkFile> + Clone) -> Vec<f32> {
    let bytes = |layer: u32| files.clone().filter(|file| file.layer == layer).map(|file| file.bytes).sum::<u64>();
    let gains = psnrs.windows(2).map(|pair| pair[1] - pair[0]);
    (0..).zip(gains).map(|(layer, gain)| (gain * 1e6 / bytes(layer).max(1) as f64) as f32).collect()
}

/// Returns the chunk files in a folder that are none of these files: they would be read with them. None if there is no
/// such folder.
pub fn other_chunks(folder: &Path, files: &[PathBuf]) -> Vec<PathBuf> {
    let mut others = chunks_in(folder).unwrap_or_default();
    let files: HashSet<&PathBuf> = files.iter().collect();
    others.retain(|chunk| !files.contains(chunk));
    others
}

#[cfg(test)]
mod tests {
    use super::super::parts::importance;
    use super::super::sound_beside::sound_beside;
    use super::super::unite::unite;
    use super::*;
    use crate::codec::{self, ReadOptions};
    use crate::offline::work::NoProgress;
    use crate::offline::work::progress::InterruptedProgress;
    use crate::scene::synth::{SynthSettings, synthesize};
    use crate::scene::{Colliders, Environment, SoundFile};

    const COUNT: usize = 6000;

    fn read(path: &Path) -> Segment {
        let scene = codec::load(path, &ReadOptions::default()).expect("the package can be read");
        Segment { path: path.to_owned(), scene }
    }

    fn whole() -> Segment {
        let mut scene = synthesize(&SynthSettings { count: COUNT, ..SynthSettings::default() });
        scene.colliders = Some(Arc::default());
        scene.sound = Some(Arc::new(SoundFile::new(b"a song").expect("a file has bytes")));
        Segment { path: PathBuf::from("whole.gs4d"), scene }
    }

    fn cut(whole: &Segment, shares: &[u32], folder: &Path) -> (Split, Chunks) {
        let shares = LayerShares::new(shares.to_vec()).expect("shares of 100 in all");
        let split = Split::of(whole, 8, &shares).expect("every Gaussian can be drawn");
        let chunks = split.write(whole, folder, Some(1), &[], &mut NoProgress).expect("files can be written");
        (split, chunks)
    }

    #[test]
    fn chunks_are_the_whole_capture_and_united_they_stay_as_they_are() {
        for shares in [&[100][..], &[25, 25, 50]] {
            let folder = tempfile::tempdir().expect("a temporary folder");
            let (mut whole, mut before) = (whole(), Vec::new());
            for round in 0..2 {
                let (split, chunks) = cut(&whole, shares, folder.path());
                let count = chunks.files.iter().map(|chunk| chunk.file.gaussians).sum::<u64>();
                assert_eq!(count, COUNT as u64, "each Gaussian once");
                assert_eq!(chunks.table.layers(), shares.len() as u32, "as many layers as shares");
                assert!(chunks.files.len() > 2, "several runs: {}", chunks.files.len());
                let files = split.paths(folder.path());
                assert!(other_chunks(folder.path(), &files).is_empty(), "no other chunk");
                assert_eq!(other_chunks(folder.path(), &files[1..]), [files[0].clone()], "another chunk");
                for (chunk, file) in chunks.files.iter().zip(&files) {
                    let [first, last] = chunk.times;
                    let own = read(file);
                    assert_eq!(own.scene.colliders.is_some(), *file == files[0], "the first file has the colliders");
                    assert!(own.scene.sound.is_none(), "the sound is a file of its own");
                    let cutoff = own.scene.trained_with.marginal_cutoff;
                    for gaussian in own.scene.gaussians().expect("every Gaussian can be drawn").iter() {
                        let is_drawn = |time: f64| gaussian.marginal(time as f32) > cutoff;
                        assert!(first <= 0.0 || !is_drawn(first - 1e-3), "alive before {first}");
                        assert!(last >= 1.0 || !is_drawn(last + 1e-3), "alive after {last}");
                    }
                }
                let united = unite(files.iter().map(|file| read(file)).collect(), &mut NoProgress);
                whole.scene = united.expect("chunks of one capture");
                assert!(whole.scene.colliders.is_some(), "the whole capture has the colliders");
                whole.scene.sound = sound_beside(folder.path()).expect("the sound can be read");
                assert_eq!(whole.scene.sound.as_ref().map(|sound| sound.bytes()), Some(&b"a song"[..]), "the sound");
                let written = files.iter().chain([&chunks.index]);
                let bytes: Vec<Vec<u8>> = written.map(|file| fs::read(file).expect("it was written")).collect();
                assert!(round == 0 || bytes == before, "the chunks of united chunks are the same files");
                before = bytes;
            }
        }
    }

    #[test]
    fn the_first_layer_of_a_run_is_the_most_important() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let (_, chunks) = cut(&whole(), &[25, 25, 50], folder.path());
        let order = |chunk: &Chunk| (chunk.file.stretches, chunk.file.layer);
        assert!(chunks.files.is_sorted_by_key(order), "by first stretch, the shorter first, then by layer");
        let extremes = |chunk: &Chunk| {
            let scene = read(&chunk.path).scene;
            let gaussians = scene.gaussians().expect("every Gaussian can be drawn");
            let ends = (f32::INFINITY, 0.0_f32);
            gaussians.iter().map(importance).fold(ends, |(least, most), own| (least.min(own), most.max(own)))
        };
        let mut compared = 0;
        for pair in chunks.files.windows(2).filter(|pair| pair[0].file.stretches == pair[1].file.stretches) {
            assert_eq!(pair[0].file.layer + 1, pair[1].file.layer, "no layer is left out");
            let ((least, _), (_, most)) = (extremes(&pair[0]), extremes(&pair[1]));
            assert!(least >= most, "{least} in a layer, {most} in the next");
            compared += 1;
        }
        assert!(compared >= 2, "a run of three layers: {compared}");
    }

    #[test]
    fn the_index_has_the_utilities_of_measured_layers() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let whole = whole();
        let (split, chunks) = cut(&whole, &[25, 25, 50], folder.path());
        assert!(chunks.table.utilities.is_empty(), "not measured");
        let counts: Vec<usize> = (0..=3).map(|count| split.first_layers(&whole.scene, count).len()).collect();
        assert_eq!((split.layers(), counts[0], counts[3]), (3, 0, COUNT), "no layer, and all");
        assert!(counts.windows(2).all(|pair| pair[0] < pair[1]), "each layer adds Gaussians: {counts:?}");
        let chunks = split.write(&whole, folder.path(), Some(1), &[10.0, 22.0, 25.0, 24.5], &mut NoProgress);
        let table = chunks.expect("files can be written").table;
        let bytes =
            |layer| (table.bytes_up_to(layer) - layer.checked_sub(1).map_or(0, |l| table.bytes_up_to(l))) as f64;
        let expected = [12e6 / bytes(0), 3e6 / bytes(1), -0.5e6 / bytes(2)];
        assert_eq!(table.utilities.len(), 3, "one for each layer");
        for (found, expected) in table.utilities.iter().zip(expected) {
            assert!((f64::from(*found) / expected - 1.0).abs() < 1e-6, "{found}, {expected} dB per megabyte");
        }
        let index = read(&folder.path().join(ChunkTable::INDEX)).scene;
        assert_eq!(index.chunks.expect("a table").utilities, table.utilities, "read again");
    }

    #[test]
    fn the_index_has_everything_but_the_gaussians() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let mut whole = whole();
        whole.scene.environment = Some(Environment { width: 2, height: 1, texels: vec![0.25; 6] });
        let (_, chunks) = cut(&whole, &[50, 50], folder.path());
        let index = read(&folder.path().join(ChunkTable::INDEX)).scene;
        let table = index.chunks.as_deref().expect("a table");
        assert_eq!(*table, chunks.table, "the table is read back");
        assert_eq!((table.check(), table.stretches, table.files.len()), (Ok(()), 8, chunks.files.len()), "its numbers");
        assert_eq!(table.gaussian_bytes, whole.scene.gaussian_bytes(), "the size of a Gaussian");
        for (number, file) in table.files.iter().enumerate() {
            let path = folder.path().join(ChunkTable::file_name(number, table.files.len()));
            assert_eq!(file.bytes, fs::metadata(&path).expect("the file exists").len(), "the length of file {number}");
            assert_eq!(file.gaussians, read(&path).scene.len() as u64, "the Gaussians of file {number}");
        }
        assert!(index.is_empty() && index.filter.is_none(), "no Gaussian, no filter");
        assert_eq!(index.form.color_degrees(), whole.scene.form.color_degrees(), "the color of the whole");
        assert_eq!(index.environment, whole.scene.environment, "the environment map");
        assert_eq!(index.colliders.as_deref(), Some(&Colliders::default().rounded()), "the colliders");
        assert!(index.sound.is_none(), "the sound would delay the first picture");
        assert_eq!((index.trained_with, index.playback), (whole.scene.trained_with, whole.scene.playback), "settings");
    }

    #[test]
    fn an_interrupted_split_leaves_no_index() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let whole = whole();
        let (split, chunks) = cut(&whole, &[100], folder.path());
        assert!(chunks.index.exists(), "an index");
        let interrupted = split.write(&whole, folder.path(), Some(1), &[], &mut InterruptedProgress);
        assert!(matches!(interrupted, Err(SegmentsError::Interrupted(_))), "the second split is interrupted");
        assert!(!chunks.index.exists(), "the files may be of two splits");
    }
}
