//! The size of the pixels that a capture was trained with.
//!
//! In: a scene, the views it was trained on. Out: the largest size that a pixel of these views has at its Gaussians, beyond which pictures
//! are anti-aliased.

use super::dataset::TrainingView;
use crate::scene::GaussianScene;
use crate::view::RasterFov;
use rayon::prelude::*;

/// One in this number of Gaussians may be farther away, since some are outliers.
const STRAYS: usize = 100;

/// Returns the largest size, in capture units, that a pixel of the training views has at the Gaussians of a scene, except the farthest
/// hundredth in each view, so that the Gaussians are drawn unchanged in these views; `None` if no view has a Gaussian in front of it.
pub fn trained_pixel(scene: &GaussianScene, views: &[TrainingView]) -> Option<f32> {
    let means = scene.form.means();
    let size_in = |view: &TrainingView| {
        let view = view.camera.view(view.time, RasterFov::Corrected);
        let depths = means.iter().map(|&mean| view.world_to_camera.transform_point3(mean.into()).z);
        let mut depths: Vec<f32> = depths.filter(|&depth| depth > view.near).collect();
        let farthest = depths.len().checked_sub(1 + depths.len() / STRAYS)?;
        let (_, depth, _) = depths.select_nth_unstable_by(farthest, f32::total_cmp);
        Some(*depth / view.focal().min_element())
    };
    let sizes = views.par_iter().filter_map(size_in).filter(|pixel| pixel.is_finite() && *pixel > 0.0);
    sizes.reduce_with(f32::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gaussian::{Gaussian, Harmonics};
    use crate::scene::RuntimeScene;
    use crate::view::Camera;
    use glam::{UVec2, Vec3};
    use std::path::PathBuf;

    fn view_from(eye: Vec3) -> TrainingView {
        let camera = Camera::look_at(eye, Vec3::ZERO, Vec3::Z, 2.0 * 0.5f32.atan(), UVec2::splat(100));
        let (name, image) = (String::new(), PathBuf::new());
        TrainingView { name, camera, time: 0.0, original: camera.size, image, mask: None }
    }

    #[test]
    fn the_view_with_the_farthest_gaussians_determines_the_size() {
        let at = |y: f32| Gaussian {
            mean: [0.0, y, 0.0],
            mean_t: 0.0,
            velocity: [0.0; 3],
            sigma_t: 1.0,
            covariance: [1.0, 0.0, 0.0, 1.0, 0.0, 1.0],
            opacity: 0.5,
            padding: 0.0,
        };
        let scene = |gaussians| GaussianScene::from(RuntimeScene::sliced(gaussians, Harmonics::default()));
        let two = scene(vec![at(-1.0), at(1.0)]);
        let views = [view_from(Vec3::new(0.0, -4.0, 0.0)), view_from(Vec3::new(0.0, -9.0, 0.0))];
        // 100 pixels are as wide as the depth: 9 to the middle, and one to the far side.
        let found = trained_pixel(&two, &views).expect("Gaussians are in front of the views");
        assert!((found - 0.1).abs() < 1e-4, "{found}");
        assert_eq!(trained_pixel(&two, &[]), None, "without views");
        assert_eq!(trained_pixel(&scene(Vec::new()), &views), None, "without a scene");
    }
}
