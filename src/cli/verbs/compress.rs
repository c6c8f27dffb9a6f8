//! `gs4d compress IN OUT`: quantizes geometry and codes colors by codebook.
//!
//! In: a scene, a quality or single options. Out: a package in the packed form, bytes by section, PSNR of its pictures
//! to those of the original scene, and warnings if it does not keep what the quality promises.

use crate::cli::args::{CheckpointArgs, EngineArgs, Given, Need, OrderArgs, PackageArgs, ViewArgs, file_size, values};
use crate::cli::output::failure::Failure;
use crate::cli::output::note::note;
use crate::cli::output::progress::Bars;
use crate::cli::output::report::Report;
use crate::cli::output::table::{Table, bytes};
use crate::codec::package;
use crate::offline::compress::{
    CompressSettings, PackedOrder, Quality, broken_promises, compress_with, reorder, require_unpacked,
};
use crate::offline::forms::convert::merge;
use crate::offline::measure::SquaredError;
use crate::offline::measure::reference_pictures::ReferencePictures;
use crate::offline::score::read_weights;
use crate::offline::store::outputs::Files;
use crate::offline::work::Progress;
use crate::scene::{Bits, Form, GaussianScene, RuntimeScene, SceneForm};
use serde_json::json;
use std::collections::BTreeMap;
use std::fs::File;
use std::path::PathBuf;

/// Compress a capture: quantize its geometry, code its color, keep its temporal filter.
///
/// OUT draws through the same passes; the GPU reads it as it is. Prune and mask first: a packed capture can no longer
/// be scored. Of a capture that is packed already only the order can change, with --progressive or --chunk alone: its
/// positions and velocities are rounded once more, and nothing else.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  gs4d compress masked.gs4d capture.gs4d
  gs4d compress chkpnt30000.pth small.gs4d --quality small --cameras transforms_test.json
  gs4d compress chkpnt30000.pth exact.gs4d --quality visually-lossless
  gs4d compress chkpnt30000.pth page.gs4d --progressive
  gs4d compress capture.gs4d page.gs4d --progressive    # of a packed capture, only the order changes
  gs4d compress long.gs4d packed.gs4d --chunk 1, then gs4d split packed.gs4d -o chunks
  gs4d compress chkpnt30000.pth own.gs4d --codebooks 4096,4096 --scale-bits 10 --escape 0.05

No choice is made on pictures, and no training views are needed: --cameras takes those of a dataset for the comparison with the original.
A warning is printed if the package is farther from the original than its quality promises.
gs4d bake and gs4d finetune --compress train codebooks on the training views, and lose less.")]
pub(crate) struct Compress {
    #[command(flatten)]
    given: Given,
    /// The checkpoint or package to read.
    #[arg(value_name = "IN")]
    input: PathBuf,
    #[command(flatten)]
    package: PackageArgs,
    /// How much may be lost: small, balanced, visually-lossless or lossless.
    #[arg(long, value_name = "QUALITY", default_value = "balanced", value_parser = values::one_of(&Quality::NAMES))]
    quality: Quality,
    #[command(flatten)]
    order: OrderArgs,
    #[command(flatten)]
    knobs: Knobs,
    /// First merge Gaussians of consecutive frames of a sequence that differ by at most this part of their scales,
    /// opacities and colors; 0 merges equal ones [default: none are merged].
    #[arg(long, value_name = "TOLERANCE", value_parser = values::step)]
    merge: Option<f32>,
    /// Weight of the color of each Gaussian in codebooks: scores by `gs4d score`, little-endian float32 in the order of
    /// IN [default: by opacity].
    #[arg(long, value_name = "FILE")]
    weights: Option<PathBuf>,
    /// Number of views to compare with the original, of --cameras or of an orbit; 0 for none.
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = values::count_or_none(100_000))]
    verify: usize,
    #[command(flatten)]
    views: ViewArgs,
    #[command(flatten)]
    engine: EngineArgs,
    #[command(flatten)]
    checkpoint: CheckpointArgs,
}

/// Single settings, which replace those of the quality.
#[derive(clap::Args)]
#[command(next_help_heading = "Single settings (default: those of --quality)")]
struct Knobs {
    /// Number of entries of each color codebook, up to four codebooks: each codes the residuals of those before it.
    #[arg(long, value_name = "N,..", value_delimiter = ',')]
    codebooks: Option<Vec<usize>>,
    /// Bits of the mean, per axis, within a block of 256 Gaussians (1 to 16).
    #[arg(long, value_name = "BITS", value_parser = clap::value_parser!(u32).range(1..=16))]
    mean_bits: Option<u32>,
    /// Bits of the temporal mean (1 to 16).
    #[arg(long, value_name = "BITS", value_parser = clap::value_parser!(u32).range(1..=16))]
    mean_t_bits: Option<u32>,
    /// Bits of the velocity, per axis (2 to 16).
    #[arg(long, value_name = "BITS", value_parser = clap::value_parser!(u32).range(2..=16))]
    velocity_bits: Option<u32>,
    /// Bits of the temporal deviation (1 to 15).
    #[arg(long, value_name = "BITS", value_parser = clap::value_parser!(u32).range(1..=15))]
    sigma_t_bits: Option<u32>,
    /// Bits of the scale, per axis (1 to 16).
    #[arg(long, value_name = "BITS", value_parser = clap::value_parser!(u32).range(1..=16))]
    scale_bits: Option<u32>,
    /// Bits of each of the rotation's three components (1 to 16).
    #[arg(long, value_name = "BITS", value_parser = clap::value_parser!(u32).range(1..=16))]
    rotation_bits: Option<u32>,
    /// Bits of the opacity (1 to 16).
    #[arg(long, value_name = "BITS", value_parser = clap::value_parser!(u32).range(1..=16))]
    opacity_bits: Option<u32>,
    /// Bits of the base color, per channel, where colors are coded (1 to 10).
    #[arg(long, value_name = "BITS", value_parser = clap::value_parser!(u32).range(1..=10))]
    base_bits: Option<u32>,
    /// Without codebooks: round every coefficient to a multiple of this; 0 keeps them as they are.
    #[arg(long, value_name = "STEP", value_parser = values::step)]
    color_step: Option<f32>,
    /// Share of the Gaussians, those with the largest splats, that keep 16 bits for mean, scale and rotation.
    #[arg(long, value_name = "SHARE", value_parser = values::share)]
    escape: Option<f64>,
}

impl Knobs {
    fn settings(&self, quality: Quality) -> CompressSettings {
        let settings = CompressSettings::from(quality);
        let geometry = settings.geometry.map(|bits| Bits {
            mean: self.mean_bits.unwrap_or(bits.mean),
            mean_t: self.mean_t_bits.unwrap_or(bits.mean_t),
            velocity: self.velocity_bits.unwrap_or(bits.velocity),
            sigma_t: self.sigma_t_bits.unwrap_or(bits.sigma_t),
            scale: self.scale_bits.unwrap_or(bits.scale),
            rotation: self.rotation_bits.unwrap_or(bits.rotation),
            opacity: self.opacity_bits.unwrap_or(bits.opacity),
            base: self.base_bits.unwrap_or(bits.base),
            escape: self.escape.map_or(bits.escape, |share| share as f32),
        });
        CompressSettings {
            geometry,
            codebooks: self.codebooks.clone().unwrap_or(settings.codebooks),
            color_step: self.color_step.unwrap_or(settings.color_step),
            order: PackedOrder::Spatial,
            weights: None,
        }
    }
}

impl Compress {
    /// Compresses and writes.
    ///
    /// # Errors
    /// The scene cannot be read or is packed already, the package cannot be written, a failure of the engine.
    pub(crate) fn run(&self) -> Result<Report, Failure> {
        self.check_options()?;
        let progress = &mut Bars::default();
        let files = Files::default().reads_scene(&self.input).reads(&self.weights);
        let out = self.package.checked_file(self.views.add_to(files))?;
        let before = file_size(&self.input)?;
        let mut scene = self.checkpoint.load_to_change(&self.input)?;
        if let Some(tolerance) = self.merge {
            merge(&mut scene, tolerance).map_err(|error| Failure::at(&self.input, &error))?;
        }
        let is_reordered = self.is_reordered(&scene);
        if !is_reordered {
            require_unpacked(&scene.form).map_err(|error| Failure::at(&self.input, &error))?;
        }
        let scene = scene.into_runtime().map_err(|error| Failure::at(&self.input, &error))?;
        let weights = self.weights.as_ref().map(|path| read_weights(path, scene.len())).transpose()?;
        let originals = self.originals(&scene, progress)?;
        let settings = CompressSettings { weights, order: self.order.order(), ..self.knobs.settings(self.quality) };
        let compressed = if is_reordered {
            reorder(scene, &settings.order)
        } else {
            progress.begin("codebooks", settings.codebooks.len());
            let compressed = compress_with(scene, &settings, || progress.advance());
            progress.finish();
            compressed
        };
        let (scene, report) = compressed.map_err(|error| Failure::at(&self.input, &error))?;
        let after = self.package.save(&scene)?;
        let file = File::open(out).map_err(|error| Failure::at(out, &error))?;
        let info = package::inspect(file).map_err(|error| Failure::at(out, &error))?;
        let mut sections = BTreeMap::<&str, u64>::new();
        for section in &info.header.sections {
            *sections.entry(&section.name).or_default() += section.length as u64;
        }
        let scene = scene.into_runtime().map_err(|error| Failure::at(out, &error))?;
        let errors = match &originals {
            Some(originals) => originals.errors(&mut self.engine.open(&self.given)?, &scene, progress)?,
            None => Vec::new(),
        };

        let mut table = Table::new(&["section", "bytes", "per Gaussian"]);
        let each = |size: u64| size as f64 / report.gaussians.max(1) as f64;
        for (name, size) in &sections {
            table.row([(*name).to_owned(), size.to_string(), format!("{:.2}", each(*size))]);
        }
        table.row(["whole package".to_owned(), after.to_string(), format!("{:.2}", each(after))]);
        let mut text = format!(
            "{} ({}) -> {} ({}): {} Gaussians\n{table}in memory {} -> {}\n",
            self.input.display(),
            bytes(before),
            out.display(),
            bytes(after),
            report.gaussians,
            bytes(report.memory_before as u64),
            bytes(report.memory_after as u64),
        );
        if report.fillers > 0 {
            let reason = match settings.order {
                PackedOrder::Chunks(_) => "they fill the blocks of chunks",
                _ => "they fill blocks, since some Gaussians are far from the others",
            };
            text += &format!("{} invisible Gaussians were added: {reason}\n", report.fillers);
        }
        let psnr: Vec<f64> = errors.iter().map(SquaredError::psnr).collect();
        let all: SquaredError = errors.into_iter().collect();
        let warnings = match is_reordered {
            true => Vec::new(),
            false => self.warnings(&scene, (!psnr.is_empty()).then(|| all.psnr())),
        };
        if let Some(lowest) = psnr.iter().copied().reduce(f64::min) {
            let (views, pooled) = (psnr.len(), all.psnr());
            text += &match all.is_identical() {
                true => format!("{views} views are identical to the original\n"),
                false => {
                    format!("PSNR to the original over {views} views: {pooled:.2} dB, lowest {lowest:.2} dB\n")
                }
            };
        }
        let json = json!({
            "in": self.input.display().to_string(),
            "out": out.display().to_string(),
            "bytes_in": before,
            "bytes_out": after,
            "gaussians": report.gaussians,
            "bytes_per_gaussian": each(after),
            "sections": sections,
            "settings": if is_reordered { json!({ "order": settings.order }) } else { json!(settings) },
            "report": report,
            "psnr_to_original": psnr,
            "warnings": warnings,
        });
        Ok(Report::new(json, text))
    }

    /// Returns whether only the order of a packed scene changes: an order is given, and nothing that would change its values.
    fn is_reordered(&self, scene: &GaussianScene) -> bool {
        let settings = CompressSettings { order: self.order.order(), ..self.knobs.settings(self.quality) };
        let plain = CompressSettings { order: settings.order.clone(), ..CompressSettings::from(Quality::default()) };
        let is_alone = settings == plain && self.merge.is_none() && self.weights.is_none();
        let is_packed = matches!(scene.form, SceneForm::Ready(Form::Packed(_)));
        is_packed && is_alone && settings.order != PackedOrder::Spatial
    }

    /// Prints and returns the promises of the quality that the compressed scene does not keep; none if single options
    /// replace settings of the quality. `psnr` is that of all pictures to those of the original, dB.
    fn warnings(&self, scene: &RuntimeScene, psnr: Option<f64>) -> Vec<String> {
        let settings = self.knobs.settings(self.quality);
        let is_of_quality = settings == CompressSettings::from(self.quality);
        let warnings = match &scene.form {
            Form::Packed(packed) if is_of_quality => broken_promises(self.quality, packed, psnr),
            Form::Packed(_) | Form::Sliced(_) => Vec::new(),
        };
        warnings.iter().for_each(|warning| note(&format!("warning: {warning}")));
        warnings
    }

    /// Checks that every option has an effect.
    fn check_options(&self) -> Result<(), Failure> {
        self.engine.check(&self.given)?;
        self.given.require(Need::VerifiedViews, self.verify > 0)?;
        let settings = self.knobs.settings(self.quality);
        let is_coded = !settings.codebooks.is_empty();
        self.given.require(Need::Quantized, settings.geometry.is_some())?;
        self.given.require(Need::Layers, settings.geometry.is_some())?;
        self.given.require(Need::WholeColors, !is_coded)?;
        self.given.require(Need::Codebooks, is_coded)
    }

    /// Draws the views to compare with, of the original scene; `None` if there are none.
    fn originals(&self, scene: &RuntimeScene, progress: &mut Bars) -> Result<Option<ReferencePictures>, Failure> {
        if self.verify == 0 || scene.is_empty() {
            return Ok(None);
        }
        let shots = self.views.shots(scene, self.verify)?;
        let step = shots.len().div_ceil(self.verify).max(1);
        let views = shots.iter().step_by(step).map(|shot| shot.view(scene)).collect();
        let engine = &mut self.engine.open(&self.given)?;
        let background = scene.trained_background();
        Ok(Some(ReferencePictures::of_scene(engine, scene, views, background, progress)?))
    }
}
