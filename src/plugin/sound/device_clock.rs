//! The clock of an audio device, by which samples are made ahead of the time at which they are heard.
//!
//! In: the wall clock whenever a block of samples is asked for. Out: the time of the wall clock at which that block is
//! heard, but for the constant delay of the device.

/// Share of the time by which the clocks may drift apart.
const DRIFT: f64 = 0.001;

/// A clock that runs with the samples of a device. A device asks for many blocks at once, each time that its buffer
/// runs low: the first of them is the one that is timely, and the others follow it.
#[derive(Debug, Default)]
pub(super) struct DeviceClock {
    /// Seconds of samples that have been made.
    made: f64,
    /// The wall clock less `made`, when a block was asked for in time.
    ahead: Option<f64>,
}

impl DeviceClock {
    /// Returns when the next block, of `block` seconds, is heard. `wall` is the wall clock, in seconds.
    pub(super) fn next(&mut self, wall: f64, block: f64) -> f64 {
        let away = wall - self.made;
        let ahead = self.ahead.map_or(away, |ahead| away.max(ahead - DRIFT * block));
        self.ahead = Some(ahead);
        let heard = self.made + ahead;
        self.made += block;
        heard
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_that_are_asked_for_at_once_are_heard_one_after_the_other() {
        let mut clock = DeviceClock::default();
        for burst in 0..100 {
            // A device that asks for 40 ms at once, late by up to 3 ms.
            let wall = 5.0 + 0.04 * f64::from(burst) + 0.003 * f64::from(burst % 4) / 3.0;
            for block in 0..4 {
                let heard = clock.next(wall, 0.01);
                let ideal = 5.0 + 0.04 * f64::from(burst) + 0.01 * f64::from(block);
                assert!((heard - ideal).abs() < 0.0031, "block {block} of burst {burst}: {heard} for {ideal}");
            }
        }
    }

    #[test]
    fn a_device_that_stood_still_goes_on_at_the_wall_clock() {
        let mut clock = DeviceClock::default();
        clock.next(1.0, 0.01);
        assert_eq!(clock.next(3.0, 0.01), 3.0, "after two seconds without samples");
        let later: Vec<f64> = (1..=1000).map(|block| clock.next(3.0 + 0.00999 * f64::from(block), 0.01)).collect();
        let away = later[999] - (3.0 + 9.99);
        assert!(away.abs() < 0.003, "a device that is a thousandth fast stays near, {away} s");
    }
}
