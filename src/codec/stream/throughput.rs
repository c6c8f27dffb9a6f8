//! Throughput: how fast files arrive, and how much earlier the most important Gaussians of later are loaded than the
//! least important ones of now.
//!
//! In: in each frame, its length, whether files are on their way, the bytes of those that have arrived; how many bytes
//! playing needs. Out: the seconds by which each layer may come later, and which files are long for the link.

use super::limits::StreamLimits;

/// Bytes and seconds of before count half after so many seconds with files on their way.
const HALF_LIFE: f64 = 3.0;
/// No throughput is known before files have been on their way for so many seconds.
const LEAST_SECONDS: f64 = 0.3;
/// Seconds by which each layer may come later over a fast link.
const FAST: f64 = 0.1;
/// A link becomes fast, and is not any more, at these multiples of the bytes per second that playing needs.
const FAST_FROM: f64 = 4.0;
const SLOW_FROM: f64 = 1.5;
/// Seconds from which on a file is long, alone on the link.
const LONG: f64 = 1.0;
/// Bytes from which on a file is long over a link whose throughput is not known, and over the slowest.
const LONG_UNKNOWN: u64 = 1 << 20;
const LONG_AT_LEAST: u64 = 256 << 10;

/// The bytes of files that have arrived, and the seconds for which files were on their way, of the last few such
/// seconds.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Throughput {
    bytes: f64,
    seconds: f64,
    is_fast: bool,
}

impl Throughput {
    /// Adds a frame: its length, whether files were on their way in it, the bytes of those that arrived, and how many
    /// bytes per second playing needs ([`StreamSchedule::bytes_per_second`](super::StreamSchedule::bytes_per_second)).
    pub fn add(&mut self, seconds: f64, is_busy: bool, bytes: u64, needed: f64) {
        if is_busy {
            let kept = (-seconds / HALF_LIFE).exp2();
            self.bytes = self.bytes * kept + bytes as f64;
            self.seconds = self.seconds * kept + seconds;
        }
        if self.seconds >= LEAST_SECONDS {
            // NaN is not fast.
            let ratio = self.bytes / self.seconds / needed.max(1.0);
            self.is_fast = ratio >= if self.is_fast { SLOW_FROM } else { FAST_FROM };
        }
    }

    /// Returns [`StreamLimits::layer_seconds`] of a capture, given whether it has memory for what is ahead
    /// ([`StreamSchedule::has_room`](super::StreamSchedule::has_room)): where memory is short, the first layer of what
    /// is played next comes before the last layer of now, over every link.
    pub fn layer_seconds(self, has_room: bool) -> f64 {
        if self.is_fast && has_room { FAST } else { StreamLimits::LAYER_SECONDS }
    }

    /// Returns [`StreamLimits::long_bytes`] of all captures: files that take longer than a second.
    pub fn long_bytes(self) -> u64 {
        match self.seconds >= LEAST_SECONDS && self.bytes > 0.0 {
            true => ((self.bytes / self.seconds * LONG) as u64).max(LONG_AT_LEAST),
            false => LONG_UNKNOWN,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SLOW: f64 = StreamLimits::LAYER_SECONDS;

    /// Adds ten seconds of frames, with files of `bytes` in every fifth; after each, none are on their way.
    fn play(throughput: &mut Throughput, bytes: u64, needed: f64) -> f64 {
        for frame in 0..500 {
            throughput.add(0.02, true, if frame % 5 == 4 { bytes } else { 0 }, needed);
            throughput.add(0.1, false, 0, needed);
        }
        throughput.layer_seconds(true)
    }

    #[test]
    fn layers_of_now_come_first_over_a_fast_link_alone() {
        // A million bytes per second while files are on their way.
        let seconds = |needed: f64| play(&mut Throughput::default(), 100_000, needed);
        assert_eq!([seconds(1e5), seconds(5e5), seconds(2e6)], [FAST, SLOW, SLOW], "ten times, twice, and half");
        assert_eq!([seconds(f64::INFINITY), seconds(0.0)], [SLOW, FAST], "a still, and nothing");
    }

    #[test]
    fn files_are_long_that_take_more_than_a_second() {
        let mut throughput = Throughput::default();
        assert_eq!(throughput.long_bytes(), LONG_UNKNOWN, "at the beginning");
        throughput.add(0.5, true, 0, 1e5);
        assert_eq!(throughput.long_bytes(), LONG_UNKNOWN, "nothing has arrived yet");
        throughput.add(0.5, true, 1000, 1e5);
        assert_eq!(throughput.long_bytes(), LONG_AT_LEAST, "a slow link");
        // A million bytes per second.
        play(&mut throughput, 100_000, 1e5);
        assert!((900_000..1_200_000).contains(&throughput.long_bytes()), "{} bytes", throughput.long_bytes());
    }

    #[test]
    fn a_link_stays_fast_until_it_is_clearly_slower() {
        let mut throughput = Throughput::default();
        let mut seconds = |needed: f64| play(&mut throughput, 100_000, needed);
        assert_eq!([seconds(3e5), seconds(2e5), seconds(3e5)], [SLOW, FAST, FAST], "three times, five, and three");
        assert_eq!([seconds(8e5), seconds(3e5)], [SLOW, SLOW], "1.25 times, and three times again");
    }

    #[test]
    fn an_idle_link_is_as_fast_as_before_and_an_unknown_one_is_slow() {
        let mut unknown = Throughput::default();
        unknown.add(0.1, true, 1 << 30, 1.0);
        assert_eq!(unknown.layer_seconds(true), SLOW, "at the beginning");
        let mut throughput = Throughput::default();
        play(&mut throughput, 100_000, 1e5);
        for _ in 0..1000 {
            throughput.add(1.0, false, 0, 1e5);
        }
        assert_eq!(throughput.layer_seconds(true), FAST, "after minutes without files");
        assert_eq!(throughput.layer_seconds(false), SLOW, "memory is short");
        let frames = (0..).take_while(|_| {
            throughput.add(0.02, true, 2000, 1e5);
            throughput.layer_seconds(true) == FAST
        });
        let seconds = frames.count() as f64 * 0.02;
        assert!(seconds < 15.0, "a link of a tenth of the throughput is noticed: {seconds} s");
    }
}
