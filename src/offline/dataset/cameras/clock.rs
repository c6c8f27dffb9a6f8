//! The meaning of the times of a dataset.
//!
//! In: entries of a camera file, or how the times were found. Out: a [`Clock`], from which the interval and the
//! duration of a capture follow.

/// The meaning of the times of views. Default: fractions of an interval if all are between 0 and 1, else seconds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Clock {
    /// Seconds of one unit of time: 1 unless the dataset gives another value.
    pub unit_seconds: f32,
    /// Whether times follow from the numbers of frames, so that the capture ends at the last of them, not at 1.
    pub is_numbered: bool,
}

impl Default for Clock {
    fn default() -> Self {
        Self { unit_seconds: 1.0, is_numbered: false }
    }
}

impl Clock {
    /// Times by the numbers of frames, in seconds.
    pub(crate) const NUMBERED: Self = Self { unit_seconds: 1.0, is_numbered: true };
}
