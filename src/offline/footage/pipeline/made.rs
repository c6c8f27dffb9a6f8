//! What has been made of footage.
//!
//! In: the results of the stages. Out: [`MadeDataset`], for reports.

use crate::offline::store::stages::StageTime;
use serde_json::Value;

/// A dataset that has been made of footage.
#[derive(Debug, Clone, PartialEq)]
pub struct MadeDataset {
    /// The names of the cameras, in the order of their first views.
    pub cameras: Vec<String>,
    /// Number of pictures to train on.
    pub frames: usize,
    /// Number of pictures for the test and for validation.
    pub test_frames: usize,
    /// Number of moments of the pictures to train on.
    pub moments: usize,
    /// How the clocks of the cameras were compared, in words.
    pub sync: String,
    /// The seconds by which the times of each camera were too late.
    pub offsets: Vec<f64>,
    /// Number of masks of what moves.
    pub masks: usize,
    /// Number of points.
    pub points: usize,
    /// What the footage can give, in sentences.
    pub verdict: String,
    /// Whether a capture of this footage will be wrong unless it is mended.
    pub grave: bool,
    /// The verdict for programs.
    pub verdict_json: Value,
    /// The stages, with their durations.
    pub stages: Vec<StageTime>,
}
