//! Numbers as the panel presents them.
//!
//! In: counts, bytes, times. Out: text for people, shares for bars, positions for marks.

/// Formats a count in groups of three digits: `1,234,567`.
pub(super) fn count(number: u64) -> String {
    let digits = number.to_string();
    let mut text = String::with_capacity(digits.len() * 4 / 3);
    for (index, digit) in digits.chars().enumerate() {
        if index > 0 && (digits.len() - index).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

/// Formats bytes in the largest unit that leaves at least one: `512 B`, `1.5 MiB`.
pub(super) fn bytes(number: u64) -> String {
    const UNITS: [&str; 5] = ["KiB", "MiB", "GiB", "TiB", "PiB"];
    if number < 1024 {
        return format!("{number} B");
    }
    let mut value = number as f64 / 1024.0;
    let mut unit = 0;
    // A value that would be rounded to 1024.0 becomes 1.0 of the next unit.
    while value >= 1023.95 && unit + 1 < UNITS.len() {
        value /= 1024.0;
        unit += 1;
    }
    format!("{value:.1} {}", UNITS[unit])
}

/// Returns the share of a part in a whole, from 0 to 1; 0 if the whole is 0.
pub(super) fn share(part: f64, whole: f64) -> f32 {
    if whole > 0.0 { (part / whole).clamp(0.0, 1.0) as f32 } else { 0.0 }
}

/// Formats a frame time in seconds: `60.0 frames/s, 16.7 ms`.
pub(super) fn frame_rate(seconds: f32) -> String {
    if seconds > 0.0 {
        format!("{:.1} frames/s, {:.1} ms", 1.0 / seconds, seconds * 1e3)
    } else {
        "no time passes".into()
    }
}

/// Returns the mean of about the last twenty values, given the `mean` before and the newest value. A `mean` of 0 means
/// that there is none yet.
pub(super) fn smoothed(mean: f32, value: f32) -> f32 {
    if mean > 0.0 { mean + (value - mean) * 0.05 } else { value }
}

/// Returns the positions between `left` and `right` of marks at rising `times` of `duration` seconds. Of marks that
/// would touch, only the first is kept.
pub(super) fn mark_positions(times: impl Iterator<Item = f32>, duration: f32, left: f32, right: f32) -> Vec<f32> {
    const APART: f32 = 2.0;
    let mut positions: Vec<f32> = Vec::new();
    for time in times {
        let position = left + (right - left) * share(time.into(), duration.into());
        if positions.last().is_none_or(|last| position - last >= APART) {
            positions.push(position);
        }
    }
    positions
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_are_grouped_from_the_right() {
        for (number, text) in [(0, "0"), (999, "999"), (1000, "1,000"), (12_345, "12,345"), (1_234_567, "1,234,567")] {
            assert_eq!(count(number), text, "{number} in groups");
        }
    }

    #[test]
    fn bytes_take_the_largest_unit_that_fits() {
        let cases = [
            (0, "0 B"),
            (1023, "1023 B"),
            (1024, "1.0 KiB"),
            (1536, "1.5 KiB"),
            ((1 << 20) - 1, "1.0 MiB"),
            (3 << 29, "1.5 GiB"),
            (u64::MAX, "16384.0 PiB"),
        ];
        for (number, text) in cases {
            assert_eq!(bytes(number), text, "{number} bytes");
        }
    }

    #[test]
    fn shares_of_nothing_are_nothing() {
        assert_eq!(share(1.0, 4.0), 0.25, "a quarter");
        assert_eq!(share(5.0, 4.0), 1.0, "never more than all");
        assert_eq!(share(0.0, 0.0), 0.0, "of nothing, nothing");
        assert_eq!(share(f64::NAN, 0.0), 0.0, "whatever the part is");
    }

    #[test]
    fn the_frame_rate_settles_on_what_frames_take() {
        let mean = (0..200).fold(0.0, |mean, _| smoothed(mean, 0.02));
        assert_eq!(frame_rate(mean), "50.0 frames/s, 20.0 ms", "the same frame time all along");
        assert_eq!(frame_rate(0.0), "no time passes", "no rate without time");
    }

    #[test]
    fn marks_lie_in_proportion_and_never_touch() {
        let times = [0.0, 0.5, 1.0, 2.0];
        let positions = mark_positions(times.into_iter(), 2.0, 10.0, 110.0);
        assert_eq!(positions, [10.0, 35.0, 60.0, 110.0], "from end to end");
        let crowded = mark_positions((0..=10_000).map(|index| index as f32 * 1e-4), 1.0, 0.0, 100.0);
        assert!(crowded.len() <= 51, "{} marks on 100 points would touch", crowded.len());
        assert!(crowded.windows(2).all(|pair| pair[1] - pair[0] >= 2.0), "each stands by itself");
        assert_eq!(mark_positions([0.0].into_iter(), 0.0, 5.0, 9.0), [5.0], "a still has its one moment at the start");
    }
}
