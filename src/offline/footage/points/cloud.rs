//! The points of a take.
//!
//! In: cameras, the times of the moments, the masked pictures of each moment as they are needed, the points of what
//! stands, and what stands before the cameras. Out: [`TakePoints`]: points with colors, times and velocities. Pictures of
//! one moment are in memory at a time.

use super::backdrop::Backdrop;
use super::moving_hull::{Hull, Silhouette, Space};
use super::surface_points::MomentPoints;
use super::velocity::velocities;
use crate::offline::dataset::point_cloud::CloudPoint;
use crate::offline::work::{Interrupted, Progress, proceed};
use crate::view::Camera;
use glam::Vec3;
use image::{GrayImage, RgbImage};
use rayon::prelude::*;

/// Most points of a moment that velocities are found with, and most of all moments together, unless more points are
/// wanted.
const DENSE: usize = 16_384;
const MOST_DENSE: usize = 4_000_000;

/// The picture and the mask of a camera at a moment, both of the size of the camera's pictures.
pub(crate) struct Masked {
    /// The index of the camera.
    pub camera: usize,
    /// Without lens distortion.
    pub picture: RgbImage,
    /// The mask of what moves.
    pub mask: GrayImage,
}

/// The points to begin a training with.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct TakePoints {
    /// Moving points with their times and velocities, then standing ones without.
    pub points: Vec<CloudPoint>,
}

impl TakePoints {
    /// Joins moving and standing points; points that are not finite are left out.
    pub(crate) fn joined(moving: Vec<CloudPoint>, standing: Vec<CloudPoint>) -> Self {
        let standing = standing.into_iter().map(|point| CloudPoint { time: None, velocity: Vec3::ZERO, ..point });
        let mut points: Vec<CloudPoint> = moving.into_iter().chain(standing).collect();
        points.retain(|point| point.position.is_finite() && point.velocity.is_finite());
        Self { points }
    }
}

/// Returns at most so many points of all moments together, on the surfaces of what moves. `times` are those of the
/// moments, ascending; `load` returns the pictures of a moment; `agreeing` is the least share, of the cameras that show a
/// place, that must have it inside their masks. A camera shows no place behind its backdrop. Cameras that look at no
/// common place yield no points. Begins the task "points of the moments".
///
/// # Errors
/// Those of `load`; [`Interrupted`].
pub(crate) fn moving_points<E: From<Interrupted>>(
    (cameras, backdrops): (&[Camera], &[Backdrop]),
    times: &[f32],
    load: &mut dyn FnMut(usize) -> Result<Vec<Masked>, E>,
    (most, agreeing): (usize, f32),
    progress: &mut dyn Progress,
) -> Result<Vec<CloudPoint>, E> {
    let Some(space) = Space::of(cameras) else { return Ok(Vec::new()) };
    let before = |camera: &Camera| backdrops.iter().find(|backdrop| backdrop.camera == *camera);
    let rig: Vec<(&Camera, Option<&Backdrop>)> = cameras.iter().map(|camera| (camera, before(camera))).collect();
    let each = most / times.len().max(1);
    let dense = DENSE.min(MOST_DENSE / times.len().max(1)).max(each);
    let mut moments = Vec::with_capacity(times.len());
    progress.begin("points of the moments", times.len());
    for (index, &time) in times.iter().enumerate() {
        proceed(progress)?;
        moments.push(points_at((&rig, &space), load(index)?, time, (dense, agreeing)));
        progress.advance();
    }
    progress.finish();
    let beside = |index: usize| moments.get(index).filter(|moment| !moment.points.is_empty());
    let of_moment = |(index, moment): (usize, &MomentPoints)| {
        let before = index.checked_sub(1).and_then(beside);
        let velocities = velocities(before, moment, beside(index + 1));
        let point = |index: usize| {
            let point = &moment.points[index];
            let (color, time) = (Some(point.color), Some(moment.time));
            CloudPoint { position: point.position, color, time, velocity: velocities[index] }
        };
        moment.fewer(each).into_iter().map(point).collect::<Vec<CloudPoint>>()
    };
    Ok(moments.par_iter().enumerate().map(of_moment).collect::<Vec<_>>().concat())
}

/// Returns the points of a moment. Pictures of a wrong size, or of no camera, are left out.
fn points_at(
    (rig, space): (&[(&Camera, Option<&Backdrop>)], &Space),
    masked: Vec<Masked>,
    time: f32,
    (most, agreeing): (usize, f32),
) -> MomentPoints {
    let silhouette = |Masked { camera, picture, mask }: Masked| {
        let &(camera, backdrop) = rig.get(camera)?;
        let silhouette = Silhouette::new(camera, &mask, backdrop)?;
        (picture.dimensions() == mask.dimensions()).then_some((silhouette, picture))
    };
    let pictures: Vec<(Silhouette<'_>, RgbImage)> = masked.into_par_iter().filter_map(silhouette).collect();
    let hull = Hull::of(pictures.iter().map(|(silhouette, _)| silhouette), space, agreeing);
    MomentPoints::of(hull, &pictures, time, most)
}

#[cfg(test)]
mod tests {
    use super::super::fixture::{cameras, mask};
    use super::*;
    use crate::offline::work::NoProgress;
    use image::Rgb;

    #[test]
    fn a_ball_that_flies_has_its_place_color_and_velocity_at_every_moment() {
        let cameras = cameras(12);
        let times = [0.0, 0.5, 1.0, 1.5];
        // Four pixels from moment to moment.
        let center = |time: f32| Vec3::new(0.12 * time - 0.1, 0.0, 0.1);
        let mut load = |moment: usize| -> Result<Vec<Masked>, Interrupted> {
            let shown = |(index, camera): (usize, &Camera)| {
                let picture = RgbImage::from_pixel(camera.size.x, camera.size.y, Rgb([255, 128, 0]));
                Masked { camera: index, picture, mask: mask(camera, &[(center(times[moment]), 0.1)]) }
            };
            Ok(cameras.iter().enumerate().map(shown).collect())
        };
        let points =
            moving_points((&cameras, &[]), &times, &mut load, (400, 0.9), &mut NoProgress).expect("nobody interrupts");
        assert!((200..=400).contains(&points.len()), "at most as many as allowed: {}", points.len());
        for time in times {
            let own: Vec<&CloudPoint> = points.iter().filter(|point| point.time == Some(time)).collect();
            assert!(own.len() >= 50, "every moment has points: {} at {time}", own.len());
            let mean = own.iter().map(|point| point.position).sum::<Vec3>() / own.len() as f32;
            assert!(mean.distance(center(time)) < 0.04, "the place of the ball at {time}: {mean}");
            let velocity = own.iter().map(|point| point.velocity).sum::<Vec3>() / own.len() as f32;
            assert!(velocity.distance(Vec3::X * 0.12) < 0.05, "its velocity at {time}: {velocity}");
            assert!(own.iter().all(|point| point.color == Some(Vec3::new(1.0, 128.0 / 255.0, 0.0))), "its color");
        }
        let joined = TakePoints::joined(points.clone(), points[..10].to_vec());
        assert_eq!(joined.points.len(), points.len() + 10, "all points");
        assert!(joined.points.iter().rev().take(10).all(|point| point.time.is_none()), "the last ones stand");
    }
}
