//! How well the silhouettes of several cameras agree.
//!
//! In: masks of one moment with their cameras. Out: [`Carved`]: the visual hull, as voxels, and which share of a mask
//! the hull explains, with or without a camera. A mask of a camera with wrong calibration carves parts off that the
//! masks of the others show.

use super::geometry::Projector;
use crate::offline::dataset::mask::INSIDE;
use crate::view::Camera;
use glam::Vec3;
use image::GrayImage;
use rayon::prelude::*;

/// Voxels along a side: of the first search, of the hull, and of the hull of many cameras.
const SEARCH: u32 = 48;
const FINE: u32 = 64;
const COARSE: u32 = 40;
const MANY: usize = 32;
/// Pixels by which masks are widened for the first search.
const WIDER: u32 = 2;
/// A pixel of no picture.
const HIDDEN: u32 = u32::MAX;

/// The silhouette of a camera.
#[derive(Debug, Clone)]
pub(super) struct Silhouette {
    projector: Projector,
    /// Whether a pixel is inside, and inside the widened mask.
    mask: Vec<bool>,
    wider: Vec<bool>,
}

impl Silhouette {
    /// The silhouette of a mask of the size of its camera.
    pub(super) fn of(camera: &Camera, mask: &GrayImage) -> Self {
        let projector = Projector::of(camera);
        let mut inside: Vec<bool> = mask.pixels().map(|pixel| pixel.0[0] >= INSIDE).collect();
        inside.resize(projector.size.element_product() as usize, false);
        let wider = (0..inside.len()).map(|pixel| is_near(&inside, &projector, pixel, WIDER)).collect();
        Self { projector, mask: inside, wider }
    }

    /// Exchanges the masks of two cameras; `None`, without an exchange, if their pictures have different sizes.
    pub(super) fn exchange(silhouettes: &mut [Self], a: usize, b: usize) -> Option<()> {
        let (of_a, of_b) = (silhouettes[a].projector, silhouettes[b].projector);
        (of_a.size == of_b.size).then(|| {
            silhouettes[a].projector = of_b;
            silhouettes[b].projector = of_a;
        })
    }
}

/// Returns whether a pixel within a distance (the greater of across and down, pixels) is set.
fn is_near(pixels: &[bool], projector: &Projector, pixel: usize, distance: u32) -> bool {
    let [width, height, distance] = [projector.size.x, projector.size.y, distance].map(|length| length as usize);
    let (x, y) = (pixel % width, pixel / width);
    let (left, right) = (x.saturating_sub(distance), (x + distance).min(width - 1));
    let mut rows = y.saturating_sub(distance)..=(y + distance).min(height - 1);
    rows.any(|row| pixels[row * width + left..=row * width + right].contains(&true))
}

/// The visual hull of silhouettes.
pub(super) struct Carved<'a> {
    silhouettes: &'a [Silhouette],
    /// Voxels of the hull, and those that are outside one silhouette too many: the number of silhouettes that they are
    /// outside of, and inside of.
    voxels: Vec<[u16; 2]>,
    /// The pixel of each voxel in each picture.
    pixels: Vec<u32>,
    /// Distance within which a voxel explains the pixels of each picture.
    radii: Vec<u32>,
    /// Most silhouettes that a voxel of the hull is outside of, and fewest that it is inside of.
    tolerance: u16,
    needed: u16,
}

impl<'a> Carved<'a> {
    /// Carves the hull out of a cube; `None` if nothing is left of it.
    pub(super) fn of(silhouettes: &'a [Silhouette], center: Vec3, reach: f32) -> Option<Self> {
        let count = silhouettes.len();
        let tolerance = (count / 10) as u16;
        let needed = if count < 6 { 2 } else { 3 };
        let first = Cells { low: center - reach, side: Vec3::splat(2.0 * reach / SEARCH as f32), count: SEARCH };
        let is_likely = |place: &Vec3| {
            let shown = silhouettes.iter().filter_map(|own| Some(own.wider[own.projector.pixel(*place)?]));
            let [outside, inside] = counted(shown);
            outside <= tolerance + 1 && inside >= needed
        };
        let likely: Vec<Vec3> = first.places().filter(is_likely).collect();
        let low = likely.iter().copied().reduce(Vec3::min)? - 1.5 * first.side;
        let high = likely.iter().copied().reduce(Vec3::max)? + 1.5 * first.side;
        let fine = if count > MANY { COARSE } else { FINE };
        let cells = Cells { low, side: (high - low) / fine as f32, count: fine };
        let in_pictures = |place: Vec3| {
            let pixels = silhouettes.iter().map(|own| own.projector.pixel(place).map_or(HIDDEN, |pixel| pixel as u32));
            let pixels: Vec<u32> = pixels.collect();
            let seen = silhouettes.iter().zip(&pixels).filter(|(_, pixel)| **pixel != HIDDEN);
            let [outside, inside] = counted(seen.map(|(own, pixel)| own.mask[*pixel as usize]));
            (outside <= tolerance + 1 && inside >= needed).then_some(([outside, inside], pixels))
        };
        let found: Vec<([u16; 2], Vec<u32>)> = cells.places().filter_map(in_pictures).collect();
        let radius = |own: &Silhouette| {
            let distance = own.projector.distance(center).max(1e-6);
            (cells.side.max_element() * own.projector.focal.x / distance / 2.0).ceil().clamp(1.0, 16.0) as u32
        };
        let (voxels, pixels): (Vec<[u16; 2]>, Vec<Vec<u32>>) = found.into_iter().unzip();
        let radii = silhouettes.iter().map(radius).collect();
        Some(Self { silhouettes, voxels, pixels: pixels.concat(), radii, tolerance, needed })
    }

    /// Returns the share of the mask of a camera that the hull explains; the hull of all cameras, or without one.
    pub(super) fn recall(&self, camera: usize, without: Option<usize>) -> f32 {
        let own = &self.silhouettes[camera];
        let mut shown = vec![false; own.mask.len()];
        for ([outside, inside], pixels) in self.voxels.iter().zip(self.pixels.chunks_exact(self.silhouettes.len())) {
            let (mut outside, mut inside) = (*outside, *inside);
            if let Some(left_out) = without.filter(|&left_out| pixels[left_out] != HIDDEN) {
                let is_inside = self.silhouettes[left_out].mask[pixels[left_out] as usize];
                *(if is_inside { &mut inside } else { &mut outside }) -= 1;
            }
            let is_hull = outside <= self.tolerance && inside >= self.needed;
            if is_hull && pixels[camera] != HIDDEN {
                shown[pixels[camera] as usize] = true;
            }
        }
        let masked = (0..own.mask.len()).filter(|&pixel| own.mask[pixel]);
        let is_explained = |pixel: &usize| is_near(&shown, &own.projector, *pixel, self.radii[camera]);
        let explained = masked.clone().filter(is_explained).count();
        explained as f32 / masked.count().max(1) as f32
    }

    /// Returns the mean share of the masks that the hull explains: of all cameras, or of the others without one.
    pub(super) fn agreement(&self, without: Option<usize>) -> f32 {
        let cameras = (0..self.silhouettes.len()).filter(|camera| Some(*camera) != without);
        let shares: Vec<f32> = cameras.map(|camera| self.recall(camera, without)).collect();
        shares.iter().sum::<f32>() / shares.len().max(1) as f32
    }
}

/// Returns how many are false, and how many are true.
fn counted(values: impl Iterator<Item = bool>) -> [u16; 2] {
    let mut counts = [0; 2];
    values.for_each(|value| counts[usize::from(value)] += 1);
    counts
}

/// The cells of a box.
struct Cells {
    low: Vec3,
    /// Sides of a cell.
    side: Vec3,
    /// Cells along each axis.
    count: u32,
}

impl Cells {
    /// Returns the middles of the cells.
    fn places(&self) -> impl ParallelIterator<Item = Vec3> {
        let (low, side, count) = (self.low, self.side, self.count);
        (0..count * count * count).into_par_iter().map(move |index| {
            let cell = [index % count, index / count % count, index / count / count].map(|at| at as f32);
            low + (Vec3::from(cell) + 0.5) * side
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::UVec2;
    use image::Luma;

    const SIZE: UVec2 = UVec2::splat(96);

    /// Returns the silhouettes of two balls, of cameras on a ring; camera 1 looks beside them by an angle.
    fn balls(count: usize, off: f32) -> Vec<Silhouette> {
        let at = |index: usize, off: f32| {
            let angle = index as f32 / count as f32 * std::f32::consts::TAU + 0.3;
            let eye = Vec3::new(4.0 * angle.cos(), 4.0 * angle.sin(), 1.0);
            Camera::look_at(eye, Vec3::new(-angle.sin(), angle.cos(), 0.5) * off * 4.0, Vec3::Z, 0.8, SIZE)
        };
        let silhouette = |index: usize| {
            let projector = Projector::of(&at(index, 0.0));
            let mut mask = GrayImage::new(SIZE.x, SIZE.y);
            let cells = Cells { low: Vec3::splat(-1.0), side: Vec3::splat(0.025), count: 80 };
            let is_ball = |place: &Vec3| {
                place.distance(Vec3::new(0.2, 0.0, -0.3)) < 0.5 || place.distance(Vec3::new(-0.4, 0.3, 0.5)) < 0.3
            };
            let pixels: Vec<usize> =
                cells.places().filter(is_ball).filter_map(|place| projector.pixel(place)).collect();
            for pixel in pixels {
                mask.put_pixel(pixel as u32 % SIZE.x, pixel as u32 / SIZE.x, Luma([255]));
            }
            Silhouette::of(&at(index, if index == 1 { off } else { 0.0 }), &mask)
        };
        (0..count).map(silhouette).collect()
    }

    #[test]
    fn right_silhouettes_agree_and_the_wrong_camera_is_the_one_without_which_they_do() {
        let right = balls(5, 0.0);
        let carved = Carved::of(&right, Vec3::ZERO, 4.0).expect("the balls are found");
        assert!(carved.agreement(None) > 0.93, "all agree: {}", carved.agreement(None));
        let wrong = balls(5, 0.09);
        let carved = Carved::of(&wrong, Vec3::ZERO, 4.0).expect("the balls are found");
        let without: Vec<f32> = (0..5).map(|camera| carved.agreement(Some(camera))).collect();
        let best = (0..5).max_by(|a, b| without[*a].total_cmp(&without[*b])).expect("there are five");
        assert!(carved.agreement(None) < without[best] - 0.04, "one is off by 5 degrees: {}", carved.agreement(None));
        assert_eq!(best, 1, "the second is wrong: {without:?}");
    }

    #[test]
    fn empty_masks_have_no_hull() {
        let mut empty = balls(4, 0.0);
        for silhouette in &mut empty {
            silhouette.mask.fill(false);
            silhouette.wider.fill(false);
        }
        assert!(Carved::of(&empty, Vec3::ZERO, 4.0).is_none(), "nothing is inside");
    }
}
