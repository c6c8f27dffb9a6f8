//! Cleaning masks: opening, closing, holes, specks.
//!
//! In: yes and no for each pixel of a picture, in the order of rows. Out: the cleaned mask.

use super::window::{dilated, eroded};
use glam::UVec2;

/// Returns the mask without what is narrower than `2 radius + 1` pixels.
pub(super) fn opened(mask: &[bool], size: UVec2, radius: usize) -> Vec<bool> {
    dilated(&eroded(mask, size, radius), size, radius)
}

/// Returns the mask with the gaps that are at most `2 radius` pixels wide.
pub(super) fn closed(mask: &[bool], size: UVec2, radius: usize) -> Vec<bool> {
    eroded(&dilated(mask, size, radius), size, radius)
}

/// Returns the mask with its holes of at most so many pixels. What touches the border is no hole.
pub(super) fn filled(mut mask: Vec<bool>, size: UVec2, largest: usize) -> Vec<bool> {
    let outside: Vec<bool> = mask.iter().map(|inside| !inside).collect();
    let [width, height] = size.to_array().map(|side| side as usize);
    let is_border = |&index: &usize| {
        let (x, y) = (index % width, index / width);
        x == 0 || y == 0 || x + 1 == width || y + 1 == height
    };
    each_part(&outside, size, false, |part| {
        if part.len() <= largest && !part.iter().any(is_border) {
            part.iter().for_each(|&index| mask[index] = true);
        }
    });
    mask
}

/// Returns the mask without the parts of fewer than `least` pixels.
pub(super) fn without_specks(mask: &[bool], size: UVec2, least: usize) -> Vec<bool> {
    parts_where(mask, size, |part| part.len() >= least)
}

/// Returns the parts of the mask that have a pixel of `seeds`.
pub(super) fn seeded(mask: &[bool], seeds: &[bool], size: UVec2) -> Vec<bool> {
    parts_where(mask, size, |part| part.iter().any(|&index| seeds[index]))
}

/// Returns a mask of the parts that are kept. Pixels that touch at a corner are of one part.
fn parts_where(mask: &[bool], size: UVec2, is_kept: impl Fn(&[usize]) -> bool) -> Vec<bool> {
    let mut kept = vec![false; mask.len()];
    each_part(mask, size, true, |part| {
        if is_kept(part) {
            part.iter().for_each(|&index| kept[index] = true);
        }
    });
    kept
}

/// Visits the pixels of each connected part; `by_corners`: pixels that touch at a corner are connected.
fn each_part(mask: &[bool], size: UVec2, by_corners: bool, mut visit: impl FnMut(&[usize])) {
    let [width, height] = size.to_array().map(|side| side as usize);
    let mut is_left = mask.to_vec();
    let mut part = Vec::new();
    let mut firsts = 0..mask.len();
    while let Some(first) = firsts.find(|&index| is_left[index]) {
        is_left[first] = false;
        part.clear();
        part.push(first);
        let mut next = 0;
        while next < part.len() {
            let (x, y) = (part[next] % width, part[next] / width);
            next += 1;
            for row in y.saturating_sub(1)..(y + 2).min(height) {
                for column in x.saturating_sub(1)..(x + 2).min(width) {
                    let index = row * width + column;
                    if is_left[index] && (by_corners || row == y || column == x) {
                        is_left[index] = false;
                        part.push(index);
                    }
                }
            }
        }
        visit(&part);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the mask of a drawing, whose pixels are `#`, and its size.
    fn drawn(rows: &[&str]) -> (Vec<bool>, UVec2) {
        let mask = rows.iter().flat_map(|row| row.bytes()).map(|byte| byte == b'#').collect();
        (mask, UVec2::new(rows[0].len() as u32, rows.len() as u32))
    }

    #[test]
    fn a_hole_in_a_mask_is_closed() {
        let (ring, size) = drawn(&[".....#", ".###..", ".#.#..", ".#..#.", "..##.."]);
        let (full, _) = drawn(&[".....#", ".###..", ".###..", ".####.", "..##.."]);
        assert_eq!(filled(ring.clone(), size, 3), full, "three pixels inside");
        assert_eq!(filled(ring.clone(), size, 2), ring, "the hole is larger than two pixels");
        let (open, size) = drawn(&["#.#", "###"]);
        assert_eq!(filled(open.clone(), size, 9), open, "what touches the border is no hole");
    }

    #[test]
    fn specks_and_parts_without_a_seed_go() {
        let (mask, size) = drawn(&["##...#", "#....#", ".#...#", "...#.."]);
        let (large, _) = drawn(&["##...#", "#....#", ".#...#", "......"]);
        assert_eq!(without_specks(&mask, size, 3), large, "corners connect");
        let (seeds, _) = drawn(&["......", "......", ".#....", "......"]);
        let (left, _) = drawn(&["##....", "#.....", ".#....", "......"]);
        assert_eq!(seeded(&mask, &seeds, size), left, "the part of the seed");
    }

    #[test]
    fn lines_open_and_gaps_close() {
        let (mask, size) = drawn(&["......#", "###...#", "######.", "###....", "......."]);
        let (square, _) = drawn(&[".......", "###....", "###....", "###....", "......."]);
        assert_eq!(opened(&mask, size, 1), square, "only the square is three pixels wide");
        let (gap, size) = drawn(&["##..##", "##..##"]);
        assert_eq!(closed(&gap, size, 1), [true; 12], "a gap of two pixels");
    }
}
