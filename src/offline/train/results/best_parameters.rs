//! The best parameters of a run, and its curve.
//!
//! In: points of the curve, states of training. Out: [`Best`] and [`Progressed`], which the first phase begins and the
//! last phase completes.

use super::outcome::CurvePoint;
use crate::offline::train::trainer::TrainerState;

/// The best parameters so far.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Best {
    pub point: CurvePoint,
    pub state: TrainerState,
}

impl Best {
    /// Returns the parameters after a step from which on evaluations are compared anew, because images have another
    /// size: every evaluation is better.
    pub(crate) fn unmeasured(step: usize, state: TrainerState) -> Self {
        Self { point: CurvePoint { step, loss: None, training_psnr: None, psnr: None }, state }
    }
}

/// What a run has found so far.
#[derive(Debug, Clone)]
pub(crate) struct Progressed {
    pub curve: Vec<CurvePoint>,
    pub best: Best,
    /// Steps made by this run, without those of a stored state, and seconds that they took.
    pub pace: (usize, f64),
}
