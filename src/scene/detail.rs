//! Levels of detail: a capture made of fewer Gaussians, for pictures of few pixels.
//!
//! In: scenes that show nearly the same, each with the size on the screen up to which it does. Out: [`Level`]s of a scene, checked, and
//! the size on the screen that they are chosen by.

use super::{GaussianScene, RuntimeScene, TrainedWith};
use crate::gaussian::InvalidGaussian;
use std::sync::Arc;

/// Most levels of a scene.
pub const MAX_LEVELS: usize = 8;

/// A capture made of fewer Gaussians. It has neither levels nor an environment map nor a temporal filter.
#[derive(Debug, Clone, PartialEq)]
pub struct Level {
    /// The largest size on the screen ([`pixels_across`]) at which it shows nearly the same as all Gaussians, pixels.
    pub pixels: f32,
    /// Its Gaussians and their color. The time interval is that of the capture. Shared, because it does not change.
    pub scene: Arc<RuntimeScene>,
}

impl Level {
    /// Checks that every Gaussian can be drawn.
    pub(super) fn into_runtime(self) -> Result<Self, InvalidGaussian> {
        let scene = GaussianScene::from(Arc::unwrap_or_clone(self.scene)).into_runtime()?;
        Ok(Self { scene: Arc::new(scene), ..self })
    }
}

/// Returns the size on the screen of a capture: the diameter of the sphere about its bounds, as seen in the middle of a picture, in
/// pixels. `radius` is that of the sphere and `distance` that of its center from the camera, in one unit; `focal` is the focal length in
/// pixels. Infinite if the camera is inside the sphere, or a number is not finite.
pub fn pixels_across(radius: f32, distance: f32, focal: f32) -> f32 {
    let beside = distance * distance - radius * radius;
    let pixels = 2.0 * focal * radius / beside.sqrt();
    if beside > 0.0 && pixels.is_finite() { pixels } else { f32::INFINITY }
}

/// Checks the levels of a scene: their sizes, finest first, and that each fits the scene.
pub(super) fn check_levels(
    levels: &[Level],
    trained_with: &TrainedWith,
    has_environment: bool,
) -> Result<(), &'static str> {
    if levels.len() > MAX_LEVELS {
        return Err("more levels of detail than a capture may have");
    }
    if has_environment && !levels.is_empty() {
        return Err("levels of detail of a capture with an environment map, which surrounds the camera");
    }
    check_sizes(levels.iter().map(|level| level.pixels))?;
    for level in levels {
        let own = &level.scene;
        if !own.levels.is_empty() || own.environment.is_some() || own.filter.is_some() {
            return Err("a level of detail that has levels, an environment map or a temporal filter itself");
        }
        if level.scene.trained_with.time_interval != trained_with.time_interval {
            return Err("a level of detail of another time interval");
        }
        level.scene.check()?;
    }
    Ok(())
}

/// Checks the sizes of levels: positive, finite, and each smaller than the one before.
pub(crate) fn check_sizes(sizes: impl Iterator<Item = f32>) -> Result<(), &'static str> {
    let mut before = f32::INFINITY;
    for pixels in sizes {
        // A size that is not a number is not smaller.
        if !(pixels > 0.0 && pixels < before) {
            return Err("sizes of levels of detail that do not fall from one to the next");
        }
        before = pixels;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gaussian::Harmonics;
    use crate::scene::{Environment, TemporalFilter};

    fn empty() -> RuntimeScene {
        RuntimeScene::sliced(Vec::new(), Harmonics { coefficients: 1, ..Harmonics::default() })
    }

    fn level(pixels: f32, scene: RuntimeScene) -> Level {
        Level { pixels, scene: Arc::new(scene) }
    }

    #[test]
    fn a_sphere_far_away_is_as_large_as_its_diameter() {
        assert!((pixels_across(1.0, 100.0, 500.0) - 10.0).abs() < 1e-2, "ten pixels of a hundredth of the distance");
        assert!(pixels_across(1.0, 2.0, 500.0) > 500.0, "near by it is larger than its diameter");
        for (radius, distance) in [(1.0, 1.0), (2.0, 1.0), (f32::NAN, 9.0), (1.0, f32::NAN)] {
            assert_eq!(pixels_across(radius, distance, 9.0), f32::INFINITY, "from inside, or of no number");
        }
    }

    #[test]
    fn levels_that_do_not_fit_are_refused() {
        let with = |levels| RuntimeScene { levels, ..empty() };
        assert_eq!(with(vec![level(64.0, empty()), level(8.0, empty())]).check(), Ok(()), "finest first");
        let map = Environment { width: 1, height: 1, texels: vec![0.0; 3] };
        let other = TrainedWith { time_interval: [0.0, 2.0], ..TrainedWith::default() };
        let bad = [
            vec![level(8.0, empty()), level(64.0, empty())],
            vec![level(8.0, empty()), level(8.0, empty())],
            vec![level(f32::NAN, empty())],
            vec![level(f32::INFINITY, empty())],
            vec![level(0.0, empty())],
            vec![level(8.0, with(vec![level(4.0, empty())]))],
            vec![level(8.0, RuntimeScene { environment: Some(map.clone()), ..empty() })],
            vec![level(
                8.0,
                RuntimeScene { filter: Some(TemporalFilter::support(empty().iter(), [0.0, 1.0], 2)), ..empty() },
            )],
            vec![level(8.0, RuntimeScene { trained_with: other, ..empty() })],
            (0..=MAX_LEVELS).map(|index| level(64.0 - index as f32, empty())).collect(),
        ];
        for (index, levels) in bad.into_iter().enumerate() {
            assert!(with(levels).check().is_err(), "levels {index}");
        }
        let surrounded = RuntimeScene { environment: Some(map), ..with(vec![level(8.0, empty())]) };
        assert!(surrounded.check().is_err(), "an environment map is seen at every size");
    }
}
