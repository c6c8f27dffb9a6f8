//! A capture as chunk files.
//!
//! In: a capture, a number of stretches of time. Out: a file for each run of Gaussians: a capture with the clock of the
//! whole, of which any player shows what it has. Together they are the whole capture: see `unite`.

use super::covers::{Run, runs};
use super::error::SegmentsError;
use super::files::{chunk_name, chunks_in};
use super::segment::Segment;
use super::windows::{hulls, intervals};
use crate::offline::prune::select::select;
use crate::offline::work::{Progress, proceed, save, write_settings};
use crate::scene::TemporalFilter;
use std::path::{Path, PathBuf};

/// Most stretches of time of a capture.
pub const MOST_CHUNKS: u32 = 10_000;

/// A chunk file.
#[derive(Debug, Clone, PartialEq)]
pub struct Chunk {
    /// The file.
    pub path: PathBuf,
    /// The times between which its Gaussians are alive, timestamp units.
    pub times: [f64; 2],
    /// Number of Gaussians.
    pub gaussians: usize,
}

/// A capture cut into chunks that are not yet written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Split {
    runs: Vec<Run>,
    /// Number of stretches of time.
    stretches: u32,
}

impl Split {
    /// Cuts a capture into `stretches` stretches of time, 1 to [`MOST_CHUNKS`].
    ///
    /// # Errors
    /// A packed capture, a Gaussian that cannot be drawn.
    pub fn of(segment: &Segment, stretches: u32) -> Result<Self, SegmentsError> {
        segment.require_unpacked()?;
        let stretches = stretches.clamp(1, MOST_CHUNKS);
        Ok(Self { runs: runs(lives(segment, stretches)?.into_iter(), stretches), stretches })
    }

    /// Returns the files that it will be in.
    pub fn paths(&self, folder: &Path) -> Vec<PathBuf> {
        let count = self.runs.len();
        (0..count).map(|number| folder.join(chunk_name(number, count))).collect()
    }

    /// Writes the chunk files of the capture into a folder, which exists. `level` is the zstd level, `None` the usual
    /// one. Begins the task "writing".
    ///
    /// # Errors
    /// Files that cannot be written, an interruption.
    pub fn write(
        &self,
        segment: &Segment,
        folder: &Path,
        level: Option<i32>,
        progress: &mut dyn Progress,
    ) -> Result<Vec<Chunk>, SegmentsError> {
        progress.begin("writing", self.runs.len());
        let mut chunks = Vec::with_capacity(self.runs.len());
        for (run, path) in self.runs.iter().zip(self.paths(folder)) {
            proceed(progress)?;
            let mut scene = select(&segment.scene, &run.gaussians);
            // All chunks have one environment map, and the same sockets and colliders, in the first file.
            scene.environment = scene.environment.filter(|_| chunks.is_empty());
            if !chunks.is_empty() {
                scene.sockets.clear();
                scene.colliders = None;
            }
            save(&path, &scene, &write_settings(&scene.form, level))?;
            chunks.push(Chunk { path, times: self.times(segment, run), gaussians: run.gaussians.len() });
            progress.advance();
        }
        progress.finish();
        Ok(chunks)
    }

    /// Returns the times between which a run is alive, timestamp units.
    fn times(&self, segment: &Segment, run: &Run) -> [f64; 2] {
        let [first, last] = segment.scene.trained_with.time_interval.map(f64::from);
        let time = |stretch: u32| first + (last - first) * f64::from(stretch) / f64::from(self.stretches);
        [time(run.chunks[0]), time(run.chunks[1] + 1)]
    }
}

/// Returns the first and the last stretch of time in which each Gaussian may be drawn.
fn lives(segment: &Segment, stretches: u32) -> Result<Vec<[u32; 2]>, SegmentsError> {
    let (scene, trained_with) = (&segment.scene, &segment.scene.trained_with);
    let filter = match &scene.filter {
        Some(filter) => filter.clone(),
        None => {
            let gaussians = scene.gaussians().map_err(|error| segment.at(error))?;
            let (interval, cutoff) = (trained_with.time_interval, trained_with.marginal_cutoff);
            TemporalFilter::support(gaussians.iter().copied(), interval, cutoff, stretches)
        }
    };
    let words = intervals(&filter).unwrap_or_else(|| hulls(&filter));
    let (count, segments) = (u64::from(stretches), u64::from(filter.segments.max(1)));
    let life = |word: &u32| {
        let (first, last) = (u64::from(word & 0xffff), u64::from(word >> 16));
        // Of Gaussians that are never drawn, the last segment is the one at which they would be.
        let first = first.min(last) * count / segments;
        let last = ((last + 1) * count).div_ceil(segments).clamp(1, count) - 1;
        [first.min(last) as u32, last as u32]
    };
    Ok(words.iter().map(life).collect())
}

/// Returns a chunk file in a folder that is none of these files: it would be read with them. `None` if there is no such
/// file, or no such folder.
pub fn other_chunk(folder: &Path, files: &[PathBuf]) -> Option<PathBuf> {
    chunks_in(folder).ok()?.into_iter().find(|chunk| !files.contains(chunk))
}

#[cfg(test)]
mod tests {
    use super::super::unite::unite;
    use super::*;
    use crate::codec::{self, ReadOptions};
    use crate::offline::work::NoProgress;
    use crate::scene::synth::{SynthSettings, synthesize};
    use std::sync::Arc;

    fn read(path: &Path) -> Segment {
        let scene = codec::load(path, &ReadOptions::default()).expect("the package can be read");
        Segment { path: path.to_owned(), scene }
    }

    #[test]
    fn chunks_are_the_whole_capture_and_united_they_stay_as_they_are() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let mut scene = synthesize(&SynthSettings { count: 4000, ..SynthSettings::default() });
        scene.colliders = Some(Arc::default());
        let mut whole = Segment { path: PathBuf::from("whole.gs4d"), scene };
        let mut before = Vec::new();
        for round in 0..2 {
            let split = Split::of(&whole, 8).expect("every Gaussian can be drawn");
            let chunks = split.write(&whole, folder.path(), Some(1), &mut NoProgress).expect("files can be written");
            assert_eq!(chunks.iter().map(|chunk| chunk.gaussians).sum::<usize>(), 4000, "each Gaussian once");
            assert!(chunks.len() > 2, "several runs: {}", chunks.len());
            let files = split.paths(folder.path());
            assert_eq!(other_chunk(folder.path(), &files), None, "no other chunk");
            assert_eq!(other_chunk(folder.path(), &files[1..]), Some(files[0].clone()), "another chunk");
            for (chunk, file) in chunks.iter().zip(&files) {
                let [first, last] = chunk.times;
                let own = read(file);
                assert_eq!(own.scene.colliders.is_some(), *file == files[0], "the first file has the colliders");
                for gaussian in own.scene.gaussians().expect("every Gaussian can be drawn").iter() {
                    let is_drawn = |time: f64| gaussian.marginal(time as f32) > own.scene.trained_with.marginal_cutoff;
                    assert!(first <= 0.0 || !is_drawn(first - 1e-3), "alive before {first}");
                    assert!(last >= 1.0 || !is_drawn(last + 1e-3), "alive after {last}");
                }
            }
            let united = unite(files.iter().map(|file| read(file)).collect(), &mut NoProgress);
            whole.scene = united.expect("chunks of one capture");
            assert!(whole.scene.colliders.is_some(), "the whole capture has the colliders");
            let bytes: Vec<Vec<u8>> = files.iter().map(|file| std::fs::read(file).expect("it was written")).collect();
            assert!(round == 0 || bytes == before, "the chunks of united chunks are the same files");
            before = bytes;
        }
    }
}
