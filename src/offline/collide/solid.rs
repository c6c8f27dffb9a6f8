//! Sets of cells.
//!
//! In: the optical thickness of each cell of a grid. Out: the [`Solid`] cells, of which gaps are closed, holes are
//! filled, and parts of few cells are dropped; sets that two others make.

use super::grid::Grid;
use rayon::prelude::*;

/// A set of cells of a grid.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Solid {
    pub grid: Grid,
    /// Whether each cell is in the set.
    pub cells: Vec<bool>,
}

impl Solid {
    /// Returns the cells whose optical thickness is at least `least`.
    pub(super) fn of(grid: Grid, thickness: &[f32], least: f32) -> Self {
        Self { grid, cells: thickness.par_iter().map(|&thick| thick >= least).collect() }
    }

    /// Returns the number of cells.
    pub(super) fn count(&self) -> usize {
        self.cells.iter().filter(|&&cell| cell).count()
    }

    /// Returns the smallest and the largest coordinates of its cells; `None` if it has none.
    pub(super) fn span(&self) -> Option<[[usize; 3]; 2]> {
        let places = self.indices().map(|index| self.grid.coordinates(index)).map(|place| [place, place]);
        places.reduce(|[low, high], [place, _]| {
            let beyond = |axis: usize| (low[axis].min(place[axis]), high[axis].max(place[axis]));
            let [x, y, z] = [0, 1, 2].map(beyond);
            [[x.0, y.0, z.0], [x.1, y.1, z.1]]
        })
    }

    fn indices(&self) -> impl Iterator<Item = usize> {
        self.cells.iter().enumerate().filter_map(|(index, &cell)| cell.then_some(index))
    }

    /// Returns the cells for which `is_in` holds.
    fn with_each(&self, is_in: impl Fn(usize) -> bool + Sync + Send) -> Self {
        Self { grid: self.grid, cells: (0..self.cells.len()).into_par_iter().map(is_in).collect() }
    }

    /// Returns its cells and those of another set.
    pub(super) fn and(&self, other: &Self) -> Self {
        self.with_each(|index| self.cells[index] || other.cells[index])
    }

    /// Returns its cells that are also in another set.
    pub(super) fn in_both(&self, other: &Self) -> Self {
        self.with_each(|index| self.cells[index] && other.cells[index])
    }

    /// Returns its cells that are not in another set.
    pub(super) fn without(&self, other: &Self) -> Self {
        self.with_each(|index| self.cells[index] && !other.cells[index])
    }

    /// Returns its cells and those that share a face with one of them.
    pub(super) fn grown(&self) -> Self {
        self.with_each(|index| self.cells[index] || self.grid.faces(index).any(|near| self.cells[near]))
    }

    /// Returns its cells without those that share a face with a cell that is not in the set. What lies outside the grid
    /// does not count.
    fn shrunk(&self) -> Self {
        self.with_each(|index| self.cells[index] && self.grid.faces(index).all(|near| self.cells[near]))
    }

    /// Returns the set without gaps of one or two cells.
    pub(super) fn closed(&self) -> Self {
        self.grown().shrunk()
    }

    /// Returns the set with all cells from which no way over faces of other cells leads out of the grid.
    pub(super) fn filled(&self) -> Self {
        let is_start = |&index: &usize| !self.cells[index] && self.grid.is_at_side(index);
        // A grid has fewer cells than u32 has numbers.
        let mut open: Vec<u32> = (0..self.cells.len()).filter(is_start).map(|index| index as u32).collect();
        let mut outside = vec![false; self.cells.len()];
        open.iter().for_each(|&index| outside[index as usize] = true);
        while let Some(index) = open.pop() {
            for next in self.grid.faces(index as usize) {
                if !self.cells[next] && !outside[next] {
                    outside[next] = true;
                    open.push(next as u32);
                }
            }
        }
        self.with_each(|index| !outside[index])
    }

    /// Returns the set with a further cell wherever two of its cells touch at an edge alone, so that every edge of its
    /// surface has two sides: of the two cells beside that edge the one that `rank` ranks higher.
    pub(super) fn joined(mut self, rank: impl Fn(usize) -> f32) -> Self {
        let Some([low, high]) = self.span() else { return self };
        let steps = self.grid.steps();
        let mut is_settled = false;
        // Cells are only added, between those of the set: this ends.
        while !is_settled {
            is_settled = true;
            for z in low[2]..=high[2] {
                for y in low[1]..=high[1] {
                    for x in low[0]..=high[0] {
                        let place = [x, y, z];
                        for [a, b] in [[0, 1], [0, 2], [1, 2]] {
                            if place[a] == high[a] || place[b] == high[b] {
                                continue;
                            }
                            let corner = x * steps[0] + y * steps[1] + z * steps[2];
                            let square = [0, steps[a], steps[b], steps[a] + steps[b]].map(|step| corner + step);
                            let [one, other] = match square.map(|index| self.cells[index]) {
                                [true, false, false, true] => [square[1], square[2]],
                                [false, true, true, false] => [square[0], square[3]],
                                _ => continue,
                            };
                            let chosen = if rank(one) < rank(other) { other } else { one };
                            self.cells[chosen] = true;
                            is_settled = false;
                        }
                    }
                }
            }
        }
        self
    }

    /// Returns the set without its parts of fewer than `smallest` cells. Cells of a part touch, if only at a corner.
    pub(super) fn without_small(mut self, smallest: usize) -> Self {
        let mut seen = vec![false; self.cells.len()];
        for start in 0..self.cells.len() as u32 {
            if !self.cells[start as usize] || seen[start as usize] {
                continue;
            }
            seen[start as usize] = true;
            let (mut part, mut at) = (vec![start], 0);
            while let Some(&index) = part.get(at) {
                at += 1;
                for next in self.grid.around(index as usize) {
                    if self.cells[next] && !seen[next] {
                        seen[next] = true;
                        part.push(next as u32);
                    }
                }
            }
            if part.len() < smallest {
                part.iter().for_each(|&index| self.cells[index as usize] = false);
            }
        }
        self
    }
}

#[cfg(test)]
impl Solid {
    /// Returns the cells of a grid of this size for which `is_in` holds. Cells have the side 1.
    pub(super) fn in_size(size: [usize; 3], is_in: impl Fn([usize; 3]) -> bool) -> Self {
        let grid = Grid { low: glam::DVec3::ZERO, cell: 1.0, size };
        Self { grid, cells: (0..grid.len()).map(|index| is_in(grid.coordinates(index))).collect() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CUBE: [usize; 3] = [9, 9, 9];

    fn is_box([low, high]: [usize; 2], place: [usize; 3]) -> bool {
        place.iter().all(|side| (low..=high).contains(side))
    }

    #[test]
    fn cells_are_solid_from_the_level_on() {
        let grid = Solid::in_size([2, 2, 1], |_| false).grid;
        let solid = Solid::of(grid, &[0.0, 0.5, 0.49, 9.0], 0.5);
        assert_eq!(solid.cells, [false, true, false, true], "the level counts");
        assert_eq!((solid.count(), solid.span()), (2, Some([[1, 0, 0], [1, 1, 0]])), "two in a column");
        assert_eq!(Solid::of(grid, &[0.0; 4], 0.5).span(), None, "nothing has no span");
    }

    #[test]
    fn narrow_gaps_are_closed_and_wide_ones_are_not() {
        let walls = |gap: usize| Solid::in_size([12, 5, 5], move |[x, _, _]| x < 4 || x >= 4 + gap);
        assert_eq!(walls(1).closed().count(), 300, "one cell is closed");
        assert_eq!(walls(2).closed().count(), 300, "so are two");
        assert_eq!(walls(3).closed(), walls(3), "three are not");
        let solid = Solid::in_size(CUBE, |place| is_box([2, 5], place));
        assert_eq!(solid.closed(), solid, "a cube stays as it is");
    }

    #[test]
    fn hollows_are_filled_and_open_ones_are_not() {
        let shell = |place: [usize; 3]| is_box([1, 7], place) && !is_box([2, 6], place);
        let whole = Solid::in_size(CUBE, |place| is_box([1, 7], place));
        assert_eq!(Solid::in_size(CUBE, shell).filled(), whole, "a hollow cube becomes whole");
        let open = Solid::in_size(CUBE, |place| shell(place) && place != [1, 4, 4]);
        assert_eq!(open.filled(), open, "a hole of one cell leads inside");
    }

    #[test]
    fn small_parts_are_dropped() {
        let is_in = |place: [usize; 3]| is_box([0, 2], place) || place == [3, 3, 3] || place == [7, 7, 7];
        let both = Solid::in_size(CUBE, is_in);
        let cube = Solid::in_size(CUBE, |place| is_in(place) && place != [7, 7, 7]);
        assert_eq!(both.clone().without_small(28), cube, "a cell at a corner belongs to the cube, one apart does not");
        assert_eq!(both.clone().without_small(29).count(), 0, "larger than all");
        assert_eq!(both.clone().without_small(0), both, "no smallest size drops nothing");
    }

    #[test]
    fn cells_that_touch_at_an_edge_are_joined_by_the_higher_one() {
        let diagonal = Solid::in_size([4, 4, 4], |place| place == [1, 1, 1] || place == [2, 2, 1]);
        let [one, other] = [[2, 1, 1], [1, 2, 1]].map(|[x, y, z]| x + 4 * y + 16 * z);
        let joined = diagonal.joined(|index| if index == other { 1.0 } else { 0.0 });
        assert!(joined.cells[other] && !joined.cells[one], "the one that ranks higher");
        assert_eq!(joined.count(), 3, "and no other");
        let checkers = Solid::in_size([5, 5, 5], |[x, y, z]| (x + y + z) % 2 == 0).joined(|index| index as f32);
        let is_ambiguous = |index: usize| {
            let (place, steps) = (checkers.grid.coordinates(index), checkers.grid.steps());
            [[0, 1], [0, 2], [1, 2]].iter().any(|&[a, b]| {
                let square = [0, steps[a], steps[b], steps[a] + steps[b]];
                let in_set = |step: usize| checkers.cells[index + step];
                let is_inside = place[a] < 4 && place[b] < 4;
                is_inside && matches!(square.map(in_set), [true, false, false, true] | [false, true, true, false])
            })
        };
        assert!(!(0..125).any(is_ambiguous), "no two cells of a checkered cube touch at an edge alone any more");
    }

    #[test]
    fn sets_are_united_and_cut() {
        let row = |low: usize, high: usize| Solid::in_size([6, 1, 1], move |[x, _, _]| (low..=high).contains(&x));
        let (left, right) = (row(0, 3), row(2, 5));
        assert_eq!(left.and(&right).count(), 6, "in either");
        assert_eq!(left.in_both(&right), row(2, 3), "in both");
        assert_eq!(left.without(&right), row(0, 1), "in the first alone");
        assert_eq!(left.grown(), row(0, 4), "grown by one at the end that is free");
    }
}
