//! The result of fine-tuning.
//!
//! In: the trained scene, its quality after some steps. Out: [`FineTuned`], with its curve of [`CurvePoint`]s and their descriptions.

use super::totals::Faults;
use crate::scene::GaussianScene;
use serde::{Deserialize, Serialize};

/// The quality after some steps.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct CurvePoint {
    /// Steps made.
    pub step: usize,
    /// Mean loss of the steps since the point before; `None` before the first.
    pub loss: Option<f64>,
    /// PSNR of these steps, all pixels together, dB; `None` before the first.
    pub training_psnr: Option<f64>,
    /// PSNR on the validation views, dB; `None` without validation views.
    pub psnr: Option<f64>,
}

impl CurvePoint {
    /// Returns the point as a line of text, with the steps a second if they are given.
    pub(super) fn describe(&self, speed: Option<f64>) -> String {
        let Self { step, loss, training_psnr, psnr } = self;
        let loss = loss.map_or(String::new(), |loss| format!("loss {loss:.5}, "));
        let training = training_psnr.map_or(String::new(), |psnr| format!("training {psnr:.2} dB, "));
        let speed = speed.map_or(String::new(), |speed| format!(", {speed:.1} steps a second"));
        let validation = psnr.map_or("no validation views".to_owned(), |psnr| format!("validation {psnr:.3} dB"));
        format!("step {step}: {loss}{training}{validation}{speed}")
    }
}

/// A scene after fine-tuning.
#[derive(Debug, Clone, PartialEq)]
pub struct FineTuned {
    /// The scene with the best parameters.
    pub scene: GaussianScene,
    /// The quality before the first step, at every evaluation and at the end.
    pub curve: Vec<CurvePoint>,
    /// The point with the best parameters: the highest PSNR on the validation views; without these, the last point.
    pub best: CurvePoint,
    /// Steps a second, of those made now, without evaluations; `None` if there were none.
    pub steps_per_second: Option<f64>,
    /// Number of validation views.
    pub validation: usize,
    /// Gradients that were not finite and have been left out.
    pub faults: Option<Faults>,
}
