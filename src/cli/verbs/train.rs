//! `gs4d train --data DIR -o OUT`: trains a capture from nothing but the pictures of a dataset.
//!
//! In: training views with their images. Out: a package in the trained form, rewritten while training goes on, and its
//! quality at each evaluation.

use crate::cli::args::{Given, Need, PackageArgs, RendererArgs, SplitArgs, TrainingArgs, values};
use crate::cli::output::curve::curve_table;
use crate::cli::output::exposures::exposure_row;
use crate::cli::output::failure::Failure;
use crate::cli::output::interrupt;
use crate::cli::output::progress::Bars;
use crate::cli::output::report::Report;
use crate::cli::output::table::{bytes, lines};
use crate::offline::dataset::gaps::have_gaps;
use crate::offline::dataset::{Splits, Validation};
use crate::offline::engine::AdapterDescription;
use crate::offline::footage::{is_raw, prepared};
use crate::offline::measure::belonging::require_belonging_on_gpu;
use crate::offline::store::outputs::Files;
use crate::offline::store::results::Store;
use crate::offline::train::{
    Births, CaptureSettings, Cloning, Coarse, FineTuneSettings, FineTuned, Floaters, Growth, Rates, Start,
    StartSettings, Terms, TrainSettings, TrainedCapture, Training, Usual,
};
use serde_json::json;
use std::path::PathBuf;

/// Train a capture from nothing but the pictures of a dataset.
///
/// The number of Gaussians is fixed: those that fade move to others (with --densify original it grows up to
/// --gaussians). OUT has the parameters with the best PSNR on the validation views so far (with --validation none the
/// latest) and is rewritten as training goes on: a player that reloads changed files shows it. A killed run resumes
/// from OUT.train/ and writes the same bytes as an uninterrupted one. Ctrl-C ends the run and writes the best
/// parameters so far; a second Ctrl-C ends it immediately.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  gs4d train --data data/hook --resolution 2 -o hook.gs4d
  gs4d train --data data/hook --resolution 2 --gaussians 30000 --steps 10000 -o small.gs4d
  gs4d train --data data/hook --resolution 2 --densify original --gaussians 200000 -o original.gs4d
  gs4d train --data data/cameras --exposure -o even.gs4d     # cameras of different exposure or white balance
  gs4d train --data data/n3v --resolution 2 -o n3v.gs4d      # poses_bounds.npy with a video of each camera

The result is as large as a checkpoint: gs4d bake prunes and compresses it.")]
pub(crate) struct Train {
    #[command(flatten)]
    given: Given,
    #[command(flatten)]
    package: PackageArgs,
    #[command(flatten)]
    data: SplitArgs,
    /// Validation views, on which the best step is chosen and nothing is trained: those of the dataset's own split
    /// `val` (file), whole cameras, blocks of time (times), or none; auto takes the first of these that the data
    /// allows.
    #[arg(long, help_heading = "Validation", value_name = "VIEWS", default_value = "auto", value_parser = values::one_of(&Validation::NAMES))]
    validation: Validation,
    /// Skip the check, after 1000 steps or more, that the capture shows the images, which fails if the poses are those
    /// of other images.
    #[arg(long, help_heading = "Validation")]
    trust_images: bool,
    /// First and last time of the capture, as the dataset counts times [default: 0,1 if no view is outside, else from
    /// the first view to the last].
    #[arg(long, value_name = "T0,T1", value_parser = values::interval, allow_hyphen_values = true)]
    time_interval: Option<[f64; 2]>,
    /// Seconds of one pass through the time interval at speed 1, 0 for a still [default: that of the dataset, else the
    /// interval's length].
    #[arg(long, value_name = "SECONDS", value_parser = values::seconds)]
    duration: Option<f32>,
    /// Background color, 0 to 1 in the space of the pictures.
    #[arg(long, value_name = "R,G,B", default_value = "0,0,0", value_parser = values::color, allow_hyphen_values = true)]
    background: [f32; 3],
    /// Number of Gaussians; with --densify original the most that there are at any step [default: 60000; for cameras
    /// that stand still and see the same moments one for 32 pixels of a moment, for other opaque pictures one for 32
    /// pixels of one picture of each moment, up to 400000].
    #[arg(long, value_name = "N", value_parser = values::count(100_000_000))]
    gaussians: Option<usize>,
    /// Where Gaussians are placed at the beginning: hull, inside the silhouettes of the images; points, at those of the
    /// dataset (`points3D` of COLMAP, `ply_file_path` of `transforms.json`, `points3d.ply` beside
    /// `transforms_train.json`); random, in the box that the cameras look at; or auto: the first of these that the
    /// dataset allows.
    #[arg(long, value_name = "WHERE", default_value = "auto", value_parser = values::one_of(&Start::NAMES))]
    start: Start,
    /// Begin with the points of FILE: PLY, `points3D.bin` or `points3D.txt`, in the space of the cameras.
    #[arg(long, value_name = "FILE")]
    points: Option<PathBuf>,
    /// Temporal scale of Gaussians at the beginning, as a share of the time interval [default: 0.1, at least the step
    /// between two moments of the images; the original's is 0.447 of an interval of 1].
    #[arg(long, value_name = "SHARE", value_parser = time_scale)]
    time_scale: Option<f64>,
    /// Spatial degree of color, 0 to 3.
    #[arg(long, value_name = "DEGREE", default_value = "3", value_parser = clap::value_parser!(u32).range(0..=3))]
    sh_degree: u32,
    /// Degree of color in time, 0 to 2 [default: 2 if the spatial degree is 3].
    #[arg(long, value_name = "DEGREE", value_parser = clap::value_parser!(u32).range(0..=2))]
    sh_degree_t: Option<u32>,
    /// Rows of the environment map that is trained behind the Gaussians, on a sphere with a radius of 60 units; 0: none
    /// [default: 32 if no image has transparent pixels or a mask, and their borders show more than the background
    /// color, else 0].
    #[arg(long, value_name = "ROWS", value_parser = clap::value_parser!(u32).range(0..=4096))]
    environment: Option<u32>,
    /// Number of training steps [default: 10000 for cameras that stand still and see the same moments, else 20000].
    #[arg(long, value_name = "N", value_parser = values::count(100_000_000))]
    steps: Option<usize>,
    /// Factor on all rates at the last step. The factor falls from 1; 1 keeps the rates constant.
    #[arg(long, value_name = "FACTOR", default_value = "0.2", value_parser = values::share)]
    last_rate: f64,
    /// Further factor on the rate of the means at the last step, to which it falls exponentially from 1.
    #[arg(long, value_name = "FACTOR", default_value = "0.01", value_parser = values::share)]
    last_mean_rate: f64,
    /// Factor on the rates of the means, relative to those of `finetune`.
    #[arg(long, value_name = "FACTOR", default_value = "4", value_parser = values::not_negative)]
    mean_rate: f64,
    /// Weight of SSIM in the loss, 0 to 1; the rest is L1.
    #[arg(long, value_name = "WEIGHT", default_value = "0.2", value_parser = values::share)]
    similarity: f64,
    /// Weight, in the loss, of the mean opacity: unneeded Gaussians fade, and move elsewhere [default: 0.01, with
    /// --densify original 0].
    #[arg(long, value_name = "WEIGHT", value_parser = values::not_negative)]
    opacity_weight: Option<f64>,
    /// Weight, in the loss, of the mean spatial scale [default: 0.01, with --densify original 0].
    #[arg(long, value_name = "WEIGHT", value_parser = values::not_negative)]
    scale_weight: Option<f64>,
    /// How Gaussians are added where they are missing: relocate moves those that have faded, with noise and dropout;
    /// original, for comparison, begins with a quarter of --gaussians and, in the first half of the steps, does as the
    /// original 4DGS: it clones or splits those with large gradients on the screen, up to --gaussians, removes faint
    /// and large ones, and resets opacities.
    #[arg(long, value_name = "HOW", default_value = "relocate", value_parser = values::one_of(&DENSIFY))]
    densify: Densify,
    /// Most Gaussians that begin anew, three for each, where several cameras of one moment see the same error, such as a
    /// small thing that moves fast; 0: none.
    #[arg(long, help_heading = "Experimental", value_name = "N", default_value = "0", value_parser = values::count_or_none(100_000))]
    births: usize,
    /// Remove Gaussians close before cameras that few others see.
    #[arg(long, help_heading = "Experimental", value_name = "SWITCH", default_value = "off", action = clap::ArgAction::Set, value_parser = values::switch())]
    floaters: bool,
    /// Keep Gaussians that begin at points without a time, beside points with one, as points of what stands still: without
    /// motion and change. A package of them is smaller, and shows less of other views.
    #[arg(long, help_heading = "Experimental", value_name = "SWITCH", default_value = "off", action = clap::ArgAction::Set, value_parser = values::switch())]
    standing: bool,
    /// Begin with the velocities of points that have some.
    #[arg(long, help_heading = "Experimental", value_name = "SWITCH", default_value = "off", action = clap::ArgAction::Set, value_parser = values::switch())]
    start_velocity: bool,
    /// Temporal scale of Gaussians at points without a time, beside points with one, at the beginning, as a share of the
    /// time interval [default: that of --time-scale].
    #[arg(long, help_heading = "Experimental", value_name = "SHARE", value_parser = time_scale)]
    untimed_scale: Option<f64>,
    /// Share of the Gaussians that begin at points with a time, beside points without, at most four at each.
    #[arg(long, help_heading = "Experimental", value_name = "SHARE", default_value_t = StartSettings::default().timed_share, value_parser = values::share)]
    timed_share: f64,
    /// Train on a quarter of the size of each side at first, then on half, where the longer side of pictures has more
    /// than 1000 pixels.
    #[arg(long, help_heading = "Experimental", value_name = "SWITCH", default_value = "off", action = clap::ArgAction::Set, value_parser = values::switch())]
    coarse: bool,
    /// Steps between two relocations of the Gaussians that have faded; 0: none is relocated.
    #[arg(long, value_name = "N", default_value = "100")]
    relocate_every: usize,
    /// Strength of the noise that moves faint Gaussians, as a factor on the rate of the means; 0: none.
    #[arg(long, value_name = "FACTOR", default_value = "2.5e5", value_parser = values::not_negative)]
    noise: f64,
    /// Share of the Gaussians, drawn anew for each step, that its views are drawn without, until relocation ends.
    #[arg(long, value_name = "SHARE", default_value = "0.1", value_parser = values::share)]
    dropout: f64,
    /// Least temporal scale of Gaussians, as a share of the time interval; 0: any.
    #[arg(long, help_heading = "Experimental", value_name = "SHARE", default_value = "0", value_parser = values::share)]
    least_time_scale: f64,
    /// Steps between two increases of a degree of color [default: 1000, at most a twentieth of all].
    #[arg(long, value_name = "N", value_parser = values::count(100_000_000))]
    raise_degree_every: Option<usize>,
    /// Steps between two evaluations on the validation views.
    #[arg(long, value_name = "N", default_value = "1000", value_parser = values::count(1_000_000))]
    evaluate_every: usize,
    /// A state is saved at evaluations whose step is a multiple of N, and at the first one a minute after the last
    /// state.
    #[arg(long, value_name = "N", default_value = "5000", value_parser = values::count(1_000_000))]
    save_every: usize,
    #[command(flatten)]
    training: TrainingArgs,
    #[command(flatten)]
    renderer: RendererArgs,
}

/// Number of steps from which on the capture is checked to show the images.
const CHECKED: usize = 1000;

/// How Gaussians are added where they are missing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Densify {
    Relocate,
    Original,
}

const DENSIFY: [(&str, Densify); 2] = [("relocate", Densify::Relocate), ("original", Densify::Original)];

/// Parses a temporal scale as a share of the interval.
fn time_scale(text: &str) -> Result<f64, String> {
    let share = text.trim().parse::<f64>().ok().filter(|share| (1e-3..=100.0).contains(share));
    share.ok_or_else(|| "expected a number from 0.001 to 100".to_owned())
}

impl Train {
    /// Trains a capture and writes it.
    ///
    /// # Errors
    /// Views that cannot be used, a package that cannot be written, a failure of the GPU.
    pub(crate) fn run(&self) -> Result<Report, Failure> {
        self.check_options()?;
        let out = self.package.checked_file(self.data.add_to(Files::default()).reads(&self.points))?;
        let store = Store::beside(out, ".train")?;
        let progress = &mut Bars::default();
        let data = match !self.data.is_static && is_raw(&self.data.data) {
            true => prepared(&self.data.data, out, progress)?,
            false => self.data.data.clone(),
        };
        let usual = Usual::read(&data, &self.data.options(self.validation), progress)?;
        let usual = Usual {
            gaussians: self.gaussians.unwrap_or(usual.gaussians),
            steps: self.steps.unwrap_or(usual.steps),
            ..usual
        };
        let settings = self.settings(data, &usual);
        let training = Training::open(&settings, progress)?;
        let Splits { train, validation, .. } = training.splits();
        self.given.require(Need::ValidationViews, !validation.is_empty())?;
        if self.given.depends_on(Need::Gaps) {
            self.given.require(Need::Gaps, have_gaps(train, progress)?)?;
        }
        let mut headless = self.renderer.open()?;
        let deferred = interrupt::defer();
        let trained = training.run(&mut headless, &store, Some(out), progress)?;
        let TrainedCapture { tuned, started, views, splits, compared, interrupted } = &trained;
        let (from, interrupted) = (started.name(), *interrupted);
        let size = self.package.save(&tuned.scene)?;
        drop(deferred);
        if !interrupted {
            store.remove()?;
        }
        let FineTuned { scene, curve, best, steps_per_second, validation, faults, exposures } = tuned;
        let steps = curve.last().map_or(0, |last| last.step);
        if steps >= CHECKED && !interrupted && !self.trust_images {
            let runtime = scene.clone().into_runtime()?;
            require_belonging_on_gpu(&mut headless, &runtime, compared, runtime.trained_background())?;
        }
        let quality = match best.psnr {
            Some(psnr) => format!("{psnr:.3} dB at step {} ({validation} validation views)", best.step),
            None => "not measured, no validation views".to_owned(),
        };
        let speed = steps_per_second.map_or(String::new(), |speed| format!(", {speed:.1} steps per second"));
        let gaussians = scene.len();
        let environment = scene.environment.as_ref().map(|map| [map.width, map.height]);
        let map = environment.map_or("none".to_owned(), |[width, height]| format!("{width} x {height}"));
        let mut pairs = vec![
            ("trained", format!("{gaussians} Gaussians on {views} views, begun from {from} points{speed}")),
            ("environment map", map),
            ("views", splits.clone()),
            ("PSNR", quality),
            ("wrote", format!("{}, {}", out.display(), bytes(size))),
        ];
        pairs.extend(exposure_row(tuned));
        if interrupted {
            pairs.push(("interrupted", "wrote the best parameters so far; the same command resumes".to_owned()));
        }
        if let Some(faults) = faults {
            pairs.push(("left out", format!("{} gradients that are not finite", faults.count)));
        }
        let json = json!({
            "out": out.display().to_string(),
            "bytes_out": size,
            "gaussians": gaussians,
            "start": from,
            "environment": environment,
            "views": views,
            "validation": validation,
            "split": splits,
            "time_interval": scene.trained_with.time_interval,
            "duration_seconds": scene.playback.duration_seconds,
            "best": best,
            "psnr": best.psnr,
            "curve": curve,
            "exposures": exposures,
            "steps_per_second": steps_per_second,
            "interrupted": interrupted,
            "gradients_left_out": faults.map_or(0, |faults| faults.count),
            "adapter": AdapterDescription::of(&headless),
        });
        let mut report = Report::new(json, format!("{}\n{}", lines(&pairs), curve_table(curve, false)));
        report.interrupted = interrupted;
        Ok(report)
    }

    /// Checks that every option has an effect.
    fn check_options(&self) -> Result<(), Failure> {
        let relocates = self.densify == Densify::Relocate;
        let needs = [
            (Need::ValidationViews, self.validation != Validation::None),
            (Need::Relocation, relocates),
            (Need::FixedNumber, relocates),
            (Need::StartAtPoints, !matches!(self.start, Start::Hull | Start::Random)),
            (Need::CheckedSteps, self.steps.is_none_or(|steps| steps >= CHECKED)),
            (Need::Degrees, self.sh_degree > 0),
            (Need::ColorInTime, self.sh_degree >= 3),
        ];
        needs.into_iter().try_for_each(|(need, is_met)| self.given.require(need, is_met))
    }

    fn start_settings(&self, usual: &Usual) -> StartSettings {
        StartSettings {
            gaussians: match self.densify {
                Densify::Relocate => usual.gaussians,
                Densify::Original => Cloning::first(usual.gaussians),
            },
            start: if self.points.is_some() { Start::Points } else { self.start },
            time_scale: self.time_scale,
            untimed_scale: self.untimed_scale,
            timed_share: self.timed_share,
            velocities: self.start_velocity,
            standing: self.standing,
            seed: self.training.seed,
            degree: self.sh_degree,
            degree_t: self.sh_degree_t.unwrap_or(2),
            environment: self.environment,
        }
    }

    fn settings(&self, data: PathBuf, usual: &Usual) -> TrainSettings {
        TrainSettings {
            data,
            splits: self.data.options(self.validation),
            capture: CaptureSettings {
                time_interval: self.time_interval,
                background: self.background,
                duration_seconds: self.duration,
                ..CaptureSettings::default()
            },
            start: self.start_settings(usual),
            points: self.points.clone(),
            tuning: self.tuning(usual),
            save_every: self.save_every,
        }
    }

    fn tuning(&self, usual: &Usual) -> FineTuneSettings {
        let shared = self.training.settings();
        let (growth, weight) = match self.densify {
            Densify::Relocate => {
                let relocate_every = (self.relocate_every > 0).then_some(self.relocate_every);
                let (noise, dropout) = (self.noise, self.dropout);
                (Growth { relocate_every, noise, dropout, ..Growth::over(usual.steps) }, 0.01)
            }
            Densify::Original => (Growth::original(usual.steps, usual.gaussians), 0.0),
        };
        let (opacity, scale) = (self.opacity_weight.unwrap_or(weight), self.scale_weight.unwrap_or(weight));
        FineTuneSettings {
            steps: usual.steps,
            rates: Rates { mean: Rates::OURS.mean * self.mean_rate, ..Rates::OURS },
            last_rate: self.last_rate,
            similarity_share: self.similarity,
            terms: Terms { opacity, scale, ..shared.terms },
            exposure: self.training.exposure.unwrap_or(usual.is_rig),
            patience: if self.training.patience.is_none() { usual.patience } else { shared.patience },
            standing: self.standing,
            coarse: self.coarse.then(Coarse::default),
            evaluate_every: self.evaluate_every,
            growth: Some(Growth {
                least_time_scale: self.least_time_scale,
                last_mean_rate: self.last_mean_rate,
                raise_every: self.raise_degree_every.unwrap_or(growth.raise_every),
                births: (self.births > 0).then(|| Births { most: self.births, ..Births::over(usual.steps) }),
                floaters: self.floaters.then(|| Floaters::over(usual.steps)),
                ..growth
            }),
            ..shared
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    #[derive(Parser)]
    struct Command {
        #[command(flatten)]
        train: Train,
    }

    #[test]
    fn without_options_the_settings_are_the_usual_ones() {
        let command = Command::try_parse_from(["train", "--data", "d", "-o", "o.gs4d"]).expect("both paths are given");
        let splits = command.train.data.options(Validation::Auto);
        for usual in
            [Usual::PLAIN, Usual { gaussians: 90_000, steps: 30_000, is_rig: true, patience: Some(7), ..Usual::PLAIN }]
        {
            let settings = command.train.settings("d".into(), &usual);
            assert_eq!(
                settings,
                TrainSettings::usual("d".into(), splits, &usual),
                "a bake trains with the same settings"
            );
        }
    }
}
