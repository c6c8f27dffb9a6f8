//! How opaque each cell is at a moment.
//!
//! In: what is drawn, the cells of a grid, a time. Out: the optical thickness of each cell: the sum over the Gaussians
//! at its center, of which a part `1 − e^−thickness` of the light is lost.
//!
//! A Gaussian may be narrower than a cell and lie between the centers of cells: each is widened by half a cell, in all
//! directions. That is a mean over the places within about a cell. Along its narrowest axis a Gaussian is as opaque as
//! it looks, however thin it is, since a straight line along this axis meets it somewhere; of the lines of that
//! direction through a cell, only a part meets a Gaussian whose other axes are narrower than the cell. The opacity is
//! therefore reduced by the growth of the area that the two wider axes span: a disk of many cells remains opaque, and a
//! speck becomes faint.

use super::drawn::Drawn;
use super::grid::Grid;
use crate::gaussian::alpha::{ALPHA_MAX, ALPHA_MIN};
use crate::gaussian::eigen::eigen;
use glam::{DMat3, DMat4, DVec3, Vec3};
use rayon::prelude::*;

/// Variance by which Gaussians are widened, cells squared.
const WIDENING: f64 = 0.25;
/// Distance from the mean up to which a Gaussian counts, standard deviations.
const REACH: f32 = 3.0;
/// Number of slices of the grid that one thread fills at once.
const SLAB: usize = 4;

/// The Gaussians of a capture in a grid.
pub(super) struct Occupancy {
    grid: Grid,
    /// The marginal at and below which a Gaussian is not drawn.
    cutoff: f32,
    blobs: Vec<Blob>,
}

/// A widened Gaussian. Lengths are in cells; the center of the first cell of the grid is 0.
struct Blob {
    drawn: Drawn,
    /// Factor on the opacity, at most 1.
    share: f32,
    /// Half the sides of the box within the reach.
    reach: Vec3,
    /// Inverse of the covariance, upper triangle xx, xy, xz, yy, yz, zz.
    inverse: [f32; 6],
}

/// A blob at a moment.
struct Spot<'a> {
    blob: &'a Blob,
    center: Vec3,
    /// Opacity at the center.
    alpha: f32,
    /// The first cell of its box, and the one after the last.
    first: [usize; 3],
    end: [usize; 3],
}

impl Occupancy {
    /// Returns the Gaussians in the grid. `cutoff` is the marginal at and below which they are not drawn.
    pub(super) fn of(drawn: &[Drawn], grid: Grid, cutoff: f32) -> Self {
        Self { grid, cutoff, blobs: drawn.par_iter().map(|drawn| Blob::of(drawn, grid.cell)).collect() }
    }

    /// Returns the optical thickness of each cell at a time, timestamp units.
    pub(super) fn at(&self, time: f32) -> Vec<f32> {
        let spots: Vec<Spot<'_>> =
            self.blobs.par_iter().filter_map(|blob| blob.at(time, &self.grid, self.cutoff)).collect();
        let [width, height, _] = self.grid.size;
        let mut thickness = vec![0.0f32; self.grid.len()];
        // Each cell sums the Gaussians in their order: the result does not depend on the threads.
        thickness.par_chunks_mut(SLAB * width * height).enumerate().for_each(|(slab, cells)| {
            spots.iter().for_each(|spot| spot.add([width, height], slab * SLAB, cells));
        });
        thickness
    }
}

impl Blob {
    /// Returns a widened Gaussian. `cell` is the side of a cell, capture units.
    fn of(drawn: &Drawn, cell: f64) -> Self {
        let [xx, xy, xz, yy, yz, zz] = drawn.gaussian.covariance.map(|entry| f64::from(entry) / (cell * cell));
        let covariance = DMat3::from_cols_array(&[xx, xy, xz, xy, yy, yz, xz, yz, zz]);
        let (variances, axes) = eigen(DMat4::from_mat3(covariance));
        // Rounding leaves small negative variances.
        let (variances, axes) = (variances.truncate().max(DVec3::ZERO), DMat3::from_mat4(axes));
        let widened = variances + WIDENING;
        let along_axes = |diagonal: DVec3| axes * DMat3::from_diagonal(diagonal) * axes.transpose();
        let [[xx, _, _], [_, yy, _], [_, _, zz]] = along_axes(widened).to_cols_array_2d();
        let reach = DVec3::new(xx, yy, zz).map(f64::sqrt).as_vec3() * REACH;
        let [[xx, xy, xz], [_, yy, yz], [_, _, zz]] = along_axes(widened.recip()).as_mat3().to_cols_array_2d();
        // The narrowest axis grows the most.
        let [_, middle, widest] = sorted((variances / widened).to_array());
        Self { drawn: *drawn, share: (middle * widest).sqrt() as f32, reach, inverse: [xx, xy, xz, yy, yz, zz] }
    }

    /// Returns the blob at a time, timestamp units; `None` if it is not drawn in the grid.
    fn at(&self, time: f32, grid: &Grid, cutoff: f32) -> Option<Spot<'_>> {
        let Drawn { gaussian, life: [born, dead] } = self.drawn;
        let marginal = gaussian.marginal(time);
        let peak = gaussian.opacity * marginal;
        let is_drawn = (born..=dead).contains(&f64::from(time)) && marginal > cutoff && peak >= ALPHA_MIN;
        let center = grid.cells(gaussian.mean_at(time).as_dvec3()).as_vec3();
        if !is_drawn || !center.is_finite() {
            return None;
        }
        // A box that is larger than the grid ends with it.
        let first = (center - self.reach).ceil().max(Vec3::ZERO).to_array().map(|side| side as usize);
        let end = (center + self.reach).floor().to_array().map(|side| (side + 1.0) as usize);
        let end: [usize; 3] = std::array::from_fn(|axis| end[axis].min(grid.size[axis]));
        let is_inside = first.iter().zip(&end).all(|(first, end)| first < end);
        is_inside.then_some(Spot { blob: self, center, alpha: peak * self.share, first, end })
    }
}

fn sorted(mut values: [f64; 3]) -> [f64; 3] {
    values.sort_unstable_by(f64::total_cmp);
    values
}

impl Spot<'_> {
    /// Adds the optical thickness of the blob to cells: whole slices of so many cells along x and y, of which the first
    /// is number `slice` of the grid.
    fn add(&self, [width, height]: [usize; 2], slice: usize, cells: &mut [f32]) {
        let Self { blob, center, alpha, first, end } = self;
        let [xx, xy, xz, yy, yz, zz] = blob.inverse;
        for z in first[2].max(slice)..end[2].min(slice + cells.len() / (width * height)) {
            let dz = z as f32 - center.z;
            for y in first[1]..end[1] {
                let dy = y as f32 - center.y;
                // The squared distance, in standard deviations, is a polynomial in x.
                let linear = 2.0 * (xy * dy + xz * dz);
                let constant = yy * dy * dy + 2.0 * yz * dy * dz + zz * dz * dz;
                let row = ((z - slice) * height + y) * width;
                for (x, cell) in (first[0]..end[0]).zip(&mut cells[row + first[0]..row + end[0]]) {
                    let dx = x as f32 - center.x;
                    let squared = (xx * dx + linear) * dx + constant;
                    if squared < REACH * REACH {
                        let opacity = (alpha * (-0.5 * squared).exp()).min(ALPHA_MAX);
                        *cell -= (-opacity).ln_1p();
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gaussian::{Gaussian, MARGINAL_CUTOFF};

    /// Cells of side 0.5 from the origin.
    const GRID: Grid = Grid { low: DVec3::ZERO, cell: 0.5, size: [9, 7, 8] };

    /// Returns a Gaussian in the middle of cell (4, 3, 2), with these variances along the axes, cells squared.
    fn drawn(variances: [f32; 3]) -> Drawn {
        let [xx, yy, zz] = variances.map(|variance| variance * 0.25);
        let gaussian = Gaussian {
            mean: [2.25, 1.75, 1.25],
            mean_t: 0.0,
            velocity: [0.0; 3],
            sigma_t: f32::INFINITY,
            covariance: [xx, 0.0, 0.0, yy, 0.0, zz],
            opacity: 0.9,
            padding: 0.0,
        };
        Drawn { gaussian, life: [0.0, 1.0] }
    }

    fn thickness(drawn: Drawn, time: f32) -> Vec<f32> {
        Occupancy::of(&[drawn], GRID, MARGINAL_CUTOFF).at(time)
    }

    fn index([x, y, z]: [usize; 3]) -> usize {
        x + 9 * (y + 7 * z)
    }

    #[test]
    fn the_thickness_falls_with_the_distance_and_ends_at_the_reach() {
        let thick = thickness(drawn([1.0; 3]), 0.5);
        // Widened from 1 to 1.25, of which the two wider axes keep 0.8.
        let expected = |squared: f32| -(1.0 - 0.9 * 0.8 * (-0.5 * squared / 1.25).exp()).ln();
        for (cell, squared) in [([4, 3, 2], 0.0), ([5, 3, 2], 1.0), ([3, 4, 2], 2.0), ([4, 3, 5], 9.0)] {
            let found = thick[index(cell)];
            assert!((found - expected(squared)).abs() < 1e-5, "{cell:?} has the thickness {found}");
        }
        assert_eq!(thick[index([8, 3, 2])], 0.0, "four cells away is beyond three deviations");
    }

    #[test]
    fn a_turned_gaussian_is_thick_along_its_own_axes() {
        let mut turned = drawn([1.0, 1.0, 0.0]);
        // Long along x = y.
        turned.gaussian.covariance[1] = 0.24;
        let thick = thickness(turned, 0.0);
        let [along, across] = [[5, 4, 2], [5, 2, 2]].map(|cell| thick[index(cell)]);
        assert!(along > 3.0 * across, "along it is {along} and across {across}");
    }

    #[test]
    fn a_disk_without_thickness_is_opaque_and_a_speck_is_faint() {
        let disk = thickness(drawn([16.0, 16.0, 0.0]), 0.0);
        assert!(disk[index([4, 3, 2])] > 2.0, "a line through it meets nearly its opacity");
        assert!(disk[index([2, 4, 2])] > 1.0, "in all of its cells");
        assert_eq!(disk[index([4, 3, 4])], 0.0, "but not two cells beside it");
        let speck = thickness(drawn([1e-8; 3]), 0.0);
        assert!(speck.iter().all(|&thick| thick < 1e-6), "few lines through its cell meet a speck");
    }

    #[test]
    fn a_gaussian_larger_than_the_grid_fills_it_and_one_beside_it_does_not() {
        let large = thickness(drawn([1e9; 3]), 0.0);
        assert!(large.iter().all(|&thick| (thick - 10.0f32.ln()).abs() < 1e-3), "an opacity of 0.9 everywhere");
        let mut beside = drawn([1.0; 3]);
        beside.gaussian.mean = [-9.0, 1.0, 1.0];
        assert!(thickness(beside, 0.0).iter().all(|&thick| thick == 0.0), "none of it is in the grid");
        beside.gaussian.velocity = [f32::MAX; 3];
        assert!(thickness(beside, 1.0).iter().all(|&thick| thick == 0.0), "nor if it is beyond all numbers");
    }

    #[test]
    fn a_gaussian_counts_where_and_while_it_is_drawn() {
        let mut moving = drawn([1.0; 3]);
        moving.gaussian.velocity = [0.0, 0.0, 2.0];
        assert_eq!(thickness(moving, 0.5)[index([4, 3, 4])], thickness(moving, 0.0)[index([4, 3, 2])], "it moves");
        moving.life = [0.25, 1.0];
        assert!(thickness(moving, 0.0).iter().all(|&thick| thick == 0.0), "before its life");
        moving.life = [0.0, 1.0];
        moving.gaussian.sigma_t = 0.1;
        assert!(thickness(moving, 0.3).iter().all(|&thick| thick == 0.0), "where its marginal is below the cut-off");
        assert!(thickness(moving, 0.1)[index([4, 3, 2])] > 0.1, "where it is above");
    }
}
