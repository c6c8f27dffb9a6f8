//! A point at which a Gaussian begins.
//!
//! In: a place in the hull, in a file of points, or at random. Out: [`StartPoint`], with its [`Life`].

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
    /// For how long a Gaussian at the point lives at first.
    pub life: Life,
}

/// For how long a Gaussian lives at first: its temporal scale.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Life {
    /// Around the time of its point.
    Timed,
    /// Around a random time: its point has none, beside others that have one.
    Untimed,
    /// During the whole interval: its point is of what stands still.
    Whole,
}
