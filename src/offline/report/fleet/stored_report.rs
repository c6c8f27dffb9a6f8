//! The report of one bake, as it is read back.
//!
//! In: the bytes of `NAME.report.json`. Out: the part of it that is compared with other bakes. Fields that a report
//! lacks, as those of other versions may, count as unknown.

use crate::offline::report::{Change, StageTime};
use serde::Deserialize;

/// The part of a [`BakeReport`](crate::offline::report::BakeReport) that is read.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(default)]
pub(crate) struct StoredReport {
    /// Path of the checkpoint.
    pub checkpoint: Option<String>,
    /// Number of Gaussians.
    pub gaussians: Option<Change<usize>>,
    /// Bytes of the checkpoint and of the package.
    pub bytes: Option<Change<u64>>,
    /// The choices of the user and of the bake, as names and values.
    pub choices: Vec<(String, String)>,
    /// Durations of the stages.
    pub stages: Vec<StageTime>,
    /// Metrics over the views of the test split.
    pub evaluation: Option<Change<StoredEvaluation>>,
}

/// The metrics of one side of a bake.
#[derive(Debug, Clone, Copy, Default, Deserialize)]
#[serde(default)]
pub(crate) struct StoredEvaluation {
    /// Means over all views.
    pub mean: StoredMean,
}

/// Means over all views. They are unknown where the report has no number.
#[derive(Debug, Clone, Copy, Default, Deserialize)]
#[serde(default)]
pub(crate) struct StoredMean {
    /// PSNR, dB.
    pub psnr: Option<f64>,
    /// SSIM.
    pub ssim: Option<f64>,
}
