//! The size of the pixels of a capture's training views.
//!
//! In: a scene, its training views. Out: the largest size that a pixel of these views has at the Gaussians of the
//! scene. Pictures with larger pixels are anti-aliased.

use super::TrainingView;
use crate::scene::GaussianScene;
use crate::view::{Optics, RasterFov, View};
use glam::Vec3;
use rayon::prelude::*;

/// In each view, one in this many Gaussians may be farther away: these are outliers.
const STRAYS: usize = 100;

/// Returns the largest size, in capture units, that a pixel of the training views has at the Gaussians of a scene,
/// except the farthest hundredth in each view. Training views are therefore drawn without anti-aliasing. Views without
/// a Gaussian in their picture are left out; `None` if no view is left.
pub(crate) fn trained_pixel(scene: &GaussianScene, views: &[TrainingView]) -> Option<f32> {
    let means = scene.form.means();
    let optics = Optics { raster_fov: RasterFov::Corrected, ..scene.trained_with.optics() };
    let size_in = |view: &TrainingView| {
        let view = view.camera.view(view.time, optics);
        if !shows_any(&view, &means) {
            return None;
        }
        let depths = means.iter().map(|&mean| view.world_to_camera.transform_point3(mean.into()).z);
        let mut depths: Vec<f32> = depths.filter(|&depth| depth > view.near).collect();
        let farthest = depths.len().checked_sub(1 + depths.len() / STRAYS)?;
        let (_, depth, _) = depths.select_nth_unstable_by(farthest, f32::total_cmp);
        Some(*depth / view.focal().min_element())
    };
    let sizes = views.par_iter().filter_map(size_in).filter(|pixel| pixel.is_finite() && *pixel > 0.0);
    sizes.reduce_with(f32::max)
}

/// Returns whether one of these means is in the picture of a view.
fn shows_any(view: &View, means: &[[f32; 3]]) -> bool {
    let [row_x, row_y] = view.clip_rows();
    means.iter().any(|&mean| {
        let point = Vec3::from(mean);
        let depth = view.world_to_camera.transform_point3(point).z;
        let point = point.extend(1.0);
        depth > view.near && row_x.dot(point).abs() <= depth && row_y.dot(point).abs() <= depth
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gaussian::{Gaussian, Harmonics};
    use crate::scene::RuntimeScene;
    use crate::view::Camera;
    use glam::UVec2;
    use std::path::PathBuf;

    fn view_from(eye: Vec3, target: Vec3) -> TrainingView {
        let camera = Camera::look_at(eye, target, Vec3::Z, 2.0 * 0.5f32.atan(), UVec2::splat(100));
        let (name, image) = (String::new(), PathBuf::new());
        let correction = Default::default();
        TrainingView { name, camera, time: 0.0, original: camera.size, image, mask: None, correction }
    }

    #[test]
    fn the_size_is_that_in_the_farthest_view_that_shows_the_scene() {
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
        let eye = |y: f32| Vec3::new(0.0, y, 0.0);
        let mut views = vec![view_from(eye(-4.0), Vec3::ZERO), view_from(eye(-9.0), Vec3::ZERO)];
        // 100 pixels are as wide as the depth: 9 to the center, and 1 more to the far Gaussian.
        let found = trained_pixel(&two, &views).expect("both views show the scene");
        assert!((found - 0.1).abs() < 1e-4, "the size in the farther view is 0.1 units: {found}");
        // In the first view, both Gaussians are in front of the camera, but outside the picture. In the second, they
        // are behind the camera.
        let away = [view_from(eye(-90.0), Vec3::new(90.0, -89.0, 0.0)), view_from(eye(-90.0), eye(-91.0))];
        assert_eq!(trained_pixel(&two, &away), None, "no size without a Gaussian in a picture");
        views.extend(away);
        assert_eq!(trained_pixel(&two, &views), Some(found), "views that show no Gaussian do not change the size");
        assert_eq!(trained_pixel(&two, &[]), None, "no size without views");
        assert_eq!(trained_pixel(&scene(Vec::new()), &views), None, "no size without Gaussians");
    }
}
