//! Points inside the silhouettes of a moment: the visual hull.
//!
//! In: views with images that say what they cover, the box that the cameras look at. Out: [`StartPoint`]s, each inside
//! the silhouettes of all views of its moment that show its place. Where a moment has few views (one, if the camera
//! moves), views of moments nearby count too, with silhouettes that are widened, since things move between the moments.

use super::point::{Life, StartPoint};
use super::region::Region;
use crate::offline::dataset::CoveredImage;
use crate::offline::dataset::mask::INSIDE;
use crate::scene::random::Random;
use crate::view::View;
use glam::{UVec2, Vec3, Vec4};
use rayon::prelude::*;
use std::collections::HashSet;
use std::ops::Range;

/// Number of views that silhouettes are taken from, if the moments nearby have as many.
const ENOUGH: usize = 8;
/// Least number of views that must show a point; all, if there are fewer.
const FEWEST: usize = 3;
/// Largest distance of a moment nearby, as a share of the time of all views.
const NEARBY: f32 = 0.05;
/// Slack of silhouettes of moments nearby, as a share of the longer side of the picture.
const SLACK: f32 = 0.02;
/// Candidates of a chunk, which are drawn one after the other with one seed.
const AT_ONCE: usize = 4096;
/// Chunks of candidates in a round, and most rounds.
const CHUNKS: u64 = 64;
const ROUNDS: u64 = 200;
/// Rounds after which the search ends if no point has been found.
const FRUITLESS: u64 = 8;

/// Returns at most so many points of the hull; fewer, or none, if the hull is too small to be found.
pub(crate) fn hull(
    images: &[(&View, &CoveredImage)],
    region: &Region,
    interval: [f32; 2],
    wanted: usize,
    seed: u64,
) -> Vec<StartPoint> {
    let mut ordered = images.to_vec();
    ordered.sort_by(|(a, _), (b, _)| a.time.total_cmp(&b.time));
    let silhouettes: Vec<Silhouette<'_>> =
        ordered.par_iter().map(|(view, image)| Silhouette::new(view, image)).collect();
    let groups: Vec<Range<usize>> = (0..silhouettes.len()).map(|index| group(&silhouettes, index)).collect();
    let moments = silhouettes.iter().map(|own| own.time.to_bits()).collect::<HashSet<_>>().len();
    let mut points = Vec::new();
    for round in 0..ROUNDS {
        let chunk = |chunk: u64| {
            let mut random = Random::new(seed ^ (round * CHUNKS + chunk + 1).wrapping_mul(0xD129_0D3A_2B5C_6F1D));
            let candidate = |_| {
                let index = random.below(silhouettes.len());
                let offset = Vec3::from([(); 3].map(|()| random.in_range(-1.0, 1.0)));
                let position = region.center + region.half * offset;
                let late = random.unit();
                let color = color_inside(&silhouettes, groups[index].clone(), silhouettes[index].time, position)?;
                let time = match moments {
                    1 => interval[0] + late * (interval[1] - interval[0]),
                    // A random time closer to this moment than to others.
                    _ => silhouettes[index].time + (late - 0.5) * (interval[1] - interval[0]) / moments as f32,
                };
                Some(StartPoint { position, time, color, velocity: Vec3::ZERO, life: Life::Timed })
            };
            (0..AT_ONCE).filter_map(candidate).collect::<Vec<_>>()
        };
        if silhouettes.is_empty() || round == FRUITLESS && points.is_empty() {
            break;
        }
        points.par_extend((0..CHUNKS).into_par_iter().flat_map_iter(chunk));
        if points.len() >= wanted {
            break;
        }
    }
    points.truncate(wanted);
    points
}

/// Returns the views of the moment of a view and, if these are few, of moments nearby. The silhouettes are in order of
/// time.
fn group(silhouettes: &[Silhouette<'_>], index: usize) -> Range<usize> {
    let time = silhouettes[index].time;
    let span = silhouettes[silhouettes.len() - 1].time - silhouettes[0].time;
    let distance = |other: usize| (silhouettes[other].time - time).abs();
    let same = |other: &usize| silhouettes[*other].time == time;
    let mut first = index - (0..index).rev().take_while(same).count();
    let mut end = index + (index..silhouettes.len()).take_while(same).count();
    while end - first < ENOUGH {
        let before = first.checked_sub(1).map(|other| (distance(other), false));
        let after = (end < silhouettes.len()).then(|| (distance(end), true));
        let nearest = [before, after].into_iter().flatten().min_by(|a, b| a.0.total_cmp(&b.0));
        match nearest.filter(|(far, _)| end - first < FEWEST || *far <= NEARBY * span) {
            Some((_, true)) => end += 1,
            Some((_, false)) => first -= 1,
            None => break,
        }
    }
    first..end
}

/// Returns the mean color of a point in the views of a group; `None` if the point is outside a silhouette, or too few
/// views show its place.
fn color_inside(silhouettes: &[Silhouette<'_>], group: Range<usize>, time: f32, position: Vec3) -> Option<Vec3> {
    let needed = FEWEST.min(group.len());
    let (mut shown, mut color, mut covered) = (0, Vec3::ZERO, 0.0);
    for own in &silhouettes[group] {
        let Some(pixel) = own.pixel(position) else { continue };
        if !own.is_inside(pixel, own.time == time) {
            return None;
        }
        shown += 1;
        let [r, g, b, coverage] = own.image.texels[own.index(pixel)].map(f32::from);
        color += Vec3::new(r, g, b);
        covered += coverage;
    }
    (shown >= needed).then(|| if covered > 0.0 { (color / covered).min(Vec3::ONE) } else { Vec3::splat(0.5) })
}

/// The silhouette in an image.
struct Silhouette<'a> {
    image: &'a CoveredImage,
    size: UVec2,
    time: f32,
    /// Rows x and y of clip space, and depth.
    rows: [Vec4; 3],
    near: f32,
    /// Whether a pixel is inside the widened silhouette.
    wider: Vec<bool>,
}

impl<'a> Silhouette<'a> {
    fn new(view: &View, image: &'a CoveredImage) -> Self {
        let [x, y] = view.clip_rows();
        let slack = (SLACK * image.size.max_element() as f32).ceil() as usize;
        let covered: Vec<bool> = image.texels.iter().map(|texel| texel[3] >= INSIDE).collect();
        Self {
            image,
            size: image.size,
            time: view.time,
            rows: [x, y, view.world_to_camera.row(2)],
            near: view.near,
            wider: widened(covered, image.size, slack),
        }
    }

    /// Returns the pixel that shows a place; `None` if the picture does not.
    fn pixel(&self, position: Vec3) -> Option<UVec2> {
        let [x, y, depth] = self.rows.map(|row| row.dot(position.extend(1.0)));
        let at = (glam::Vec2::new(x, y) / depth + 1.0) * 0.5 * self.size.as_vec2();
        let is_shown = depth > self.near && at.cmpge(glam::Vec2::ZERO).all() && at.cmplt(self.size.as_vec2()).all();
        is_shown.then(|| at.as_uvec2().min(self.size - 1))
    }

    fn index(&self, pixel: UVec2) -> usize {
        pixel.y as usize * self.size.x as usize + pixel.x as usize
    }

    /// Returns whether a pixel is inside the silhouette, exactly or widened.
    fn is_inside(&self, pixel: UVec2, exactly: bool) -> bool {
        let index = self.index(pixel);
        if exactly { self.image.texels[index][3] >= INSIDE } else { self.wider[index] }
    }
}

/// Returns a mask that also has every pixel within a distance, across and down, of one that it had.
fn widened(mut mask: Vec<bool>, size: UVec2, distance: usize) -> Vec<bool> {
    let [width, height] = size.to_array().map(|side| side as usize);
    // Lines of `length` pixels that are `step` apart.
    let mut widen = |firsts: &mut dyn Iterator<Item = usize>, length: usize, step: usize| {
        let mut line = vec![false; length];
        for first in firsts {
            // Pixels since the last that is inside, from either end.
            for backwards in [false, true] {
                let mut since = usize::MAX;
                for at in 0..length {
                    let at = if backwards { length - 1 - at } else { at };
                    since = if mask[first + at * step] { 0 } else { since.saturating_add(1) };
                    line[at] = (backwards && line[at]) || since <= distance;
                }
            }
            line.iter().enumerate().for_each(|(at, &inside)| mask[first + at * step] = inside);
        }
    };
    widen(&mut (0..height).map(|y| y * width), width, 1);
    widen(&mut (0..width), height, width);
    mask
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::view::{Camera, RasterFov};

    const SIZE: UVec2 = UVec2::splat(64);

    /// Returns a view from a place on a circle, with the silhouette of a red ball of radius 0.4 at `center`.
    fn ball(index: usize, time: f32, center: Vec3) -> (View, CoveredImage) {
        let angle = index as f32 * 2.4;
        let eye = Vec3::new(4.0 * angle.cos(), 4.0 * angle.sin(), 1.5);
        let view = Camera::look_at(eye, Vec3::ZERO, Vec3::Z, 0.7, SIZE).view(time, RasterFov::Corrected);
        let texel = |index: u32| {
            let ray = view.ray(index % SIZE.x, index / SIZE.x);
            let away = (center - eye) - ray * ray.dot(center - eye);
            if away.length() < 0.4 { [255, 0, 0, 255] } else { [0; 4] }
        };
        let texels: Vec<[u8; 4]> = (0..SIZE.element_product()).map(texel).collect();
        (view, CoveredImage { size: SIZE, texels, has_gaps: true })
    }

    fn points(views: &[(View, CoveredImage)], wanted: usize) -> Vec<StartPoint> {
        let images: Vec<_> = views.iter().map(|(view, image)| (view, image)).collect();
        hull(&images, &Region { center: Vec3::ZERO, half: 1.3 }, [0.0, 1.0], wanted, 5)
    }

    #[test]
    fn points_of_many_cameras_are_inside_the_ball_of_their_moment() {
        let at = |moment: usize| Vec3::new(0.6 * moment as f32 - 0.6, 0.0, 0.0);
        let views: Vec<_> = (0..30).map(|i| ball(i, (i % 3) as f32 * 0.5, at(i % 3))).collect();
        let found = points(&views, 500);
        assert_eq!(found.len(), 500, "as many as wanted");
        for point in &found {
            let moment = (point.time * 2.0).round().clamp(0.0, 2.0);
            let far = point.position.distance(at(moment as usize));
            assert!(far < 0.55, "at {} the point is {far} from the center of the ball", point.time);
            assert_eq!(point.color, Vec3::X, "the color of the ball");
        }
        assert_eq!(points(&views, 500), found, "the same points for the same seed");
    }

    #[test]
    fn points_of_one_camera_use_moments_nearby() {
        let at = |time: f32| Vec3::new(time - 0.5, 0.0, 0.0);
        let views: Vec<_> = (0..100).map(|i| i as f32 / 99.0).enumerate().map(|(i, t)| ball(i, t, at(t))).collect();
        let found = points(&views, 500);
        assert_eq!(found.len(), 500, "as many as wanted");
        let far = found.iter().filter(|point| point.position.distance(at(point.time)) > 0.65).count();
        assert!(far < 25, "of 500 points {far} are far from the ball at their time");
    }

    #[test]
    fn empty_silhouettes_have_no_hull() {
        let views: Vec<_> = (0..6).map(|i| ball(i, 0.0, Vec3::splat(90.0))).collect();
        assert_eq!(points(&views, 10), [], "nothing is inside");
        assert_eq!(points(&[], 10), [], "nothing without views");
    }

    #[test]
    fn a_mask_grows_by_the_distance_across_and_down() {
        let size = UVec2::new(9, 7);
        let mut mask = vec![false; 63];
        mask[3 * 9 + 4] = true;
        let wider = widened(mask, size, 2);
        let expected: Vec<bool> = (0..63usize).map(|i| (i % 9).abs_diff(4) <= 2 && (i / 9).abs_diff(3) <= 2).collect();
        assert_eq!(wider, expected, "a square of five pixels");
    }
}
