//! The environment map before the first step.
//!
//! In: the background color, images, the number of rows. Out: the usual number of rows for these images; a map of this
//! color. Directions that no camera looks at keep this color. The map does not begin with the images: cameras around a
//! scene would put the scene into the map, behind itself.

use crate::offline::dataset::CoveredImage;
use crate::offline::train::TrainingImages;
use crate::scene::Environment;

/// Rows of the map where images show surroundings, unless another number is asked for.
const USUAL_ROWS: u32 = 32;
/// Difference of a channel, 0 to 255, up to which a pixel has the color of the background.
const SAME: f32 = 8.0;

/// Returns the usual number of rows: none unless opaque images show surroundings, from cameras within half the radius
/// of the map.
pub(crate) fn usual_rows(images: &TrainingImages, background: [f32; 3]) -> u32 {
    let are_inside = images.all_views().all(|view| 2.0 * view.camera_position.length() < Environment::RADIUS);
    let has_map = are_inside && !images.has_gaps() && are_shown(images.first().map(|(_, image)| image), background);
    if has_map { USUAL_ROWS } else { 0 }
}

/// Returns whether opaque images show what surrounds the scene: most pixels of their borders do not have the color of
/// the background. A plain backdrop in that color does not count as surroundings.
fn are_shown<'a>(images: impl Iterator<Item = &'a CoveredImage>, background: [f32; 3]) -> bool {
    let (mut all, mut others) = (0_u64, 0_u64);
    for image in images {
        let (width, height) = (image.size.x as usize, image.size.y as usize);
        let ends = [0, height - 1].into_iter().flat_map(|row| (0..width).map(move |column| row * width + column));
        let sides = (0..height).flat_map(|row| [row * width, row * width + width - 1]);
        for index in ends.chain(sides) {
            let texel = image.texels[index];
            let differs = |(value, background): (&u8, f32)| (f32::from(*value) - 255.0 * background).abs() > SAME;
            all += 1;
            others += u64::from(texel[..3].iter().zip(background).any(differs));
        }
    }
    2 * others > all
}

/// Returns the map, with twice as many columns as rows.
pub(crate) fn surroundings(background: [f32; 3], rows: u32) -> Environment {
    let plane = 2 * rows as usize * rows as usize;
    let texels = background.into_iter().flat_map(|channel| std::iter::repeat_n(channel, plane)).collect();
    Environment { width: 2 * rows, height: rows, texels }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{UVec2, Vec3};

    #[test]
    fn a_plain_backdrop_shows_no_surroundings() {
        let size = UVec2::new(6, 4);
        let of = |border: [u8; 4]| {
            let texel = |index: u32| {
                let (x, y) = (index % size.x, index / size.x);
                let is_inside = (1..size.x - 1).contains(&x) && (1..size.y - 1).contains(&y);
                if is_inside { [200, 100, 50, 255] } else { border }
            };
            CoveredImage { size, texels: (0..size.element_product()).map(texel).collect(), has_gaps: false }
        };
        let (black, room) = (of([3, 0, 5, 255]), of([90, 80, 70, 255]));
        assert!(!are_shown([&black, &black].into_iter(), [0.0; 3]), "noise of a black backdrop");
        assert!(are_shown([&room].into_iter(), [0.0; 3]), "a room");
        assert!(are_shown([&black].into_iter(), [1.0; 3]), "not the color of this background");
        assert!(!are_shown([&black, &room].into_iter(), [0.0; 3]), "half of the borders are not most of them");
    }

    #[test]
    fn the_map_has_the_background_color_in_every_direction() {
        let map = surroundings([0.5, 0.0, 0.25], 16);
        assert_eq!((map.width, map.height, map.check()), (32, 16, Ok(())), "twice as wide as high");
        for direction in [Vec3::X, Vec3::NEG_Y, Vec3::new(0.3, -0.2, 0.9)] {
            let found = map.sample(Vec3::ZERO, direction);
            assert!(found.distance(Vec3::new(0.5, 0.0, 0.25)) < 1e-5, "the color everywhere: {found}");
        }
    }
}
