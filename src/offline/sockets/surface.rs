//! The surfaces of what is drawn, as they are seen from all around.
//!
//! In: the Gaussians in a box at a time. Out: points on what they draw, each with its color, about evenly apart.
//!
//! The box is drawn with parallel rays from each of [`DIRECTIONS`], front to back, as in equations 2 and 3 of "3D
//! Gaussian Splatting" (Kerbl and others, 2023); the depth of a pixel is the mean of the depths of its Gaussians, of
//! each where it is densest along the ray, weighted as their colors.

use super::moment::{Drawn, Feature, is_inside, thinned};
use crate::gaussian::alpha::{ALPHA_MAX, ALPHA_MIN};
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// Directions of view, not normalized: along the axes of the capture and the diagonals of its octants.
const DIRECTIONS: [[f64; 3]; 14] = [
    [1.0, 0.0, 0.0],
    [-1.0, 0.0, 0.0],
    [0.0, 1.0, 0.0],
    [0.0, -1.0, 0.0],
    [0.0, 0.0, 1.0],
    [0.0, 0.0, -1.0],
    [1.0, 1.0, 1.0],
    [-1.0, 1.0, 1.0],
    [1.0, -1.0, 1.0],
    [-1.0, -1.0, 1.0],
    [1.0, 1.0, -1.0],
    [-1.0, 1.0, -1.0],
    [1.0, -1.0, -1.0],
    [-1.0, -1.0, -1.0],
];
/// Standard deviation by which Gaussians are widened, in pixels.
const BLUR: f64 = 0.5;
/// Standard deviations up to which a Gaussian is drawn.
const DRAWN_TO: f64 = 3.0;
/// The transmittance at which a pixel is full.
const FULL: f64 = 0.02;
/// Smallest opacity of a pixel that shows a surface.
const OPACITY: f64 = 0.3;
/// Largest standard deviation of its depth, in pixels: above it, it mixes surfaces at different depths.
const DEEPEST: f64 = 4.0;
/// Side of the cells of which each has one point, in pixels.
const CELL: f64 = 2.0;
/// Most pixels along the diagonal of a box.
const WIDEST: f64 = 512.0;
/// Smallest determinant of a correlation: thinner needles have no shape in their entries.
const THINNEST: f64 = 1e-12;

/// Returns points on the surfaces in a box (capture space) of these Gaussians, with pixels of this size (capture
/// units); `None` if the box is too wide for such pixels.
pub(super) fn surface(drawn: &[Drawn], [low, high]: [DVec3; 2], pixel: f64) -> Option<Vec<Feature>> {
    // Not more than its diagonal along any direction; false for what is no number.
    let fits = (high - low).length() <= WIDEST * pixel;
    let views = DIRECTIONS.par_iter();
    let seen = |direction: &[f64; 3]| View::along(DVec3::from(*direction), [low, high], pixel).seen(drawn);
    let points = || views.flat_map_iter(seen).filter(|one| is_inside(one.place, [low, high])).collect();
    fits.then(|| thinned(points(), CELL * pixel))
}

/// Parallel rays through a box.
struct View {
    center: DVec3,
    /// Across, up and along the rays, of length 1.
    axes: [DVec3; 3],
    /// From the center to the middle of the last pixel, capture units.
    half: [f64; 2],
    /// Number of pixels across and up.
    size: [usize; 2],
    pixel: f64,
}

/// What is drawn in a pixel.
#[derive(Clone, Copy)]
struct Pixel {
    /// The part of the light that comes through.
    transmittance: f64,
    /// Sums of colors, depths and their squares, weighted.
    color: Vec3,
    depth: f64,
    square: f64,
}

impl View {
    fn along(direction: DVec3, [low, high]: [DVec3; 2], pixel: f64) -> Self {
        let along = direction.normalize();
        let (across, up) = along.any_orthonormal_pair();
        let reach = 0.5 * (high - low);
        let count = |axis: DVec3| (2.0 * reach.dot(axis.abs()) / pixel).ceil().max(0.0) as usize + 1;
        let size = [count(across), count(up)];
        let half = size.map(|count| 0.5 * (count - 1) as f64 * pixel);
        // The pixels of a view are at the same places wherever the box is: what stands is seen alike.
        let aside = |axis: DVec3, half: f64| {
            let corner = (0.5 * (low + high)).dot(axis) - half;
            axis * ((corner / pixel).round() * pixel - corner)
        };
        let center = 0.5 * (low + high) + aside(across, half[0]) + aside(up, half[1]);
        Self { center, axes: [across, up, along], half, size, pixel }
    }

    /// Returns the surfaces that these Gaussians show.
    fn seen(&self, drawn: &[Drawn]) -> Vec<Feature> {
        let empty = Pixel { transmittance: 1.0, color: Vec3::ZERO, depth: 0.0, square: 0.0 };
        let mut pixels = vec![empty; self.size[0] * self.size[1]];
        let mut order: Vec<(f64, &Drawn)> =
            drawn.iter().map(|one| ((one.mean - self.center).dot(self.axes[2]), one)).collect();
        order.sort_by(|a, b| a.0.total_cmp(&b.0));
        order.into_iter().for_each(|(depth, one)| self.draw(one, depth, &mut pixels));
        let shown = pixels.iter().enumerate().filter_map(|(index, pixel)| self.shown(index, pixel));
        shown.collect()
    }

    /// Draws a Gaussian whose mean is at a depth.
    fn draw(&self, one: &Drawn, depth: f64, pixels: &mut [Pixel]) {
        let [across, up, along] = self.axes;
        let (mean, blur) = (one.mean - self.center, (BLUR * self.pixel).powi(2));
        let mean = [mean.dot(across), mean.dot(up)];
        let products = [one.covariance * across, one.covariance * up];
        let (xx, xy, yy) = (products[0].dot(across) + blur, products[0].dot(up), products[1].dot(up) + blur);
        let determinant = xx * yy - xy * xy;
        // False for what is no number.
        let has_shape = determinant > THINNEST * xx * yy;
        if !has_shape {
            return;
        }
        let (a, b, c) = (yy / determinant, -xy / determinant, xx / determinant);
        let deeper = [products[0].dot(along), products[1].dot(along)];
        let range = |axis: usize, variance: f64| {
            let at = |offset: f64| (mean[axis] + offset + self.half[axis]) / self.pixel;
            let reach = DRAWN_TO * variance.sqrt();
            at(-reach).ceil().max(0.0) as usize..(at(reach).floor() + 1.0).clamp(0.0, self.size[axis] as f64) as usize
        };
        let (columns, rows) = (range(0, xx), range(1, yy));
        for row in rows {
            let y = row as f64 * self.pixel - self.half[1] - mean[1];
            for column in columns.clone() {
                let x = column as f64 * self.pixel - self.half[0] - mean[0];
                let pixel = &mut pixels[row * self.size[0] + column];
                if pixel.transmittance < FULL {
                    continue;
                }
                let power = 0.5 * (a * x * x + 2.0 * b * x * y + c * y * y);
                let alpha = (one.opacity * (-power).exp()).min(ALPHA_MAX.into());
                if alpha < ALPHA_MIN.into() {
                    continue;
                }
                let depth = depth + deeper[0] * (a * x + b * y) + deeper[1] * (b * x + c * y);
                let weight = pixel.transmittance * alpha;
                pixel.color += one.color * weight as f32;
                pixel.depth += depth * weight;
                pixel.square += depth * depth * weight;
                pixel.transmittance *= 1.0 - alpha;
            }
        }
    }

    /// Returns the surface that a pixel shows; `None` if it shows none, or several.
    fn shown(&self, index: usize, pixel: &Pixel) -> Option<Feature> {
        let opacity = 1.0 - pixel.transmittance;
        let depth = pixel.depth / opacity;
        let variance = (pixel.square / opacity - depth * depth).max(0.0) / (self.pixel * self.pixel);
        let [column, row] = [index % self.size[0], index / self.size[0]].map(|count| count as f64 * self.pixel);
        let [across, up, along] = self.axes;
        let place = across * (column - self.half[0]) + up * (row - self.half[1]) + along * depth;
        (opacity >= OPACITY && variance <= DEEPEST * DEEPEST).then(|| Feature {
            place: self.center + place,
            weight: opacity / (1.0 + variance),
            color: pixel.color / opacity as f32,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::random::Random;
    use glam::DMat3;

    /// Returns a Gaussian at a place, thin along Z.
    fn flat(mean: DVec3, color: Vec3) -> Drawn {
        let covariance = DMat3::from_diagonal(DVec3::new(4e-3, 4e-3, 1e-6));
        Drawn { mean, opacity: 0.9, covariance, color, velocity: DVec3::ZERO, duration: 1.0 }
    }

    #[test]
    fn a_plane_of_gaussians_is_seen_where_it_is_though_their_means_are_apart() {
        let mut random = Random::new(3);
        let mut at = || f64::from(random.in_range(-1.0, 1.0));
        let red_then_blue = |x: f64| if x < 0.0 { Vec3::X } else { Vec3::Z };
        let plane: Vec<Drawn> = (0..2000)
            .map(|_| {
                let (x, y) = (at(), at());
                flat(DVec3::new(x, y, 0.21), red_then_blue(x))
            })
            .collect();
        let found = surface(&plane, [DVec3::splat(-0.5), DVec3::splat(0.5)], 0.02).expect("it is small");
        // The cells cross the edges of the square.
        assert!((400..=26 * 26).contains(&found.len()), "cells of 0.04 in a square of side 1: {}", found.len());
        let beside: Vec<&Feature> = found.iter().filter(|one| one.place.x.abs() > 0.2).collect();
        assert!(beside.len() > 200, "both sides are seen");
        let is_alike = |one: &&Feature| one.color.abs_diff_eq(red_then_blue(one.place.x), 0.1);
        assert!(beside.iter().all(is_alike), "the colors are where they are drawn");
        let off: f64 = found.iter().map(|one| (one.place.z - 0.21).abs()).sum::<f64>() / found.len() as f64;
        assert!(off < 0.01, "it is seen {off} beside its place");
    }

    #[test]
    fn what_is_behind_is_seen_from_behind_and_not_mixed_with_what_is_before_it() {
        let both: Vec<Drawn> = (0..40)
            .flat_map(|x| (0..40).map(move |y| (f64::from(x) * 0.05 - 1.0, f64::from(y) * 0.05 - 1.0)))
            .flat_map(|(x, y)| [flat(DVec3::new(x, y, -0.2), Vec3::X), flat(DVec3::new(x, y, 0.2), Vec3::Z)])
            .collect();
        let found = surface(&both, [DVec3::splat(-0.5), DVec3::splat(0.5)], 0.02).expect("it is small");
        let is_red = |one: &Feature| one.color.x > one.color.z;
        assert!(found.iter().all(|one| is_red(one) == (one.place.z < 0.0)), "each color is on its side");
        assert!(found.iter().any(is_red) && !found.iter().all(is_red), "both are seen");
    }

    #[test]
    fn boxes_too_wide_for_their_pixels_have_no_surface() {
        let one = [flat(DVec3::ZERO, Vec3::X)];
        assert!(surface(&one, [DVec3::splat(-1e9), DVec3::splat(1e9)], 0.1).is_none(), "it would be a huge picture");
        assert!(surface(&one, [DVec3::splat(f64::NAN); 2], 0.1).is_none(), "no numbers");
        assert!(surface(&one, [DVec3::ZERO; 2], 0.1).is_some_and(|found| found.len() == 1), "a box without size");
    }
}
