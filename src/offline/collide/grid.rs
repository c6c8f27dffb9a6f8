//! The cells of a box.
//!
//! In: what is drawn, the settings. Out: the [`Grid`] that is searched: cubic cells, in order of z, y and x, x fastest;
//! the neighbors of a cell.

use super::drawn::{Drawn, middle};
use super::error::CollideError;
use super::settings::CollideSettings;
use glam::{DVec3, Vec3};

/// Number of cells around the middle of the capture on each side.
const MARGIN: f64 = 2.0;
/// Smallest side of a cell, as a part of the distance of the box from the origin: points are in single precision.
const FINEST: f64 = 1e-6;

/// Cubic cells.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Grid {
    /// Smallest corner, capture space.
    pub low: DVec3,
    /// Side of a cell, capture units.
    pub cell: f64,
    /// Number of cells along x, y and z, at least 1.
    pub size: [usize; 3],
}

impl Grid {
    /// Returns the grid of the box that is searched. `span` is the length of the time interval, timestamp units.
    ///
    /// # Errors
    /// A box without a size that cells can have.
    pub(super) fn of(drawn: &[Drawn], span: f64, settings: &CollideSettings) -> Result<Self, CollideError> {
        let cells = f64::from(settings.cells);
        let (low, high, cell) = match settings.bounds {
            Some(bounds) => {
                let [low, high] = bounds.map(|corner| Vec3::from(corner).as_dvec3());
                (low, high, (high - low).max_element() / cells)
            }
            None => {
                let [low, high] = middle(drawn, span).ok_or(CollideError::NoExtent)?;
                let cell = (high - low).max_element() / (cells - 2.0 * MARGIN);
                (low - MARGIN * cell, high + MARGIN * cell, cell)
            }
        };
        let farthest = low.abs().max(high.abs()).max_element();
        let is_fit = cell.is_finite() && cell > FINEST * farthest;
        // Sides that are whole numbers of cells have no further cell for rounding.
        let count = |side: f64| (side / cell - 1e-6).ceil().clamp(1.0, cells) as usize;
        let grid = Self { low, cell, size: (high - low).to_array().map(count) };
        if is_fit { Ok(grid) } else { Err(CollideError::NoExtent) }
    }

    /// Returns the number of cells.
    pub(super) fn len(&self) -> usize {
        self.size.iter().product()
    }

    /// Returns the largest corner, capture space.
    pub(super) fn high(&self) -> DVec3 {
        self.low + self.cell * DVec3::from_array(self.size.map(|side| side as f64))
    }

    /// Returns a place in capture space from its place in cells, in which the center of the first cell is 0.
    pub(super) fn place(&self, cells: Vec3) -> Vec3 {
        (self.low + self.cell * (cells.as_dvec3() + 0.5)).as_vec3()
    }

    /// Returns the place in cells from a place in capture space: the inverse of [`place`](Self::place).
    pub(super) fn cells(&self, place: DVec3) -> DVec3 {
        (place - self.low) / self.cell - 0.5
    }

    /// Returns the differences of the indices of neighbors along x, y and z.
    pub(super) fn steps(&self) -> [usize; 3] {
        [1, self.size[0], self.size[0] * self.size[1]]
    }

    /// Returns the coordinates of a cell.
    pub(super) fn coordinates(&self, index: usize) -> [usize; 3] {
        let [_, row, slice] = self.steps();
        [index % row, index % slice / row, index / slice]
    }

    /// Returns whether a cell is at a side of the grid.
    pub(super) fn is_at_side(&self, index: usize) -> bool {
        let is_end = |(place, size): (usize, usize)| place == 0 || place + 1 == size;
        self.coordinates(index).into_iter().zip(self.size).any(is_end)
    }

    /// Returns the cells that share a face with a cell.
    pub(super) fn faces(&self, index: usize) -> impl Iterator<Item = usize> {
        let (place, size, steps) = (self.coordinates(index), self.size, self.steps());
        (0..3).flat_map(move |axis| {
            let before = (place[axis] > 0).then(|| index - steps[axis]);
            let after = (place[axis] + 1 < size[axis]).then(|| index + steps[axis]);
            [before, after].into_iter().flatten()
        })
    }

    /// Returns the cells that share a face, an edge or a corner with a cell, and the cell.
    pub(super) fn around(&self, index: usize) -> impl Iterator<Item = usize> {
        let (place, size, steps) = (self.coordinates(index), self.size, self.steps());
        let near = move |axis: usize| place[axis].saturating_sub(1)..(place[axis] + 2).min(size[axis]);
        near(2).flat_map(move |z| {
            near(1).flat_map(move |y| near(0).map(move |x| x * steps[0] + y * steps[1] + z * steps[2]))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid(bounds: [[f32; 3]; 2], cells: u32) -> Result<Grid, CollideError> {
        Grid::of(&[], 1.0, &CollideSettings { cells, bounds: Some(bounds), ..CollideSettings::default() })
    }

    #[test]
    fn the_grid_covers_the_box_with_cubes() {
        let grid = grid([[-1.0, 0.0, 2.0], [3.0, 1.0, 2.1]], 40).expect("a box");
        assert_eq!(grid.size, [40, 10, 1], "the longest side has all cells, the others as many as cover them");
        assert!(grid.high().cmpge(DVec3::new(3.0, 1.0, 2.1) - 1e-6).all(), "it ends at {}", grid.high());
        let corner = grid.place(Vec3::ZERO);
        assert!(corner.abs_diff_eq(Vec3::new(-0.95, 0.05, 2.05), 1e-5), "the center of the first cell is {corner}");
        let back = grid.cells(DVec3::new(-0.95, 0.05, 2.05));
        assert!(back.abs_diff_eq(DVec3::ZERO, 1e-5), "and has the coordinates 0, but {back}");
    }

    #[test]
    fn boxes_that_have_no_cells_are_refused() {
        let far = grid([[1e7, 0.0, 0.0], [1e7 + 1.0, 1.0, 1.0]], 128);
        assert!(matches!(far, Err(CollideError::NoExtent)), "far from the origin: {far:?}");
        let none = Grid::of(&[], 1.0, &CollideSettings::default());
        assert!(matches!(none, Err(CollideError::NoExtent)), "nothing is drawn: {none:?}");
    }

    #[test]
    fn neighbors_are_inside_the_grid_and_mutual() {
        let grid = Grid { low: DVec3::ZERO, cell: 1.0, size: [3, 4, 5] };
        let middle = 1 + 3 + 2 * 12;
        assert_eq!((grid.faces(middle).count(), grid.around(middle).count()), (6, 27), "in the middle");
        assert_eq!((grid.faces(0).count(), grid.around(0).count()), (3, 8), "in a corner");
        let inside = (0..grid.len()).filter(|&index| !grid.is_at_side(index));
        assert_eq!(inside.count(), 2 * 3, "the cells that are at no side");
        for index in 0..grid.len() {
            let [x, y, z] = grid.coordinates(index);
            assert_eq!(x + 3 * y + 12 * z, index, "coordinates give the index");
            for next in grid.faces(index) {
                assert!(grid.faces(next).any(|back| back == index), "{next} is beside {index}, and it beside that");
                assert!(grid.around(index).any(|near| near == next), "what shares a face is around");
            }
        }
    }
}
