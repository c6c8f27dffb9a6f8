//! The target of a camera: what captures write into it and what other passes read of it.
//!
//! In: the color, depth and motion of captures. Out: the same in the camera's target, depth buffer and motion vectors.

pub(crate) mod bindings;
pub(crate) mod checked_pipelines;
pub(crate) mod composite;
pub(crate) mod depth_readers;
pub(crate) mod write_depth;
pub(crate) mod write_motion;
