//! Depths between those that are known.
//!
//! In: the depths of the cells of a map, 0 where there is none. Out: depths of the other cells near known ones: the
//! harmonic mean, since the inverse depth of a plane is linear in a picture, over the smallest square with enough of
//! them.

use glam::UVec2;
use rayon::prelude::*;

/// Largest half side of the square, cells.
const REACH: usize = 12;
/// Fewest known depths in it.
const FEWEST: u32 = 4;

/// Returns the depths of the cells that have none; 0 for the others, and for those far from all known ones.
pub(super) fn filled(depths: &[f32], size: UVec2) -> Vec<f32> {
    let [width, height] = size.to_array().map(|side| side as usize);
    let sums = Sums::of(depths, width, height);
    let fill = |(index, &depth): (usize, &f32)| {
        if depth > 0.0 {
            return 0.0;
        }
        let (x, y) = (index % width, index / width);
        let around = (1..=REACH).map(|reach| {
            let [left, top] = [x, y].map(|at| at.saturating_sub(reach));
            let [right, bottom] = [(x + reach + 1).min(width), (y + reach + 1).min(height)];
            sums.within([left, right], [top, bottom])
        });
        let mean = around.into_iter().find(|(count, _)| *count >= FEWEST);
        mean.map_or(0.0, |(count, inverse)| (f64::from(count) / inverse) as f32)
    };
    depths.par_iter().enumerate().map(fill).collect()
}

/// The numbers of known depths and the sums of their inverses, above and left of each cell.
struct Sums {
    width: usize,
    rows: Vec<(u32, f64)>,
}

impl Sums {
    fn of(depths: &[f32], width: usize, height: usize) -> Self {
        let mut rows = vec![(0, 0.0); (width + 1) * (height + 1)];
        for y in 0..height {
            let mut row = (0, 0.0);
            for x in 0..width {
                let depth = depths[y * width + x];
                if depth > 0.0 {
                    row = (row.0 + 1, row.1 + f64::from(depth).recip());
                }
                let above = rows[y * (width + 1) + x + 1];
                rows[(y + 1) * (width + 1) + x + 1] = (above.0 + row.0, above.1 + row.1);
            }
        }
        Self { width: width + 1, rows }
    }

    /// Returns the number of known depths and the sum of their inverses in these columns and rows.
    fn within(&self, [left, right]: [usize; 2], [top, bottom]: [usize; 2]) -> (u32, f64) {
        let at = |x: usize, y: usize| self.rows[y * self.width + x];
        let [all, above, beside, both] = [at(right, bottom), at(right, top), at(left, bottom), at(left, top)];
        (all.0 + both.0 - above.0 - beside.0, all.1 + both.1 - above.1 - beside.1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plain_wall_is_filled_between_its_edges() {
        let size = UVec2::new(20, 10);
        // A wall whose inverse depth is linear across the picture, known every fourth cell.
        let depth = |index: usize| 1.0 / (0.2 + 0.01 * (index % 20) as f32);
        let known = |index: usize| if index.is_multiple_of(4) { depth(index) } else { 0.0 };
        let found = filled(&(0..200).map(known).collect::<Vec<_>>(), size);
        for (index, found) in found.into_iter().enumerate() {
            let expected = if index.is_multiple_of(4) { 0.0 } else { depth(index) };
            assert!((found - expected).abs() <= 0.15 * depth(index), "{index}: {found}, not {expected}");
        }
    }

    #[test]
    fn what_is_far_from_known_depths_stays_empty() {
        let mut depths = vec![0.0; 60];
        depths[..4].fill(2.0);
        let found = filled(&depths, UVec2::new(60, 1));
        assert_eq!((found[5], found[40]), (2.0, 0.0), "near and far");
        assert_eq!(filled(&[0.0; 60], UVec2::new(60, 1)), [0.0; 60], "nothing is known");
    }
}
