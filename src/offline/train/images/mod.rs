//! The images to train on.
//!
//! In: training views. Out: the images of each step, decoded in parallel, at the size of the step, in memory as many as
//! have room, the others read ahead.

pub(crate) mod prefetch;
pub(crate) mod reduced;
pub(crate) mod shot;
pub(crate) mod targets;

pub use reduced::Coarse;
pub use targets::{ImageRoom, TrainingImages};
