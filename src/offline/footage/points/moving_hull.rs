//! The visual hull of the motion masks of a moment.
//!
//! In: the masks of several cameras at one moment, what stands before each camera, and the cube that the cameras look
//! at. Out: [`Hull`]: the cubes at the surface of what is inside the masks where nothing that stands hides it. Cubes are
//! halved as long as they may be inside, so that cubes of one and a half pixels are found in a space twice as wide as the
//! pictures show: a ball of eight pixels has about a hundred.

use super::backdrop::Backdrop;
use super::cells;
use super::projection::Projection;
use crate::offline::dataset::mask::INSIDE;
use crate::offline::train::start::region::Region;
use crate::view::{Camera, RasterFov, View};
use glam::{UVec2, UVec3, Vec2, Vec3};
use image::GrayImage;
use rayon::prelude::*;

/// Side of the smallest cubes, pixels at the center.
const VOXEL: f32 = 1.5;
/// Side of the space that is searched, in sides of the [`Region`]: things at its border are whole.
const WIDER: f32 = 2.0;
/// Halvings of the space before the first test, and most halvings.
const COARSE: u32 = 5;
const FINEST: u32 = 12;
/// Cubes of one size above which they are not halved further: masks that cover nearly everything say little.
const MOST_CELLS: usize = 1 << 21;
/// Least number of cameras that have a place inside their masks, if there are as many (never below two), and least share
/// of all cameras.
const FEWEST: usize = 3;
const LEAST_SHARE: f32 = 0.25;
/// Least share, of the cameras whose pictures show a place, that have it inside their masks, however many are hidden.
const LEAST_SEEING: f32 = 0.5;
/// Excess of the outline of a cube in a picture over that of a ball around it, for the border of the picture.
const STRETCH: f32 = 1.25;

/// The space that is searched.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Space {
    /// The corner of least coordinates, world space.
    low: Vec3,
    /// Side of the smallest cubes, world units.
    voxel: f32,
    /// Halvings from the whole to the smallest cubes.
    levels: u32,
}

impl Space {
    /// Returns the space that cameras look at; `None` if they look at none.
    pub(crate) fn of(cameras: &[Camera]) -> Option<Self> {
        let views: Vec<View> = cameras.iter().map(|camera| camera.view(0.0, RasterFov::Corrected)).collect();
        let region = Region::of(views.iter()).ok()?;
        let projections = cameras.iter().map(Projection::of);
        let pixel = |at: Projection| at.pixel(region.center).map(|(_, depth)| depth / at.focal);
        let mut pixels: Vec<f32> = projections.filter_map(pixel).collect();
        pixels.sort_unstable_by(f32::total_cmp);
        let side = 2.0 * WIDER * region.half;
        let voxel = (VOXEL * pixels.get(pixels.len() / 2)?).max(side / (1u32 << FINEST) as f32);
        let levels = ((side / voxel).log2().ceil() as u32).clamp(COARSE, FINEST);
        let low = region.center - 0.5 * voxel * (1u32 << levels) as f32;
        (voxel > 0.0 && low.is_finite()).then_some(Self { low, voxel, levels })
    }
}

/// The mask of a camera, with the number of pixels inside in every rectangle from its first pixel.
pub(crate) struct Silhouette<'a> {
    /// The camera.
    pub projection: Projection,
    sums: Vec<u32>,
    backdrop: Option<&'a Backdrop>,
}

/// The part of a picture that shows a cube.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Footprint {
    /// From the first pixel to before the last.
    low: UVec2,
    high: UVec2,
    /// Largest depth of the cube, camera units.
    depth: f32,
}

/// What a mask says of a cube.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Evidence {
    /// The picture does not show the cube.
    Hidden,
    /// No part of the cube is inside.
    Outside(Footprint),
    /// A part of the cube may be inside.
    Possible,
}

impl<'a> Silhouette<'a> {
    /// Returns a silhouette with what stands before the camera, if that is known; `None` if the mask has another size
    /// than the pictures of the camera.
    pub(crate) fn new(camera: &Camera, mask: &GrayImage, backdrop: Option<&'a Backdrop>) -> Option<Self> {
        if [mask.width(), mask.height()] != camera.size.to_array() {
            return None;
        }
        let width = mask.width() as usize;
        let mut sums = vec![0; (width + 1) * (mask.height() as usize + 1)];
        for (y, row) in mask.as_raw().chunks_exact(width.max(1)).enumerate() {
            let mut count = 0;
            for (x, &value) in row.iter().enumerate() {
                count += u32::from(value >= INSIDE);
                sums[(y + 1) * (width + 1) + x + 1] = sums[y * (width + 1) + x + 1] + count;
            }
        }
        Some(Self { projection: Projection::of(camera), sums, backdrop })
    }

    /// Returns whether a pixel of the picture is inside.
    pub(crate) fn is_inside(&self, x: u32, y: u32) -> bool {
        self.count([x, y], [x + 1, y + 1]) > 0
    }

    /// Returns the number of pixels inside from `low` to before `high`.
    fn count(&self, low: [u32; 2], high: [u32; 2]) -> u32 {
        let sum = |x: u32, y: u32| self.sums[y as usize * (self.projection.size.x as usize + 1) + x as usize];
        sum(high[0], high[1]) + sum(low[0], low[1]) - sum(low[0], high[1]) - sum(high[0], low[1])
    }

    /// Returns what the mask says of a ball, world space.
    fn evidence(&self, center: Vec3, radius: f32) -> Evidence {
        let Some((at, depth)) = self.projection.pixel(center) else { return Evidence::Hidden };
        if depth <= radius {
            return Evidence::Possible;
        }
        let reach = Vec2::splat(STRETCH * radius * self.projection.focal / (depth - radius) + 1.0);
        let (low, high, size) = (at - reach, at + reach, self.projection.size.as_vec2());
        if low.cmpge(size).any() || high.cmple(Vec2::ZERO).any() {
            return Evidence::Hidden;
        }
        let is_whole = low.cmpge(Vec2::ZERO).all() && high.cmple(size).all();
        let [low, high] = [low.floor(), high.ceil()].map(|corner| corner.clamp(Vec2::ZERO, size).as_uvec2());
        match self.count(low.to_array(), high.to_array()) {
            0 if is_whole => Evidence::Outside(Footprint { low, high, depth: depth + radius }),
            _ => Evidence::Possible,
        }
    }

    /// Returns what the mask says of the center of a cube, world space.
    fn evidence_at(&self, center: Vec3) -> Evidence {
        match self.projection.shown(center) {
            None => Evidence::Hidden,
            Some((pixel, _)) if self.is_inside(pixel.x, pixel.y) => Evidence::Possible,
            Some((low, depth)) => Evidence::Outside(Footprint { low, high: low + 1, depth }),
        }
    }
}

/// The surface of a visual hull.
pub(crate) struct Hull {
    /// Codes of its cubes, in Morton order.
    pub cells: Vec<u64>,
    /// Side of the cubes, world units.
    pub side: f32,
    /// The corner of least coordinates of the space, world space.
    pub low: Vec3,
}

impl Hull {
    /// Returns the hull of these silhouettes of one moment. `agreeing` is the least share of the cameras showing a place
    /// that have it inside their masks.
    pub(crate) fn of<'a>(silhouettes: impl Iterator<Item = &'a Silhouette<'a>>, space: &Space, agreeing: f32) -> Self {
        let silhouettes: Vec<&Silhouette<'_>> = silhouettes.collect();
        let fewest = FEWEST.min(silhouettes.len()).max((LEAST_SHARE * silhouettes.len() as f32).ceil() as usize).max(2);
        let is_kept = |evidence: &dyn Fn(&Silhouette<'_>) -> Evidence, hides: fn(&Backdrop, Footprint) -> bool| {
            let (mut outside, mut inside) = (0, 0);
            for &silhouette in &silhouettes {
                match evidence(silhouette) {
                    Evidence::Hidden => {}
                    Evidence::Outside(_) => outside += 1,
                    Evidence::Possible => inside += 1,
                }
            }
            let agree = |outside: usize| inside as f32 >= agreeing * (inside + outside) as f32;
            if inside < fewest || agree(outside) {
                return inside >= fewest;
            }
            // What stands is looked at only for cubes that depend on it, until too many cameras see that they are empty.
            let mut empty = 0;
            let is_empty = |silhouette: &Silhouette<'_>| match (evidence(silhouette), silhouette.backdrop) {
                (Evidence::Outside(footprint), Some(backdrop)) => !hides(backdrop, footprint),
                (evidence, _) => matches!(evidence, Evidence::Outside(_)),
            };
            let is_seen = inside as f32 >= LEAST_SEEING * (inside + outside) as f32;
            is_seen
                && silhouettes.iter().all(|silhouette| {
                    empty += usize::from(is_empty(silhouette));
                    agree(empty)
                })
        };
        let may_hide = |backdrop: &Backdrop, Footprint { low, high, depth }| backdrop.may_hide(low, high, depth);
        let hides = |backdrop: &Backdrop, Footprint { low, depth, .. }| backdrop.hides(low, depth);
        let mut hull = Self { cells: cells::all(COARSE), side: 0.0, low: space.low };
        for level in COARSE..=space.levels {
            hull.side = space.voxel * (1u32 << (space.levels - level)) as f32;
            let radius = 0.5 * 3f32.sqrt() * hull.side;
            let may_be_inside = |cell: &u64| {
                let center = hull.place(*cell);
                is_kept(&|silhouette: &Silhouette<'_>| silhouette.evidence(center, radius), may_hide)
            };
            let kept: Vec<u64> = hull.cells.par_iter().copied().filter(may_be_inside).collect();
            if level == space.levels || kept.len() > MOST_CELLS {
                hull.cells = kept;
                break;
            }
            hull.cells = cells::children(&kept);
        }
        let is_inside = |cell: &u64| {
            let center = hull.place(*cell);
            is_kept(&|silhouette: &Silhouette<'_>| silhouette.evidence_at(center), hides)
        };
        let inside: Vec<u64> = hull.cells.par_iter().copied().filter(is_inside).collect();
        hull.cells = cells::surface(&inside);
        hull
    }

    /// Returns the center of a cube, world space.
    pub(crate) fn place(&self, cell: u64) -> Vec3 {
        self.low + (UVec3::from(cells::coordinates(cell)).as_vec3() + 0.5) * self.side
    }
}

#[cfg(test)]
mod tests {
    use super::super::fixture::{PIXEL, cameras, mask};
    use super::*;

    fn hull(cameras: &[Camera], agreeing: f32, masks: impl Fn(usize, &Camera) -> GrayImage) -> Hull {
        hull_behind(&[], cameras, agreeing, masks)
    }

    /// Returns the hull of masks, with what stands before the first cameras.
    fn hull_behind(
        backdrops: &[Backdrop],
        cameras: &[Camera],
        agreeing: f32,
        masks: impl Fn(usize, &Camera) -> GrayImage,
    ) -> Hull {
        let silhouette =
            |(index, camera): (usize, &Camera)| Silhouette::new(camera, &masks(index, camera), backdrops.get(index));
        let silhouettes: Vec<Silhouette<'_>> = cameras.iter().enumerate().filter_map(silhouette).collect();
        assert_eq!(silhouettes.len(), cameras.len(), "masks of the size of the pictures");
        Hull::of(silhouettes.iter(), &Space::of(cameras).expect("cameras that look at the origin"), agreeing)
    }

    #[test]
    fn the_hull_of_a_ball_is_its_surface_even_if_one_mask_of_twelve_misses_it() {
        let center = Vec3::new(0.3, -0.2, 0.1);
        let cameras = cameras(12);
        let balls = [(center, 0.3)];
        let missing = |index: usize, camera: &Camera| mask(camera, if index == 4 { &[] } else { &balls });
        let found = hull(&cameras, 0.9, missing);
        assert!(found.cells.len() > 500, "many cubes: {}", found.cells.len());
        for &cell in &found.cells {
            let far = found.place(cell).distance(center);
            assert!((0.22..0.42).contains(&far), "near the surface: {far}");
        }
    }

    #[test]
    fn a_ball_of_eight_pixels_is_found() {
        let balls = [(Vec3::new(-0.6, 0.4, 0.3), 4.0 * PIXEL)];
        let found = hull(&cameras(12), 0.9, |_, camera| mask(camera, &balls));
        assert!((40..400).contains(&found.cells.len()), "about a hundred cubes: {}", found.cells.len());
        let mean = found.cells.iter().map(|&cell| found.place(cell)).sum::<Vec3>() / found.cells.len() as f32;
        assert!(mean.distance(balls[0].0) < 0.015, "at its place: {mean}");
    }

    #[test]
    fn a_ball_that_three_of_twelve_cameras_miss_is_found_if_three_quarters_suffice() {
        let balls = [(Vec3::new(0.3, -0.2, 0.1), 0.1)];
        let missing = |index: usize, camera: &Camera| mask(camera, if index < 3 { &[] } else { &balls });
        let [most, fewer] = [0.9, 0.75].map(|agreeing| hull(&cameras(12), agreeing, missing).cells.len());
        assert!(most == 0 && fewer > 100, "{most} cubes where nine tenths must agree, else {fewer}");
    }

    #[test]
    fn a_ball_that_a_wall_hides_from_five_of_twelve_cameras_is_found() {
        let balls = [(Vec3::new(0.3, -0.2, 0.1), 0.1)];
        let cameras = cameras(12);
        let masks = |index: usize, camera: &Camera| mask(camera, if index < 5 { &[] } else { &balls });
        // A wall over the whole picture, in the middle between camera and ball, and one far behind the ball.
        let [before, behind] = [2.0, 9.0].map(|depth| {
            let size = UVec2::new(25, 18);
            let wall = |camera: &Camera| Backdrop::new(*camera, 8, size, &[depth; 450]);
            let backdrops: Vec<Backdrop> = cameras[..5].iter().map(wall).collect();
            hull_behind(&backdrops, &cameras, 0.9, masks).cells
        });
        assert_eq!(behind.len(), 0, "five cameras see that it is not there");
        let seven = hull(&cameras[5..], 0.9, |_, camera| mask(camera, &balls));
        assert!(before.len() > 100 && before.len() < 2 * seven.cells.len(), "as the others see it: {}", before.len());
    }

    #[test]
    fn what_most_cameras_cannot_see_is_not_found() {
        let balls = [(Vec3::new(0.3, -0.2, 0.1), 0.1)];
        let cameras = cameras(12);
        let wall = |camera: &Camera| Backdrop::new(*camera, 8, UVec2::new(25, 18), &[2.0; 450]);
        let backdrops: Vec<Backdrop> = cameras[..7].iter().map(wall).collect();
        let masks = |index: usize, camera: &Camera| mask(camera, if index < 7 { &[] } else { &balls });
        assert_eq!(hull_behind(&backdrops, &cameras, 0.9, masks).cells.len(), 0, "five of twelve say little");
    }

    #[test]
    fn empty_masks_have_no_hull() {
        assert_eq!(hull(&cameras(6), 0.9, |_, camera| mask(camera, &[])).cells.len(), 0, "nothing is inside");
    }
}
