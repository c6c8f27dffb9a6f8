//! Captures on the GPU, before any camera looks at them.
//!
//! In: entities with captures, their times, poses and settings. Out: buffers on the GPU, the list of active Gaussians and
//! the level of detail of each placed capture.

pub(crate) mod active;
pub(crate) mod back_off;
pub(crate) mod detail;
pub(crate) mod extract;
pub(crate) mod previous;
pub(crate) mod upload;
pub(crate) mod view;
pub(crate) mod visibility;
