//! Sizes on the screen at which levels of detail are drawn.
//!
//! In: the bounding sphere of a capture, its distance and a focal length; the sizes of levels. Out: the size of the
//! capture on the screen, in pixels; an error unless the sizes of the levels decrease.

/// Largest number of levels of detail of a scene.
pub const MAX_LEVELS: usize = 8;

/// Returns the size on the screen of a capture: the diameter of the sphere around its bounds, seen at the center of a
/// picture, in pixels. `radius` is that of the sphere and `distance` that of its center from the camera, in the same
/// unit; `focal` is the focal length in pixels. Infinite if the camera is inside the sphere, or a number is not finite.
pub fn pixels_across(radius: f32, distance: f32, focal: f32) -> f32 {
    let squared = distance * distance - radius * radius;
    let pixels = 2.0 * focal * radius / squared.sqrt();
    if squared > 0.0 && pixels.is_finite() { pixels } else { f32::INFINITY }
}

/// Checks the sizes of levels: positive, finite, and each smaller than the one before.
pub(crate) fn check_sizes(sizes: impl Iterator<Item = f32>) -> Result<(), &'static str> {
    let mut before = f32::INFINITY;
    for pixels in sizes {
        // NaN is not smaller than the size before.
        if !(pixels > 0.0 && pixels < before) {
            return Err("sizes of levels of detail that do not decrease from one to the next");
        }
        before = pixels;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_size_of_a_distant_sphere_is_that_of_its_diameter() {
        assert!(
            (pixels_across(1.0, 100.0, 500.0) - 10.0).abs() < 1e-2,
            "a diameter of 1/50 of the distance at focal length 500 is ten pixels"
        );
        assert!(pixels_across(1.0, 2.0, 500.0) > 500.0, "a near sphere looks larger than its diameter");
        for (radius, distance) in [(1.0, 1.0), (2.0, 1.0), (f32::NAN, 9.0), (1.0, f32::NAN)] {
            assert_eq!(
                pixels_across(radius, distance, 9.0),
                f32::INFINITY,
                "infinite from inside the sphere and for NaN"
            );
        }
    }
}
