//! Whether the views of a dataset see the points beside it.
//!
//! In: points, training views. Out: whether they are points of what the views show. Points that a converter placed at
//! random around the origin may be far from it, and no Gaussian that begins there ever moves as far.

use crate::offline::dataset::TrainingView;
use crate::offline::dataset::point_cloud::PointCloud;
use crate::offline::dataset::selection::distinct_cameras;
use crate::view::{RasterFov, View};
use glam::Vec3;

/// Least share of the points that half of the cameras see.
const SEEN: f64 = 0.01;
/// Most points that are looked at.
const MOST: usize = 10_000;

/// Returns whether half of the cameras see at least a hundredth of the points.
pub(crate) fn are_seen(cloud: &PointCloud, views: &[TrainingView]) -> bool {
    let PointCloud(points) = cloud;
    let step = points.len().div_ceil(MOST).max(1);
    let share = |view: &View| {
        let seen = points.iter().step_by(step).filter(|point| sees(view, point.position)).count();
        seen as f64 / points.len().div_ceil(step) as f64
    };
    let views = distinct_cameras(views).into_iter().map(|camera| camera.view(0.0, RasterFov::Corrected));
    let mut shares: Vec<f64> = views.map(|view| share(&view)).collect();
    shares.sort_unstable_by(f64::total_cmp);
    shares.get(shares.len() / 2).is_none_or(|&share| share >= SEEN)
}

/// Returns whether a point is in the picture of a view.
fn sees(view: &View, point: Vec3) -> bool {
    let at = view.world_to_camera.transform_point3(point);
    let [across, down, offset_x, offset_y] = view.projection.to_array();
    let ndc = [across * at.x / at.z + offset_x, down * at.y / at.z + offset_y];
    at.z > view.near && ndc.iter().all(|side| side.abs() <= 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::offline::dataset::point_cloud::CloudPoint;
    use crate::view::Camera;
    use glam::UVec2;

    #[test]
    fn points_between_the_cameras_are_not_of_the_scene() {
        let view = |index: usize| {
            let eye = Vec3::X * index as f32;
            let camera = Camera::look_at(eye, Vec3::Y * 50.0, Vec3::Z, 0.7, UVec2::splat(8));
            let (name, image) = (index.to_string(), "none.png".into());
            TrainingView {
                name,
                camera,
                time: 0.0,
                original: camera.size,
                image,
                mask: None,
                correction: Default::default(),
            }
        };
        let views: Vec<_> = (0..5).map(view).collect();
        let around = |center: Vec3| {
            let point = |index: usize| CloudPoint {
                position: center
                    + Vec3::new((index as f32).sin(), (3.0 * index as f32).sin(), (7.0 * index as f32).sin()),
                color: None,
                time: None,
                velocity: Vec3::ZERO,
            };
            PointCloud((0..300).map(point).collect())
        };
        assert!(are_seen(&around(Vec3::Y * 50.0), &views), "what the cameras look at");
        assert!(!are_seen(&around(Vec3::X * 2.0 - Vec3::Y), &views), "between and behind the cameras");
    }
}
