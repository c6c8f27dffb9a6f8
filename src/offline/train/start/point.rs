//! A point at which a Gaussian begins.
//!
//! In: a place in the hull, in a file of points, or at random. Out: [`StartPoint`].

use glam::Vec3;

/// A point in space and time, with a color and a motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct StartPoint {
    /// Capture space.
    pub position: Vec3,
    /// In the unit of timestamps.
    pub time: f32,
    /// RGB, 0 to 1.
    pub color: Vec3,
    /// Capture units for each unit of timestamps.
    pub velocity: Vec3,
    /// Whether the point is of what stands still during the whole interval.
    pub stands: bool,
}
