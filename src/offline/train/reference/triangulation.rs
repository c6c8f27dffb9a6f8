//! Points in space at which several cameras of one moment have a peak of error.
//!
//! In: the views of a moment with their [`Peak`]s. Out: [`Sighted`] points. Two peaks of different views with similar
//! colors whose rays nearly meet give a candidate. It is kept if enough of the views that show its place have a peak
//! there with a similar color; the candidates with most such views come first, and each peak counts for one point.

use super::error_peaks::Peak;
use super::pinhole::Pinhole;
use crate::gaussian::outer::outer;
use crate::view::View;
use glam::{DMat3, DVec3, Vec3};
use rayon::prelude::*;

/// Largest distance between two rays that meet, pixels at their depth.
const MEETING: f32 = 1.5;
/// Largest distance between a point in a picture and a peak that it has, pixels.
const NEAR: f32 = 2.5;
/// Largest difference of a channel between similar colors.
const ALIKE: f32 = 0.2;
/// Least number of views with a peak, and least share of the views that show the place.
const FEWEST: usize = 3;
const SHARE: f64 = 0.4;
/// Least squared sine of the angle between two rays that give a point: two degrees.
const APART: f32 = 1.2e-3;

/// A view of a moment, with the peaks of its error.
#[derive(Debug, Clone)]
pub(crate) struct Sight {
    pub view: View,
    pub peaks: Vec<Peak>,
}

/// A point at which several views have a peak.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Sighted {
    /// Capture space.
    pub position: Vec3,
    /// Median color of the peaks, RGB.
    pub color: Vec3,
    /// Median size of a pixel of these views at the point, capture units.
    pub pixel: f32,
    /// Median width of these pictures at the point, capture units.
    pub width: f32,
    /// Number of views that have a peak there.
    pub views: usize,
}

/// Returns the points of a moment, those that most views have first. `center` and `reach` are those of the cube that
/// points are in; the reach may be infinite.
pub(crate) fn triangulate(sights: &[Sight], center: Vec3, reach: f32) -> Vec<Sighted> {
    let of_moment = OfMoment { cameras: sights.iter().map(Camera::of).collect(), center, reach };
    let of_camera = |first: usize| of_moment.candidates(first);
    let mut candidates: Vec<Candidate> = (0..sights.len()).into_par_iter().flat_map_iter(of_camera).collect();
    candidates.sort_by(|a, b| {
        let by_views = b.members.len().cmp(&a.members.len()).then(a.error.total_cmp(&b.error));
        by_views.then_with(|| a.members.cmp(&b.members))
    });
    let mut used: Vec<Vec<bool>> = sights.iter().map(|sight| vec![false; sight.peaks.len()]).collect();
    let mut found = Vec::new();
    for Candidate { position, members, seen, .. } in candidates {
        let free: Vec<[usize; 2]> = members.into_iter().filter(|&[camera, peak]| !used[camera][peak]).collect();
        if free.len() >= needed(seen) {
            free.iter().for_each(|&[camera, peak]| used[camera][peak] = true);
            found.push(of_moment.sighted(position, &free));
        }
    }
    found
}

/// Returns the number of views that must have a peak at a point which so many show.
fn needed(seen: usize) -> usize {
    FEWEST.max((SHARE * seen as f64).ceil() as usize)
}

fn are_alike(a: Vec3, b: Vec3) -> bool {
    (a - b).abs().max_element() < ALIKE
}

/// A point that may be one.
struct Candidate {
    position: Vec3,
    /// Its peaks, each the index of the camera and of the peak.
    members: Vec<[usize; 2]>,
    /// Number of views that show the place.
    seen: usize,
    /// Sum of the distances from the peaks, pixels.
    error: f32,
}

/// The cameras of a moment, and the cube of points.
struct OfMoment<'a> {
    cameras: Vec<Camera<'a>>,
    center: Vec3,
    reach: f32,
}

impl OfMoment<'_> {
    /// Returns the candidates from the peaks of a camera and those of the cameras after it.
    fn candidates(&self, first: usize) -> Vec<Candidate> {
        let own = &self.cameras[first];
        let mut found = Vec::new();
        for (peak, &ray) in own.peaks.iter().zip(&own.rays) {
            for other in &self.cameras[first + 1..] {
                for (theirs, &their_ray) in other.peaks.iter().zip(&other.rays) {
                    let is_alike = are_alike(peak.color, theirs.color);
                    let position = if is_alike { meeting([own, other], [ray, their_ray]) } else { None };
                    let color = 0.5 * (peak.color + theirs.color);
                    found.extend(position.and_then(|position| self.candidate(position, color)));
                }
            }
        }
        found
    }

    /// Returns the candidate at a place, if enough views have a peak of this color there.
    fn candidate(&self, position: Vec3, color: Vec3) -> Option<Candidate> {
        if !self.contains(position) {
            return None;
        }
        let mut candidate = Candidate { position, members: Vec::new(), seen: 0, error: 0.0 };
        for (index, camera) in self.cameras.iter().enumerate() {
            let Some(at) = camera.lens.pixel_of(position) else { continue };
            candidate.seen += 1;
            let distances = camera.peaks.iter().map(|peak| (peak.at.distance(at), peak.color)).enumerate();
            let near = distances.filter(|(_, (far, own))| *far < NEAR && are_alike(*own, color));
            if let Some((peak, (far, _))) = near.min_by(|(_, (a, _)), (_, (b, _))| a.total_cmp(b)) {
                candidate.members.push([index, peak]);
                candidate.error += far;
            }
        }
        (candidate.members.len() >= needed(candidate.seen)).then_some(candidate)
    }

    /// Returns whether a place is inside the cube; a place that is not a number is not.
    fn contains(&self, position: Vec3) -> bool {
        (position - self.center).abs().max_element() <= self.reach
    }

    /// Returns the point of some peaks: where their rays come closest to each other, or else this place.
    fn sighted(&self, position: Vec3, members: &[[usize; 2]]) -> Sighted {
        let ray = |&[camera, peak]: &[usize; 2]| (self.cameras[camera].lens.origin, self.cameras[camera].rays[peak]);
        let closest = closest_point(members.iter().map(ray)).filter(|closest| {
            let is_near = |&[camera, peak]: &[usize; 2]| {
                let Camera { lens, peaks, .. } = &self.cameras[camera];
                lens.pixel_of(*closest).is_some_and(|at| at.distance(peaks[peak].at) < NEAR)
            };
            self.contains(*closest) && members.iter().all(is_near)
        });
        let position = closest.unwrap_or(position);
        let median = |value: &dyn Fn(&[usize; 2]) -> f32| median(members.iter().map(value).collect());
        let channel =
            |channel: usize| median(&|&[camera, peak]: &[usize; 2]| self.cameras[camera].peaks[peak].color[channel]);
        let pixel = |&[camera, _]: &[usize; 2]| self.cameras[camera].lens.pixel_size(position);
        let width = |member: &[usize; 2]| pixel(member) * self.cameras[member[0]].lens.size.x;
        Sighted {
            position,
            color: Vec3::new(channel(0), channel(1), channel(2)),
            pixel: median(&pixel),
            width: median(&width),
            views: members.len(),
        }
    }
}

/// A camera of a moment with its peaks.
struct Camera<'a> {
    lens: Pinhole,
    peaks: &'a [Peak],
    /// The direction of each peak.
    rays: Vec<Vec3>,
}

impl<'a> Camera<'a> {
    fn of(sight: &'a Sight) -> Self {
        let lens = Pinhole::of(&sight.view);
        let rays = sight.peaks.iter().map(|peak| lens.ray(peak.at)).collect();
        Self { lens, peaks: &sight.peaks, rays }
    }
}

/// Returns the middle between two rays where they are closest to each other, if they nearly meet there, before both
/// cameras.
fn meeting([a, b]: [&Camera<'_>; 2], [along_a, along_b]: [Vec3; 2]) -> Option<Vec3> {
    let (between, cosine) = (a.lens.origin - b.lens.origin, along_a.dot(along_b));
    let squared_sine = 1.0 - cosine * cosine;
    if squared_sine < APART {
        return None;
    }
    let (of_a, of_b) = (along_a.dot(between), along_b.dot(between));
    let far_a = (cosine * of_b - of_a) / squared_sine;
    let far_b = (of_b - cosine * of_a) / squared_sine;
    if far_a <= 0.0 || far_b <= 0.0 {
        return None;
    }
    let (at_a, at_b) = (a.lens.origin + far_a * along_a, b.lens.origin + far_b * along_b);
    let middle = 0.5 * (at_a + at_b);
    let pixel = a.lens.pixel_size(middle).max(b.lens.pixel_size(middle));
    (at_a.distance(at_b) < MEETING * pixel).then_some(middle)
}

/// Returns the point closest to rays, each an origin and a unit direction; `None` if they are parallel.
fn closest_point(rays: impl Iterator<Item = (Vec3, Vec3)>) -> Option<Vec3> {
    let (mut sum, mut at) = (DMat3::ZERO, DVec3::ZERO);
    for (origin, direction) in rays {
        let (origin, along) = (origin.as_dvec3(), direction.as_dvec3());
        let across = DMat3::IDENTITY - outer(along, along);
        sum += across;
        at += across * origin;
    }
    let closest = (sum.determinant() > f64::from(APART)).then(|| (sum.inverse() * at).as_vec3());
    closest.filter(|closest| closest.is_finite())
}

/// Returns the median; of an even number of values, the larger of both in the middle; 0 of none.
fn median(mut values: Vec<f32>) -> f32 {
    values.sort_by(f32::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::random::Random;
    use crate::view::{Camera as OfDataset, RasterFov};
    use glam::{UVec2, Vec2};

    const SIZE: UVec2 = UVec2::new(320, 240);

    fn view(index: usize) -> View {
        let angle = index as f32 * 1.25;
        let eye = Vec3::new(4.0 * angle.cos(), 4.0 * angle.sin(), 1.0 + 0.3 * index as f32);
        OfDataset::look_at(eye, Vec3::ZERO, Vec3::Z, 0.9, SIZE).view(0.0, RasterFov::Corrected)
    }

    /// Returns the sights of so many cameras of these balls, with false peaks in random places and colors.
    fn sights(cameras: usize, balls: &[(Vec3, Vec3)]) -> Vec<Sight> {
        let mut random = Random::new(7);
        let sight = |index: usize| {
            let view = view(index);
            let lens = Pinhole::of(&view);
            let mut peaks = Vec::new();
            for (position, color) in balls {
                let beside = Vec2::new(random.in_range(-0.4, 0.4), random.in_range(-0.4, 0.4));
                let at = lens.pixel_of(*position).expect("every camera shows the balls") + beside;
                peaks.push(Peak { at, color: *color + random.in_range(-0.05, 0.05) });
            }
            for _ in 0..8 {
                let at = Vec2::new(random.unit(), random.unit()) * SIZE.as_vec2();
                let color = Vec3::new(random.unit(), random.unit(), random.unit());
                peaks.push(Peak { at, color });
            }
            Sight { view, peaks }
        };
        (0..cameras).map(sight).collect()
    }

    #[test]
    fn balls_are_found_among_false_peaks() {
        let balls = [
            (Vec3::new(0.5, 0.2, 0.1), Vec3::new(0.9, 0.5, 0.1)),
            (Vec3::new(-0.4, 0.6, -0.3), Vec3::new(0.2, 0.2, 0.8)),
            (Vec3::new(0.0, -0.7, 0.4), Vec3::new(0.5, 0.9, 0.5)),
        ];
        let found = triangulate(&sights(5, &balls), Vec3::ZERO, 3.0);
        assert_eq!(found.len(), 3, "each ball once, and nothing else: {found:?}");
        for (position, color) in balls {
            let near = found.iter().find(|point| point.position.distance(position) < 0.02);
            let near = near.unwrap_or_else(|| panic!("no point at {position}: {found:?}"));
            assert!((near.color - color).abs().max_element() < 0.06, "its color: {near:?}");
            assert_eq!(near.views, 5, "in all views");
            assert!((near.width / near.pixel - 320.0).abs() < 30.0, "pictures are 320 pixels wide: {near:?}");
        }
        let far = triangulate(&sights(5, &balls), Vec3::splat(50.0), 3.0);
        assert_eq!(far, [], "nothing outside of the cube");
    }

    #[test]
    fn two_views_or_unlike_colors_are_no_point() {
        let balls = [(Vec3::new(0.5, 0.2, 0.1), Vec3::new(0.9, 0.5, 0.1))];
        assert_eq!(triangulate(&sights(2, &balls), Vec3::ZERO, 3.0), [], "two views");
        let mut unlike = sights(4, &balls);
        unlike.iter_mut().enumerate().for_each(|(index, sight)| {
            sight.peaks.truncate(1);
            sight.peaks[0].color = Vec3::splat(0.3 * index as f32);
        });
        assert_eq!(triangulate(&unlike, Vec3::ZERO, 3.0), [], "a color of its own in each view");
        assert_eq!(triangulate(&[], Vec3::ZERO, 3.0), [], "no views");
    }
}
