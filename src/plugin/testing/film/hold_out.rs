//! The division of a film's pictures into splits.
//!
//! In: the index of a camera and of a time. Out: the [`Split`] of their picture.

/// The pictures that are held out from training: by camera and by time. Default: every eighth camera is for the test,
/// and the camera in the middle between two of these for validation; no time is held out.
///
/// A picture is for the test if its camera or its time is, else for validation if its camera or its time is, else for
/// training. 0 holds out nothing. The first and the last time are never held out, so that training covers all times.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct HoldOut {
    /// One of this many cameras is for the test.
    pub test_cameras: usize,
    /// One of this many cameras is for validation.
    pub validation_cameras: usize,
    /// One of this many times is for the test.
    pub test_times: usize,
    /// One of this many times is for validation.
    pub validation_times: usize,
}

impl Default for HoldOut {
    fn default() -> Self {
        Self { test_cameras: 8, validation_cameras: 8, test_times: 0, validation_times: 0 }
    }
}

impl HoldOut {
    /// Holds out nothing: all pictures are for training.
    pub const NOTHING: Self = Self { test_cameras: 0, validation_cameras: 0, test_times: 0, validation_times: 0 };

    /// Returns the split of the picture of a camera at a time, of `times` times.
    pub(super) fn split(&self, camera: usize, time: usize, times: usize) -> Split {
        let inside = time > 0 && time + 1 < times;
        if is_last(camera, self.test_cameras) || inside && is_last(time, self.test_times) {
            Split::Test
        } else if is_middle(camera, self.validation_cameras) || inside && is_middle(time, self.validation_times) {
            Split::Validation
        } else {
            Split::Train
        }
    }
}

/// Returns whether `index` is the last of a group of `every`.
fn is_last(index: usize, every: usize) -> bool {
    every > 0 && index % every == every - 1
}

/// Returns whether `index` is in the middle of a group of `every`.
fn is_middle(index: usize, every: usize) -> bool {
    every > 0 && index % every == (every - 1) / 2
}

/// A subset of the pictures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Split {
    /// Pictures that a capture is trained on.
    Train,
    /// Pictures that choices in training are made on.
    Validation,
    /// Pictures that a capture is evaluated on.
    Test,
}

impl Split {
    /// Every split; training is the last, so that a folder with its camera file is complete.
    pub(super) const ALL: [Self; 3] = [Self::Test, Self::Validation, Self::Train];

    /// Returns the name of the split in the names of folders and camera files.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Train => "train",
            Self::Validation => "val",
            Self::Test => "test",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn test_outranks_validation_and_the_outer_times_are_never_held_out() {
        let all = HoldOut { test_cameras: 4, validation_cameras: 4, test_times: 2, validation_times: 1 };
        let splits = |camera| (0..4).map(|time| all.split(camera, time, 4)).collect::<Vec<_>>();
        use Split::{Test, Train, Validation};
        assert_eq!(splits(0), [Train, Test, Validation, Train], "a camera for training, times held out inside");
        assert_eq!(splits(1), [Validation, Test, Validation, Validation], "a camera for validation");
        assert_eq!(splits(3), [Test; 4], "a camera for the test");
        assert_eq!(HoldOut::NOTHING.split(7, 1, 4), Train, "nothing is held out");
    }
}
