//! `gs4d detail IN -o OUT`: adds levels of detail to a scene.
//!
//! In: a scene, the number of levels, the lowest PSNR, optionally training views. Out: a package with the levels that
//! are close enough at some size, and the PSNR of each; with training views also the size of their pixels, with which
//! all Gaussians are anti-aliased.

use crate::cli::args::{CheckpointArgs, DataArgs, PackageArgs, RendererArgs, values};
use crate::cli::output::failure::Failure;
use crate::cli::output::progress::Bars;
use crate::cli::output::report::Report;
use crate::cli::output::table::{Table, bytes, lines};
use crate::offline::dataset::trained_pixel;
use crate::offline::detail::{Closeness, DetailSettings, MadeLevel, detail};
use crate::offline::measure::belonging::require_belonging_on_gpu;
use crate::offline::store::outputs::Files;
use crate::scene::MAX_LEVELS;
use serde_json::json;
use std::path::PathBuf;

/// Add levels of detail: the same capture with fewer Gaussians, to draw it small on the screen.
///
/// Each level is trained on two kinds of pictures of all Gaussians: pictures of the size at which the level is drawn,
/// and the truth, which is pictures of many times as many pixels, averaged to that size. The level is compared with
/// both from all directions, at several times and sizes. It is drawn up to the largest size at which two conditions
/// hold: its PSNR to the truth is at most 0.5 dB below that of all Gaussians, and a screen with the level has a PSNR of
/// at least --min-psnr to a screen with all Gaussians. A level without such a size is left out. With --data, games also
/// anti-alias all Gaussians where pixels are larger than in training. Needs a GPU; a software driver is sufficient.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  gs4d detail capture.gs4d --data data/toybox -o detailed.gs4d
  gs4d detail capture.gs4d -o detailed.gs4d --levels 2 --min-psnr 40
  gs4d detail chkpnt30000.pth -o detailed.gs4d --steps 5000 --json

A size on the screen is the diameter of the bounding sphere of the capture in pixels. Levels are compared and drawn up
to 250 pixels. The PSNR of a screen is over 1280x720 pixels, the PSNR to the truth over the rectangle of the capture. Both are the lower
value of black and white background, in the worst view. Other verbs that write packages leave levels out: run detail last.")]
pub(crate) struct Detail {
    /// The checkpoint or package to read. Its levels are replaced.
    #[arg(value_name = "IN")]
    input: PathBuf,
    #[command(flatten)]
    package: PackageArgs,
    #[command(flatten)]
    data: DataArgs,
    /// Skip the check that the images of --data show the capture.
    #[arg(long, help_heading = "Training data", requires = "data")]
    trust_images: bool,
    /// Number of levels. Each has a seventh of the Gaussians of the finer level.
    #[arg(long, value_name = "N", default_value = "3", value_parser = values::count(MAX_LEVELS as u64))]
    levels: usize,
    /// Lowest PSNR of a screen on which a level replaces all Gaussians, dB.
    #[arg(long, value_name = "DB", default_value = "45", value_parser = values::not_negative)]
    min_psnr: f64,
    /// Training steps of each level.
    #[arg(long, value_name = "N", default_value = "2000", value_parser = values::count(1_000_000))]
    steps: usize,
    /// Number of directions from which levels are trained and compared.
    #[arg(long, value_name = "N", default_value = "24", value_parser = values::count(1000))]
    directions: usize,
    /// Number of times of each direction.
    #[arg(long, value_name = "N", default_value = "6", value_parser = values::count(1000))]
    times: usize,
    #[command(flatten)]
    renderer: RendererArgs,
    #[command(flatten)]
    checkpoint: CheckpointArgs,
}

impl Detail {
    /// Makes the levels and writes the scene with the levels.
    ///
    /// # Errors
    /// A scene that cannot be read or has an environment map, training views that do not show it, a package that cannot
    /// be written, no such adapter, a failure of the GPU.
    pub(crate) fn run(&self) -> Result<Report, Failure> {
        let out = self.package.checked_out(self.data.add_to(Files::default().reads_scene(&self.input)))?;
        let mut scene = self.checkpoint.load(&self.input)?;
        let views = match self.data.is_given() {
            true => Some(self.data.open(&scene.trained_with, &mut Bars::default())?),
            false => None,
        };
        if let Some(views) = &views {
            let pixel = trained_pixel(&scene, views);
            let reason = "no training view shows any of its Gaussians: is --data the folder that it was trained on?";
            scene.trained_with.pixel = Some(pixel.ok_or_else(|| Failure::about(&self.input, reason))?);
        }
        let mut headless = self.renderer.open()?;
        if let Some(views) = views.filter(|_| !self.trust_images) {
            let runtime = scene.clone().into_runtime().map_err(|error| Failure::at(&self.input, &error))?;
            require_belonging_on_gpu(&mut headless, &runtime, &views, runtime.trained_background())?;
        }
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
            ("training pixel", pixel.map_or("unknown: give --data".to_owned(), |pixel| format!("{pixel} units"))),
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

/// Returns the PSNR of a level at the largest size at which it is drawn, or at the smallest size if it is not kept.
fn measured(level: &MadeLevel) -> String {
    let limit = level.measured.iter().find(|close| Some(close.pixels) == level.pixels).or(level.measured.first());
    limit.map_or(String::new(), |Closeness { screen, truth, all, .. }| format!("{screen:.1}, {truth:.1} ({all:.1})"))
}
