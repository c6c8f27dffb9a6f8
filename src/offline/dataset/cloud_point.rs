//! A point that a training may begin with.
//!
//! In: what a file says of it. Out: [`CloudPoint`].

use glam::Vec3;

/// A point of a file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CloudPoint {
    /// World space of the cameras.
    pub position: Vec3,
    /// RGB, 0 to 1; `None` if the file has no colors.
    pub color: Option<Vec3>,
    /// In the unit of timestamps; `None` if the file has no times.
    pub time: Option<f32>,
}
