//! `gs4d bench SCENE..`: measures how fast scenes are drawn.
//!
//! In: scenes, views of them, and the ways in which they are drawn. Out: medians of GPU milliseconds per pass and per
//! frame, and of wall-clock time, with their spread over rounds.

use crate::cli::args::{CheckpointArgs, Given, Need, RenderersArgs, ViewArgs, values};
use crate::cli::output::failure::Failure;
use crate::cli::output::note::note;
use crate::cli::output::progress::Bars;
use crate::cli::output::report::{Report, switches_json};
use crate::cli::output::table::{Table, bytes};
use crate::offline::draw::orbit::{at_times, share};
use crate::offline::engine::AdapterDescription;
use crate::offline::engine::Purpose;
use crate::offline::engine::memory::Pictures;
use crate::offline::work::proceed;
use crate::reference::{Workload, workload};
use crate::renderer::{ColorPrecision, Design, GpuCapture, Timings};
use crate::scene::{Form as DrawnForm, RuntimeScene, SceneForm};
use crate::view::View;
use serde_json::json;
use std::path::{Path, PathBuf};

/// Measure how fast scenes are drawn.
///
/// Every scene is drawn with every combination of the options; with --rounds the rows are measured in turn, so that a
/// change of the machine's state affects all of them. Times are medians over frames, which take the views in turn, then
/// over rounds. GPU times are timestamps around each frame and, in other frames, between its passes.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  gs4d bench capture.gs4d
  gs4d bench chkpnt30000.pth --cameras data/transforms_test.json --resolution 2 --times 5
  gs4d bench a.gs4d b.gs4d --renderer bins,sort --form stored,fp32 --filter on,off --rounds 3
  gs4d bench capture.gs4d --orbit 24 --size 1352x1014 --frames 1000 --json")]
pub(crate) struct Bench {
    #[command(flatten)]
    given: Given,
    /// The packages or checkpoints to draw.
    #[arg(value_name = "SCENE", required = true)]
    scenes: Vec<PathBuf>,
    /// Frames of each kind to measure.
    #[arg(long, value_name = "N", default_value = "240", value_parser = values::count(1_000_000))]
    frames: usize,
    /// Number of views, evenly spread over the camera file or, without one, over an orbit.
    #[arg(id = "views", long = "views", value_name = "N", default_value = "12", conflicts_with = "orbit", value_parser = values::count(100_000))]
    count: usize,
    /// Draw every view at K times, evenly over the interval [default: each at its own time].
    #[arg(long, value_name = "K", conflicts_with = "time", value_parser = values::count(10_000))]
    times: Option<usize>,
    /// Number of times that all rows are measured, in turn.
    #[arg(long, value_name = "N", default_value = "1", value_parser = values::count(1000))]
    rounds: usize,
    /// Form of packed Gaussians: stored, or fp32: unpacked to single precision, with colors that are not coded.
    #[arg(long, value_name = "FORM,..", default_value = "stored", value_delimiter = ',', value_parser = values::one_of(&FORMS))]
    form: Vec<Form>,
    /// Whether temporal filters are used.
    #[arg(long, value_name = "on|off,..", default_value = "on", value_delimiter = ',', value_parser = values::one_of(&SWITCH))]
    filter: Vec<bool>,
    /// Also compute expected and median depth.
    #[arg(long)]
    depths: bool,
    /// Draw into a color target of half precision, as in Bevy apps, instead of single.
    #[arg(long)]
    half: bool,
    #[command(flatten)]
    views: ViewArgs,
    #[command(flatten)]
    renderer: RenderersArgs,
    #[command(flatten)]
    checkpoint: CheckpointArgs,
}

/// In which form a scene is drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Form {
    Stored,
    Unpacked,
}

const FORMS: [(&str, Form); 2] = [("stored", Form::Stored), ("fp32", Form::Unpacked)];
const SWITCH: [(&str, bool); 2] = [("on", true), ("off", false)];

/// Most views, each at a time: as many as the most frames that are measured.
const MOST_VIEWS: usize = 1_000_000;
/// Number of views in which the splats of each pixel are counted, on the CPU.
const COUNTED_VIEWS: usize = 3;

/// A scene that has been read, with its views.
struct Scene<'a> {
    path: &'a Path,
    form: Form,
    /// Whether its file has packed Gaussians.
    is_packed: bool,
    scene: RuntimeScene,
    views: Vec<View>,
}

/// A scene on the GPU, with its views.
struct Subject<'a> {
    path: &'a Path,
    form: Form,
    scene: RuntimeScene,
    capture: GpuCapture,
    views: Vec<View>,
}

/// One way to draw a subject, and its measurements.
struct Row<'a> {
    subject: &'a Subject<'a>,
    design: Design,
    filtered: bool,
    rounds: Vec<Timings>,
    /// Splats per pixel, a mean over some of the views.
    workload: Workload,
}

impl Bench {
    /// Measures.
    ///
    /// # Errors
    /// A scene or views that cannot be used, no such adapter, a failure of the GPU.
    pub(crate) fn run(&self) -> Result<Report, Failure> {
        [Need::Background, Need::Playback].into_iter().try_for_each(|need| self.given.require(need, false))?;
        self.given.require(Need::UpAxis, self.views.are_of_orbit())?;
        // Before the adapter is opened: a bad file is reported on machines without one, too.
        let mut read = Vec::new();
        for path in &self.scenes {
            for &form in &self.form {
                read.push(self.read(path, form)?);
            }
        }
        self.given.require(Need::Packed, read.iter().any(|scene| scene.is_packed))?;
        self.given.require(Need::Filter, read.iter().any(|scene| scene.scene.filter.is_some()))?;
        let mut headless = self.renderer.open()?;
        for Scene { views, .. } in &read {
            // The targets of the frames in flight have about as many bytes as a picture that is read back and one that
            // waits.
            Pictures::written(views.iter().map(|view| view.size), 1).require(Some(&headless), Purpose::Drawn)?;
        }
        let mut subjects = Vec::with_capacity(read.len());
        for Scene { path, form, scene, views, .. } in read {
            subjects.push(Subject { path, form, capture: headless.upload(&scene)?, scene, views });
        }
        let mut rows = Vec::new();
        for subject in &subjects {
            for &filtered in &self.filter {
                let ways = self.renderer.renderers.iter();
                rows.extend(ways.map(|&design| Row::new(subject, design, filtered)));
            }
        }
        headless.measure_depths(self.depths);
        headless.measure_precision(if self.half { ColorPrecision::Half } else { ColorPrecision::Single });
        for round in 1..=self.rounds {
            for row in &mut rows {
                proceed(&Bars::default())?;
                let Subject { path, capture, views, .. } = row.subject;
                note(&format!("round {round} of {}: {}", self.rounds, path.display()));
                headless.set_design(row.design);
                row.design = headless.design();
                headless.use_filters(row.filtered);
                row.rounds.push(headless.time(capture, views, self.frames)?);
            }
        }
        let mut counted: Vec<(&Path, Workload)> = Vec::new();
        // All ways to draw a scene have the same work.
        for row in &mut rows {
            let path = row.subject.path;
            row.workload = match counted.iter().find(|(of, _)| *of == path) {
                Some((_, workload)) => *workload,
                None => row.subject.workload(),
            };
            counted.push((path, row.workload));
        }
        let adapter = AdapterDescription::of(&headless);
        let table: String = rows.iter().map(Row::text).collect();
        let json = json!({ "adapter": adapter, "rows": rows.iter().map(Row::json).collect::<Vec<_>>() });
        Ok(Report::new(json, format!("{adapter}\n{table}")))
    }

    /// Returns a scene in the form in which it is drawn, and its views.
    fn read<'a>(&self, path: &'a Path, form: Form) -> Result<Scene<'a>, Failure> {
        let scene = self.checkpoint.load(path)?;
        let is_packed = matches!(scene.form, SceneForm::Ready(DrawnForm::Packed(_)));
        let scene = if form == Form::Unpacked { scene.unpacked() } else { scene };
        let scene = scene.into_runtime().map_err(|error| Failure::at(path, &error))?;
        let mut shots = share(self.views.shots(&scene, self.count)?, self.views.limit(self.count));
        if let Some(times) = self.times {
            let count = shots.len();
            if count.saturating_mul(times) > MOST_VIEWS {
                let views = format!("{count} views at {times} times are more than {MOST_VIEWS} pictures");
                return Err(Failure::new(format!("{views}: give fewer --times, --orbit or --views")));
            }
            shots = at_times(shots, times, scene.trained_with.time_interval);
        }
        let views = shots.iter().map(|shot| shot.view(&scene)).collect();
        Ok(Scene { path, form, is_packed, scene, views })
    }
}

impl Subject<'_> {
    /// Returns the mean of the splats per pixel over some of the views.
    fn workload(&self) -> Workload {
        note(&format!("counting splats per pixel: {}", self.path.display()));
        let views = share(self.views.clone(), COUNTED_VIEWS);
        mean(&views.iter().map(|view| workload(&self.scene, view)).collect::<Vec<_>>())
    }
}

impl<'a> Row<'a> {
    fn new(subject: &'a Subject<'a>, design: Design, filtered: bool) -> Self {
        Self { subject, design, filtered, rounds: Vec::new(), workload: Workload::default() }
    }

    fn json(&self) -> serde_json::Value {
        let Subject { path, scene, capture, views, .. } = self.subject;
        let timings = self.medians();
        let [low, high] = self.spread();
        json!({
            "scene": path.display().to_string(),
            "gaussians": scene.len(),
            "form": name_of(&FORMS, self.subject.form),
            "renderer": name_of(&Design::NAMES, self.design),
            "filter": self.filtered && capture.has_filter(),
            "views": views.len(),
            "size": views.first().map_or([0, 0], |view| view.size.to_array()),
            "bytes": capture.bytes(),
            "splats_per_pixel": self.workload,
            "fps": { "gpu": timings.frame_milliseconds.map(fps), "pipelined": fps(timings.pipelined_milliseconds) },
            "rounds": { "count": self.rounds.len(), "least": low, "most": high },
            "timings": timings,
            "switches": switches_json(&scene.trained_with, &scene.playback),
        })
    }

    fn text(&self) -> String {
        let Subject { path, scene, capture, views, form } = self.subject;
        let timings = self.medians();
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
        row("preparing and recording", timings.encode_milliseconds, false);
        let size = views.first().map_or([0, 0], |view| view.size.to_array());
        let [low, high] = self.spread();
        let spread = match self.rounds.len() {
            1 => String::new(),
            count => format!("{count} rounds: {low:.4} to {high:.4} ms on the GPU\n"),
        };
        let counts = timings.counts;
        format!(
            "\n{}: {} Gaussians ({}), {} renderer, filter {}, {} views of {}x{}\n{table}{spread}\
             {} Gaussians active, {} splats visible, {} pairs of splat and tile (medians)\n\
             {:.1} splats evaluated for each pixel, {:.1} of them blended (mean of {} views, counted on the CPU)\n\
             {} of the capture, {} of the view\n",
            path.display(),
            scene.len(),
            name_of(&FORMS, *form),
            name_of(&Design::NAMES, self.design),
            name_of(&SWITCH, self.filtered && capture.has_filter()),
            views.len(),
            size[0],
            size[1],
            timings.active,
            counts.visible,
            counts.pairs,
            self.workload.evaluated,
            self.workload.contributing,
            views.len().min(COUNTED_VIEWS),
            bytes(capture.bytes()),
            bytes(timings.bytes),
        )
    }

    /// Returns the round whose frame took the median time, so that all its numbers belong together.
    fn medians(&self) -> &Timings {
        let mut rounds: Vec<&Timings> = self.rounds.iter().collect();
        rounds.sort_by(|a, b| time_of(a).total_cmp(&time_of(b)));
        rounds[rounds.len() / 2]
    }

    /// Returns the shortest and the longest time of a frame of all rounds.
    fn spread(&self) -> [f64; 2] {
        let times = self.rounds.iter().map(time_of);
        times.fold([f64::INFINITY, 0.0], |[low, high], time| [low.min(time), high.max(time)])
    }
}

/// Returns the mean of the workloads of some views.
fn mean(workloads: &[Workload]) -> Workload {
    let each = 1.0 / workloads.len().max(1) as f64;
    let sum = |value: fn(&Workload) -> f64| workloads.iter().map(value).sum::<f64>() * each;
    Workload { evaluated: sum(|w| w.evaluated), contributing: sum(|w| w.contributing) }
}

/// Returns the GPU time of a frame; without timestamps, the time of one of many frames in flight. Milliseconds.
fn time_of(timings: &Timings) -> f64 {
    timings.frame_milliseconds.unwrap_or(timings.pipelined_milliseconds)
}

fn name_of<T: PartialEq + Copy>(names: &[(&'static str, T)], value: T) -> &'static str {
    names.iter().find(|(_, named)| *named == value).map_or("", |(name, _)| name)
}

fn fps(milliseconds: f64) -> f64 {
    1e3 / milliseconds
}
