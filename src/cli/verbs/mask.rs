//! `gs4d mask IN -o OUT`: adds a temporal filter to a scene.
//!
//! In: a scene, a number of key-frames, training views if the filter needs them. Out: a package with the filter, and a
//! report with the share of active Gaussians; or the part of one shard of the views.

use crate::cli::args::{
    CheckpointArgs, DataArgs, EngineArgs, Given, Need, PART, PackageArgs, Portion, ShardArgs, values,
};
use crate::cli::output::failure::Failure;
use crate::cli::output::progress::Bars;
use crate::cli::output::report::{Report, part_report};
use crate::cli::output::table::{bytes, lines};
use crate::offline::dataset::TrainingView;
use crate::offline::engine::Engine;
use crate::offline::filter::FilterError;
use crate::offline::filter::temporal_filter::{
    FILTER_NAMES, filter, filter_name, label, merge, needs_views, neighbor_overlap, write_part,
};
use crate::offline::forms::convert::require_no_windows;
use crate::offline::store::outputs::Files;
use crate::offline::store::shard::Shard;
use crate::scene::{ActiveSets, FilterKind, MAX_SEGMENTS, TemporalFilter};
use serde_json::json;
use std::path::PathBuf;
use std::time::Instant;

/// Add a temporal filter: the Gaussians that are active in each segment of time. Drawing skips the other Gaussians.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  gs4d mask chkpnt30000.pth -o filtered.gs4d
  gs4d mask chkpnt30000.pth --filter interval --data data/toybox --key-frames 11 -o filtered.gs4d
  gs4d mask n3v.pth --filter key-frame --data data/n3v --every 20 -o filtered.gs4d
  gs4d mask n3v.pth --filter interval --data data/n3v --shard 0/2 -o 0.gs4p
  gs4d mask n3v.pth -o filtered.gs4d --filter interval --data data/n3v --merge 0.gs4p 1.gs4p

Filters:
  support    Gaussians whose opacity can be visible in the segment. Changes no pixel and needs no views.
  interval   Gaussians of support that a training view in the segment, or a camera at its two key-frames, sees.
  key-frame  Gaussians that a camera sees at the two key-frames of the segment, as in the paper. Loses Gaussians that appear
             and disappear between them.")]
pub(crate) struct Mask {
    #[command(flatten)]
    given: Given,
    /// The checkpoint or package to filter. Its filter is replaced.
    #[arg(value_name = "IN")]
    input: PathBuf,
    #[command(flatten)]
    package: PackageArgs,
    /// Kind of filter.
    #[arg(long, value_name = "FILTER", default_value = "support", value_parser = values::one_of(&FILTER_NAMES))]
    filter: FilterKind,
    /// Number of key-frames, evenly spaced over the time interval including both ends [default: 11].
    #[arg(long, value_name = "K", value_parser = clap::value_parser!(u32).range(2..=i64::from(MAX_SEGMENTS) + 1))]
    key_frames: Option<u32>,
    /// Number of timestamps of the training data between two key-frames, in place of --key-frames.
    #[arg(long, value_name = "FRAMES", conflicts_with = "key_frames", requires = "data", value_parser = values::count(1_000_000))]
    every: Option<usize>,
    #[command(flatten)]
    data: DataArgs,
    #[command(flatten)]
    shards: ShardArgs,
    #[command(flatten)]
    engine: EngineArgs,
    #[command(flatten)]
    checkpoint: CheckpointArgs,
}

impl Mask {
    /// Computes the filter and writes the scene with the filter.
    ///
    /// # Errors
    /// A scene or views that cannot be used, too many key-frames, a package that cannot be written, a failure of the
    /// engine.
    pub(crate) fn run(&self) -> Result<Report, Failure> {
        self.check_options()?;
        let files = self.data.add_to(Files::default().reads_scene(&self.input)).reads(self.shards.parts());
        let out = match self.shards.portion() {
            Portion::Shard(_) => {
                let out = self.package.out()?;
                files.writes(out, PART).check()?;
                out
            }
            Portion::All | Portion::Parts(_) => self.package.checked_out(files)?,
        };
        let mut scene = self.checkpoint.load_to_change(&self.input)?;
        let no_windows = require_no_windows(scene.filter.as_ref(), "another filter");
        no_windows.map_err(|error| Failure::at(&self.input, &error))?;
        scene.filter = None;
        let by_views = needs_views(self.filter);
        let views = if by_views || self.every.is_some() {
            self.data.open(&scene.trained_with, &mut Bars::default())?
        } else {
            Vec::new()
        };
        let keys = self.keys(&views)?;
        let mut engine = if by_views { self.engine.open(&self.given)? } else { Engine::Cpu };
        let (kind, progress) = (self.filter, &mut Bars::default());
        let about_input = |error: FilterError| Failure::at(&self.input, &error);
        let filter = match self.shards.portion() {
            Portion::All => filter(&mut engine, &scene, kind, keys, &views, progress).map_err(about_input)?,
            Portion::Shard(shard) => {
                let start = Instant::now();
                let label = label(&self.input, &scene, kind, keys, &views, &engine, shard)?;
                let written = write_part(out, &label, &mut engine, &scene, kind, keys, &views, progress);
                let work = written.map_err(about_input)?.then(|| (start.elapsed().as_secs_f64(), engine.name()));
                return Ok(part_report(shard, out, work));
            }
            Portion::Parts(paths) => {
                let label = label(&self.input, &scene, kind, keys, &views, &engine, Shard::WHOLE)?;
                merge(paths, &label, kind, keys, scene.len())?
            }
        };
        let (share, overlap) = (filter.active_share(), neighbor_overlap(&filter));
        let least = overlap.iter().copied().fold(1.0, f64::min);
        let mean = if overlap.is_empty() { 1.0 } else { overlap.iter().sum::<f64>() / overlap.len() as f64 };
        let (form, size) = stored(&filter);
        let (count, segments) = (scene.len(), filter.segments);
        scene.filter = Some(filter);
        let written = self.package.save(&scene)?;
        let name = filter_name(self.filter);
        let text = lines(&[
            ("filter", format!("{name}, {keys} key-frames, {segments} segments")),
            ("active", format!("{:.1} % of {count} Gaussians, mean over segments", share * 100.0)),
            ("overlap", format!("{mean:.3} (mean IoU of neighboring segments; lowest {least:.3})")),
            ("size", format!("{} as {form}, before compression", bytes(size))),
            ("wrote", format!("{}, {}", out.display(), bytes(written))),
        ]);
        let json = json!({
            "in": self.input.display().to_string(),
            "out": out.display().to_string(),
            "bytes_out": written,
            "filter": self.filter,
            "key_frames": keys,
            "segments": segments,
            "gaussians": count,
            "active_share": share,
            "overlap": overlap,
            "stored_as": form,
            "filter_bytes": size,
        });
        Ok(Report::new(json, text))
    }

    /// Checks that every option has an effect.
    fn check_options(&self) -> Result<(), Failure> {
        self.engine.check(&self.given)?;
        self.shards.check(&self.given)?;
        let by_views = needs_views(self.filter);
        self.given.require(Need::FilteredViews, by_views)?;
        self.given.require(Need::KeyFrameViews, by_views || self.every.is_some())
    }

    /// Returns the number of key-frames.
    fn keys(&self, views: &[TrainingView]) -> Result<u32, Failure> {
        let keys = values::key_frames(self.key_frames, self.every).count(views);
        let fits = u32::try_from(keys).ok().filter(|keys| *keys <= MAX_SEGMENTS + 1);
        let most = MAX_SEGMENTS + 1;
        fits.ok_or_else(|| Failure::new(format!("{keys} key-frames are more than {most}: use a larger --every")))
    }
}

/// Returns how the sets are stored, and their size in bytes.
fn stored(filter: &TemporalFilter) -> (&'static str, u64) {
    match &filter.sets {
        ActiveSets::Bits(words) => ("bits", size_of_val(words.as_slice()) as u64),
        ActiveSets::Intervals(intervals) => ("intervals", size_of_val(intervals.as_slice()) as u64),
    }
}
