//! `gs4d synth OUT`: creates a procedural moving scene of any size.
//!
//! In: a number of Gaussians and a seed, or a capture to grow. Out: a package in the trained form, for tests and
//! benchmarks.

use crate::cli::args::{CheckpointArgs, Given, Need, PackageArgs, values};
use crate::cli::output::failure::Failure;
use crate::cli::output::report::Report;
use crate::cli::output::table::{bytes, lines};
use crate::offline::store::outputs::Files;
use crate::scene::grow::grow;
use crate::scene::synth::{SynthSettings, synthesize};
use crate::scene::{GaussianScene, SceneForm};
use serde_json::json;
use std::ffi::OsString;
use std::path::Path;

/// Create a procedural moving scene, or a capture with more Gaussians, for tests and benchmarks.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  gs4d synth small.gs4d
  gs4d synth large.gs4d --count 667000 --seed 7
  gs4d synth grown.gs4d --grow 37 chkpnt30000.pth --level 1")]
pub(crate) struct Synth {
    #[command(flatten)]
    given: Given,
    #[command(flatten)]
    package: PackageArgs,
    /// Number of Gaussians.
    #[arg(long, value_name = "N", default_value = "10000", value_parser = values::count(MAX_COUNT as u64))]
    count: usize,
    /// Split each Gaussian of CAPTURE into K Gaussians inside its 4D volume, in place of a procedural scene. The
    /// pictures are nearly the same.
    #[arg(long, num_args = 2, value_names = ["K", "CAPTURE"], conflicts_with_all = ["count", "sh_degree", "sh_degree_t"])]
    grow: Option<Vec<OsString>>,
    /// Seed of the random numbers. The same seed creates the same scene on every machine.
    #[arg(long, value_name = "S", default_value_t = 1)]
    seed: u64,
    /// Spatial degree of color, 0 to 3.
    #[arg(long, value_name = "D", default_value_t = 3, value_parser = clap::value_parser!(u32).range(0..=3))]
    sh_degree: u32,
    /// Time degree of color, 0 to 2; used only with --sh-degree 3.
    #[arg(long, value_name = "D", default_value_t = 2, value_parser = clap::value_parser!(u32).range(0..=2))]
    sh_degree_t: u32,
    /// Seconds of playback; 0 for a still.
    #[arg(long, value_name = "SECONDS", default_value = "2", value_parser = values::seconds, conflicts_with = "grow")]
    duration: f32,
}

/// The largest number of Gaussians of a created scene.
const MAX_COUNT: usize = 20_000_000;

impl Synth {
    /// Creates the scene and writes it.
    ///
    /// # Errors
    /// The capture to grow cannot be read, or the package cannot be written.
    pub(crate) fn run(&self) -> Result<Report, Failure> {
        self.given.require(Need::ColorInTime, self.sh_degree >= 3)?;
        let capture = self.grow.as_deref().and_then(<[OsString]>::last).map(Path::new);
        let files = capture.into_iter().fold(Files::default(), Files::reads_scene);
        let out = self.package.checked_out(files)?;
        let scene = match self.grow.as_deref() {
            Some([times, capture]) => self.grown(times, Path::new(capture))?,
            _ => synthesize(&SynthSettings {
                count: self.count,
                seed: self.seed,
                degree: self.sh_degree,
                degree_t: self.sh_degree_t,
                duration_seconds: self.duration,
            }),
        };
        let size = self.package.save(&scene)?;
        let text =
            lines(&[("wrote", format!("{}, {}", out.display(), bytes(size))), ("Gaussians", scene.len().to_string())]);
        let json =
            json!({ "out": out.display().to_string(), "gaussians": scene.len(), "bytes": size, "seed": self.seed });
        Ok(Report::new(json, text))
    }

    /// Returns the capture with `times` Gaussians for each of its Gaussians.
    fn grown(&self, times: &OsString, capture: &Path) -> Result<GaussianScene, Failure> {
        let text = times.to_string_lossy();
        let times: usize = text.parse().ok().filter(|&times| times > 0).ok_or_else(|| {
            Failure::new(format!("--grow {text}: expected the number of parts of each Gaussian, such as 37"))
        })?;
        let scene = CheckpointArgs::default().load_to_change(capture)?;
        let SceneForm::Trained(trained) = &scene.form else {
            let reason = "--grow needs Gaussians in the trained form: give a checkpoint or a package in that form";
            return Err(Failure::about(capture, reason));
        };
        if trained.parameters.len().saturating_mul(times) > MAX_COUNT {
            return Err(Failure::about(
                capture,
                &format!("{times} times as many Gaussians are more than {MAX_COUNT}: give a smaller K"),
            ));
        }
        grow(&scene, trained, times, self.seed).map_err(|error| Failure::at(capture, &error))
    }
}
