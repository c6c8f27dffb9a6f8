//! `gs4d convert IN OUT`: converts a checkpoint or a package to a package.
//!
//! In: a scene, a target form, color degrees. Out: a package; a report of its training and playback settings and of the
//! sizes before and after.

use crate::cli::args::{CheckpointArgs, Given, Need, PackageArgs, file_size, values};
use crate::cli::output::failure::Failure;
use crate::cli::output::report::{Report, switches, switches_json};
use crate::cli::output::table::{bytes, lines};
use crate::offline::forms::convert::form_name;
use crate::offline::forms::{ConvertSettings, TargetForm, convert};
use crate::offline::store::outputs::Files;
use serde_json::json;
use std::path::PathBuf;

/// Convert a checkpoint (.pth) or a package to a package (.gs4d).
///
/// The conversion is lossless, except with --form runtime, a lower color degree or a --merge above 0; levels of detail
/// are left out. The package is written to a temporary file beside OUT and renamed when it is complete: an existing OUT
/// is replaced or stays unchanged. OUT must not be IN.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  gs4d convert chkpnt30000.pth capture.gs4d
  gs4d convert chkpnt30000.pth small.gs4d --form runtime --sh-degree 0
  gs4d convert n3v/chkpnt30000.pth -o n3v.gs4d --time-interval 0,10 --trained-cameras intrinsics --duration 10")]
pub(crate) struct Convert {
    #[command(flatten)]
    given: Given,
    /// The checkpoint or package to read.
    #[arg(value_name = "IN")]
    input: PathBuf,
    #[command(flatten)]
    package: PackageArgs,
    /// Form of the Gaussians: trained (can be pruned and fine-tuned) or runtime (smaller, same pictures) [default: as
    /// in IN].
    #[arg(long, value_name = "FORM", value_parser = values::one_of(&TargetForm::NAMES))]
    form: Option<TargetForm>,
    /// Highest spatial degree of color that is kept, 0 to 3 [default: all].
    #[arg(long, value_name = "D", value_parser = clap::value_parser!(u32).range(0..=3))]
    sh_degree: Option<u32>,
    /// Highest time degree of color that is kept, 0 to 2 [default: all].
    #[arg(long, value_name = "D", value_parser = clap::value_parser!(u32).range(0..=2))]
    sh_degree_t: Option<u32>,
    /// Merge Gaussians of consecutive frames of a sequence that differ by at most this part of their scales, opacities
    /// and colors; 0 merges equal ones [default: none are merged].
    #[arg(long, value_name = "TOLERANCE", value_parser = values::step)]
    merge: Option<f32>,
    #[command(flatten)]
    checkpoint: CheckpointArgs,
}

impl Convert {
    /// Converts the scene and writes it.
    ///
    /// # Errors
    /// The scene cannot be read or converted, or the package cannot be written.
    pub(crate) fn run(&self) -> Result<Report, Failure> {
        self.given.require(Need::ColorInTime, self.sh_degree.is_none_or(|degree| degree >= 3))?;
        let out = self.package.checked_out(Files::default().reads_scene(&self.input))?;
        let before = file_size(&self.input)?;
        let (form, sh_degree, sh_degree_t, merge) = (self.form, self.sh_degree, self.sh_degree_t, self.merge);
        let settings = ConvertSettings { form, sh_degree, sh_degree_t, merge };
        let scene = convert(self.checkpoint.load_to_change(&self.input)?, &settings);
        let scene = scene.map_err(|error| Failure::at(&self.input, &error))?;
        let after = self.package.save(&scene)?;
        let per_gaussian = after as f64 / scene.len().max(1) as f64;
        let mut text = lines(&switches(&scene.trained_with, &scene.playback));
        text += &format!(
            "\n{} ({}) -> {} ({}): {} Gaussians in the {} form, {per_gaussian:.1} bytes each\n",
            self.input.display(),
            bytes(before),
            out.display(),
            bytes(after),
            scene.len(),
            form_name(&scene.form),
        );
        let json = json!({
            "in": self.input.display().to_string(),
            "out": out.display().to_string(),
            "bytes_in": before,
            "bytes_out": after,
            "gaussians": scene.len(),
            "bytes_per_gaussian": per_gaussian,
            "form": form_name(&scene.form),
            "switches": switches_json(&scene.trained_with, &scene.playback),
        });
        Ok(Report::new(json, text))
    }
}
