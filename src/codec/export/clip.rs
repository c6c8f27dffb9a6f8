//! How the Gaussians of an export are played.
//!
//! In: the settings of a scene. Out: [`Clip`], for the functions that write files.

use crate::scene::UpAxis;

/// How the Gaussians of an export are played.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Clip {
    /// First and last timestamp; those of the capture also in the file of one instant.
    pub time_interval: [f32; 2],
    /// Seconds of one pass through the interval; 0 for a still.
    pub duration_seconds: f32,
    /// Frames a second, for formats that count in frames.
    pub fps: f32,
    /// The axis of the capture that points up. Formats with a fixed axis have the Gaussians and colors rotated.
    pub up: UpAxis,
    /// The marginal at and below which a Gaussian is not drawn.
    pub marginal_cutoff: f32,
}
