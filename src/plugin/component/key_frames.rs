//! The key-frames of a capture: the times between which its temporal filter is constant.
//!
//! In: the filter's number of segments and the capture's duration. Out: the times of its key-frames, evenly spaced from the start to the
//! end, and those that lie between two times.

/// The key-frames of a capture: the bounds of its temporal filter's segments, evenly spaced.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KeyFrames {
    segments: u32,
    duration: f32,
}

impl KeyFrames {
    /// Returns the key-frames of a filter with `segments` segments over `duration` seconds; `None` for a still.
    pub(super) fn new(segments: u32, duration: f32) -> Option<Self> {
        (segments > 0 && duration > 0.0).then_some(Self { segments, duration })
    }

    /// Returns their number: one more than the filter has segments.
    pub fn count(&self) -> u32 {
        self.segments.saturating_add(1)
    }

    /// Returns the time of the key-frame with an index, counted from 0, in seconds since the capture's start.
    pub fn time(&self, index: u32) -> f32 {
        (f64::from(index) * self.spacing()) as f32
    }

    /// Returns the times of all of them, rising, in seconds since the capture's start.
    pub fn times(&self) -> impl Iterator<Item = f32> {
        (0..self.count()).map(|index| self.time(index))
    }

    fn spacing(&self) -> f64 {
        f64::from(self.duration) / f64::from(self.segments)
    }

    /// Returns the indices of those after `from` (or at it, if `inclusive`) up to and including `to`, in the order of
    /// play: falling if `to` is before `from`. Both in seconds since the capture's start.
    pub(crate) fn within(&self, from: f64, to: f64, inclusive: bool) -> impl Iterator<Item = u32> + use<> {
        let last = f64::from(self.segments);
        let [from, to] = [from, to].map(|time| time / self.spacing());
        let (low, high) = match (from <= to, inclusive) {
            (true, false) => (from.floor() + 1.0, to.floor()),
            (true, true) => (from.ceil(), to.floor()),
            (false, false) => (to.ceil(), from.ceil() - 1.0),
            (false, true) => (to.ceil(), from.floor()),
        };
        let (low, high) = (low.max(0.0), high.min(last));
        let count = if low <= high { (high - low) as u32 + 1 } else { 0 };
        (0..count).map(move |step| if from <= to { low as u32 + step } else { high as u32 - step })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn key_frames_lie_at_even_spacing_from_end_to_end() {
        let key_frames = KeyFrames::new(4, 2.0).expect("four segments");
        assert_eq!(key_frames.times().collect::<Vec<_>>(), [0.0, 0.5, 1.0, 1.5, 2.0], "both ends included");
        assert_eq!(KeyFrames::new(4, 0.0), None, "a still has none");
        assert_eq!(KeyFrames::new(0, 2.0), None, "nor has what has no segments");
    }

    #[test]
    fn crossed_key_frames_come_in_the_order_of_play() {
        let key_frames = KeyFrames::new(4, 2.0).expect("four segments");
        let within = |from, to, inclusive| key_frames.within(from, to, inclusive).collect::<Vec<_>>();
        assert_eq!(within(0.5, 1.5, false), [2, 3], "after the first, up to the last");
        assert_eq!(within(0.5, 1.5, true), [1, 2, 3], "or with the first");
        assert_eq!(within(1.5, 0.5, false), [2, 1], "backwards");
        assert_eq!(within(1.5, 0.5, true), [3, 2, 1], "backwards with the first");
        assert_eq!(within(0.6, 0.9, true), [0; 0], "between two, none");
        assert_eq!(within(0.9, 0.6, true), [0; 0], "nor backwards");
        assert_eq!(within(1.0, 1.0, false), [0; 0], "no way, none");
        assert_eq!(within(1.0, 1.0, true), [2], "but where it is, if that counts");
        assert_eq!(within(-9.0, 9.0, false), [0, 1, 2, 3, 4], "never more than there are");
        assert_eq!(within(9.0, -9.0, false), [4, 3, 2, 1, 0], "never fewer than 0");
    }
}
