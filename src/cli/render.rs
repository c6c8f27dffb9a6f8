//! `gs4d render SCENE`: draws pictures of a scene.
//!
//! In: a scene and views of it. Out: a folder of PNG files, and raw float32 ones with `--raw`.

use super::args::{CheckpointArgs, RendererArgs, ViewArgs, values};
use super::failure::Failure;
use super::progress::Bars;
use super::report::{Report, switches, switches_json};
use super::table::lines;
use crate::offline::engine::AdapterDescription;
use crate::offline::files::Files;
use crate::offline::orbit::Shot;
use crate::offline::render::render_shots;
use crate::offline::{OfflineError, write_beside, write_png};
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
/// Pictures are named after the frames of the camera file, without folders and extension; existing ones are replaced.
#[derive(clap::Args)]
#[command(group = clap::ArgGroup::new("what").args(["cameras", "orbit"]).required(true))]
#[command(after_help = "\
Examples:
  gs4d render capture.gs4d --cameras data/transforms_test.json --out frames
  gs4d render chkpnt30000.pth --orbit 120 --size 800x600 --out turn
  gs4d render capture.gs4d --cameras golden.json --raw --background 0,0,0 --out exact
  gs4d render capture.gs4d --orbit 12 --size 100x100 --level 1 --out far

Raw pictures (.f32): height x width x 3 little-endian float32 before any clamping.
The background is the capture's own, its environment map if it has one, unless --background is given.")]
pub struct Render {
    /// The package or checkpoint to draw.
    #[arg(value_name = "SCENE")]
    scene: PathBuf,
    /// Folder for the pictures, made if it is not there.
    #[arg(short, long, value_name = "DIR")]
    out: PathBuf,
    /// Make Gaussians fainter where pictures have larger pixels than training had, as games do; the original does not. Needs a package that
    /// tells the size of training pixels: `gs4d bake` and `gs4d detail --data` write it.
    #[arg(long)]
    antialias: bool,
    /// Draw this level of detail in place of all Gaussians, anti-aliased; 1 is the finest.
    #[arg(long, value_name = "N", value_parser = values::count(MAX_LEVELS as u64))]
    level: Option<usize>,
    /// Write raw float32 pictures (.f32) too.
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
    /// Draws and writes.
    ///
    /// # Errors
    /// A scene or views that cannot be used, pictures that cannot be written, no such adapter, a failure of the GPU.
    pub fn run(&self) -> Result<Report, Failure> {
        let files = self.views.add_to(Files::default().reads_scene(&self.scene));
        files.clone().writes_folder(&self.out, []).check()?;
        let (scene, headless) = std::thread::scope(|scope| {
            // The adapter opens while the scene is read, and most are compressed packages.
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
        let trained_pixel = scene.trained_with.pixel.filter(|_| self.antialias || self.level.is_some());
        if self.antialias && trained_pixel.is_none() {
            return Err(Failure::about(
                &self.scene,
                "does not tell the size of training pixels: add it with gs4d detail --data DIR",
            ));
        }
        let shots = self.views.shots(&scene, 1)?;
        files.writes_folder(&self.out, shots.iter().flat_map(|shot| self.paths(shot))).check()?;
        fs::create_dir_all(&self.out).map_err(|error| Failure::at(&self.out, &error))?;
        let mut headless = headless?;
        let capture = headless.upload(drawn)?;
        let background = self.checkpoint.background.map_or(scene.trained_background(), Background::Color);
        let with_view = |shot: Shot| {
            let view = shot.view(&scene).antialiased(trained_pixel);
            (shot, view)
        };
        let views: Vec<(Shot, View)> = shots.into_iter().map(with_view).collect();
        let mut text = lines(&switches(&scene.trained_with, &scene.playback));
        let switches = switches_json(&scene.trained_with, &scene.playback);
        drop(scene);

        let start = Instant::now();
        let write = |shot: &Shot, picture: &Picture| self.write(shot, picture);
        let counts = render_shots(&mut headless, &capture, background, &views, write, &mut Bars::default())?;
        let seconds = start.elapsed().as_secs_f64();
        let frames: Vec<Value> = views.iter().zip(&counts).map(|(view, counts)| self.frame(view, counts)).collect();
        let (count, adapter) = (frames.len(), AdapterDescription::of(&headless));
        text += &format!("\n{count} pictures in {}, {seconds:.1} s on {adapter}\n", self.out.display());
        let json = json!({
            "scene": self.scene.display().to_string(),
            "level": self.level.unwrap_or(0),
            "out": self.out.display().to_string(),
            "adapter": adapter,
            "seconds": seconds,
            "switches": switches,
            "frames": frames,
        });
        Ok(Report::new(json, text))
    }

    /// Returns what is drawn of a scene: all of it, or the level that is asked for.
    fn drawn<'a>(&self, scene: &'a RuntimeScene) -> Result<&'a RuntimeScene, Failure> {
        let Some(level) = self.level else { return Ok(scene) };
        let count = scene.levels.len();
        match count {
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

    fn write(&self, shot: &Shot, picture: &Picture) -> Result<(), OfflineError> {
        write_png(&self.path(shot, "png"), picture)?;
        if self.raw {
            write_beside(&self.path(shot, "f32"), |file| file.write_all(&picture.to_raw()))?;
        }
        Ok(())
    }
}
