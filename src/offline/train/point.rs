//! A point that a Gaussian begins as.
//!
//! In: a place that a source of points has found. Out: [`StartPoint`].

use glam::Vec3;

/// A point in space and time, with a color.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct StartPoint {
    /// Capture space.
    pub position: Vec3,
    /// In the unit of timestamps.
    pub time: f32,
    /// RGB, 0 to 1.
    pub color: Vec3,
}
