//! `gs4d finetune SCENE --data DIR -o OUT`: trains a scene, to recover the quality that was lost by pruning.
//!
//! In: a scene in the trained form, training views with their images. Out: a package in the trained form, or in the
//! packed form with `--compress`, and its quality before, during and after training.

use crate::cli::args::{
    CheckpointArgs, Given, Need, OrderArgs, PackageArgs, RendererArgs, SplitArgs, TrainingArgs, ValidationArgs, values,
};
use crate::cli::output::curve::curve_table;
use crate::cli::output::exposures::exposure_row;
use crate::cli::output::failure::Failure;
use crate::cli::output::interrupt;
use crate::cli::output::progress::Bars;
use crate::cli::output::report::Report;
use crate::cli::output::table::{bytes, lines};
use crate::gaussian::{GradientMode, Model};
use crate::offline::compress::{CompressSettings, Quality};
use crate::offline::dataset::gaps::have_gaps;
use crate::offline::dataset::{Validation, trained_pixel};
use crate::offline::engine::AdapterDescription;
use crate::offline::filter::temporal_filter::needs_views;
use crate::offline::measure::belonging::require_belonging_on_gpu;
use crate::offline::store::outputs::Files;
use crate::offline::store::results::{Key, Store};
use crate::offline::train::{
    FineTuneSettings, FineTuned, ImageRoom, Rates, Resume, Terms, TrainError, TrainingImages, fine_tune,
};
use crate::scene::GaussianScene;
use serde_json::json;
use std::path::PathBuf;

/// Train a scene on its views, to recover the quality that was lost by pruning.
///
/// The number of Gaussians does not change. The result has the parameters of the step with the best PSNR on the
/// validation views; with --validation none, those of the last step. A killed run resumes from OUT.tune/ and writes the
/// same bytes as an uninterrupted one. Ctrl-C ends the run and writes the best parameters so far, without compression;
/// a second Ctrl-C ends it immediately.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  gs4d prune chkpnt30000.pth --data data/toybox --ratio 0.8 -o pruned.gs4d
  gs4d finetune pruned.gs4d --data data/toybox -o tuned.gs4d
  gs4d finetune pruned.gs4d --data data/standup --resolution 2 --steps 10000 --batch 4 -o tuned.gs4d

A temporal filter of the scene (gs4d mask) is used in training: Gaussians that it leaves out at a time are not drawn at that time. The filter
is computed again every --refresh-filter steps. A support filter changes no picture; it is computed again after training.")]
pub(crate) struct FineTune {
    #[command(flatten)]
    given: Given,
    /// The checkpoint, or a package in the trained form.
    #[arg(value_name = "SCENE")]
    input: PathBuf,
    #[command(flatten)]
    package: PackageArgs,
    #[command(flatten)]
    data: SplitArgs,
    #[command(flatten)]
    validation: ValidationArgs,
    /// Number of training steps.
    #[arg(long, value_name = "N", default_value = "5000", value_parser = values::count(100_000_000))]
    steps: usize,
    /// Learning rates: ours, or original, which are those at the end of the original's training.
    #[arg(long, value_name = "RATES", default_value = "ours", value_parser = values::one_of(&RATES))]
    rates: Rates,
    /// Factor on the rates at the last step. The factor falls from 1; 1 keeps the rates constant.
    #[arg(long, value_name = "FACTOR", default_value = "0.2", value_parser = values::share)]
    last_rate: f64,
    /// Factor on the rates of the means.
    #[arg(long, value_name = "FACTOR", default_value = "1", value_parser = values::not_negative)]
    mean_rate: f64,
    /// Weight of SSIM in the loss, 0 to 1; the rest is L1.
    #[arg(long, value_name = "WEIGHT", default_value = "0.1", value_parser = values::share)]
    similarity: f64,
    /// Weight, in the loss, of the mean opacity. Unneeded Gaussians fade, so that more can be pruned.
    #[arg(long, help_heading = "Experimental", value_name = "WEIGHT", default_value = "0", value_parser = values::not_negative)]
    opacity_weight: f64,
    #[command(flatten)]
    training: TrainingArgs,
    /// Steps between two evaluations on the validation views.
    #[arg(long, value_name = "N", default_value = "500", value_parser = values::count(1_000_000))]
    evaluate_every: usize,
    /// Steps between two computations of a key-frame or interval filter.
    #[arg(long, value_name = "N", default_value = "1000", value_parser = values::count(100_000_000))]
    refresh_filter: usize,
    /// A state is saved at evaluations whose step is a multiple of N, and at the first one a minute after the last
    /// state.
    #[arg(long, value_name = "N", default_value = "500", value_parser = values::count(1_000_000))]
    save_every: usize,
    /// Gradients: exact, or compat, which are those of the original with its deviations.
    #[arg(long, value_name = "MODE", default_value = "exact", value_parser = values::one_of(&MODES))]
    gradients: GradientMode,
    /// Compress the result as `gs4d compress` does, with less loss: the codebooks of color are trained too, and their
    /// sizes follow the number of Gaussians. visually-lossless and lossless have no codebooks.
    #[arg(long, value_name = "QUALITY", value_parser = values::one_of(&Quality::NAMES))]
    compress: Option<Quality>,
    #[command(flatten)]
    order: OrderArgs,
    /// Train codebooks on pictures of the rounded geometry of the package. Useful only if geometry has fewer bits than
    /// with `small`.
    #[arg(long, help_heading = "Experimental", requires = "compress", conflicts_with_all = ["progressive", "chunk"])]
    round_geometry: bool,
    /// Steps that train codebooks, after the other steps.
    #[arg(long, value_name = "N", default_value = "2000", requires = "compress", value_parser = values::count(1_000_000))]
    compress_steps: usize,
    #[command(flatten)]
    renderer: RendererArgs,
    #[command(flatten)]
    checkpoint: CheckpointArgs,
}

const RATES: [(&str, Rates); 2] = [("ours", Rates::OURS), ("original", Rates::ORIGINAL)];
const MODES: [(&str, GradientMode); 2] = [("exact", GradientMode::Exact), ("compat", GradientMode::Compat)];

impl FineTune {
    /// Trains the scene and writes it.
    ///
    /// # Errors
    /// A scene or views that cannot be used, a package that cannot be written, a failure of the GPU.
    pub(crate) fn run(&self) -> Result<Report, Failure> {
        self.check_options()?;
        let out = self.package.checked_file(self.data.add_to(Files::default().reads_scene(&self.input)))?;
        let store = Store::beside(out, ".tune")?;
        let mut scene = self.checkpoint.load_to_change(&self.input)?;
        self.require_scene(&scene)?;
        if let Some(background) = self.checkpoint.background {
            scene.trained_with.background = background;
        }
        let (gaussians, progress) = (scene.len(), &mut Bars::default());
        let splits = self.data.divide(self.validation, &scene.trained_with, progress)?;
        self.given.require(Need::ValidationViews, !splits.validation.is_empty())?;
        if self.given.depends_on(Need::Gaps) {
            self.given.require(Need::Gaps, have_gaps(&splits.train, progress)?)?;
        }
        scene.trained_with.validation = Some(splits.to_string());
        let views = splits.all_training(&scene.trained_with, progress)?;
        scene.trained_with.pixel = trained_pixel(&scene, &views).or(scene.trained_with.pixel);
        let mut headless = self.renderer.open()?;
        TrainingImages::require_room(&splits.train, &splits.validation, &headless)?;
        if !self.validation.trust_images {
            let runtime = scene.clone().into_runtime()?;
            require_belonging_on_gpu(&mut headless, &runtime, &views, runtime.trained_background())?;
        }
        let images = TrainingImages::load(
            splits.train.clone(),
            &splits.validation,
            &scene.trained_with,
            ImageRoom::of_system(),
            progress,
        )?;
        let key = Key::of_scene(&self.input)?
            .with(Key::of_images(&splits.train, progress)?)
            .with(Key::of_images(&splits.validation, progress)?)
            .with(Key::of_views(&splits.train))
            .with(Key::of_views(&splits.validation))
            .and(&format!("{:?}", scene.trained_with))
            .and(env!("CARGO_PKG_VERSION"));
        let resume = Resume { store: &store, key, every: self.save_every };
        let deferred = interrupt::defer();
        let tuned = fine_tune(&mut headless, scene, &images, &self.settings(), Some(resume), progress);
        let (tuned, interrupted) = match tuned {
            Err(TrainError::Interrupted { tuned: Some(tuned) }) => (*tuned, true),
            tuned => (tuned?, false),
        };
        let size = self.package.save(&tuned.scene)?;
        drop(deferred);
        if !interrupted {
            store.remove()?;
        }
        let FineTuned { curve, best, steps_per_second, validation, faults, exposures, .. } = &tuned;
        // The last point of a compressed result is measured on the package.
        let compressed = self.compress.and_then(|_| curve.last()).filter(|_| !interrupted);
        let written = compressed.unwrap_or(best);
        let before = curve.first().and_then(|point| point.psnr);
        let quality = match (before, best.psnr) {
            (Some(before), Some(trained)) => {
                let package = compressed.and_then(|point| point.psnr);
                let package = package.map_or(String::new(), |psnr| format!("{psnr:.3} dB compressed, "));
                let step = best.step;
                format!(
                    "{package}{trained:.3} dB at step {step}, {before:.3} dB before ({validation} validation views)"
                )
            }
            _ => "not measured, no validation views".to_owned(),
        };
        let form = if compressed.is_some() { ", compressed" } else { "" };
        let speed = steps_per_second.map_or(String::new(), |speed| format!(", {speed:.1} steps per second"));
        let mut pairs = vec![
            ("fine-tuned", format!("{gaussians} Gaussians on {} views{speed}", images.len())),
            ("views", splits.to_string()),
            ("PSNR", quality),
            ("wrote", format!("{}, {}{form}", out.display(), bytes(size))),
        ];
        pairs.extend(exposure_row(&tuned));
        if interrupted {
            let form = if self.compress.is_some() { ", not compressed" } else { "" };
            pairs.push(("interrupted", format!("wrote the best parameters so far{form}; the same command resumes")));
        }
        if let Some(faults) = faults {
            pairs.push(("left out", format!("{} gradients that are not finite", faults.count)));
        }
        let json = json!({
            "in": self.input.display().to_string(),
            "out": out.display().to_string(),
            "bytes_out": size,
            "gaussians": gaussians,
            "views": images.len(),
            "validation": validation,
            "split": splits.to_string(),
            "psnr_before": before,
            "best": best,
            "psnr": written.psnr,
            "compressed": compressed.is_some(),
            "curve": curve,
            "exposures": exposures,
            "steps_per_second": steps_per_second,
            "interrupted": interrupted,
            "gradients_left_out": faults.map_or(0, |faults| faults.count),
            "adapter": AdapterDescription::of(&headless),
        });
        let mut report = Report::new(json, format!("{}\n{}", lines(&pairs), curve_table(curve, compressed.is_some())));
        report.interrupted = interrupted;
        Ok(report)
    }

    /// Checks that every option has an effect.
    fn check_options(&self) -> Result<(), Failure> {
        self.given.require(Need::ValidationViews, self.validation.validation != Validation::None)?;
        let is_coded = |quality: Quality| !CompressSettings::from(quality).codebooks.is_empty();
        self.given.require(Need::Compressed, self.compress.is_some())?;
        self.given.require(Need::Layers, self.compress != Some(Quality::Lossless))?;
        self.given.require(Need::TrainedCodebooks, self.compress.is_none_or(is_coded))
    }

    /// Checks that every option has an effect on this scene.
    fn require_scene(&self, scene: &GaussianScene) -> Result<(), Failure> {
        let is_refreshed = scene.filter.as_ref().is_some_and(|filter| needs_views(filter.kind));
        self.given.require(Need::SeenFilter, is_refreshed)?;
        self.given.require(Need::OpenBackground, scene.environment.is_none())?;
        self.given.require(Need::Motion, scene.model().is_none_or(|model| model == Model::Rotated4d))
    }

    fn settings(&self) -> FineTuneSettings {
        let shared = self.training.settings();
        FineTuneSettings {
            steps: self.steps,
            rates: Rates { mean: self.rates.mean * self.mean_rate, ..self.rates },
            last_rate: self.last_rate,
            similarity_share: self.similarity,
            terms: Terms { opacity: self.opacity_weight, ..shared.terms },
            evaluate_every: self.evaluate_every,
            refresh_filter: self.refresh_filter,
            mode: self.gradients,
            rounding: self.round_geometry,
            order: self.order.order(),
            compress: self.compress.map(|quality| (quality, self.compress_steps)),
            ..shared
        }
    }
}
