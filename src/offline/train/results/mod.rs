//! What training leaves while it runs and at its end.
//!
//! In: the scene and the state after some steps. Out: the best parameters, the curve, the state from which an
//! interrupted run goes on, a picture and a package that show how far it is.

pub(crate) mod best_parameters;
pub(crate) mod live_package;
pub(crate) mod outcome;
pub(crate) mod preview;
pub(crate) mod stored_state;

pub use outcome::{CurvePoint, FineTuned};
pub use stored_state::Resume;
