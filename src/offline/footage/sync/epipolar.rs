//! Motion in corresponding strips of two cameras.
//!
//! In: cameras that stand still, and their pictures over time. Out: what changes in the pictures, and for two cameras
//! the [`Motion`] in the strips between the planes of a pencil through both. A point is always in the same strip of
//! both pictures, so that the strips move alike, whereas the whole pictures do not: a leg that swings across one
//! picture swings towards the other camera.

use super::motion::Motion;
use crate::offline::dataset::DatasetError;
use crate::view::{Camera, RasterFov};
use glam::{UVec2, Vec3};
use image::{GrayImage, RgbImage, imageops};

/// Longer side of the pictures that are compared, pixels.
pub(crate) const SIDE: u32 = 160;
/// Most pictures of a camera.
pub(crate) const MOST: usize = 600;
/// Strips of a pencil.
const STRIPS: usize = 32;
/// Noise that is subtracted from changes, in sixteenths of a step of 255.
const NOISE: u32 = 24;
/// Changes are stored in so many sixteenths.
const UNIT: u32 = 8;
/// Least angle of the pencil that both cameras see, radians.
const LEAST: f32 = 0.02;
/// Length across the axis from which the sum of the directions of two cameras is not parallel to it.
const PARALLEL: f32 = 1e-3;

/// What changes from each picture of a camera to the next.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Changes {
    /// The camera, at the size of the pictures that are compared.
    pub camera: Camera,
    /// The times in the middle between two pictures.
    pub times: Vec<f32>,
    /// The changes of all pixels, one picture after the other.
    changes: Vec<u8>,
}

impl Changes {
    /// Finds the changes between the first [`MOST`] pictures, whose times ascend. The camera has the size at which they
    /// are compared, of at most [`SIDE`] pixels.
    ///
    /// # Errors
    /// The first of a picture.
    pub(crate) fn of(
        camera: Camera,
        pictures: impl Iterator<Item = Result<(f32, RgbImage), DatasetError>>,
    ) -> Result<Self, DatasetError> {
        let mut found = Self { camera, times: Vec::new(), changes: Vec::new() };
        let mut previous: Option<(f32, GrayImage)> = None;
        for picture in pictures.take(MOST) {
            let (time, picture) = picture?;
            let gray = imageops::grayscale(&imageops::thumbnail(&picture, camera.size.x, camera.size.y));
            if let Some((before, earlier)) = previous.filter(|(before, _)| *before < time) {
                found.times.push(before.midpoint(time));
                found.changes.extend(changes(&earlier, &gray, camera.size));
            }
            previous = Some((time, gray));
        }
        Ok(found)
    }

    /// Returns the motion in strips, of which each pixel has one or none.
    fn motion(&self, strips: &[Option<usize>]) -> Motion {
        let mut motion = Motion { times: self.times.clone(), strips: vec![Vec::new(); STRIPS] };
        for picture in self.changes.chunks_exact(strips.len().max(1)) {
            let mut sums = [0_u32; STRIPS];
            for (&change, strip) in picture.iter().zip(strips) {
                if let Some(strip) = *strip {
                    sums[strip] += u32::from(change);
                }
            }
            motion.strips.iter_mut().zip(sums).for_each(|(strip, sum)| strip.push(sum as f32));
        }
        motion
    }
}

/// Returns the motion of two cameras in corresponding strips; `None` if the cameras are at one place, or the planes
/// that they see are not the same.
pub(crate) fn motions(a: &Changes, b: &Changes) -> Option<[Motion; 2]> {
    let [rays_a, rays_b] = [a, b].map(|changes| rays(&changes.camera));
    let places = [a, b].map(|changes| changes.camera.world_to_camera.inverse().w_axis.truncate());
    let axis = (places[1] - places[0]).try_normalize()?;
    // Angles are from the plane through the directions of both cameras, so that they do not wrap around inside.
    let ahead: Vec3 = [a, b].into_iter().map(|changes| middle(&changes.camera)).sum();
    let across = Some(ahead.reject_from_normalized(axis)).filter(|across| across.length() > PARALLEL);
    let zero = across.map_or_else(|| axis.any_orthonormal_vector(), Vec3::normalize);
    let side = axis.cross(zero);
    let angles = |rays: &[Vec3]| -> Vec<f32> { rays.iter().map(|ray| ray.dot(side).atan2(ray.dot(zero))).collect() };
    let (angles_a, angles_b) = (angles(&rays_a), angles(&rays_b));
    let least = |angles: &[f32]| angles.iter().copied().fold(f32::INFINITY, f32::min);
    let most = |angles: &[f32]| angles.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    let low = least(&angles_a).max(least(&angles_b));
    let width = most(&angles_a).min(most(&angles_b)) - low;
    if !(LEAST..f32::INFINITY).contains(&width) {
        return None;
    }
    let strip = |&angle: &f32| {
        let strip = ((angle - low) / width * STRIPS as f32).floor();
        (0.0..STRIPS as f32).contains(&strip).then_some(strip as usize)
    };
    let strips = |angles: &[f32]| -> Vec<Option<usize>> { angles.iter().map(strip).collect() };
    Some([a.motion(&strips(&angles_a)), b.motion(&strips(&angles_b))])
}

/// Returns the directions of all pixels, row by row, world space.
fn rays(camera: &Camera) -> Vec<Vec3> {
    let view = camera.view(0.0, RasterFov::Corrected);
    let UVec2 { x: width, y: height } = camera.size;
    (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| view.ray(x, y)).collect()
}

/// Returns the direction of the pixel in the middle, world space.
fn middle(camera: &Camera) -> Vec3 {
    camera.view(0.0, RasterFov::Corrected).ray(camera.size.x / 2, camera.size.y / 2)
}

/// Returns the absolute differences of two pictures that are blurred over 3 pixels, without noise.
fn changes(earlier: &GrayImage, later: &GrayImage, size: UVec2) -> Vec<u8> {
    let difference = |x: u32, y: u32| i32::from(later.get_pixel(x, y).0[0]) - i32::from(earlier.get_pixel(x, y).0[0]);
    let near = |at: u32, most: u32| [(at.saturating_sub(1), 1), (at, 2), ((at + 1).min(most - 1), 1)];
    let change = |(x, y): (u32, u32)| {
        let row = |(y, weight): (u32, i32)| {
            let blurred: i32 = near(x, size.x).map(|(x, weight)| weight * difference(x, y)).into_iter().sum();
            weight * blurred
        };
        let blurred: i32 = near(y, size.y).map(row).into_iter().sum();
        (blurred.unsigned_abs().saturating_sub(NOISE) / UNIT).min(255) as u8
    };
    (0..size.y).flat_map(|y| (0..size.x).map(move |x| (x, y))).map(change).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Rgb;

    /// Returns a camera that looks at the origin, and its pictures of a small thing that is at this height in time.
    fn filmed(eye: Vec3, height: impl Fn(f32) -> f32) -> Changes {
        let camera = Camera::look_at(eye, Vec3::ZERO, Vec3::Z, 0.8, UVec2::new(120, 160));
        let [x, y] = camera.view(0.0, RasterFov::Corrected).clip_rows();
        let picture = |frame: u32| {
            let time = frame as f32;
            let thing = Vec3::new(0.3, -0.2, height(time)).extend(1.0);
            let depth = camera.world_to_camera.row(2).dot(thing);
            let at = (glam::Vec2::new(x.dot(thing), y.dot(thing)) / depth + 1.0) * 0.5 * camera.size.as_vec2();
            let shade = |x: u32, y: u32| {
                let far = (glam::Vec2::new(x as f32 + 0.5, y as f32 + 0.5) - at).length();
                Rgb([if far < 6.0 { 250 } else { 30 }; 3])
            };
            Ok((time, RgbImage::from_fn(camera.size.x, camera.size.y, shade)))
        };
        Changes::of(camera, (0..4).map(picture)).expect("no picture fails")
    }

    /// Returns the mean strip of the motion at each time.
    fn means(motion: &Motion) -> Vec<f32> {
        let mean = |at: usize| {
            let amounts = motion.strips.iter().map(|strip| strip[at]);
            let sum: f32 = amounts.clone().sum();
            amounts.enumerate().map(|(strip, amount)| strip as f32 * amount).sum::<f32>() / sum
        };
        (0..motion.times.len()).map(mean).collect()
    }

    #[test]
    fn a_thing_is_in_the_same_strip_of_both_cameras() {
        let height = |time: f32| 0.25 * time - 0.4;
        let [a, b] = [Vec3::new(3.0, 0.5, 0.5), Vec3::new(-0.5, 3.5, 0.9)].map(|eye| filmed(eye, height));
        let [a, b] = motions(&a, &b).expect("both see the origin");
        assert_eq!(a.times, [0.5, 1.5, 2.5], "between the pictures");
        let (a, b) = (means(&a), means(&b));
        assert!(a.windows(2).all(|pair| (pair[0] - pair[1]).abs() > 1.0), "it moves through the strips: {a:?}");
        for (a, b) in a.iter().zip(&b) {
            assert!((a - b).abs() < 0.75, "strips {a} and {b}");
        }
    }

    #[test]
    fn cameras_at_one_place_have_no_pencil() {
        let [a, b] = [0.0, 1.0].map(|height| filmed(Vec3::new(3.0, 0.0, 0.0), move |_| height));
        assert!(a.changes.iter().all(|&change| change == 0), "what stands still is no change");
        assert_eq!(motions(&a, &b), None, "no axis");
    }
}
