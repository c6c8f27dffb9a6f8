//! Depths of a picture that its neighbors agree with, as points.
//!
//! In: pictures of one moment, or plates of what stands, with their cameras. Out: [`Standing`]: colored points, and what
//! stands before each camera. For known pixels of every picture, the depth at which the pictures of the nearest cameras
//! correlate best is kept if it is distinct, and if the depths of another picture agree. Pixels between them, such as
//! those of a plain wall, get the mean of the depths around them: a Gaussian that begins near its wall finds it, and none
//! hangs as fog before a camera.

use super::backdrop::Backdrop;
use super::filling::filled;
use super::patch::GrayView;
use crate::offline::dataset::point_cloud::CloudPoint;
use crate::offline::train::start::region::Region;
use crate::offline::work::{Interrupted, Progress, proceed};
use crate::view::{Camera, RasterFov, View};
use glam::{UVec2, Vec2, Vec3};
use image::{GrayImage, RgbImage};
use rayon::prelude::*;

/// Depths that are tried, and nearest and farthest, in median distances of the cameras from their common center.
const DEPTHS: usize = 128;
const NEAR: f32 = 0.2;
const FAR: f32 = 10.0;
/// Least distance between pixels that are tried, and most of these in a picture.
const STEP: u32 = 4;
const MOST_PIXELS: f32 = 20_000.0;
/// Most neighbors of a picture, the number of them that must agree, and their largest angle (radians).
const NEIGHBORS: usize = 4;
const AGREEING: usize = 2;
const ANGLE: f32 = 0.79;
/// Least correlation.
const CORRELATION: f32 = 0.7;
/// Largest ratio of the lack of correlation to that of the best depth elsewhere, and steps that are not elsewhere.
const DISTINCT: f32 = 0.8;
const BESIDE: usize = 3;
/// Largest difference of depths that agree, as a share.
const TOLERANCE: f32 = 0.04;
/// Of so many pixels that get the mean of depths around them, one becomes a point.
const OF_FILLED: usize = 3;
/// Confidence from which a pixel is known.
const KNOWN: u8 = 128;

/// A picture with its camera.
pub(crate) struct Plate {
    /// Without lens distortion.
    pub camera: Camera,
    /// Of the size of the camera's pictures, else it is left out.
    pub picture: RgbImage,
    /// Of the same size: from 128 on, a pixel is known.
    pub confidence: GrayImage,
}

/// What stands.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Standing {
    /// Points without times.
    pub points: Vec<CloudPoint>,
    /// What stands before the cameras whose pictures show it.
    pub backdrops: Vec<Backdrop>,
}

/// Returns what the pictures show, with at most so many points. Begins the task "sweeping depths".
///
/// # Errors
/// [`Interrupted`].
pub(crate) fn standing(plates: &[Plate], most: usize, progress: &mut dyn Progress) -> Result<Standing, Interrupted> {
    let (views, shown): (Vec<GrayView>, Vec<&Plate>) =
        plates.iter().filter_map(|plate| Some((GrayView::new(&plate.camera, &plate.picture)?, plate))).unzip();
    let Some((center, distance)) = subject(plates) else { return Ok(Standing::default()) };
    let depths: Vec<f32> = (0..DEPTHS)
        .map(|index| {
            let share = index as f32 / (DEPTHS - 1) as f32;
            distance / (1.0 / FAR + share * (1.0 / NEAR - 1.0 / FAR))
        })
        .collect();
    let near: Vec<Vec<usize>> = (0..views.len()).map(|index| neighbors(&views, index, center)).collect();
    progress.begin("sweeping depths", views.len());
    let mut maps = Vec::with_capacity(views.len());
    for ((view, plate), near) in views.iter().zip(&shown).zip(&near) {
        proceed(progress)?;
        let others: Vec<&GrayView> = near.iter().map(|&index| &views[index]).collect();
        maps.push(DepthMap::of(view, &plate.confidence, &others, &depths));
        progress.advance();
    }
    progress.finish();
    let (mut points, mut between, mut backdrops) = (Vec::new(), Vec::new(), Vec::new());
    for (index, (map, plate)) in maps.iter().zip(shown).enumerate() {
        let beside = near[index].iter().map(|&other| (&views[other], &maps[other]));
        let agreed = map.agreed(&views[index], &beside.collect::<Vec<_>>());
        let others = filled(&agreed, map.size);
        points.extend(map.points(&views[index], plate, &agreed, 1));
        between.extend(map.points(&views[index], plate, &others, OF_FILLED));
        // A cell has a depth of its own or one that is filled, never both.
        let both: Vec<f32> = agreed.iter().zip(&others).map(|(own, filled)| own + filled).collect();
        backdrops.push(Backdrop::new(plate.camera, map.step, map.size, &both));
    }
    points.extend(between);
    let count = points.len();
    let is_chosen = |index: usize| count <= most || index * most / count != (index + 1) * most / count;
    let points =
        points.into_iter().enumerate().filter(|(index, _)| is_chosen(*index)).map(|(_, point)| point).collect();
    Ok(Standing { points, backdrops })
}

/// Returns the place that the cameras look at, and their median distance from it, world space; `None` without one.
fn subject(plates: &[Plate]) -> Option<(Vec3, f32)> {
    let views: Vec<View> = plates.iter().map(|plate| plate.camera.view(0.0, RasterFov::Corrected)).collect();
    let center = Region::of(views.iter()).ok()?.center;
    let mut distances: Vec<f32> = views.iter().map(|view| view.camera_position.distance(center)).collect();
    distances.sort_unstable_by(f32::total_cmp);
    let distance = *distances.get(distances.len() / 2)?;
    (distance > 0.0 && distance.is_finite()).then_some((center, distance))
}

/// Returns the views whose cameras are nearest in angle to one, as the center sees them, the nearest first.
fn neighbors(views: &[GrayView], index: usize, center: Vec3) -> Vec<usize> {
    let direction = |view: &GrayView| (view.projection.eye - center).normalize_or_zero();
    let own = direction(&views[index]);
    let angle = |other: usize| direction(&views[other]).dot(own).clamp(-1.0, 1.0).acos();
    let is_apart = |other: usize| views[other].projection.eye != views[index].projection.eye;
    let mut found: Vec<(f32, usize)> =
        (0..views.len()).filter(|&other| is_apart(other)).map(|other| (angle(other), other)).collect();
    found.retain(|(angle, _)| *angle < ANGLE);
    found.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    found.into_iter().take(NEIGHBORS).map(|(_, other)| other).collect()
}

/// Returns whether a pixel of a plate is known.
fn is_known(confidence: &GrayImage, pixel: UVec2) -> bool {
    confidence.get_pixel_checked(pixel.x, pixel.y).is_some_and(|share| share.0[0] >= KNOWN)
}

/// The depths of pixels of a picture, `step` apart; 0 where there is none.
struct DepthMap {
    step: u32,
    size: UVec2,
    depths: Vec<f32>,
}

impl DepthMap {
    /// Returns the depths of the known pixels of a picture that other pictures agree on.
    fn of(view: &GrayView, confidence: &GrayImage, others: &[&GrayView], depths: &[f32]) -> Self {
        let pixels = view.projection.size.as_vec2().element_product();
        let step = STEP.max((pixels / MOST_PIXELS).sqrt().ceil() as u32);
        let size = view.projection.size / step;
        let of = |index: u32| {
            let at = middle(index, size.x, step);
            if is_known(confidence, at.as_uvec2()) { depth(view, others, depths, at).unwrap_or(0.0) } else { 0.0 }
        };
        Self { step, size, depths: (0..size.element_product()).into_par_iter().map(of).collect() }
    }

    /// Returns the depths that those of another picture agree with; 0 where none does.
    fn agreed(&self, view: &GrayView, others: &[(&GrayView, &Self)]) -> Vec<f32> {
        let depth = |index: u32| {
            let depth = self.depths[index as usize];
            let place = view.projection.place(middle(index, self.size.x, self.step), depth);
            let agrees = |(other, map): &(&GrayView, &Self)| {
                other.projection.pixel(place).is_some_and(|(pixel, depth)| map.has(pixel, depth))
            };
            if depth > 0.0 && others.iter().any(agrees) { depth } else { 0.0 }
        };
        (0..self.size.element_product()).into_par_iter().map(depth).collect()
    }

    /// Returns the points at these depths of the known pixels, one of every `step`.
    fn points(&self, view: &GrayView, plate: &Plate, depths: &[f32], step: usize) -> Vec<CloudPoint> {
        let point = |index: usize| {
            let at = middle(index as u32, self.size.x, self.step);
            let pixel = at.as_uvec2();
            if depths[index] <= 0.0 || !is_known(&plate.confidence, pixel) {
                return None;
            }
            let color = plate.picture.get_pixel(pixel.x, pixel.y).0.map(|value| f32::from(value) / 255.0);
            let position = view.projection.place(at, depths[index]);
            Some(CloudPoint { position, color: Some(Vec3::from(color)), time: None, velocity: Vec3::ZERO })
        };
        (0..depths.len()).step_by(step).filter_map(point).collect()
    }

    /// Returns whether a depth at or beside a pixel is nearly this.
    fn has(&self, pixel: Vec2, depth: f32) -> bool {
        let middle = (pixel / self.step as f32).floor().as_ivec2();
        let size = self.size.as_ivec2();
        let is_near = |x: i32, y: i32| {
            let is_inside = x >= 0 && y >= 0 && x < size.x && y < size.y;
            is_inside && (self.depths[(y * size.x + x) as usize] / depth - 1.0).abs() <= TOLERANCE
        };
        let beside = |middle: i32| middle.saturating_sub(1)..=middle.saturating_add(1);
        beside(middle.y).any(|y| beside(middle.x).any(|x| is_near(x, y)))
    }
}

/// Returns the middle of a cell of a map, pixels of the picture.
fn middle(index: u32, width: u32, step: u32) -> Vec2 {
    let cell = UVec2::new(index % width, index / width);
    (cell * step + step / 2).as_vec2() + 0.5
}

/// Returns the depth of a pixel, refined between the depths that are tried; `None` if no depth is distinct.
fn depth(view: &GrayView, others: &[&GrayView], depths: &[f32], at: Vec2) -> Option<f32> {
    let patch = view.patch(at)?;
    let needed = AGREEING.min(others.len()).max(1);
    let score = |&depth: &f32| {
        let mut found = [-1.0f32; NEIGHBORS];
        for (found, other) in found.iter_mut().zip(others) {
            *found = view.correlation(&patch, at, depth, other).unwrap_or(-1.0);
        }
        found.sort_unstable_by(|a, b| b.total_cmp(a));
        found[..needed].iter().sum::<f32>() / needed as f32
    };
    let scores: Vec<f32> = depths.iter().map(score).collect();
    let (best, &highest) = scores.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1))?;
    let elsewhere = scores.iter().enumerate().filter(|(index, _)| index.abs_diff(best) > BESIDE);
    let second = elsewhere.map(|(_, &score)| score).fold(-1.0, f32::max);
    if highest < CORRELATION || 1.0 - highest > DISTINCT * (1.0 - second) {
        return None;
    }
    // The vertex of the parabola through three scores, in equal steps of inverse depth.
    let inverse = depths[best].recip();
    let before = best.checked_sub(1)?;
    let (below, above) = (scores[before], *scores.get(best + 1)?);
    let curvature = below - 2.0 * highest + above;
    let offset = if curvature < 0.0 { (0.5 * (below - above) / curvature).clamp(-0.5, 0.5) } else { 0.0 };
    Some((inverse + offset * (inverse - depths[before].recip())).recip())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::offline::work::NoProgress;
    use crate::scene::random::Random;
    use image::{Luma, Rgb};
    use std::f32::consts::TAU;

    /// Returns a value of a random pattern at a place, 0 to 255.
    fn pattern(at: Vec3) -> u8 {
        let mut random = Random::new(7);
        let mut wave = || {
            let direction = Vec3::from([(); 3].map(|()| random.in_range(-24.0, 24.0)));
            (direction.dot(at) + random.in_range(0.0, TAU)).sin()
        };
        (128.0 + 25.0 * (0..12).map(|_| wave()).sum::<f32>()) as u8
    }

    /// Returns what a camera shows of a patterned sphere of radius 1 before nothing.
    fn plate(index: usize) -> Plate {
        let angle = 0.25 * index as f32;
        let eye = Vec3::new(4.0 * angle.cos(), 4.0 * angle.sin(), 0.3 * (index % 2) as f32);
        let camera = Camera::look_at(eye, Vec3::ZERO, Vec3::Z, 0.7, UVec2::new(96, 80));
        let view = camera.view(0.0, RasterFov::Corrected);
        let picture = RgbImage::from_fn(96, 80, |x, y| {
            let ray = view.ray(x, y);
            let along = ray.dot(eye);
            let root = along * along - eye.length_squared() + 1.0;
            if root < 0.0 {
                return Rgb([30; 3]);
            }
            Rgb([pattern(eye + ray * (-along - root.sqrt())), 100, 100])
        });
        Plate { camera, picture, confidence: GrayImage::from_pixel(96, 80, Luma([KNOWN])) }
    }

    #[test]
    fn a_sphere_is_found_by_the_depths_that_agree() {
        let plates: Vec<Plate> = (0..6).map(plate).collect();
        let Standing { points, backdrops } = standing(&plates, 400, &mut NoProgress).expect("nobody interrupts");
        assert!(points.len() > 40, "many points: {}", points.len());
        assert!(points.len() <= 400, "at most as many as allowed: {}", points.len());
        let near = points.iter().filter(|point| (point.position.length() - 1.0).abs() < 0.1).count();
        // Those between and beside the depths that are found are near it.
        assert!(near * 10 > points.len() * 7, "{near} of {} are on the sphere", points.len());
        let beside = points.iter().filter(|point| (point.position.length() - 1.0).abs() < 0.5).count();
        assert!(beside * 10 > points.len() * 9, "{beside} of {} are near the sphere", points.len());
        assert!(points.iter().all(|point| point.time.is_none()), "they stand");
        assert_eq!(backdrops.len(), plates.len(), "what stands before each camera");
        for backdrop in &backdrops {
            let pixel = UVec2::new(48, 40);
            assert!(
                backdrop.hides(pixel, 4.0) && !backdrop.hides(pixel, 2.5),
                "its center is hidden, what is before not"
            );
        }
    }

    #[test]
    fn what_is_not_known_has_no_points() {
        let unknown = |index: usize| Plate { confidence: GrayImage::new(96, 80), ..plate(index) };
        let plates: Vec<Plate> = (0..6).map(unknown).collect();
        let found = standing(&plates, 400, &mut NoProgress).expect("nobody interrupts");
        assert_eq!(found.points, [], "nothing is known");
        assert!(!found.backdrops.iter().any(|backdrop| backdrop.hides(UVec2::new(48, 40), 9.0)), "nothing hides");
    }

    #[test]
    fn pictures_without_structure_have_no_points() {
        let plain = |index: usize| Plate { picture: RgbImage::new(96, 80), ..plate(index) };
        let plates: Vec<Plate> = (0..4).map(plain).collect();
        let found = standing(&plates, 400, &mut NoProgress).expect("nobody interrupts");
        assert_eq!(found.points, [], "no structure");
    }
}
