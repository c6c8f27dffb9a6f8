//! What the times of a dataset mean.
//!
//! In: entries of a camera file, or how the times were found. Out: a [`Clock`], from which the interval and the duration of a capture follow.

/// What the times of views mean. Default: shares of an interval or seconds, whichever they look like.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Clock {
    /// Seconds of one unit of time: 1 unless the dataset says otherwise.
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
    pub(super) const NUMBERED: Self = Self { unit_seconds: 1.0, is_numbered: true };
}
