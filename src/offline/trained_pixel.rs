//! The size of the pixels that a capture was trained with.
//!
//! In: a scene, the views it was trained on. Out: the size of a pixel of these views at the far side of the scene's core, beyond which
//! pictures are anti-aliased.

use super::dataset::TrainingView;
use crate::scene::{Bounds, RuntimeScene};
use crate::view::RasterFov;

/// Returns the largest size, in capture units, that a pixel of the training views has at the far side of the core of a scene
/// ([`Bounds::core`]), so that no training view of it has larger ones; `None` without Gaussians, or if no view looks at the scene.
pub fn trained_pixel(scene: &RuntimeScene, views: &[TrainingView]) -> Option<f32> {
    let core = Bounds::core(scene.iter())?;
    let size_in = |view: &TrainingView| {
        let view = view.camera.view(view.time, RasterFov::Corrected);
        let depth = view.world_to_camera.transform_point3(core.center()).z + core.radius();
        depth / view.focal().min_element()
    };
    let sizes = views.iter().map(size_in).filter(|pixel| pixel.is_finite() && *pixel > 0.0);
    sizes.reduce(f32::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gaussian::Gaussian;
    use crate::gaussian::Harmonics;
    use crate::view::Camera;
    use glam::{UVec2, Vec3};
    use std::path::PathBuf;

    fn view_from(eye: Vec3) -> TrainingView {
        let camera = Camera::look_at(eye, Vec3::ZERO, Vec3::Z, 2.0 * 0.5f32.atan(), UVec2::splat(100));
        let (name, image) = (String::new(), PathBuf::new());
        TrainingView { name, camera, time: 0.0, original: camera.size, image, mask: None }
    }

    #[test]
    fn the_farthest_view_tells_the_size() {
        let at = |x: f32| Gaussian {
            mean: [x, 0.0, 0.0],
            mean_t: 0.0,
            velocity: [0.0; 3],
            sigma_t: 1.0,
            covariance: [1.0, 0.0, 0.0, 1.0, 0.0, 1.0],
            opacity: 0.5,
            padding: 0.0,
        };
        let scene = RuntimeScene::sliced(vec![at(-1.0), at(1.0)], Harmonics::default());
        let views = [view_from(Vec3::new(0.0, -4.0, 0.0)), view_from(Vec3::new(0.0, -9.0, 0.0))];
        // 100 pixels are as wide as the depth: 9 to the middle, and one to the far side.
        let found = trained_pixel(&scene, &views).expect("they look at it");
        assert!((found - 0.1).abs() < 1e-4, "{found}");
        assert_eq!(trained_pixel(&scene, &[]), None, "without views");
        assert_eq!(
            trained_pixel(&RuntimeScene::sliced(Vec::new(), Harmonics::default()), &views),
            None,
            "without a scene"
        );
    }
}
