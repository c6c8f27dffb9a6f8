//! The colors of the surface of a visual hull.
//!
//! In: the places of the surface, the silhouettes and pictures of one moment. Out: the median color of each chosen
//! place over the cameras in which no other place of the surface hides it. Places that all cameras miss have none.

use super::moving_hull::{Hull, Silhouette};
use super::projection::Projection;
use glam::Vec3;
use image::RgbImage;
use rayon::prelude::*;

/// Side of the pixels of a depth map, in cubes of the surface as the nearest is shown: no gaps between cubes.
const CUBES: f32 = 1.5;
/// Least and largest side of the pixels of a depth map, pixels of the picture.
const SIDES: [f32; 2] = [2.0, 8.0];
/// Depth behind the nearest place up to which a place is not hidden, in sides of a cube.
const BEHIND: f32 = 3.0;

/// Returns the RGB color, 0 to 1, of the cubes with these indices; `None` where no picture shows one. Every silhouette
/// has a picture of its size.
pub(crate) fn colors(hull: &Hull, pictures: &[(Silhouette<'_>, RgbImage)], chosen: &[usize]) -> Vec<Option<Vec3>> {
    let places: Vec<Vec3> = hull.cells.par_iter().map(|&cell| hull.place(cell)).collect();
    let maps: Vec<NearestDepths> = pictures
        .par_iter()
        .map(|(silhouette, _)| NearestDepths::of(&silhouette.projection, &places, hull.side))
        .collect();
    let color = |&index: &usize| {
        let place = places[index];
        let mut visible = Vec::new();
        for ((silhouette, picture), map) in pictures.iter().zip(&maps) {
            let Some((pixel, depth)) = silhouette.projection.shown(place) else { continue };
            if silhouette.is_inside(pixel.x, pixel.y) && depth <= map.at(pixel.x, pixel.y) + BEHIND * hull.side {
                visible.push(picture.get_pixel(pixel.x, pixel.y).0);
            }
        }
        median(&visible)
    };
    chosen.par_iter().map(color).collect()
}

/// Returns the median of each channel, 0 to 1; `None` of none.
fn median(colors: &[[u8; 3]]) -> Option<Vec3> {
    let channel = |channel: usize| {
        let mut values: Vec<u8> = colors.iter().map(|color| color[channel]).collect();
        values.sort_unstable();
        values.get(values.len() / 2).map(|&value| f32::from(value) / 255.0)
    };
    Some(Vec3::new(channel(0)?, channel(1)?, channel(2)?))
}

/// The depths of the nearest places in a reduced picture.
struct NearestDepths {
    /// Side of a pixel of the map, pixels of the picture.
    side: u32,
    width: usize,
    depths: Vec<f32>,
}

impl NearestDepths {
    /// Returns the depths of these places, `cube` apart.
    fn of(projection: &Projection, places: &[Vec3], cube: f32) -> Self {
        let shown = places.iter().filter_map(|&place| projection.shown(place));
        let nearest = shown.map(|(_, depth)| depth).fold(f32::INFINITY, f32::min);
        let side = (CUBES * cube * projection.focal / nearest).ceil().clamp(SIDES[0], SIDES[1]) as u32;
        let [width, height] = projection.size.to_array().map(|pixels| pixels.div_ceil(side) as usize);
        let mut map = Self { side, width, depths: vec![f32::INFINITY; width * height] };
        for (pixel, depth) in places.iter().filter_map(|&place| projection.shown(place)) {
            let index = map.index(pixel.x, pixel.y);
            map.depths[index] = map.depths[index].min(depth);
        }
        map
    }

    /// Returns the depth of the nearest place around a pixel of the picture.
    fn at(&self, x: u32, y: u32) -> f32 {
        self.depths[self.index(x, y)]
    }

    fn index(&self, x: u32, y: u32) -> usize {
        (y / self.side) as usize * self.width + (x / self.side) as usize
    }
}

#[cfg(test)]
mod tests {
    use super::super::fixture::{cameras, mask};
    use super::super::moving_hull::Space;
    use super::*;
    use crate::view::Camera;
    use image::Rgb;

    #[test]
    fn a_side_has_the_color_of_the_cameras_before_it() {
        let cameras = cameras(12);
        let balls = [(Vec3::ZERO, 0.5)];
        // Cameras at positive y see red, others green.
        let picture = |camera: &Camera| {
            let silhouette = Silhouette::new(camera, &mask(camera, &balls), None).expect("the size of the camera");
            let color = if silhouette.projection.eye.y > 0.0 { [255, 0, 0] } else { [0, 255, 0] };
            (silhouette, RgbImage::from_pixel(camera.size.x, camera.size.y, Rgb(color)))
        };
        let pictures: Vec<(Silhouette<'_>, RgbImage)> = cameras.iter().map(picture).collect();
        let space = Space::of(&cameras).expect("cameras that look at the origin");
        let hull = Hull::of(pictures.iter().map(|(silhouette, _)| silhouette), &space, 0.9);
        let chosen: Vec<usize> = (0..hull.cells.len()).collect();
        let found = colors(&hull, &pictures, &chosen);
        for (expected, side) in [(Vec3::X, 1.0), (Vec3::Y, -1.0)] {
            let ends = chosen.iter().filter(|&&index| side * hull.place(hull.cells[index]).y > 0.45);
            let (right, all) = ends
                .fold((0, 0), |(right, all), &index| (right + usize::from(found[index] == Some(expected)), all + 1));
            assert!(all > 20 && right * 10 > all * 9, "{right} of {all} have the color of their side");
        }
    }
}
