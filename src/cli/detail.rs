//! `gs4d detail IN -o OUT`: adds levels of detail to a scene.
//!
//! In: a scene, its training views if they are there, how many levels, how close they must be. Out: a package with the levels that are
//! close enough at some size, and how close each is; with the size of training pixels, by which views of all Gaussians are anti-aliased.

use super::args::{CheckpointArgs, DataArgs, PackageArgs, RendererArgs, values};
use super::failure::Failure;
use super::progress::Bars;
use super::report::Report;
use super::table::{Table, bytes, lines};
use crate::offline::detail::{Closeness, DetailSettings, MadeLevel, detail};
use crate::offline::files::Files;
use crate::offline::trained_pixel;
use crate::scene::MAX_LEVELS;
use serde_json::json;
use std::path::PathBuf;

/// Add levels of detail: the same capture of fewer Gaussians, for where it is small on the screen.
///
/// Each level is trained on pictures of all Gaussians, half on the truth, which has many more pixels and is made smaller. It is compared
/// with both from all around, at several times and sizes, and drawn up to the largest size at which it is as close to the truth as all
/// Gaussians are, within 0.5 dB, and its taking their place changes a screen by no less than --min-psnr; it is left out if there is
/// none. With --data, all Gaussians are anti-aliased from then on where they are drawn smaller than in training. Needs a GPU; a software
/// driver is enough.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  gs4d detail capture.gs4d --data data/toybox -o detailed.gs4d
  gs4d detail capture.gs4d -o detailed.gs4d --levels 2 --min-psnr 40
  gs4d detail chkpnt30000.pth -o detailed.gs4d --steps 5000 --json

A size on the screen is the diameter of the sphere about the capture, in pixels; levels are compared, and drawn, up
to 250. The PSNR of a screen is that of 1280x720 pixels; to the truth it is that inside the rectangle of the capture; over black or white,
whichever is lower, in the worst view. Other verbs that write packages leave levels out: this one comes last.")]
pub struct Detail {
    /// The checkpoint or package to read. Levels that it has are replaced.
    #[arg(value_name = "IN")]
    input: PathBuf,
    #[command(flatten)]
    package: PackageArgs,
    #[command(flatten)]
    data: DataArgs,
    /// Levels to make, each with a seventh of the Gaussians of the one before.
    #[arg(long, value_name = "N", default_value = "3", value_parser = values::count(MAX_LEVELS as u64))]
    levels: usize,
    /// Lowest PSNR of a screen on which a level takes the place of all Gaussians, dB.
    #[arg(long, value_name = "DB", default_value = "45", value_parser = values::not_negative)]
    min_psnr: f64,
    /// Steps of training of each level.
    #[arg(long, value_name = "N", default_value = "2000", value_parser = values::count(1_000_000))]
    steps: usize,
    /// Directions from which levels are trained and compared.
    #[arg(long, value_name = "N", default_value = "24", value_parser = values::count(1000))]
    directions: usize,
    /// Times at which they are, from each direction.
    #[arg(long, value_name = "N", default_value = "6", value_parser = values::count(1000))]
    times: usize,
    #[command(flatten)]
    renderer: RendererArgs,
    #[command(flatten)]
    checkpoint: CheckpointArgs,
}

impl Detail {
    /// Makes the levels and writes the scene with them.
    ///
    /// # Errors
    /// A scene that cannot be read or has an environment map, a package that cannot be written, no such adapter, a failure of the GPU.
    pub fn run(&self) -> Result<Report, Failure> {
        let out = self.package.checked_out(self.data.add_to(Files::default().reads_scene(&self.input)))?;
        let mut scene = self.checkpoint.load(&self.input)?;
        if self.data.is_given() {
            let views = self.data.open(&scene.trained_with, &mut Bars::default())?;
            let pixel = trained_pixel(&scene, &views);
            let pixel =
                pixel.ok_or_else(|| Failure::about(&self.input, "no training view looks at it: is --data its own?"))?;
            scene.trained_with.pixel = Some(pixel);
        }
        let mut headless = self.renderer.open()?;
        let settings = DetailSettings {
            levels: self.levels,
            min_psnr: self.min_psnr,
            steps: self.steps,
            directions: self.directions,
            times: self.times,
        };
        let (count, pixel) = (scene.len(), scene.trained_with.pixel);
        let made = detail(&mut headless, scene, &settings, &mut Bars::default());
        let made = made.map_err(|error| Failure::at(&self.input, &error))?;
        let written = self.package.save(&made.scene)?;
        let mut table = Table::new(&["level", "Gaussians", "up to pixels", "dB of a screen, to the truth (all)"]);
        for (index, level) in made.made.iter().enumerate() {
            let pixels = level.pixels.map_or("not kept".to_owned(), |pixels| pixels.to_string());
            table.row([(index + 1).to_string(), level.gaussians.to_string(), pixels, measured(level)]);
        }
        let kept = made.scene.levels.len();
        let facts = lines(&[
            ("Gaussians", count.to_string()),
            ("training pixel", pixel.map_or("not known: give --data".to_owned(), |pixel| format!("{pixel} units"))),
            ("levels", format!("{kept} of {} kept, at {} dB", made.made.len(), self.min_psnr)),
            ("wrote", format!("{}, {}", out.display(), bytes(written))),
        ]);
        let json = json!({
            "in": self.input.display().to_string(),
            "out": out.display().to_string(),
            "bytes_out": written,
            "gaussians": count,
            "pixel": pixel,
            "min_psnr": self.min_psnr,
            "kept": kept,
            "levels": made.made,
        });
        Ok(Report::new(json, format!("{table}\n{facts}")))
    }
}

/// Returns what was measured of a level at its limit, or at the smallest size if it is not kept.
fn measured(level: &MadeLevel) -> String {
    let limit = level.measured.iter().find(|close| Some(close.pixels) == level.pixels).or(level.measured.first());
    limit.map_or(String::new(), |Closeness { screen, truth, all, .. }| format!("{screen:.1}, {truth:.1} ({all:.1})"))
}
