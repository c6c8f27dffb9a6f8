//! What stands before a camera, and hides what moves behind it.
//!
//! In: a camera and the depths of what stands in its picture. Out: [`Backdrop`]: whether it hides a place, and whether
//! it may hide a part of a rectangle. A mask says nothing of places that it hides.

use crate::view::Camera;
use glam::UVec2;
use std::iter::successors;

/// Distance behind what stands from which it hides a place, as a share of its depth.
const BEHIND: f32 = 0.04;
/// Cells of a level that a rectangle is long at most; one more is looked at along each side.
const ACROSS: u32 = 4;

/// The depths of what stands, as a camera sees it.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Backdrop {
    /// The camera.
    pub camera: Camera,
    /// Side of a cell, pixels.
    step: u32,
    /// Largest depth of each cell and those beside it: what is behind that is hidden in every pixel of the cell.
    farthest: Level,
    /// Least depths of the cells, and of squares of two, four and more cells.
    nearest: Vec<Level>,
}

/// Depths of the cells of a picture, camera units; infinite where there is nothing or where it is not known.
#[derive(Debug, Clone, PartialEq)]
struct Level {
    size: UVec2,
    depths: Vec<f32>,
}

impl Level {
    /// Returns the depth of each cell that `choose` makes of those of another level within a range of columns and rows.
    fn of(&self, size: UVec2, range: impl Fn(u32) -> [u32; 2], choose: fn(f32, f32) -> f32) -> Self {
        let cell = |index: u32| {
            let [columns, rows] = [index % size.x, index / size.x].map(&range);
            let found = self.within(columns, rows);
            found.reduce(choose).unwrap_or(f32::INFINITY)
        };
        Self { size, depths: (0..size.element_product()).map(cell).collect() }
    }

    /// Returns the depths of these columns and rows, both from the first to before the last.
    fn within(&self, columns: [u32; 2], rows: [u32; 2]) -> impl Iterator<Item = f32> {
        let [left, right] = columns.map(|column| column.min(self.size.x));
        let [top, bottom] = rows.map(|row| row.min(self.size.y));
        (top..bottom).flat_map(move |y| (left..right).map(move |x| self.depths[(y * self.size.x + x) as usize]))
    }

    /// Returns the level of half the size, with the least depths.
    fn halved(&self) -> Self {
        self.of((self.size + 1) / 2, |at| [2 * at, 2 * at + 2], f32::min)
    }
}

impl Backdrop {
    /// Returns what stands before a camera, by the depths of cells of `step` pixels, `size` of them; 0 where none is
    /// known.
    pub(super) fn new(camera: Camera, step: u32, size: UVec2, depths: &[f32]) -> Self {
        let known = |&depth: &f32| if depth > 0.0 { depth } else { f32::INFINITY };
        let own = Level { size, depths: depths.iter().map(known).collect() };
        let farthest = own.of(size, |at| [at.saturating_sub(1), at + 2], f32::max);
        let half = |level: &Level| (level.size.max_element() > 1).then(|| level.halved());
        Self { camera, step, farthest, nearest: successors(Some(own), half).collect() }
    }

    /// Returns whether what stands hides a place at a depth (camera units) behind a pixel.
    pub(crate) fn hides(&self, pixel: UVec2, depth: f32) -> bool {
        let [x, y] = (pixel / self.step).to_array();
        let around = self.farthest.within([x, x + 1], [y, y + 1]).next();
        around.is_some_and(|around| depth > around * (1.0 + BEHIND))
    }

    /// Returns whether it may hide a place up to a depth (camera units) behind one of the pixels from `low` to before
    /// `high`.
    pub(crate) fn may_hide(&self, low: UVec2, high: UVec2, depth: f32) -> bool {
        let (low, high) = (low / self.step, high.map(|end| end.div_ceil(self.step)));
        let across = (high - low.min(high)).max_element();
        let number = across.div_ceil(ACROSS).next_power_of_two().ilog2().min(self.nearest.len() as u32 - 1);
        let [left, top] = low.map(|at| at >> number).to_array();
        let [right, bottom] = high.map(|end| end.div_ceil(1 << number)).to_array();
        let found = self.nearest[number as usize].within([left, right], [top, bottom]);
        found.fold(f32::INFINITY, f32::min) * (1.0 + BEHIND) < depth
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::random::Random;
    use glam::Vec3;

    /// Returns random depths of 25 by 19 cells of 4 pixels, of which few are not known.
    fn backdrop() -> Backdrop {
        let size = UVec2::new(25, 19);
        let mut random = Random::new(3);
        let mut depth = || if random.unit() < 0.03 { 0.0 } else { random.in_range(3.0, 6.0) };
        let depths: Vec<f32> = (0..size.element_product()).map(|_| depth()).collect();
        Backdrop::new(Camera::look_at(Vec3::X, Vec3::ZERO, Vec3::Z, 0.7, 4 * size), 4, size, &depths)
    }

    #[test]
    fn a_place_is_hidden_behind_all_depths_around_its_pixel() {
        let size = UVec2::new(6, 5);
        let depths: Vec<f32> = (0..30).map(|index| if index % 6 < 3 { 2.0 } else { 0.0 }).collect();
        let camera = Camera::look_at(Vec3::X, Vec3::ZERO, Vec3::Z, 0.7, 8 * size);
        let backdrop = Backdrop::new(camera, 8, size, &depths);
        let hides = |x: u32, depth: f32| backdrop.hides(UVec2::new(x, 20), depth);
        assert!(hides(12, 3.0) && hides(0, 2.1), "behind what stands");
        assert!(!hides(12, 1.0) && !hides(12, 2.05), "before it, and at it");
        assert!(!hides(20, 3.0) && !hides(40, 3.0), "at its edge, and beside it");
        assert!(!backdrop.hides(UVec2::new(48, 40), 9.0), "outside of the picture");
    }

    #[test]
    fn where_a_place_is_hidden_a_rectangle_around_it_may_hide_it() {
        let backdrop = backdrop();
        let mut random = Random::new(5);
        let (mut hidden, mut surely_shown) = (0, 0);
        for _ in 0..20_000 {
            let [x, y] = [100.0, 76.0].map(|side| (random.unit() * side) as u32);
            let pixel = UVec2::new(x, y).min(UVec2::new(99, 75));
            let reach = UVec2::splat((random.unit() * 30.0) as u32);
            let depth = random.in_range(0.5, 10.0);
            let [low, high] = [pixel.saturating_sub(reach), (pixel + reach + 1).min(UVec2::new(100, 76))];
            let may_hide = backdrop.may_hide(low, high, depth);
            let hides = backdrop.hides(pixel, depth);
            assert!(may_hide || !hides, "the pixel {pixel} at {depth}, from {low} to {high}");
            hidden += usize::from(hides);
            surely_shown += usize::from(!may_hide);
        }
        assert!(hidden > 1000 && surely_shown > 1000, "{hidden} are hidden, and {surely_shown} surely not");
    }
}
