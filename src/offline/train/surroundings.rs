//! The environment map before the first step.
//!
//! In: the background color, the number of rows. Out: a map of this color. Directions that no camera looks at keep it, as without a map. A map of what the
//! cameras see would show the scene once more behind itself where they look at it from around it.

use crate::scene::Environment;

/// Returns the map, with twice as many columns as rows.
pub(super) fn surroundings(background: [f32; 3], rows: u32) -> Environment {
    let plane = 2 * rows as usize * rows as usize;
    let texels = background.into_iter().flat_map(|channel| std::iter::repeat_n(channel, plane)).collect();
    Environment { width: 2 * rows, height: rows, texels }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

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
