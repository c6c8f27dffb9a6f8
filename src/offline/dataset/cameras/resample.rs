//! Bicubic resampling of 8-bit pictures, bit for bit equal to Pillow.
//!
//! In: interleaved bytes of 1 to 4 channels and two sizes. Out: the bytes at the other size. Equal to Pillow up to
//! version 12 (13 swaps the two passes for some shapes, which moves a few values by rounding).
//!
//! The filter is the cubic with a = −0.5, stretched by the reduction (antialiased). Weights are normalized, then
//! rounded to 22-bit fixed point. The results of the horizontal and of the vertical pass are rounded and clipped to 8
//! bits. A side that keeps its length is not filtered.

use glam::UVec2;

const PRECISION_BITS: u32 = 22;
const HALF: i64 = 1 << (PRECISION_BITS - 1);

/// The first input of one output position, and the fixed-point weights of this and the following inputs.
struct Taps {
    first: usize,
    weights: Vec<i64>,
}

/// Resizes pictures of independent channels.
pub(crate) fn resize(mut bytes: Vec<u8>, channels: usize, from: UVec2, to: UVec2) -> Vec<u8> {
    if from.x != to.x {
        bytes = resize_rows(&bytes, channels, from.x, to.x);
    }
    if from.y != to.y {
        bytes = resize_columns(&bytes, channels * to.x as usize, from.y, to.y);
    }
    bytes
}

fn resize_rows(bytes: &[u8], channels: usize, from: u32, to: u32) -> Vec<u8> {
    let taps = taps(from, to);
    let row_length = from as usize * channels;
    let mut resized = Vec::with_capacity(bytes.len() / row_length * taps.len() * channels);
    for row in bytes.chunks_exact(row_length) {
        for Taps { first, weights } in &taps {
            for channel in 0..channels {
                let values = row[first * channels + channel..].iter().step_by(channels);
                let sum: i64 = weights.iter().zip(values).map(|(weight, &value)| weight * i64::from(value)).sum();
                resized.push(clipped(HALF + sum));
            }
        }
    }
    resized
}

fn resize_columns(bytes: &[u8], row_length: usize, from: u32, to: u32) -> Vec<u8> {
    let taps = taps(from, to);
    let mut resized = Vec::with_capacity(row_length * taps.len());
    let mut sums = vec![HALF; row_length];
    for Taps { first, weights } in &taps {
        sums.fill(HALF);
        let rows = bytes.chunks_exact(row_length).skip(*first);
        for (row, weight) in rows.zip(weights) {
            for (sum, &value) in sums.iter_mut().zip(row) {
                *sum += weight * i64::from(value);
            }
        }
        resized.extend(sums.iter().map(|&sum| clipped(sum)));
    }
    resized
}

fn clipped(sum: i64) -> u8 {
    (sum >> PRECISION_BITS).clamp(0, 255) as u8
}

/// Returns the taps of every output position along one side.
fn taps(from: u32, to: u32) -> Vec<Taps> {
    let scale = f64::from(from) / f64::from(to);
    let stretch = scale.max(1.0);
    let support = 2.0 * stretch;
    let taps_at = |position: u32| {
        let center = (f64::from(position) + 0.5) * scale;
        // Casts to unsigned saturate: positions before the picture become 0.
        let first = (center - support + 0.5) as u32;
        let end = ((center + support + 0.5) as u32).min(from);
        let weight = |input: u32| cubic((f64::from(input) - center + 0.5) * (1.0 / stretch));
        let weights: Vec<f64> = (first..end).map(weight).collect();
        let sum: f64 = weights.iter().sum();
        let fixed = |weight: &f64| (weight / sum * f64::from(1 << PRECISION_BITS)).round() as i64;
        Taps { first: first as usize, weights: weights.iter().map(fixed).collect() }
    };
    (0..to).map(taps_at).collect()
}

/// Returns the cubic kernel of Keys with a = −0.5.
fn cubic(x: f64) -> f64 {
    const A: f64 = -0.5;
    let x = x.abs();
    if x < 1.0 {
        ((A + 2.0) * x - (A + 3.0)) * x * x + 1.0
    } else if x < 2.0 {
        (((x - 5.0) * x + 8.0) * x - 4.0) * A
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // The result of Pillow 9.5 for `noise` with `Image.resize(size)`.
    #[rustfmt::skip]
    const RGB_5X4_TO_11X9: [u8; 297] = [
        30, 90, 136, 59, 70, 130, 129, 19, 118, 188, 7, 90, 210, 88, 32, 214, 154, 0, 200, 110, 41, 179, 52, 100, 165,
        108, 91, 158, 204, 56, 154, 244, 43, 73, 118, 127, 94, 98, 121, 144, 49, 107, 182, 29, 82, 185, 80, 37, 177,
        125, 11, 163, 104, 53, 149, 75, 107, 144, 116, 105, 145, 181, 81, 145, 208, 72, 176, 192, 104, 178, 172, 97,
        179, 126, 79, 166, 84, 61, 125, 57, 43, 87, 50, 41, 72, 85, 76, 73, 127, 121, 90, 134, 137, 116, 125, 140, 127,
        121, 143, 255, 225, 85, 247, 209, 78, 215, 174, 63, 165, 127, 57, 87, 58, 68, 25, 23, 88, 15, 94, 116, 32, 182,
        149, 56, 154, 173, 86, 82, 190, 99, 53, 199, 255, 137, 83, 255, 133, 85, 247, 123, 88, 208, 117, 103, 131, 116,
        135, 69, 129, 168, 73, 178, 192, 97, 236, 210, 88, 185, 210, 71, 95, 202, 63, 57, 200, 243, 44, 81, 246, 53, 92,
        255, 70, 113, 244, 108, 146, 174, 183, 187, 119, 246, 224, 143, 253, 245, 177, 255, 251, 132, 194, 226, 59, 114,
        189, 29, 80, 173, 155, 57, 64, 169, 73, 75, 206, 108, 101, 211, 155, 129, 136, 224, 151, 81, 255, 169, 136, 220,
        189, 203, 165, 199, 148, 127, 170, 48, 101, 129, 10, 89, 111, 54, 106, 44, 78, 126, 54, 138, 172, 76, 158, 215,
        92, 75, 249, 85, 18, 247, 79, 105, 150, 98, 206, 45, 117, 154, 39, 94, 41, 80, 58, 2, 95, 43, 12, 124, 36, 40,
        146, 45, 109, 198, 67, 137, 240, 78, 50, 255, 59, 0, 242, 43, 93, 124, 62, 209, 0, 84, 157, 3, 63, 37, 71, 28,
        0, 97, 14,
    ];
    #[rustfmt::skip]
    const GRAY_16X7_TO_5X20: [u8; 100] = [
        156, 183, 98, 128, 198, 147, 174, 99, 137, 192, 124, 150, 103, 164, 178, 92, 118, 109, 200, 157, 69, 97, 112,
        213, 139, 56, 94, 109, 188, 125, 51, 99, 105, 152, 115, 61, 106, 107, 129, 108, 93, 119, 120, 120, 104, 126,
        132, 132, 116, 106, 134, 135, 131, 113, 121, 118, 130, 117, 113, 152, 102, 122, 107, 112, 177, 104, 114, 121,
        98, 174, 119, 104, 157, 71, 148, 135, 98, 185, 58, 122, 147, 104, 185, 86, 113, 157, 116, 168, 137, 112, 163,
        126, 153, 175, 112, 166, 129, 149, 189, 111,
    ];

    /// Returns bytes of a linear congruential generator.
    fn noise(count: usize, mut state: u32) -> Vec<u8> {
        let next = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 24) as u8
        };
        std::iter::repeat_with(next).take(count).collect()
    }

    #[test]
    fn enlarging_rgb_equals_pillow() {
        let resized = resize(noise(5 * 4 * 3, 1), 3, UVec2::new(5, 4), UVec2::new(11, 9));
        assert_eq!(resized, RGB_5X4_TO_11X9, "both sides enlarged");
    }

    #[test]
    fn reducing_one_side_and_enlarging_the_other_equals_pillow() {
        let resized = resize(noise(16 * 7, 3), 1, UVec2::new(16, 7), UVec2::new(5, 20));
        assert_eq!(resized, GRAY_16X7_TO_5X20, "one channel");
    }

    #[test]
    fn resizing_to_the_same_size_changes_nothing() {
        let size = UVec2::new(5, 7);
        let bytes = noise(35 * 4, 9);
        assert_eq!(resize(bytes.clone(), 4, size, size), bytes, "every byte is unchanged");
    }

    #[test]
    fn constant_pictures_stay_constant() {
        for to in [UVec2::new(1, 1), UVec2::new(3, 50), UVec2::new(64, 2)] {
            let resized = resize(vec![201; 17 * 11], 1, UVec2::new(17, 11), to);
            assert_eq!(resized, vec![201; (to.x * to.y) as usize], "to {to}");
        }
    }
}
