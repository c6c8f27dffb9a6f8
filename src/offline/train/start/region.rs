//! The box that the cameras of a dataset look at.
//!
//! In: views. Out: [`Region`]: a cube around the point that is closest to the axes of all cameras, as large as the
//! pictures are there.

use super::error::StartError;
use crate::offline::dataset::cameras::axes::closest;
use crate::view::View;
use glam::{DVec3, Vec3};

/// Half the side of the cube, as a share of half the width of a picture at the center (1.3 of 1.44 in D-NeRF).
const SHARE: f64 = 0.9;
/// Below this determinant of the mean, axes are nearly parallel and have no closest point.
const PARALLEL: f64 = 1e-4;
/// Below this length of the mean, axes cancel out.
const OPPOSITE: f64 = 1e-3;
/// Distance of the center from the middle of parallel cameras, in distances of the farthest camera from that middle.
const AHEAD: f64 = 3.0;

/// A cube.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Region {
    pub center: Vec3,
    /// Half the side.
    pub half: f32,
}

impl Region {
    /// Returns the cube that these cameras look at.
    ///
    /// # Errors
    /// [`StartError::NoRegion`] if it is behind all of them.
    pub(crate) fn of<'a>(views: impl Iterator<Item = &'a View>) -> Result<Self, StartError> {
        let cameras: Vec<Ray> = views.map(Ray::of).collect();
        let count = cameras.len().max(1) as f64;
        let half_at = |center: DVec3| -> Option<f64> {
            let widths = cameras.iter().map(|ray| ray.direction.dot(center - ray.origin) * ray.tan);
            let mut widths: Vec<f64> = widths.collect();
            widths.sort_by(f64::total_cmp);
            widths.get(widths.len() / 2).map(|width| SHARE * width).filter(|half| half.is_finite() && *half > 0.0)
        };
        let crossing = closest(cameras.iter().map(|ray| (ray.origin, ray.direction)), PARALLEL);
        let crossing = crossing.and_then(|center| Some((center, half_at(center)?)));
        let ahead = || {
            let middle = cameras.iter().map(|ray| ray.origin).sum::<DVec3>() / count;
            let spread = cameras.iter().map(|ray| ray.origin.distance(middle)).fold(0.0, f64::max);
            let direction = cameras.iter().map(|ray| ray.direction).sum::<DVec3>() / count;
            // Directions that cancel out have no common one.
            let direction = (direction.length() > OPPOSITE).then(|| direction.normalize())?;
            let center = middle + direction * AHEAD * spread;
            Some((center, half_at(center)?))
        };
        let (center, half) = crossing.or_else(ahead).ok_or(StartError::NoRegion)?;
        Ok(Self { center: center.as_vec3(), half: half as f32 })
    }
}

/// The axis of a camera.
struct Ray {
    origin: DVec3,
    direction: DVec3,
    /// Tangent of half the smaller field of view.
    tan: f64,
}

impl Ray {
    fn of(view: &View) -> Self {
        let direction = view.world_to_camera.row(2).truncate().as_dvec3().normalize_or(DVec3::Z);
        let tan = f64::from(view.projection.x.max(view.projection.y)).recip();
        Self { origin: view.camera_position.as_dvec3(), direction, tan }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::view::{Camera, RasterFov};
    use glam::UVec2;

    fn view(eye: Vec3, target: Vec3) -> View {
        Camera::look_at(eye, target, Vec3::Z, 2.0 * 0.36f32.atan(), UVec2::splat(8)).view(0.0, RasterFov::Corrected)
    }

    #[test]
    fn cameras_around_a_place_look_at_it() {
        let center = Vec3::new(1.0, -2.0, 0.5);
        let eyes = (0..9).map(|i| Vec3::new((i as f32).cos(), (i as f32).sin(), 0.6).normalize() * 4.0);
        let views: Vec<View> = eyes.map(|eye| view(center + eye, center)).collect();
        let region = Region::of(views.iter()).expect("a region");
        assert!(region.center.distance(center) < 1e-3, "the center: {region:?}");
        assert!((region.half - 0.9 * 0.36 * 4.0).abs() < 1e-3, "as in D-NeRF, nearly 1.3: {region:?}");
    }

    #[test]
    fn parallel_cameras_look_ahead() {
        let views: Vec<View> = (-2..=2).map(|i| Vec3::X * i as f32).map(|eye| view(eye, eye + Vec3::Y)).collect();
        let region = Region::of(views.iter()).expect("a region");
        assert!(region.center.distance(Vec3::Y * 6.0) < 1e-3, "three times the spread of two ahead: {region:?}");
    }

    #[test]
    fn cameras_that_look_away_from_each_other_have_no_region() {
        let eyes = [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y];
        let views = eyes.map(|eye| view(eye, 2.0 * eye));
        assert_eq!(Region::of(views.iter()), Err(StartError::NoRegion), "the closest point is behind all");
    }
}
