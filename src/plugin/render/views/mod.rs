//! The views of cameras: which captures a camera sees, and where in its frame they are drawn.
//!
//! In: cameras, captures on the GPU, transparent items. Out: a prepared view for each camera, drawn among its transparent
//! items; counts and times.

pub(crate) mod capture_views;
pub(crate) mod draw;
pub(crate) mod fault;
pub(crate) mod order;
pub(crate) mod prepare;
pub(crate) mod publish;
pub(crate) mod shade_requests;
