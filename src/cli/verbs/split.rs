//! `gs4d split IN -o FOLDER`: cuts a capture into chunk files.
//!
//! In: a capture, the length of a stretch of time. Out: a folder with a package for each run of Gaussians that are alive
//! in the same stretches; a report of the times and the size of each.

use crate::cli::args::{CheckpointArgs, file_size, values};
use crate::cli::output::failure::Failure;
use crate::cli::output::progress::Bars;
use crate::cli::output::report::Report;
use crate::cli::output::table::{Table, bytes, lines};
use crate::offline::segments::{Chunk, MOST_CHUNKS, Segment, Split, other_chunk};
use crate::offline::store::outputs::Files;
use serde_json::{Value, json};
use std::fs;
use std::path::PathBuf;

/// Cut a capture into chunk files by the stretches of time in which its Gaussians are alive.
///
/// Each Gaussian is in one file. A file covers 1, 2, 4, ... stretches of time that follow one another: Gaussians that
/// live for a moment are in files of one stretch, those that are always there in a file of all. Each file is a package
/// with the clock of the whole capture. gs4d join puts them together again.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  gs4d split long.gs4d -o chunks
  gs4d split long.gs4d -o chunks --chunk 0.5 --json
  gs4d join chunks -o long.gs4d

The pictures of the joined chunks are those of IN. Its Gaussians are in the order of the chunks; split and joined once more, the files are the
same byte for byte. Runs of fewer than 256 Gaussians become part of longer ones. Packed captures would be rounded twice: split lossless ones.")]
pub(crate) struct SplitVerb {
    /// The checkpoint or package to read, not packed.
    #[arg(value_name = "IN")]
    input: PathBuf,
    /// The folder to write to, which is created if it does not exist.
    #[arg(short, long, value_name = "FOLDER")]
    out: PathBuf,
    /// Length of a stretch of time at speed 1, seconds.
    #[arg(long, value_name = "SECONDS", default_value = "1", value_parser = values::positive)]
    chunk: f32,
    /// zstd level, 1 (fast) to 19 (small) [default: 9].
    #[arg(long, value_name = "LEVEL", value_parser = clap::value_parser!(i32).range(1..=19))]
    level: Option<i32>,
}

impl SplitVerb {
    /// Cuts the capture and writes the chunk files.
    ///
    /// # Errors
    /// A capture that cannot be read or is packed, chunks of another capture in the folder, files that cannot be written.
    pub(crate) fn run(&self) -> Result<Report, Failure> {
        let files = Files::default().reads_scene(&self.input);
        // A wrong path is reported before the capture is read.
        files.clone().writes_folder(&self.out, []).check()?;
        let scene = CheckpointArgs::default().load_to_change(&self.input)?;
        let segment = Segment { path: self.input.clone(), scene };
        let split = Split::of(&segment, self.stretches(segment.scene.playback.duration_seconds)?)?;
        let paths = split.paths(&self.out);
        if let Some(other) = other_chunk(&self.out, &paths) {
            let reason = "is a chunk of another split, which would be read with this one: remove it, or write to another \
                          folder";
            return Err(Failure::about(&other, reason));
        }
        files.writes_folder(&self.out, paths).check()?;
        fs::create_dir_all(&self.out).map_err(|error| Failure::at(&self.out, &error))?;
        let chunks = split.write(&segment, &self.out, self.level, &mut Bars::default())?;
        self.report(&segment, &chunks)
    }

    /// Returns the number of stretches of time of a capture that plays for `seconds`.
    fn stretches(&self, seconds: f32) -> Result<u32, Failure> {
        let count = (f64::from(seconds) / f64::from(self.chunk)).ceil().max(1.0);
        if count > f64::from(MOST_CHUNKS) {
            let many = format!("{count} stretches of time are more than {MOST_CHUNKS}");
            return Err(Failure::about(&self.input, &format!("--chunk {}: {many}: give a longer one", self.chunk)));
        }
        Ok(count as u32)
    }

    fn report(&self, segment: &Segment, chunks: &[Chunk]) -> Result<Report, Failure> {
        let sizes = chunks.iter().map(|chunk| file_size(&chunk.path)).collect::<Result<Vec<u64>, Failure>>()?;
        let (before, total) = (file_size(&self.input)?, sizes.iter().sum::<u64>());
        let mut table = Table::new(&["chunk", "from", "to", "Gaussians", "size"]);
        let mut listed: Vec<Value> = Vec::with_capacity(chunks.len());
        for (Chunk { path, times, gaussians }, size) in chunks.iter().zip(&sizes) {
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            let [from, to] = *times;
            table.row([name, from.to_string(), to.to_string(), gaussians.to_string(), bytes(*size)]);
            let path = path.display().to_string();
            listed.push(json!({ "file": path, "times": times, "gaussians": gaussians, "bytes": size }));
        }
        let facts = lines(&[
            ("Gaussians", segment.scene.len().to_string()),
            ("read", bytes(before)),
            ("wrote", format!("{}, {} files, {}", self.out.display(), chunks.len(), bytes(total))),
        ]);
        let json = json!({
            "in": self.input.display().to_string(),
            "out": self.out.display().to_string(),
            "bytes_in": before,
            "bytes_out": total,
            "gaussians": segment.scene.len(),
            "chunks": listed,
        });
        Ok(Report::new(json, format!("{table}\n{facts}")))
    }
}
