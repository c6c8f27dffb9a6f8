//! The result of training.
//!
//! In: the trained scene, its quality after some steps. Out: [`FineTuned`], with its curve of [`CurvePoint`]s, and a
//! line of text for each point.

use crate::offline::train::gpu::Faults;
use crate::scene::GaussianScene;
use serde::{Deserialize, Serialize};

/// The quality after some steps.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct CurvePoint {
    /// Number of steps so far.
    pub step: usize,
    /// Mean loss of the steps since the previous point; `None` before the first step and after compression.
    pub loss: Option<f64>,
    /// PSNR of the views of these steps, all pixels together, dB; `None` before the first step and after compression.
    pub training_psnr: Option<f64>,
    /// PSNR on the validation views, dB; `None` without validation views.
    pub psnr: Option<f64>,
}

impl CurvePoint {
    /// Returns a line of text with the values that were measured, and with the steps per second if `speed` is given.
    pub(crate) fn describe(&self, speed: Option<f64>) -> String {
        let Self { step, loss, training_psnr, psnr } = self;
        let loss = loss.map_or(String::new(), |loss| format!("loss {loss:.5}, "));
        let training = training_psnr.map_or(String::new(), |psnr| format!("training {psnr:.2} dB, "));
        let speed = speed.map_or(String::new(), |speed| format!(", {speed:.1} steps per second"));
        format!("step {step}: {loss}{training}{}{speed}", describe_validation(*psnr))
    }
}

/// Returns the PSNR on the validation views as text.
pub(crate) fn describe_validation(psnr: Option<f64>) -> String {
    psnr.map_or("no validation views".to_owned(), |psnr| format!("validation {psnr:.3} dB"))
}

/// A scene after training.
#[derive(Debug, Clone, PartialEq)]
pub struct FineTuned {
    /// The scene with the best parameters, compressed if this was requested.
    pub scene: GaussianScene,
    /// The quality before the first step, at every evaluation, at the end, and after compression.
    pub curve: Vec<CurvePoint>,
    /// The point with the best parameters before compression: the highest PSNR on the validation views; without these,
    /// the last point.
    pub best: CurvePoint,
    /// Steps per second of this run, without evaluations; `None` if this run made no steps.
    pub steps_per_second: Option<f64>,
    /// Number of validation views.
    pub validation: usize,
    /// Gradients that are not finite, which were left out; `None` if there are none.
    pub faults: Option<Faults>,
    /// The exposure of each training camera, in the order of the views: for red, green and blue the factors on red,
    /// green and blue, and an offset. The scene does not have them. Empty unless they were trained.
    pub exposures: Vec<[[f32; 4]; 3]>,
}
