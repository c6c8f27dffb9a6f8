//! `gs4d join SEG... -o OUT`: makes one long capture of segments that were trained apart.
//!
//! In: captures of stretches of time, in their order; or the chunk files of one capture. Out: a package in which each
//! Gaussian is only drawn within the time of its segment; a report of the clock.

use crate::cli::args::{CheckpointArgs, file_size};
use crate::cli::output::failure::Failure;
use crate::cli::output::note::note;
use crate::cli::output::progress::Bars;
use crate::cli::output::report::Report;
use crate::cli::output::table::{Table, bytes, lines};
use crate::offline::segments::{Joined, Segment, Source, Times, join, sound_beside, sources, unite};
use crate::offline::store::outputs::Files;
use crate::offline::work::{Progress, proceed, save, write_settings};
use crate::scene::GaussianScene;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Make one long capture of segments that were trained apart, or put the chunk files of gs4d split together again.
///
/// Each segment begins when the one before it ends. Its Gaussians are only drawn within its time, without cross-fade:
/// lifespans that leak over a seam are cut by a temporal filter. Within a segment the pictures are those of the segment
/// alone, except that times are rounded to single precision.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  gs4d join part-1.gs4d part-2.gs4d part-3.gs4d -o long.gs4d
  gs4d join morning.gs4d evening.gs4d -o day.gs4d --keep-times
  gs4d join chunks -o long.gs4d

Segments must be in one space, and have the same settings (background, up axis, degree of color, ...): gs4d convert changes those of a file.
Packed segments would be rounded twice: join lossless ones (gs4d bake --quality lossless), then use gs4d compress, which trains codebooks for
all segments. Packed chunks are put together as they were. Segments of different speeds are stretched to that of the first and need colors at rest (gs4d convert --sh-degree-t 0). Chunks
are known by their names, chunk-00001-of-00012.gs4d: name their folder, or all of them.")]
pub(crate) struct Join {
    /// The segments in their order: checkpoints or packages that are not packed, or folders of chunks.
    #[arg(value_name = "SEG", required = true)]
    segments: Vec<PathBuf>,
    /// The package to write (.gs4d). An existing file is replaced when the new one is complete.
    #[arg(short, long, value_name = "OUT")]
    out: PathBuf,
    /// Show each segment at the times of its own interval, in any order. Between two, nothing may be drawn for a while.
    #[arg(long)]
    keep_times: bool,
    /// zstd level, 1 (fast) to 19 (small) [default: 9].
    #[arg(long, value_name = "LEVEL", value_parser = clap::value_parser!(i32).range(1..=19))]
    level: Option<i32>,
}

impl Join {
    /// Joins the segments and writes the capture.
    ///
    /// # Errors
    /// Segments that cannot be read or do not fit together, chunks that are missing, a package that cannot be written.
    pub(crate) fn run(&self) -> Result<Report, Failure> {
        let sources = sources(&self.segments)?;
        self.check_options(&sources)?;
        let inputs = || sources.iter().flat_map(|source| &source.files);
        let files = inputs().fold(Files::default(), |files, path| files.reads_scene(path));
        files.writes(&self.out, "gs4d").check()?;
        let before = inputs().map(|path| file_size(path)).sum::<Result<u64, Failure>>()?;
        let mut segments = self.read(&sources, &mut Bars::default())?;
        if segments.len() == 1
            && let Some(Segment { path, scene }) = segments.pop()
        {
            let size = self.save(&scene)?;
            return Ok(self.report(&scene, before, size, &[(path, None, scene.len())], true));
        }
        if segments.iter().any(|segment| !segment.scene.sockets.is_empty()) {
            note("note: sockets are left out: the track of each ends with its segment; gs4d socket makes new ones");
        }
        if segments.iter().any(|segment| segment.scene.colliders.is_some()) {
            note("note: colliders are left out: they have the times of one segment; gs4d collide makes new ones");
        }
        if segments.iter().any(|segment| segment.scene.sound.is_some()) {
            note("note: sounds are left out: each begins with its segment; gs4d sound puts one of the whole time in");
        }
        let times = if self.keep_times { Times::Own } else { Times::Following };
        let Joined { scene, segments, is_exact } = join(segments, times, &mut Bars::default())?;
        if !is_exact {
            note("note: the lengths of the segments have no common measure: seams are rounded to 65535 steps of time");
        }
        let size = self.save(&scene)?;
        let rows: Vec<_> = segments.into_iter().map(|part| (part.path, Some(part.interval), part.gaussians)).collect();
        Ok(self.report(&scene, before, size, &rows, is_exact))
    }

    /// Checks that there is something to join.
    fn check_options(&self, sources: &[Source]) -> Result<(), Failure> {
        match sources {
            [Source { is_split: true, .. }] if self.keep_times => {
                Err(Failure::new("--keep-times has no effect on the chunks of one capture; leave it out"))
            }
            [Source { is_split: false, path, .. }] => {
                Err(Failure::about(path, "is one segment: name two or more, or the folder of the chunks of a capture"))
            }
            _ => Ok(()),
        }
    }

    /// Reads the segments. Begins the task "reading".
    fn read(&self, sources: &[Source], progress: &mut dyn Progress) -> Result<Vec<Segment>, Failure> {
        progress.begin("reading", sources.iter().map(|source| source.files.len()).sum());
        let mut segments = Vec::with_capacity(sources.len());
        for Source { path, files, is_split } in sources {
            let (mut parts, mut args) = (Vec::with_capacity(files.len()), CheckpointArgs::default());
            for file in files {
                proceed(progress)?;
                let scene = args.load_to_change(file)?;
                args.codebooks = scene.form.codebooks().filter(|_| *is_split).cloned();
                parts.push(Segment { path: file.clone(), scene });
                progress.advance();
            }
            match parts.pop() {
                Some(part) if !is_split => segments.push(part),
                last => {
                    parts.extend(last);
                    let scene = GaussianScene { sound: sound_beside(path)?, ..unite(parts, progress)? };
                    segments.push(Segment { path: path.clone(), scene });
                }
            }
        }
        progress.finish();
        Ok(segments)
    }

    /// Writes the capture. Returns its size in bytes.
    fn save(&self, scene: &GaussianScene) -> Result<u64, Failure> {
        save(&self.out, scene, &write_settings(&scene.form, self.level))?;
        file_size(&self.out)
    }

    /// Returns the report of a capture of segments: their paths, intervals on the clock of all, and Gaussians.
    fn report(
        &self,
        scene: &GaussianScene,
        before: u64,
        size: u64,
        segments: &[(PathBuf, Option<[f64; 2]>, usize)],
        is_exact: bool,
    ) -> Report {
        let shown = |path: &Path| path.display().to_string();
        let mut table = Table::new(&["segment", "from", "to", "Gaussians"]);
        let [first, last] = scene.trained_with.time_interval.map(f64::from);
        let rows = || segments.iter().map(move |(path, times, count)| (path, times.unwrap_or([first, last]), *count));
        for (path, [from, to], count) in rows() {
            table.row([shown(path), from.to_string(), to.to_string(), count.to_string()]);
        }
        let seconds = scene.playback.duration_seconds;
        let facts = lines(&[
            ("Gaussians", scene.len().to_string()),
            ("duration", format!("{seconds} s")),
            ("read", bytes(before)),
            ("wrote", format!("{}, {}", self.out.display(), bytes(size))),
        ]);
        let listed: Vec<Value> = rows()
            .map(|(path, interval, count)| json!({ "in": shown(path), "interval": interval, "gaussians": count }))
            .collect();
        let json = json!({
            "out": shown(&self.out),
            "bytes_in": before,
            "bytes_out": size,
            "gaussians": scene.len(),
            "duration_seconds": seconds,
            "time_interval": scene.trained_with.time_interval,
            "filter_segments": scene.filter.as_ref().map(|filter| filter.segments),
            "exact": is_exact,
            "segments": listed,
        });
        Report::new(json, format!("{table}\n{facts}"))
    }
}
