//! The key-frames of a capture: the times between which its temporal filter is constant.
//!
//! In: the filter's number of segments and the capture's duration. Out: the times of the key-frames, evenly spaced from
//! the start to the end, and the key-frames between two times.

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

    /// Returns the number of key-frames: the number of segments plus one.
    pub fn count(&self) -> u32 {
        self.segments.saturating_add(1)
    }

    /// Returns the time of the key-frame with an index, counted from 0, in seconds since the capture's start.
    pub fn time(&self, index: u32) -> f32 {
        (f64::from(index) * self.spacing()) as f32
    }

    /// Returns the times of all key-frames in ascending order, in seconds since the capture's start.
    pub fn times(&self) -> impl Iterator<Item = f32> {
        (0..self.count()).map(|index| self.time(index))
    }

    fn spacing(&self) -> f64 {
        f64::from(self.duration) / f64::from(self.segments)
    }

    /// Returns the indices of the key-frames after `from` (or at `from`, if `inclusive`) up to and including `to`, in
    /// the order of play: descending if `to` is before `from`. Both times are in seconds since the capture's start.
    pub(crate) fn within(&self, from: f64, to: f64, inclusive: bool) -> impl Iterator<Item = u32> + use<> {
        let this = *self;
        // Rounded to the precision of key-frame times: `duration / spacing` may be just below the number of segments.
        let [from, to] = [from, to].map(|time| f64::from(time as f32));
        let [low, high] = [from.min(to), from.max(to)].map(|time| time / this.spacing());
        let first = (low - 1.0).max(0.0) as u32;
        let last = (high + 1.0).min(f64::from(this.segments)) as u32;
        let count = if high < 0.0 { 0 } else { last.saturating_add(1).saturating_sub(first) };
        let is_passed = move |index: &u32| {
            let time = f64::from(this.time(*index));
            let within = if from <= to { from < time && time <= to } else { to <= time && time < from };
            within || inclusive && time == from
        };
        (0..count).map(move |step| if from <= to { first + step } else { last - step }).filter(is_passed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn key_frames_lie_at_even_spacing_from_end_to_end() {
        let key_frames = KeyFrames::new(4, 2.0).expect("four segments");
        assert_eq!(
            key_frames.times().collect::<Vec<_>>(),
            [0.0, 0.5, 1.0, 1.5, 2.0],
            "the first key-frame is at the start and the last at the end"
        );
        assert_eq!(KeyFrames::new(4, 0.0), None, "a still has no key-frames");
        assert_eq!(KeyFrames::new(0, 2.0), None, "a filter without segments has no key-frames");
    }

    #[test]
    fn crossed_key_frames_come_in_the_order_of_play() {
        let key_frames = KeyFrames::new(4, 2.0).expect("four segments");
        let within = |from, to, inclusive| key_frames.within(from, to, inclusive).collect::<Vec<_>>();
        assert_eq!(
            within(0.5, 1.5, false),
            [2, 3],
            "forwards, the key-frame at the start is excluded and the one at the end included"
        );
        assert_eq!(within(0.5, 1.5, true), [1, 2, 3], "forwards, inclusive adds the key-frame at the start");
        assert_eq!(within(1.5, 0.5, false), [2, 1], "backwards, the indices descend");
        assert_eq!(within(1.5, 0.5, true), [3, 2, 1], "backwards, inclusive adds the key-frame at the start");
        assert_eq!(within(0.6, 0.9, true), [0; 0], "no key-frame lies between two neighbors");
        assert_eq!(within(0.9, 0.6, true), [0; 0], "no key-frame lies between two neighbors backwards");
        assert_eq!(within(1.0, 1.0, false), [0; 0], "an empty range crosses no key-frame");
        assert_eq!(within(1.0, 1.0, true), [2], "an empty inclusive range crosses the key-frame at its start");
        assert_eq!(within(-9.0, 9.0, false), [0, 1, 2, 3, 4], "a range beyond both ends crosses all key-frames");
        assert_eq!(
            within(9.0, -9.0, false),
            [4, 3, 2, 1, 0],
            "backwards, a range beyond both ends crosses all key-frames"
        );
        assert_eq!(within(-9.0, -5.0, true), [0; 0], "no key-frame lies before the start");
        assert_eq!(within(9.0, 5.0, true), [0; 0], "no key-frame lies after the end");
    }

    #[test]
    fn a_key_frame_at_the_end_of_a_step_is_crossed_in_that_step_only() {
        // For many of these pairs, the duration divided by the spacing is below the number of segments.
        for (segments, duration) in [(7, 1.2), (28, 1.2), (93, 1.0), (99, 2.0), (59, 3.0), (29, 5.0)] {
            let key_frames = KeyFrames::new(segments, duration).expect("a filter");
            let within = |from: f64, to: f64| key_frames.within(from, to, false).collect::<Vec<_>>();
            let forwards: Vec<u32> = (1..=segments).collect();
            let backwards: Vec<u32> = (0..segments).rev().collect();
            let end = f64::from(duration);
            assert_eq!(within(0.0, end), forwards, "{segments} in {duration} s: forwards to the last key-frame");
            assert_eq!(within(end, 0.0), backwards, "{segments} in {duration} s: backwards to the first key-frame");
            let times: Vec<f64> = (0..=segments).map(|index| f64::from(index) * end / f64::from(segments)).collect();
            let in_steps: Vec<u32> = times.windows(2).flat_map(|step| within(step[0], step[1])).collect();
            assert_eq!(in_steps, forwards, "{segments} in {duration} s: in steps that end at key-frames");
        }
    }
}
