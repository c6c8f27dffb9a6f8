//! `gs4d export SCENE OUT`: writes files that other programs open.
//!
//! In: a scene, a time, or frames a second. Out: a file of the Gaussians at that time, a folder with a file for each
//! frame, or a file with all motion; a report of what the files do not show.

use crate::cli::args::{CheckpointArgs, Given, Need, file_size, values};
use crate::cli::output::failure::Failure;
use crate::cli::output::progress::Bars;
use crate::cli::output::report::Report;
use crate::cli::output::table::bytes;
use crate::codec::export::exporter::Exporter;
use crate::codec::export::table::{EXPORTS, Export};
use crate::codec::options::FPS;
use crate::offline::forms::export::{Shown, frame_path, frame_times, other_frame, write_files};
use crate::offline::store::outputs::Files;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use serde_json::{Value, json};
use std::fs;
use std::path::{Path, PathBuf};

/// Write a capture in a format that other programs open: at one time, as a sequence of files, or with its motion.
///
/// The extension of OUT names the format, unless --format does. What the format cannot hold is reported. Files are
/// written to temporary files and renamed when they are complete: an existing file is replaced or stays unchanged. PLY
/// files keep the coordinates of the capture, and a comment names the axis that points up; for formats with a fixed up
/// axis, Gaussians are rotated.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  gs4d export capture.gs4d frame.ply --time 0.5
  gs4d export capture.gs4d frames --sequence --fps 30
  gs4d export capture.gs4d frames --sequence --format splat
  gs4d export capture.gs4d capture.ftgs.ply

Frame f of a sequence, frame_0000f, shows the middle of its time. gs4d opens such a folder again as one capture: gs4d convert frames again.gs4d")]
pub(crate) struct ExportVerb {
    #[command(flatten)]
    given: Given,
    /// The capture to read: a file, or the folder of a sequence.
    #[arg(value_name = "SCENE")]
    scene: PathBuf,
    /// The file to write; with --sequence a folder, which is created if it does not exist.
    #[arg(value_name = "OUT")]
    out: PathBuf,
    /// One time: the Gaussians that are drawn then, in the unit of the capture. A capture at rest needs no time.
    #[arg(long, value_name = "T", value_parser = values::number, allow_hyphen_values = true, conflicts_with = "sequence")]
    time: Option<f32>,
    /// Frames of the whole capture, a file for each.
    #[arg(long)]
    sequence: bool,
    /// Format of the files [default: by the extension of OUT; of a sequence ply].
    #[arg(long, value_name = "FORMAT", value_parser = formats())]
    format: Option<&'static Export>,
    #[command(flatten)]
    checkpoint: CheckpointArgs,
}

/// Returns a parser for the id of a format.
fn formats() -> impl TypedValueParser<Value = &'static Export> {
    let ids = PossibleValuesParser::new(EXPORTS.iter().map(|export| export.id));
    ids.try_map(|id| Export::of_id(&id).ok_or("there is no such format"))
}

impl ExportVerb {
    /// Exports the scene.
    ///
    /// # Errors
    /// The scene cannot be read, has no equivalent in the format, or needs a time; files cannot be written.
    pub(crate) fn run(&self) -> Result<Report, Failure> {
        let format = self.format()?;
        let plays = self.sequence || format.is_moving();
        self.given.require(Need::OneTime, !format.is_moving())?;
        self.given.require(Need::Background, false)?;
        self.given.require(Need::Playback, plays || self.time.is_none())?;
        let files = Files::default().reads_scene(&self.scene);
        // A wrong path is reported before the scene is read.
        if self.sequence {
            files.clone().writes_folder(&self.out, []).check()?;
        } else {
            files.clone().writes(&self.out, last_extension(format)).check()?;
        }
        // A .4dgs file has times in seconds, and does not count frames.
        let scene = self.checkpoint.load_to_play(&self.scene, plays && format.id != "4dgs")?;
        let fps = self.checkpoint.fps.unwrap_or(FPS);
        let (interval, seconds) = (scene.trained_with.time_interval, scene.playback.duration_seconds);
        let shown = if self.sequence {
            self.frames(&frame_times(interval, seconds, fps).map_err(Failure::new)?, format)?
        } else {
            let lacks_time = !format.is_moving() && seconds != 0.0 && self.time.is_none();
            if lacks_time {
                let [first, last] = interval;
                let message = format!(
                    "moves, and {} has no motion: give --time from {first} to {last}, or --sequence",
                    format.name
                );
                return Err(Failure::about(&self.scene, &message));
            }
            vec![Shown { path: self.out.clone(), time: self.time.unwrap_or(interval[0]) }]
        };
        if self.sequence {
            files.writes_folder(&self.out, shown.iter().map(|shown| shown.path.clone())).check()?;
            fs::create_dir_all(&self.out).map_err(|error| Failure::at(&self.out, &error))?;
        }
        let exporter = Exporter::new(scene, format, fps).map_err(|error| Failure::at(&self.scene, &error))?;
        let counts = write_files(&exporter, &shown, &mut Bars::default())?;
        self.report(format, &exporter, &shown, &counts)
    }

    /// Returns the format of the files.
    fn format(&self) -> Result<&'static Export, Failure> {
        let name = self.out.file_name().unwrap_or_default().to_string_lossy();
        let by_name = || if self.sequence { Export::of_id("ply") } else { Export::of_name(&name) };
        self.format.or_else(by_name).ok_or_else(|| {
            let names: Vec<&str> = EXPORTS.iter().map(|export| export.name).collect();
            Failure::about(&self.out, &format!("names no format: write {}, or give --format", names.join(", ")))
        })
    }

    /// Returns the files of a sequence with these times.
    fn frames(&self, times: &[f32], format: &Export) -> Result<Vec<Shown>, Failure> {
        let path = |frame| frame_path(&self.out, frame, format.extension);
        let shown: Vec<Shown> =
            times.iter().enumerate().map(|(frame, &time)| Shown { path: path(frame), time }).collect();
        match other_frame(&self.out, &shown, format.extension) {
            Some(other) => Err(Failure::about(
                &other,
                "is a frame of another sequence, which would be shown after this one: remove it, or write to another folder",
            )),
            None => Ok(shown),
        }
    }

    fn report(
        &self,
        format: &Export,
        exporter: &Exporter,
        shown: &[Shown],
        counts: &[usize],
    ) -> Result<Report, Failure> {
        let sizes = shown.iter().map(|shown| size(&shown.path)).collect::<Result<Vec<_>, _>>()?;
        let (total, most) = (sizes.iter().sum::<u64>(), counts.iter().max().copied().unwrap_or(0));
        let what = match shown {
            [_] => format!("{most} Gaussians"),
            _ => format!("{} files, up to {most} Gaussians each", shown.len()),
        };
        let mut text: String = exporter.lost().iter().map(|sentence| format!("{sentence}\n")).collect();
        text += &format!("{} -> {} ({}): {what}\n", self.scene.display(), self.out.display(), bytes(total));
        let files: Vec<Value> = shown
            .iter()
            .zip(counts.iter().zip(&sizes))
            .map(|(shown, (gaussians, bytes))| {
                let time = (!format.is_moving()).then_some(shown.time);
                json!({ "file": shown.path.display().to_string(), "time": time, "gaussians": gaussians, "bytes": bytes })
            })
            .collect();
        let json = json!({
            "scene": self.scene.display().to_string(),
            "out": self.out.display().to_string(),
            "format": format.id,
            "bytes": total,
            "files": files,
            "lost": exporter.lost(),
        });
        Ok(Report::new(json, text))
    }
}

/// Returns the size of a file that was written, bytes; 0 for a device.
fn size(path: &Path) -> Result<u64, Failure> {
    if path.is_file() { file_size(path) } else { Ok(0) }
}

/// Returns the part of an extension after its last dot.
fn last_extension(format: &Export) -> &'static str {
    format.extension.rsplit('.').next().unwrap_or(format.extension)
}
