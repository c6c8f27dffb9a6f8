//! `gs4d render SCENE`: draws pictures of a scene.
//!
//! In: a scene and views of it. Out: a folder of PNG files, and raw float32 ones with `--raw`.

use crate::cli::args::{CheckpointArgs, Given, Need, RendererArgs, ViewArgs, values};
use crate::cli::output::failure::Failure;
use crate::cli::output::near::NearSample;
use crate::cli::output::progress::Bars;
use crate::cli::output::report::{Report, switches, switches_json};
use crate::cli::output::table::lines;
use crate::offline::draw::render::render_shots;
use crate::offline::draw::{DrawError, Shot};
use crate::offline::engine::AdapterDescription;
use crate::offline::store::outputs::Files;
use crate::offline::work::{write_beside, write_png};
use crate::renderer::{GpuError, Storage};
use crate::scene::{MAX_LEVELS, RuntimeScene};
use crate::view::{Background, Counts, Picture, View};
use serde_json::{Value, json};
use std::fs;
use std::io::Write;
use std::path::PathBuf;
use std::time::Instant;

/// Draw views of a scene as PNG files.
///
/// Each picture has the name of its frame in the camera file, without folders and extension. Existing pictures are
/// replaced.
#[derive(clap::Args)]
#[command(group = clap::ArgGroup::new("what").args(["cameras", "orbit"]).required(true))]
#[command(after_help = "\
Examples:
  gs4d render capture.gs4d --cameras data/transforms_test.json --out frames
  gs4d render chkpnt30000.pth --orbit 120 --size 800x600 --out turn
  gs4d render capture.gs4d --cameras golden.json --raw --background 0,0,0 --out exact
  gs4d render capture.gs4d --orbit 12 --size 100x100 --level 1 --out far

Raw pictures (.f32) are height x width x 3 little-endian float32 values, not clamped.
The background is that of the capture (its environment map if it has one), or the color of --background.")]
pub(crate) struct Render {
    #[command(flatten)]
    given: Given,
    /// The package or checkpoint to draw.
    #[arg(value_name = "SCENE")]
    scene: PathBuf,
    /// Folder for the pictures. It is created if it does not exist.
    #[arg(short, long, value_name = "DIR")]
    out: PathBuf,
    /// Reduce the opacity of splats where pixels are larger than in training, as games do and the original does not.
    /// The package must have the size of its training pixels: `gs4d bake` and `gs4d detail --data` write it.
    #[arg(long)]
    antialias: bool,
    /// Draw this level of detail in place of all Gaussians, anti-aliased as in games. 1 is the finest level.
    #[arg(long, value_name = "N", value_parser = values::count(MAX_LEVELS as u64))]
    level: Option<usize>,
    /// Also write raw float32 pictures (.f32).
    #[arg(long)]
    raw: bool,
    #[command(flatten)]
    views: ViewArgs,
    #[command(flatten)]
    renderer: RendererArgs,
    #[command(flatten)]
    checkpoint: CheckpointArgs,
}

impl Render {
    /// Draws the pictures and writes them.
    ///
    /// # Errors
    /// A scene or views that cannot be used, a missing level or size of training pixels, pictures that cannot be
    /// written, no such adapter, a failure of the GPU.
    pub(crate) fn run(&self) -> Result<Report, Failure> {
        self.given.require(Need::AllGaussians, self.level.is_none())?;
        self.given.require(Need::Playback, false)?;
        self.given.require(Need::UpAxis, self.views.are_of_orbit())?;
        let files = self.views.add_to(Files::default().reads_scene(&self.scene));
        files.clone().writes_folder(&self.out, []).check()?;
        let (scene, headless) = std::thread::scope(|scope| {
            // The adapter opens while the scene is read. Most scenes are compressed packages: their pipelines are
            // compiled too.
            let opening = scope.spawn(|| {
                let headless = self.renderer.open()?;
                headless.compile_ahead(Storage::Coded)?;
                Ok::<_, GpuError>(headless)
            });
            let scene = self.checkpoint.load(&self.scene)?;
            let scene = scene.into_runtime().map_err(|error| Failure::at(&self.scene, &error))?;
            Ok::<_, Failure>((scene, opening.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))))
        })?;
        let drawn = self.drawn(&scene)?;
        let level = self.level.unwrap_or(0);
        if self.antialias && scene.antialias_pixel(level, true).is_none() {
            // Levels of detail need a capture without an environment map.
            let remedy = match scene.environment {
                Some(_) => "gs4d bake --data DIR makes a package with it",
                None => "add it with gs4d detail --data DIR",
            };
            let reason = "does not have the size of its training pixels, which --antialias needs";
            return Err(Failure::about(&self.scene, &format!("{reason}: {remedy}")));
        }
        let shots = self.views.shots(&scene, 1)?;
        files.writes_folder(&self.out, shots.iter().flat_map(|shot| self.paths(shot))).check()?;
        fs::create_dir_all(&self.out).map_err(|error| Failure::at(&self.out, &error))?;
        let mut headless = headless?;
        let capture = headless.upload(drawn)?;
        let background = self.checkpoint.background.map_or(scene.trained_background(), Background::Color);
        // The optics with which games draw this level.
        let optics = scene.optics(level, self.antialias);
        let with_view = |shot: Shot| {
            let view = shot.camera.view(shot.time, optics);
            (shot, view)
        };
        let views: Vec<(Shot, View)> = shots.into_iter().map(with_view).collect();
        let mut text = lines(&switches(&scene.trained_with, &scene.playback));
        let switches = switches_json(&scene.trained_with, &scene.playback);
        let sample = NearSample::of(drawn);
        drop(scene);

        let start = Instant::now();
        let write = |shot: &Shot, picture: &Picture| self.write(shot, picture);
        let counts = render_shots(&mut headless, &capture, background, &views, write, &mut Bars::default())?;
        let seconds = start.elapsed().as_secs_f64();
        sample.point_out(&views, &counts);
        let frames: Vec<Value> = views.iter().zip(&counts).map(|(view, counts)| self.frame(view, counts)).collect();
        let (count, adapter) = (frames.len(), AdapterDescription::of(&headless));
        text += &format!("\n{count} pictures in {}, {seconds:.1} s on {adapter}\n", self.out.display());
        let json = json!({
            "scene": self.scene.display().to_string(),
            "level": level,
            "out": self.out.display().to_string(),
            "adapter": adapter,
            "seconds": seconds,
            "switches": switches,
            "frames": frames,
        });
        Ok(Report::new(json, text))
    }

    /// Returns the scene that is drawn: the scene itself, or its level of detail with the number of `--level`.
    fn drawn<'a>(&self, scene: &'a RuntimeScene) -> Result<&'a RuntimeScene, Failure> {
        let Some(level) = self.level else { return Ok(scene) };
        let count = scene.levels.len();
        match count {
            0 if scene.environment.is_some() => {
                let reason = "has no levels of detail, and can have none with its environment map: leave out --level";
                Err(Failure::about(&self.scene, reason))
            }
            0 => Err(Failure::about(&self.scene, "has no levels of detail: make them with gs4d detail")),
            _ if level > count => {
                Err(Failure::about(&self.scene, &format!("has no level of detail {level}; the coarsest is {count}")))
            }
            _ => Ok(&scene.levels[level - 1].scene),
        }
    }

    fn frame(&self, (shot, view): &(Shot, View), counts: &Counts) -> Value {
        json!({
            "name": shot.name,
            "picture": self.path(shot, "png").display().to_string(),
            "raw": self.raw.then(|| self.path(shot, "f32").display().to_string()),
            "time": shot.time,
            "size": view.size.to_array(),
            "visible": counts.visible,
            "pairs": counts.pairs,
        })
    }

    /// Returns the paths of all files for a shot.
    fn paths(&self, shot: &Shot) -> Vec<PathBuf> {
        let extensions: &[&str] = if self.raw { &["png", "f32"] } else { &["png"] };
        extensions.iter().map(|extension| self.path(shot, extension)).collect()
    }

    fn path(&self, shot: &Shot, extension: &str) -> PathBuf {
        self.out.join(format!("{}.{extension}", shot.name))
    }

    fn write(&self, shot: &Shot, picture: &Picture) -> Result<(), DrawError> {
        write_png(&self.path(shot, "png"), picture)?;
        if self.raw {
            write_beside(&self.path(shot, "f32"), |file| file.write_all(&picture.to_raw()))?;
        }
        Ok(())
    }
}
