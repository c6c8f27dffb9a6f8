//! `gs4d render SCENE`: pictures of a scene.
//!
//! In: a scene and views of it. Out: a folder of PNG files, and raw float32 ones with `--raw`. Drawing and writing overlap.

use super::failure::Failure;
use super::gpu::{self, GpuArgs};
use super::interrupt;
use super::opening::{self, CheckpointArgs};
use super::report::{Report, lines, progress};
use super::views::{Shot, ViewArgs};
use crate::offline;
use crate::renderer::{GpuCapture, Headless};
use crate::view::{Background, Picture, View};
use image::codecs::png::PngEncoder;
use rayon::prelude::*;
use serde_json::{Value, json};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{SyncSender, sync_channel};
use std::time::Instant;
use std::{fs, thread};

/// Pictures drawn but not yet written, at most.
const QUEUE: usize = 4;

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

Raw pictures (.f32): height x width x 3 little-endian float32 before any clamping.
The background is the capture's own, its environment map if it has one, unless --background is given.")]
pub struct Render {
    /// The package or checkpoint to draw.
    #[arg(value_name = "SCENE")]
    scene: PathBuf,
    /// Folder for the pictures, made if it is not there.
    #[arg(short, long, value_name = "DIR")]
    out: PathBuf,
    /// Write raw float32 pictures (.f32) too.
    #[arg(long)]
    raw: bool,
    #[command(flatten)]
    views: ViewArgs,
    #[command(flatten)]
    gpu: GpuArgs,
    #[command(flatten)]
    checkpoint: CheckpointArgs,
}

/// What is drawn, apart from the view.
struct Subject<'a> {
    capture: &'a GpuCapture,
    background: Background,
}

impl Render {
    /// Draws and writes.
    pub fn run(&self) -> Result<Report, Failure> {
        let scene = self.checkpoint.load(&self.scene)?;
        let scene = scene.into_runtime().map_err(|error| Failure::at(&self.scene, &error))?;
        let shots = self.views.shots(&scene, 1)?;
        fs::create_dir_all(&self.out).map_err(|error| Failure::at(&self.out, &error))?;
        let mut headless = self.gpu.open()?;
        let capture = headless.upload(&scene)?;
        let background = self.checkpoint.background.map_or(scene.trained_background(), Background::Color);
        let views: Vec<(&Shot, View)> = shots.iter().map(|shot| (shot, shot.view(&scene))).collect();
        let mut text = lines(&opening::switches(&scene.trained_with, &scene.playback));
        let switches = opening::switches_json(&scene.trained_with, &scene.playback);
        drop(scene);

        let start = Instant::now();
        let frames = self.draw_all(&mut headless, &Subject { capture: &capture, background }, &views)?;
        let seconds = start.elapsed().as_secs_f64();
        let (count, adapter) = (frames.len(), gpu::adapter_name(&headless));
        text += &format!("\n{count} pictures in {}, {seconds:.1} s on {adapter}\n", self.out.display());
        let json = json!({
            "scene": self.scene.display().to_string(),
            "out": self.out.display().to_string(),
            "adapter": gpu::adapter_json(&headless),
            "seconds": seconds,
            "switches": switches,
            "frames": frames,
        });
        Ok(Report::new(json, text))
    }

    /// Draws the views in order while other threads write what is drawn.
    fn draw_all(
        &self,
        headless: &mut Headless,
        subject: &Subject<'_>,
        views: &[(&Shot, View)],
    ) -> Result<Vec<Value>, Failure> {
        let (queue, drawn) = sync_channel::<(&Shot, Picture)>(QUEUE);
        // Threads of their own: they wait for pictures, which would stall rayon's shared ones.
        let writers = rayon::ThreadPoolBuilder::new().build()?;
        thread::scope(|scope| {
            let written = scope.spawn(|| {
                let write = |(shot, picture): (&Shot, Picture)| self.write(shot, &picture);
                writers.install(|| drawn.into_iter().par_bridge().try_for_each(write))
            });
            let frames = self.draw(headless, subject, views, queue);
            let written =
                written.join().unwrap_or_else(|_| Err(Failure::new("the threads that write pictures broke down")));
            written.and(frames)
        })
    }

    fn draw<'s>(
        &self,
        headless: &mut Headless,
        subject: &Subject<'_>,
        views: &[(&'s Shot, View)],
        queue: SyncSender<(&'s Shot, Picture)>,
    ) -> Result<Vec<Value>, Failure> {
        let bar = progress(views.len(), "rendering");
        let mut frames = Vec::with_capacity(views.len());
        for &(shot, view) in views {
            let frame = headless.render(subject.capture, &view, subject.background)?;
            frames.push(json!({
                "name": shot.name,
                "picture": self.path(shot, "png").display().to_string(),
                "raw": self.raw.then(|| self.path(shot, "f32").display().to_string()),
                "time": shot.time,
                "size": view.size.to_array(),
                "visible": frame.counts.visible,
                "pairs": frame.counts.pairs,
            }));
            if queue.send((shot, frame.picture)).is_err() {
                // The writers stopped at an error, which they report.
                break;
            }
            bar.inc(1);
        }
        bar.finish_and_clear();
        Ok(frames)
    }

    fn path(&self, shot: &Shot, extension: &str) -> PathBuf {
        self.out.join(format!("{}.{extension}", shot.name))
    }

    fn write(&self, shot: &Shot, picture: &Picture) -> Result<(), Failure> {
        write_file(&self.path(shot, "png"), |file| {
            picture.to_rgb8().write_with_encoder(PngEncoder::new(file)).map_err(io::Error::other)
        })?;
        if self.raw {
            write_file(&self.path(shot, "f32"), |file| file.write_all(&picture.to_raw()))?;
        }
        Ok(())
    }
}

fn write_file(path: &Path, write: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> Result<(), Failure> {
    Ok(interrupt::whole(|| offline::write_beside(path, |file| write(file)))?)
}
