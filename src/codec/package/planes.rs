//! Byte planes: an order of bytes in which floats compress well.
//!
//! In: rows of 32-bit words. Out: their lowest bytes, then their second ones, and so on; within each plane one
//! component after the other (`xxxx yyyy zzzz`), so that similar bytes are adjacent; and back.

use super::attribute::Attribute;
use std::ops::Range;

/// Rows processed at a time, few enough that they stay in the cache for any width.
const TILE: usize = 64;

/// Returns the planes of some rows of an attribute within the table `words`.
pub(super) fn split(words: &[u32], attribute: &Attribute, rows: Range<usize>) -> Vec<u8> {
    let (count, width) = (rows.len(), attribute.width);
    let mut planes = vec![0; count * width * 4];
    for (tile, component) in tiles(count, width) {
        for row in tile {
            let word = words[(rows.start + row) * attribute.stride + attribute.offset + component];
            for (plane, byte) in word.to_le_bytes().into_iter().enumerate() {
                planes[(plane * width + component) * count + row] = byte;
            }
        }
    }
    planes
}

/// Writes a part of the rows that `planes` holds into the table `words`; the first row of `planes` is 0 in `part`. The
/// lengths must fit: `4 × width` bytes for each row.
pub(super) fn join(planes: &[u8], attribute: &Attribute, rows: Range<usize>, part: Range<usize>, words: &mut [u32]) {
    let (count, width) = (rows.len(), attribute.width);
    for (tile, component) in tiles(part.len(), width) {
        let [a, b, c, d] = [0, 1, 2, 3].map(|plane| &planes[(plane * width + component) * count..][..count]);
        for row in part.start + tile.start..part.start + tile.end {
            words[(rows.start + row) * attribute.stride + attribute.offset + component] =
                u32::from_le_bytes([a[row], b[row], c[row], d[row]]);
        }
    }
}

/// Returns every component of every tile of rows.
fn tiles(count: usize, width: usize) -> impl Iterator<Item = (Range<usize>, usize)> {
    (0..count)
        .step_by(TILE)
        .flat_map(move |first| (0..width).map(move |component| (first..count.min(first + TILE), component)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn planes_are_ordered_by_byte_then_component_then_row() {
        let attribute = Attribute { name: "mean", rows: 3, stride: 3, offset: 1, width: 2 };
        let words = [0, 0x0403_0201, 0x1413_1211, 0, 0x2423_2221, 0x3433_3231, 0, 0x4443_4241, 0x5453_5251];
        let planes = split(&words, &attribute, 1..3);
        let expected = [0x21, 0x41, 0x31, 0x51, 0x22, 0x42, 0x32, 0x52, 0x23, 0x43, 0x33, 0x53, 0x24, 0x44, 0x34, 0x54];
        assert_eq!(planes, expected, "rows 1 and 2, columns 1 and 2");
    }

    #[test]
    fn joining_reverses_splitting_and_keeps_the_other_columns() {
        let attribute = Attribute { name: "sh_rest", rows: 300, stride: 7, offset: 2, width: 5 };
        let words: Vec<u32> = (0..300 * 7).map(|i: u32| i.wrapping_mul(2_654_435_761)).collect();
        let mut joined = vec![u32::MAX; words.len()];
        for (rows, parts) in [(0..130, [0..70, 70..130]), (130..300, [0..1, 1..170])] {
            let planes = split(&words, &attribute, rows.clone());
            for part in parts {
                join(&planes, &attribute, rows.clone(), part, &mut joined);
            }
        }
        for (i, (joined, word)) in joined.into_iter().zip(words).enumerate() {
            assert_eq!(joined, if i % 7 < 2 { u32::MAX } else { word }, "word {i}");
        }
    }
}
