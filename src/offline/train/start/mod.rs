//! The scene before the first step of training.
//!
//! In: training views with their images, points if there are any. Out: a scene of native 4D Gaussians, with the
//! interval of time, the extent of the cameras and the axis that points up, which follow from the views.

pub(crate) mod begin;
pub(crate) mod capacity;
pub(crate) mod capture;
pub(crate) mod error;
mod gaussians;
pub(crate) mod hull;
mod measured;
pub(crate) mod point;
pub(crate) mod region;
pub(crate) mod seen;
pub(crate) mod surroundings;

pub use begin::{Start, StartSettings, begin};
pub use capture::{CaptureSettings, capture_of};
pub use error::StartError;
