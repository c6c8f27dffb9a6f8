//! The best parameters of a run of fine-tuning, and its curve.
//!
//! In: points of the curve, states of training. Out: [`Best`] and [`Progressed`], which the first phase begins and
//! the last phase completes.

use super::outcome::CurvePoint;
use super::state::TrainerState;

/// The best parameters so far.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Best {
    pub point: CurvePoint,
    pub state: TrainerState,
}

/// What a run has found.
#[derive(Clone)]
pub(super) struct Progressed {
    pub curve: Vec<CurvePoint>,
    pub best: Best,
    /// Steps made now and seconds that they took.
    pub pace: (usize, f64),
}
