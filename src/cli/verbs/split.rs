//! `gs4d split IN -o OUT`: cuts a capture into chunk files.
//!
//! In: a capture, the length of a stretch of time, the shares of its layers; or a packed capture, which has been cut when
//! it was compressed; perhaps a dataset, on whose validation views layers are measured. Out: a folder with a package for
//! each layer of each run of Gaussians that are alive in the same stretches, and an index of them, or one file of the index
//! and these packages; a report of the times and the size of each, and of the bit rates and the utilities of layers.

use super::info::bit_rate;
use crate::cli::args::{CheckpointArgs, DataArgs, EngineArgs, Given, Need, ValidationArgs, file_size, values};
use crate::cli::output::failure::Failure;
use crate::cli::output::progress::Bars;
use crate::cli::output::report::Report;
use crate::cli::output::table::{Table, bytes, lines};
use crate::offline::measure::belonging::require_belonging;
use crate::offline::measure::reference_pictures::ReferencePictures;
use crate::offline::segments::{
    Chunk, Chunks, Cut, LayerShares, Segment, Split, other_chunks, require_own_sound, sound_path,
};
use crate::offline::store::outputs::Files;
use crate::offline::work::{Progress, proceed};
use crate::scene::{ChunkTable, Form, SceneForm};
use serde_json::{Value, json};
use std::fs;
use std::path::PathBuf;

/// Cut a capture into chunk files by the stretches of time in which its Gaussians are alive.
///
/// Each Gaussian is in one file. A file covers 1, 2, 4, ... stretches of time that follow one another: Gaussians that
/// live for a moment are in files of one stretch, those that are always there in files of all. The Gaussians of the same
/// stretches are in layers, the most important first. Each file is a package with the clock of the whole capture. An
/// index, index.gs4d, lists the files: a player loads the index, and then the files that it needs at a time. gs4d join
/// puts the files together again.
///
/// If OUT ends with .gs4d, it is one file: the index, and all chunk files after it. A player loads the index, and then parts
/// of the file, from a disk or a server that sends parts (byte ranges); other programs read all of it as an ordinary package.
///
/// A packed capture is cut as gs4d compress --chunk has ordered its Gaussians: no value changes, the files together are
/// as small as the package, and the index has the codebooks of their colors.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  gs4d split long.gs4d -o chunks
  gs4d split long.gs4d -o chunks --chunk 0.5 --layers 20,30,50 --json
  gs4d compress long.gs4d packed.gs4d --chunk 1 --layers 5,20,25,50
  gs4d split packed.gs4d -o chunks
  gs4d split packed.gs4d -o stream.gs4d
  gs4d split packed.gs4d -o chunks --data data/take
  gs4d join chunks -o long.gs4d

With --data, the layers are measured on the validation views: the index has what each adds to the PSNR for each byte, and players fetch by that.
The pictures of the joined chunks are those of IN. Its Gaussians are in the order of the chunks; split and joined once more, the files are the
same byte for byte. Runs and layers of fewer than 256 Gaussians become part of others, packed runs of fewer than 2048.")]
pub(crate) struct SplitVerb {
    #[command(flatten)]
    given: Given,
    /// The checkpoint or package to read.
    #[arg(value_name = "IN")]
    input: PathBuf,
    /// The folder to write to, which is created if it does not exist; or one file for all (.gs4d).
    #[arg(short, long, value_name = "OUT")]
    out: PathBuf,
    /// Length of a stretch of time at speed 1, seconds.
    #[arg(long, value_name = "SECONDS", default_value = "1", value_parser = values::positive)]
    chunk: f32,
    /// Shares of the Gaussians in layers, percent, the most important first; 100: one layer.
    #[arg(long, value_name = "PERCENT,..", default_value = "25,25,50", value_parser = values::layers)]
    layers: LayerShares,
    /// zstd level, 1 (fast) to 19 (small) [default: 9; of packed captures 19].
    #[arg(long, value_name = "LEVEL", value_parser = clap::value_parser!(i32).range(1..=19))]
    level: Option<i32>,
    #[command(flatten)]
    data: DataArgs,
    #[command(flatten)]
    validation: ValidationArgs,
    #[command(flatten)]
    engine: EngineArgs,
}

impl SplitVerb {
    /// Cuts the capture and writes the chunk files and their index.
    ///
    /// # Errors
    /// A capture that cannot be read, or is packed and was not cut when it was compressed; chunks of another capture in the
    /// folder, or a sound of none; files that cannot be written; views that cannot be used, a failure of the engine.
    pub(crate) fn run(&self) -> Result<Report, Failure> {
        self.given.require(Need::MeasuredLayers, self.data.is_given())?;
        self.engine.check(&self.given)?;
        let files = self.data.add_to(Files::default().reads_scene(&self.input));
        let index = self.out.join(ChunkTable::INDEX);
        // A wrong path is reported before the capture is read.
        match self.is_one_file() {
            true => files.clone().writes_regular(&self.out, "gs4d").check()?,
            false => files.clone().writes_folder(&self.out, [index.clone()]).check()?,
        }
        let scene = CheckpointArgs::default().load_to_change(&self.input)?;
        let segment = Segment { path: self.input.clone(), scene };
        let split = match &segment.scene.form {
            SceneForm::Ready(Form::Packed(_)) => {
                self.given.require(Need::Uncut, false)?;
                Split::of_runs(&segment)?
            }
            SceneForm::Trained(_) | SceneForm::Ready(Form::Sliced(_)) => {
                let stretches = self.stretches(segment.scene.playback.duration_seconds)?;
                Split::of(&segment, stretches, &self.layers)?
            }
        };
        if self.is_one_file() {
            let psnrs = self.measured(&segment, &split)?;
            let chunks = split.write_one_file(&segment, &self.out, self.level, &psnrs, &mut Bars::default())?;
            return self.report(&segment, &chunks, &psnrs);
        }
        let paths = split.paths(&self.out);
        if let Some(other) = other_chunks(&self.out, &paths).first() {
            let reason = "is a chunk of another split, which would be read with this one: remove it, or write to another \
                          folder";
            return Err(Failure::about(other, reason));
        }
        let sound = segment.scene.sound.as_deref();
        require_own_sound(&self.out, sound)?;
        let sound = sound.map(|sound| sound_path(&self.out, sound));
        files.writes_folder(&self.out, paths.into_iter().chain([index]).chain(sound)).check()?;
        let psnrs = self.measured(&segment, &split)?;
        fs::create_dir_all(&self.out).map_err(|error| Failure::at(&self.out, &error))?;
        let chunks = split.write(&segment, &self.out, self.level, &psnrs, &mut Bars::default())?;
        self.report(&segment, &chunks, &psnrs)
    }

    /// Returns whether the index and all chunk files are to be in one file.
    fn is_one_file(&self) -> bool {
        self.out.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("gs4d")) && !self.out.is_dir()
    }

    /// Returns the PSNR of the validation views without a layer, with the first, with the first two and so on, dB; none if
    /// there are no views.
    fn measured(&self, segment: &Segment, split: &Split) -> Result<Vec<f64>, Failure> {
        if !self.data.is_given() {
            return Ok(Vec::new());
        }
        let progress = &mut Bars::default();
        let scene = &segment.scene;
        let views = self.data.divide(self.validation, &scene.trained_with, progress)?.validation;
        if views.is_empty() {
            let reason = "--data has no validation views within its times, on which layers could be measured";
            return Err(Failure::about(&self.input, reason));
        }
        let first_layers = |count: u32| {
            let layers = split.first_layers(scene, count).into_runtime();
            layers.map_err(|error| Failure::at(&self.input, &error))
        };
        let engine = &mut self.engine.open(&self.given)?;
        let whole = first_layers(split.layers())?;
        let background = whole.trained_background();
        if !self.validation.trust_images {
            require_belonging(engine, &whole, &views, background)?;
        }
        let pictures = ReferencePictures::of_images(&views, &scene.trained_with, background)?;
        progress.begin("layers", split.layers() as usize + 1);
        let mut psnrs = Vec::with_capacity(split.layers() as usize + 1);
        for count in 0..=split.layers() {
            proceed(progress)?;
            psnrs.push(pictures.psnr(engine, &first_layers(count)?)?);
            progress.advance();
        }
        progress.finish();
        Ok(psnrs)
    }

    /// Returns the number of stretches of time of a capture that plays for `seconds`.
    fn stretches(&self, seconds: f32) -> Result<u32, Failure> {
        let stretches = Cut { seconds: self.chunk, layers: self.layers.clone() }.stretches(seconds);
        stretches.ok_or_else(|| {
            let many = format!("makes more than {} stretches of time: give a longer one", ChunkTable::MOST_STRETCHES);
            Failure::about(&self.input, &format!("--chunk {} {many}", self.chunk))
        })
    }

    fn report(&self, segment: &Segment, chunks: &Chunks, psnrs: &[f64]) -> Result<Report, Failure> {
        let Chunks { index, table, files } = chunks;
        let of_files = table.files.iter().map(|file| file.bytes).sum::<u64>();
        let (before, of_index) = (file_size(&self.input)?, table.first_byte.map_or_else(|| file_size(index), Ok)?);
        let total = of_files + of_index;
        let mut rows = Table::new(&["chunk", "layer", "from", "to", "Gaussians", "size"]);
        let mut listed: Vec<Value> = Vec::with_capacity(files.len());
        for (number, Chunk { path, times, file }) in files.iter().enumerate() {
            let name = ChunkTable::file_name(number, files.len());
            let [from, to] = times.map(|time| time.to_string());
            rows.row([name, file.layer.to_string(), from, to, file.gaussians.to_string(), bytes(file.bytes)]);
            listed.push(json!({
                "file": path.display().to_string(),
                "first_byte": table.range(number).map(|range| range.start),
                "layer": file.layer,
                "stretches": file.stretches,
                "times": times,
                "gaussians": file.gaussians,
                "bytes": file.bytes,
            }));
        }
        // The index is needed with any of the layers.
        let playback = &segment.scene.playback;
        let rate = |layer: u32| bit_rate(of_index + table.bytes_up_to(layer), playback);
        let rates: Vec<f64> = (0..table.layers()).filter_map(rate).collect();
        let first = of_index + table.bytes_at(0, 0);
        let (what, place) = match table.first_byte {
            None => (format!("{} files and the index", files.len()), index.display().to_string()),
            Some(_) => (format!("the index and {} chunk files in one file", files.len()), "the beginning".to_owned()),
        };
        let mut facts = vec![
            ("Gaussians", segment.scene.len().to_string()),
            ("read", bytes(before)),
            ("wrote", format!("{}, {what}, {}", self.out.display(), bytes(total))),
            ("index", format!("{place}, {}", bytes(of_index))),
            ("first picture", format!("after {}: the index, and layer 0 of the first stretch", bytes(first))),
        ];
        if !rates.is_empty() {
            let up_to = |(layer, rate): (usize, &f64)| match layer {
                0 => format!("{rate:.1} Mbit/s for layer 0"),
                _ => format!("{rate:.1} up to layer {layer}"),
            };
            let rates: Vec<String> = rates.iter().enumerate().map(up_to).collect();
            facts.push(("bit rate", rates.join(", ")));
        }
        if let [without, with @ ..] = psnrs {
            let utilities = table.utilities.iter().zip(with).map(|(own, psnr)| format!("{psnr:.2} ({own:.1})"));
            let utilities = utilities.collect::<Vec<_>>().join(", ");
            facts.push(("PSNR", format!("{without:.2} dB without a layer; with each (dB per MB): {utilities}")));
        }
        let json = json!({
            "in": self.input.display().to_string(),
            "out": self.out.display().to_string(),
            "bytes_in": before,
            "bytes_out": total,
            "gaussians": segment.scene.len(),
            "stretches": table.stretches,
            "layers": table.layers(),
            "index": { "file": index.display().to_string(), "bytes": of_index },
            "first_picture_bytes": first,
            "megabits_per_second": rates,
            "psnr_up_to_layer": psnrs,
            "decibels_per_megabyte": table.utilities,
            "chunks": listed,
        });
        Ok(Report::new(json, format!("{rows}\n{}", lines(&facts))))
    }
}
