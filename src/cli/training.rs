//! The training data of a checkpoint, and scores from it: the options that several verbs share.
//!
//! In: `--data DIR`, sizes, which score and from how many views. Out: training views; [`Scores`]; score files.

use super::engine::Engine;
use super::failure::Failure;
use super::report::progress;
use super::values;
use crate::offline::dataset::selection::{even_share, hold_out, to_draw};
use crate::offline::dataset::{CameraOptions, Dataset, Split, TrainingView};
use crate::offline::score::variant::Variant;
use crate::offline::score::{ScoreSettings, Scores, Traits};
use crate::scene::{GaussianScene, RuntimeScene, TrainedWith};
use crate::view::Background;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use glam::UVec2;
use std::fs;
use std::path::{Path, PathBuf};

/// Where the training views are.
#[derive(clap::Args)]
#[command(next_help_heading = "Training data")]
pub struct DataArgs {
    /// Folder of the data the capture was trained on, with `transforms_train.json`. Cameras and times are enough unless results
    /// are compared with the images.
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// Picture size [default: w and h of the camera file, else that of the first image found beside it, after --resolution].
    #[arg(long, value_name = "WxH", value_parser = values::size)]
    size: Option<UVec2>,
    /// Divisor of the picture size (1, 2, 3, 4, 8), -1 (at most 1600 wide) or a target width, as in training.
    #[arg(long, value_name = "N", allow_negative_numbers = true, conflicts_with = "size")]
    resolution: Option<i32>,
}

impl DataArgs {
    /// The training views within the capture's time interval.
    ///
    /// # Errors
    /// No folder given, or one that cannot be used.
    pub fn open(&self, trained_with: &TrainedWith) -> Result<Vec<TrainingView>, Failure> {
        let folder = self.data.as_ref().ok_or_else(|| {
            Failure::new("this needs the training views: give --data DIR, the folder that the capture was trained on")
        })?;
        let options = CameraOptions {
            size: self.size,
            resolution: self.resolution,
            time_interval: Some(trained_with.time_interval),
        };
        Ok(Dataset::open(folder, Split::Train, &options)?.views)
    }
}

/// Which score is asked for.
#[derive(Clone, Copy, PartialEq)]
pub enum Choice {
    /// The best on held-out views of ours and the paper's.
    Auto,
    /// Every one.
    All,
    /// This one.
    One(Variant),
}

/// Parses `auto`, `all` (where that makes sense) or the name of a score.
pub fn choice(with_all: bool) -> impl TypedValueParser<Value = Choice> {
    let special: &[&str] = if with_all { &["auto", "all"] } else { &["auto"] };
    let names = special.iter().copied().chain(Variant::ALL.map(Variant::name));
    PossibleValuesParser::new(names).map(|name: String| match name.as_str() {
        "all" => Choice::All,
        name => name.parse().map_or(Choice::Auto, Choice::One),
    })
}

/// From which views scores come, and how.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Scoring")]
pub struct ScoringArgs {
    /// Score with an even share of N views [default: all].
    #[arg(long, value_name = "N", value_parser = values::count(10_000_000))]
    views: Option<usize>,
    /// Training views that are kept out of scoring where results are compared, to compare them on; at most a quarter of all.
    #[arg(long, value_name = "N", default_value = "24", value_parser = values::count(100_000))]
    held_out: usize,
    /// Power of the volume in the paper's factor; 0 leaves it out.
    #[arg(long, value_name = "P", default_value = "0.1", value_parser = values::not_negative)]
    volume_power: f64,
    /// Share of the volumes, from the largest down, at which the paper's reference volume lies.
    #[arg(long, value_name = "R", default_value = "0.9", value_parser = values::share)]
    volume_rank: f64,
}

impl ScoringArgs {
    /// The views to score with, and those to compare results on if that is `wanted`.
    pub fn share(&self, views: Vec<TrainingView>, wanted: bool) -> (Vec<TrainingView>, Vec<TrainingView>) {
        let (scored, held_out) = if wanted { hold_out(&views, self.held_out) } else { (views, Vec::new()) };
        match self.views {
            Some(count) => (even_share(&scored, count).into_iter().map(|i| scored[i].clone()).collect(), held_out),
            None => (scored, held_out),
        }
    }

    /// Scores a scene (twice: as it was read, and sliced) with these views.
    ///
    /// # Errors
    /// A scene that cannot be drawn; views that show nothing of it.
    pub fn scores(
        &self,
        engine: &mut Engine,
        scene: &GaussianScene,
        runtime: &RuntimeScene,
        background: Background,
        views: &[TrainingView],
    ) -> Result<Scores, Failure> {
        let traits = Traits::of(scene)?;
        let settings = ScoreSettings { volume_power: self.volume_power, volume_rank: self.volume_rank };
        let views = to_draw(views, runtime.trained_with.raster_fov);
        let mut scorer = engine.scorer(runtime, background)?;
        let bar = progress(views.len(), "scoring");
        let scores = Scores::accumulate(scorer.as_mut(), &traits, &views, &settings, || bar.inc(1))?;
        bar.finish_and_clear();
        Ok(scores)
    }
}

/// Reads a file of scores: one little-endian float32 for each of `count` Gaussians.
///
/// # Errors
/// A file of another length, or with a value that is not finite.
pub fn read_scores(path: &Path, count: usize) -> Result<Vec<f32>, Failure> {
    let bytes = fs::read(path).map_err(|error| Failure::at(path, &error))?;
    if bytes.len() != count * 4 {
        let found = bytes.len();
        let message = format!(
            "{found} bytes, but scores of {count} Gaussians have {}: was it made from another checkpoint?",
            count * 4
        );
        return Err(Failure::about(path, &message));
    }
    let scores: Vec<f32> = bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
    match scores.iter().position(|score| !score.is_finite()) {
        Some(index) => Err(Failure::about(path, &format!("the score of Gaussian {index} is not finite"))),
        None => Ok(scores),
    }
}
