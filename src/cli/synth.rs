//! `gs4d synth OUT`: creates a procedural moving scene of any size.
//!
//! In: a count and a seed. Out: a package in the trained form, for tests and benchmarks.

use super::args::{PackageArgs, values};
use super::failure::Failure;
use super::report::Report;
use super::table::{bytes, lines};
use crate::scene::synth::{SynthSettings, synthesize};
use serde_json::json;

/// Make a procedural moving scene, for tests and benchmarks.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  gs4d synth small.gs4d
  gs4d synth large.gs4d --count 667000 --seed 7")]
pub struct Synth {
    #[command(flatten)]
    package: PackageArgs,
    /// Number of Gaussians.
    #[arg(long, value_name = "N", default_value = "10000", value_parser = values::count(20_000_000))]
    count: usize,
    /// Seed of the random numbers: the same seed makes the same scene on every machine.
    #[arg(long, value_name = "S", default_value_t = 1)]
    seed: u64,
    /// Spatial degree of colour, 0 to 3.
    #[arg(long, value_name = "D", default_value_t = 3, value_parser = clap::value_parser!(u32).range(0..=3))]
    sh_degree: u32,
    /// Time degree of colour, 0 to 2; counts only with --sh-degree 3.
    #[arg(long, value_name = "D", default_value_t = 2, value_parser = clap::value_parser!(u32).range(0..=2))]
    sh_degree_t: u32,
    /// Seconds of playback.
    #[arg(long, value_name = "SECONDS", default_value = "2", value_parser = values::positive)]
    duration: f32,
}

impl Synth {
    /// Creates the scene and writes it.
    ///
    /// # Errors
    /// The package cannot be written.
    pub fn run(&self) -> Result<Report, Failure> {
        let out = self.package.out()?;
        let scene = synthesize(&SynthSettings {
            count: self.count,
            seed: self.seed,
            degree: self.sh_degree,
            degree_t: self.sh_degree_t,
            duration_seconds: self.duration,
        });
        let size = self.package.save(&scene)?;
        let text =
            lines(&[("wrote", format!("{}, {}", out.display(), bytes(size))), ("Gaussians", scene.len().to_string())]);
        let json =
            json!({ "out": out.display().to_string(), "gaussians": scene.len(), "bytes": size, "seed": self.seed });
        Ok(Report::new(json, text))
    }
}
