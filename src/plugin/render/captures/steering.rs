//! Steering: how small Gaussians may be on the screen and still be drawn, so that frames take the time that is wanted.
//!
//! In: in each frame, how many times longer than wanted the newest measured frame has taken. Out: a size in pixels,
//! which rises and falls slowly. Nothing here depends on Bevy or on a GPU.

/// The lowest size, in powers of two of a pixel: no Gaussian is left out.
const LOWEST: f32 = -6.0;
/// The highest size.
const HIGHEST: f32 = 6.0;
/// The largest change of the size per frame, in powers of two: pictures of a still view change little.
const STEP: f32 = 1.0 / 16.0;
/// Change of the size per frame for frames that take twice as long as wanted, in powers of two. A measured time is some
/// frames old, and time falls by at most as much as the size rises: no larger gain is stable with ten frames of delay.
const GAIN: f32 = 0.1;
/// Times up to this many powers of two above the one that is wanted change nothing.
const TOLERANCE: f32 = 0.04;
/// Frames of which the median is taken, so that a single long frame changes nothing.
const FRAMES: usize = 5;

/// The size of Gaussians on the screen below which they are left out.
#[derive(Debug, Clone)]
pub(super) struct Steering {
    /// The size, in powers of two of a pixel.
    stops: f32,
    /// How much longer than wanted the newest frames have taken, in powers of two; the oldest is replaced.
    recent: [f32; FRAMES],
    next: usize,
}

impl Default for Steering {
    fn default() -> Self {
        Self { stops: LOWEST, recent: [0.0; FRAMES], next: 0 }
    }
}

impl Steering {
    /// Returns the size in pixels; 0 if no Gaussian is left out.
    pub(super) fn pixels(&self) -> f32 {
        if self.stops <= LOWEST { 0.0 } else { self.stops.exp2() }
    }

    /// Changes the size after a frame. `ratio` is the measured time over the wanted one; the size stays if it is
    /// not known. `is_least` is whether every capture is drawn with its smallest share: the size does not rise further.
    pub(super) fn steer(&mut self, ratio: Option<f32>, is_least: bool) {
        let Some(longer) = ratio.map(f32::log2).filter(|longer| longer.is_finite()) else { return };
        self.recent[self.next] = longer;
        self.next = (self.next + 1) % FRAMES;
        let mut sorted = self.recent;
        sorted.sort_unstable_by(f32::total_cmp);
        let longer = sorted[FRAMES / 2];
        if longer < 0.0 || (longer > TOLERANCE && !is_least) {
            self.stops = (self.stops + (GAIN * longer).clamp(-STEP, STEP)).clamp(LOWEST, HIGHEST);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::VecDeque;

    /// A GPU: frames of all Gaussians take `whole` milliseconds, and others as many less as in the pictures of the
    /// island; each time is known some frames later.
    struct Gpu {
        whole: f32,
        fixed: f32,
        late: VecDeque<f32>,
        seed: u32,
    }

    impl Gpu {
        fn new(whole: f32, fixed: f32, delay: usize) -> Self {
            Self { whole, fixed, late: VecDeque::from(vec![whole; delay]), seed: 1 }
        }

        /// Returns a number from −1 to 1.
        fn noise(&mut self) -> f32 {
            self.seed = self.seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (self.seed >> 8) as f32 / (1u32 << 23) as f32 - 1.0
        }

        /// Draws a frame, and returns its time in milliseconds.
        fn draw(&mut self, pixels: f32, noise: f32) -> f32 {
            // Half of the pairs are those of Gaussians larger than a third of a pixel.
            let share = 1.0 / (1.0 + (pixels / 0.3).powf(0.9));
            let time = (self.fixed + (self.whole - self.fixed) * share) * (1.0 + noise * self.noise());
            self.late.push_back(time);
            time
        }

        fn known(&mut self) -> Option<f32> {
            self.late.pop_front()
        }
    }

    /// Returns the times of frames after the size has settled, and the sizes.
    fn run(gpu: &mut Gpu, wanted: f32, noise: f32, frames: usize) -> (Vec<f32>, Vec<f32>) {
        let mut steering = Steering::default();
        let (mut times, mut stops) = (Vec::new(), Vec::new());
        for _ in 0..frames {
            let ratio = gpu.known().map(|time| time / wanted);
            steering.steer(ratio, false);
            times.push(gpu.draw(steering.pixels(), noise));
            stops.push(steering.stops);
        }
        (times.split_off(frames / 2), stops.split_off(frames / 2))
    }

    fn quantile(mut values: Vec<f32>, at: f32) -> f32 {
        values.sort_by(f32::total_cmp);
        values[((values.len() - 1) as f32 * at) as usize]
    }

    #[test]
    fn times_settle_at_the_wanted_time_on_fast_and_on_slow_gpus() {
        for whole in [0.8, 8.0, 80.0] {
            for (part, delay) in [(0.9, 2), (0.5, 4), (0.25, 4), (0.25, 10)] {
                let wanted = whole * part;
                let (times, _) = run(&mut Gpu::new(whole, 0.05 * whole, delay), wanted, 0.05, 1200);
                let (median, most) = (quantile(times.clone(), 0.5) / wanted, quantile(times, 0.99) / wanted);
                let case = format!("{part} of {whole} ms, {delay} frames late");
                assert!((median - 1.0).abs() < 0.1, "{case}: the median is {median} of the wanted time");
                assert!(most < 1.25, "{case}: the 99th percentile is {most} of the wanted time");
            }
        }
    }

    #[test]
    fn a_size_that_has_settled_does_not_swing() {
        let (_, stops) = run(&mut Gpu::new(8.0, 0.4, 6), 2.0, 0.0, 2000);
        let (least, most) = stops.iter().fold((f32::MAX, f32::MIN), |(a, b), stop| (a.min(*stop), b.max(*stop)));
        assert!(most - least < 0.1, "the size swings from {least} to {most} powers of two");
    }

    #[test]
    fn all_gaussians_are_drawn_while_there_is_time() {
        let mut steering = Steering::default();
        for _ in 0..100 {
            steering.steer(Some(0.7), false);
        }
        assert_eq!(steering.pixels(), 0.0, "below the wanted time");
        for _ in 0..400 {
            steering.steer(Some(3.0), false);
        }
        let coarse = steering.pixels();
        assert_eq!(coarse, HIGHEST.exp2(), "the size rises while frames are too long");
        steering.steer(None, false);
        steering.steer(Some(0.0), false);
        steering.steer(Some(f32::NAN), false);
        assert_eq!(steering.pixels(), coarse, "the size stays without a measurement");
        for _ in 0..400 {
            steering.steer(Some(0.5), false);
        }
        assert_eq!(steering.pixels(), 0.0, "the size falls when frames are short again");
    }

    #[test]
    fn one_long_frame_changes_nothing_and_the_smallest_share_ends_the_rise() {
        let mut steering = Steering::default();
        for _ in 0..200 {
            steering.steer(Some(1.5), false);
        }
        let before = steering.clone();
        for ratio in [1.0, 1.0, 1.0, 1.0, 1.0] {
            steering.steer(Some(ratio), false);
        }
        let settled = steering.stops;
        for ratio in [1.0, 30.0, 1.0, 1.0, 30.0, 1.0, 1.0] {
            steering.steer(Some(ratio), false);
        }
        assert_eq!(steering.stops, settled, "single long frames");
        let mut held = before.clone();
        held.steer(Some(2.0), true);
        assert_eq!(held.stops, before.stops, "no capture can be drawn with less");
        for _ in 0..FRAMES {
            held.steer(Some(0.5), true);
        }
        assert!(held.stops < before.stops, "it falls then too");
    }
}
