//! The images to train on.
//!
//! In: training views. Out: the images of each step, decoded in parallel, in memory as many as have room, the others
//! read ahead.

pub(crate) mod prefetch;
pub(crate) mod targets;

pub use targets::{ImageRoom, TrainingImages};
