//! Captures on the GPU, before any camera looks at them.
//!
//! In: entities with captures, their times, poses and settings. Out: buffers on the GPU, the list of active Gaussians,
//! the level of detail and the thinning of each placed capture.

pub(crate) mod active;
pub(crate) mod back_off;
pub(crate) mod budget;
mod chunk_files;
pub(crate) mod detail;
pub(crate) mod extract;
pub(crate) mod previous;
mod steering;
pub(crate) mod upload;
pub(crate) mod view;
pub(crate) mod visibility;
