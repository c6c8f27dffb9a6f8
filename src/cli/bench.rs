//! `gs4d bench SCENE`: measures how fast a scene is drawn.
//!
//! In: a scene and views of it. Out: medians of GPU milliseconds per pass and per frame, and of wall-clock time.

use super::args::{CheckpointArgs, RendererArgs, ViewArgs, values};
use super::failure::Failure;
use super::progress::note;
use super::report::{Report, switches_json};
use super::table::Table;
use crate::offline::engine::AdapterDescription;
use crate::offline::orbit::{at_times, share};
use crate::renderer::Timings;
use crate::view::View;
use serde_json::json;
use std::path::PathBuf;

/// Measure how fast a scene is drawn.
///
/// Medians over frames that take the views in turn. GPU times are timestamps around each frame and, in other frames, between its
/// passes; wall-clock time is that of one frame at a time, and that per frame with many in flight.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  gs4d bench capture.gs4d
  gs4d bench chkpnt30000.pth --cameras data/transforms_test.json --resolution 2 --times 5
  gs4d bench capture.gs4d --orbit 24 --size 1352x1014 --frames 1000 --json")]
pub struct Bench {
    /// The package or checkpoint to draw.
    #[arg(value_name = "SCENE")]
    scene: PathBuf,
    /// Frames of each kind to measure.
    #[arg(long, value_name = "N", default_value = "240", value_parser = values::count(1_000_000))]
    frames: usize,
    /// Views to take from a camera file, evenly; also the number of views of the orbit unless --orbit says it.
    #[arg(long = "views", value_name = "N", default_value = "12", value_parser = values::count(100_000))]
    count: usize,
    /// See every view at K times, evenly over the interval [default: each at its own time].
    #[arg(long, value_name = "K", conflicts_with = "time", value_parser = values::count(10_000))]
    times: Option<usize>,
    #[command(flatten)]
    views: ViewArgs,
    #[command(flatten)]
    renderer: RendererArgs,
    #[command(flatten)]
    checkpoint: CheckpointArgs,
}

impl Bench {
    /// Measures.
    ///
    /// # Errors
    /// A scene or views that cannot be used, no such adapter, a failure of the GPU.
    pub fn run(&self) -> Result<Report, Failure> {
        let scene = self.checkpoint.load(&self.scene)?;
        let scene = scene.into_runtime().map_err(|error| Failure::at(&self.scene, &error))?;
        let mut shots = share(self.views.shots(&scene, self.count)?, self.views.limit(self.count));
        if let Some(times) = self.times {
            shots = at_times(shots, times, scene.trained_with.time_interval);
        }
        let views: Vec<View> = shots.iter().map(|shot| shot.view(&scene)).collect();
        let size = views.first().map_or([0, 0], |view| view.size.to_array());
        let mut headless = self.renderer.open()?;
        let capture = headless.upload(&scene)?;
        note(&format!("measuring {} frames over {} views", self.frames, views.len()));
        let timings = headless.time(&capture, &views, self.frames)?;
        let adapter = AdapterDescription::of(&headless);
        let text = format!(
            "{}: {} Gaussians, {} views of {}x{}\n{adapter}\n{}",
            self.scene.display(),
            scene.len(),
            views.len(),
            size[0],
            size[1],
            table(&timings),
        );
        let json = json!({
            "scene": self.scene.display().to_string(),
            "adapter": adapter,
            "gaussians": scene.len(),
            "views": views.len(),
            "size": size,
            "timings": timings,
            "fps": { "gpu": timings.frame_milliseconds.map(fps), "pipelined": fps(timings.pipelined_milliseconds) },
            "switches": switches_json(&scene.trained_with, &scene.playback),
        });
        Ok(Report::new(json, text))
    }
}

fn fps(milliseconds: f64) -> f64 {
    1e3 / milliseconds
}

fn table(timings: &Timings) -> String {
    let mut table = Table::new(&["", "ms", "FPS"]);
    let mut row = |name: &str, milliseconds: f64, rate: bool| {
        let rate = if rate { format!("{:.0}", fps(milliseconds)) } else { String::new() };
        table.row([name.to_owned(), format!("{milliseconds:.4}"), rate]);
    };
    for pass in &timings.passes {
        row(pass.name, pass.milliseconds, false);
    }
    if let Some(milliseconds) = timings.frame_milliseconds {
        row("frame on the GPU", milliseconds, true);
    }
    row("frame, many in flight", timings.pipelined_milliseconds, true);
    row("frame, one at a time", timings.wall_milliseconds, true);
    let counts = timings.counts;
    format!("{table}{} splats visible, {} pairs of splat and tile (medians)\n", counts.visible, counts.pairs)
}
