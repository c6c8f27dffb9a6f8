//! Formatting of the panel's numbers.
//!
//! In: counts, bytes, times. Out: text, fractions for bars, positions for marks.

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

/// Formats bytes in the largest unit in which the value is at least 1: `512 B`, `1.5 MiB`.
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

/// Returns the quotient of a part and a whole, clamped to 0 to 1; 0 if the whole is 0.
pub(super) fn fraction(part: f64, whole: f64) -> f32 {
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

/// Returns the mean of about the last twenty values, from the previous `mean` and the newest value. A previous `mean`
/// of 0 means that there is no value yet.
pub(super) fn smoothed(mean: f32, value: f32) -> f32 {
    if mean > 0.0 { mean + (value - mean) * 0.05 } else { value }
}

/// Returns the positions between `left` and `right` of marks at ascending `times` in a duration of `duration` seconds.
/// Of marks closer than two points, only the first is kept.
pub(super) fn mark_positions(times: impl Iterator<Item = f32>, duration: f32, left: f32, right: f32) -> Vec<f32> {
    const APART: f32 = 2.0;
    let mut positions: Vec<f32> = Vec::new();
    for time in times {
        let position = left + (right - left) * fraction(time.into(), duration.into());
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
    fn counts_are_grouped_in_three_digits() {
        for (number, text) in [(0, "0"), (999, "999"), (1000, "1,000"), (12_345, "12,345"), (1_234_567, "1,234,567")] {
            assert_eq!(count(number), text, "{number} is grouped from the right");
        }
    }

    #[test]
    fn bytes_use_the_largest_unit_with_a_value_of_at_least_one() {
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
            assert_eq!(bytes(number), text, "{number} bytes are formatted");
        }
    }

    #[test]
    fn fractions_are_clamped_and_zero_for_an_empty_whole() {
        assert_eq!(fraction(1.0, 4.0), 0.25, "1 of 4 is a quarter");
        assert_eq!(fraction(5.0, 4.0), 1.0, "a fraction is at most 1");
        assert_eq!(fraction(0.0, 0.0), 0.0, "a fraction of 0 is 0");
        assert_eq!(fraction(f64::NAN, 0.0), 0.0, "a NaN part of 0 is 0");
    }

    #[test]
    fn the_smoothed_frame_time_converges_to_a_constant_frame_time() {
        let mean = (0..200).fold(0.0, |mean, _| smoothed(mean, 0.02));
        assert_eq!(frame_rate(mean), "50.0 frames/s, 20.0 ms", "a constant frame time is its own mean");
        assert_eq!(frame_rate(0.0), "no time passes", "a frame time of 0 has no rate");
    }

    #[test]
    fn marks_are_proportional_and_at_least_two_points_apart() {
        let times = [0.0, 0.5, 1.0, 2.0];
        let positions = mark_positions(times.into_iter(), 2.0, 10.0, 110.0);
        assert_eq!(positions, [10.0, 35.0, 60.0, 110.0], "positions are proportional to times");
        let crowded = mark_positions((0..=10_000).map(|index| index as f32 * 1e-4), 1.0, 0.0, 100.0);
        assert!(crowded.len() <= 51, "at most 51 marks fit on 100 points, not {}", crowded.len());
        assert!(crowded.windows(2).all(|pair| pair[1] - pair[0] >= 2.0), "marks are at least two points apart");
        assert_eq!(mark_positions([0.0].into_iter(), 0.0, 5.0, 9.0), [5.0], "the mark of a still is at the left end");
    }
}
