//! The lag between two recordings of the same motion.
//!
//! In: how much moves in each of several strips of the pictures of two cameras, over time. Out: how much later the
//! second has the motion, with a correlation. Lags are found up to 12 frames, less than half a step of a walker. Motion
//! repeats itself: of several good lags, the nearest to none is taken.

/// Largest lag, frames.
const REACH: usize = 12;
/// Samples of a frame.
const FINE: usize = 4;
/// Width of the moving mean that is subtracted, frames.
const SLOW: usize = 30;
/// Lags whose correlation is at least this part of the best are good.
const GOOD: f64 = 0.9;
/// Least correlation.
const LEAST: f64 = 0.2;
/// Shortest time that both recordings must have, frames.
const SHORTEST: usize = 12;
/// Most samples of a recording.
const MOST: f64 = 20_000.0;

/// What a camera saw of motion.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Motion {
    /// Times, ascending.
    pub times: Vec<f32>,
    /// The amount of motion in each strip at these times, at least 0.
    pub strips: Vec<Vec<f32>>,
}

/// A lag between two recordings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Lag {
    /// Time of a motion in the second recording, less its time in the first, frames.
    pub frames: f64,
    /// Correlation of the recordings at this lag, 0 to 1.
    pub correlation: f64,
}

/// Samples of a recording at whole multiples of a step.
struct Sampled {
    /// The multiple of the first.
    first: usize,
    count: usize,
    strips: Vec<Vec<f64>>,
}

/// Returns the usual time between two frames, the median; `None` of less than two.
pub(crate) fn frame<'a>(times: impl Iterator<Item = &'a [f32]>) -> Option<f64> {
    let steps = times.flat_map(|times| times.windows(2)).map(|pair| f64::from(pair[1] - pair[0]));
    let mut steps: Vec<f64> = steps.filter(|&step| step > 0.0 && step.is_finite()).collect();
    steps.sort_unstable_by(f64::total_cmp);
    steps.get(steps.len() / 2).copied()
}

/// Returns the lag of `b` against `a`, whose strips correspond; `None` if too little moves, the recordings are too
/// short, or no lag stands out. `frame` is the time between two frames.
pub(crate) fn lag(a: &Motion, b: &Motion, frame: f64) -> Option<Lag> {
    let start = a.times.first()?.min(*b.times.first()?);
    let [a, b] = [a, b].map(|motion| Sampled::of(motion, f64::from(start), frame / FINE as f64));
    let (a, b) = (a?, b?);
    let least = (SHORTEST * FINE).max(a.count.min(b.count) / 2);
    let reach = (REACH * FINE) as i64;
    let all: Vec<Option<f64>> = (-reach..=reach).map(|shift| correlation(&a, &b, shift, least)).collect();
    let best = all.iter().flatten().copied().reduce(f64::max)?;
    let peaks = all.windows(3).enumerate().filter_map(|(index, around)| {
        let (before, at, after) = (around[0]?, around[1]?, around[2]?);
        let is_peak = at >= before && at > after && at >= GOOD * best && at >= LEAST;
        let bend = before - 2.0 * at + after;
        let samples = (index as i64 + 1 - reach) as f64 + 0.5 * (before - after) / bend;
        is_peak.then_some(Lag { frames: samples / FINE as f64, correlation: at })
    });
    peaks.min_by(|a, b| a.frames.abs().total_cmp(&b.frames.abs()))
}

impl Sampled {
    /// Samples a recording: single outliers and slow changes removed, small motion made to count.
    fn of(motion: &Motion, start: f64, step: f64) -> Option<Self> {
        let [begin, end] = [motion.times.first()?, motion.times.last()?].map(|&time| (f64::from(time) - start) / step);
        if !(0.0..=MOST).contains(&begin) || !(begin..=MOST).contains(&end) {
            return None;
        }
        let (first, last) = (begin.ceil() as usize, end.floor() as usize);
        let times: Vec<f64> = (first..=last).map(|sample| start + sample as f64 * step).collect();
        let strip = |strip: &Vec<f32>| {
            let roots: Vec<f64> = medians(strip).into_iter().map(|value| f64::from(value).max(0.0).sqrt()).collect();
            without_slow(&times.iter().map(|&time| at(&motion.times, &roots, time)).collect::<Vec<_>>())
        };
        let strips = motion.strips.iter().filter(|strip| strip.len() == motion.times.len()).map(strip).collect();
        Some(Self { first, count: times.len(), strips })
    }
}

/// Returns the medians of each value and its neighbors. A key frame of an encoder changes all pixels, once.
fn medians(values: &[f32]) -> Vec<f32> {
    let mut medians = values.to_vec();
    for (median, around) in medians.iter_mut().skip(1).zip(values.windows(3)) {
        *median = around[0].max(around[1]).min(around[0].min(around[1]).max(around[2]));
    }
    medians
}

/// Returns the value at a time between those of samples, by linear interpolation.
fn at(times: &[f32], values: &[f64], time: f64) -> f64 {
    let after = times.partition_point(|&sample| f64::from(sample) < time).min(times.len() - 1);
    let before = after.saturating_sub(1);
    let (from, to) = (f64::from(times[before]), f64::from(times[after]));
    let part = if to > from { ((time - from) / (to - from)).clamp(0.0, 1.0) } else { 1.0 };
    values[before] + part * (values[after] - values[before])
}

/// Returns the differences from the moving mean, which is over less at both ends.
fn without_slow(values: &[f64]) -> Vec<f64> {
    let mut sums = vec![0.0];
    sums.extend(values.iter().scan(0.0, |sum, value| {
        *sum += value;
        Some(*sum)
    }));
    let half = SLOW * FINE / 2;
    let fast = |(index, value): (usize, &f64)| {
        let (from, to) = (index.saturating_sub(half), (index + half + 1).min(values.len()));
        value - (sums[to] - sums[from]) / (to - from) as f64
    };
    values.iter().enumerate().map(fast).collect()
}

/// Returns the correlation of the samples of `a` with those of `b` that are `shift` later; `None` if they have less
/// than `least` in common, or nothing moves.
fn correlation(a: &Sampled, b: &Sampled, shift: i64, least: usize) -> Option<f64> {
    // Sample i of `a` is compared with sample i - ahead of `b`.
    let ahead = b.first as i64 - a.first as i64 - shift;
    let from = ahead.max(0);
    let to = (a.count as i64).min(b.count as i64 + ahead);
    if to - from < least as i64 {
        return None;
    }
    let (own, other) = (from as usize..to as usize, (from - ahead) as usize..(to - ahead) as usize);
    let (mut product, mut squares) = (0.0, [0.0; 2]);
    for (a, b) in a.strips.iter().zip(&b.strips) {
        let (a, b) = (&a[own.clone()], &b[other.clone()]);
        let [mean_a, mean_b] = [a, b].map(|values| values.iter().sum::<f64>() / values.len() as f64);
        for (a, b) in a.iter().zip(b) {
            let (a, b) = (a - mean_a, b - mean_b);
            product += a * b;
            squares[0] += a * a;
            squares[1] += b * b;
        }
    }
    let size = (squares[0] * squares[1]).sqrt();
    (size > f64::EPSILON).then_some(product / size)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    /// Returns the motion of somebody who makes a step in 26 frames of 1/60 s, and bends slowly, seen by a camera whose
    /// clock is so many frames late. Each view has its own share of motion in a strip.
    fn steps(late: f64, share: [f64; 3]) -> Motion {
        let times: Vec<f32> = (0..100).map(|frame| frame as f32 / 60.0).collect();
        let strip = |index: usize| {
            let motion = |&time: &f32| {
                let phase = (f64::from(time) * 60.0 - late) / 26.0;
                let moved = 1.0 + (TAU * (phase + 0.2 * index as f64)).sin() + 0.6 * (TAU * phase * 0.37).cos();
                (moved.max(0.0) * share[index]) as f32
            };
            times.iter().map(motion).collect()
        };
        Motion { strips: (0..3).map(strip).collect(), times }
    }

    #[test]
    fn a_lag_of_a_few_frames_of_a_walk_is_found() {
        let first = steps(0.0, [1.0, 2.0, 0.5]);
        for late in [-3.0, 0.0, 1.5, 3.0, 6.0] {
            let found = lag(&first, &steps(late, [2.0, 1.0, 1.0]), 1.0 / 60.0).expect("somebody walks");
            assert!((found.frames - late).abs() < 0.3, "{found:?}, not {late}");
            assert!(found.correlation > 0.7, "{found:?}");
        }
    }

    #[test]
    fn a_key_frame_is_no_motion() {
        let [mut first, mut second] = [0.0, 3.0].map(|late| steps(late, [1.0; 3]));
        for strip in first.strips.iter_mut().chain(&mut second.strips) {
            [20, 50, 80].into_iter().for_each(|frame| strip[frame] += 40.0);
        }
        let found = lag(&first, &second, 1.0 / 60.0).expect("somebody walks");
        assert!((found.frames - 3.0).abs() < 0.5, "{found:?}");
    }

    #[test]
    fn a_recording_that_begins_later_is_compared_by_its_times() {
        let first = steps(0.0, [1.0; 3]);
        let mut second = steps(2.0, [1.0; 3]);
        second.times.drain(..15);
        second.strips.iter_mut().for_each(|strip| drop(strip.drain(..15)));
        let found = lag(&first, &second, 1.0 / 60.0).expect("somebody walks");
        assert!((found.frames - 2.0).abs() < 0.3, "{found:?}");
    }

    #[test]
    fn nothing_that_moves_has_no_lag() {
        let still = Motion { times: steps(0.0, [1.0; 3]).times, strips: vec![vec![0.0; 100]; 3] };
        assert_eq!(lag(&still, &still, 1.0 / 60.0), None, "nothing moves");
        let far = Motion { times: vec![0.0, f32::MAX], strips: vec![vec![0.0; 2]; 3] };
        assert_eq!(lag(&far, &far, 1.0 / 60.0), None, "times are not trusted");
    }

    #[test]
    fn the_usual_frame_is_the_median() {
        assert_eq!(frame([&[0.0, 0.5, 1.0, 9.0][..], &[]].into_iter()), Some(0.5), "a gap is no frame");
        assert_eq!(frame([&[1.0][..]].into_iter()), None, "one picture");
    }
}
