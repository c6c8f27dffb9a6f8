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

/// What a run has found so far.
#[derive(Debug, Clone)]
pub(crate) struct Progressed {
    pub curve: Vec<CurvePoint>,
    pub best: Best,
    /// Steps made by this run, without those of a stored state, and seconds that they took.
    pub pace: (usize, f64),
}
