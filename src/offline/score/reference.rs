//! `score`: the contribution of each Gaussian to a picture; CPU reference of `shaders/offline/score.wgsl`.
//!
//! In: a scene, a view, the background. Out: [`ViewScore`], sums over the picture's pixels for each Gaussian. With `c =
//! α T` where a Gaussian was blended into a pixel (after the tests of [`blend`](crate::reference::blend())), these are
//! Σ c, Σ c², and the squared change of the picture if that Gaussian alone were removed.

use crate::gaussian::alpha::{BlendStep, blend_step, reach_squared};
use crate::gaussian::overlap::tile_at;
use crate::reference::{Layer, Pair, Splat, TileLists, behind, project, tile_lists};
use crate::scene::RuntimeScene;
use crate::view::{Appearance, Background, BlendSpace, TILE_SIZE, View};
use glam::{UVec2, Vec2, Vec3};
use rayon::prelude::*;
use std::ops::Range;

/// The sums to compute for a view.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Want {
    /// `contribution` and `energy`, in one pass front to back. `removal` is empty.
    Contribution,
    /// `removal` too, in a second pass, once the final picture is known.
    Removal,
}

/// The contributions of every Gaussian of a scene to one picture, in the order of the scene; 0 for Gaussians that are
/// not blended. Default: empty.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ViewScore {
    /// Σ c over pixels. Above 0 if and only if the Gaussian was blended into a pixel.
    pub contribution: Vec<f32>,
    /// Σ c² over pixels.
    pub energy: Vec<f32>,
    /// Σ (c (color − B))² over pixels and channels, B the color behind the Gaussian at that pixel, background included:
    /// the squared change of the picture if the Gaussian were removed. Exact at pixels that do not stop early. Empty
    /// with [`Want::Contribution`].
    pub removal: Vec<f32>,
}

/// Scores one view on the CPU. The result does not depend on the number of threads.
pub fn score(scene: &RuntimeScene, view: &View, background: Background, want: Want) -> ViewScore {
    let layer = Layer { scene, view: *view, appearance: Appearance::default() };
    let splats = project(&layer, BlendSpace::Encoded);
    let TileLists { pairs, ranges, .. } = tile_lists(&splats, view);
    let environment = scene.environment.as_ref();
    let behind =
        |x, y| behind(view, background, environment.map(|map| (map, Appearance::default())), BlendSpace::Encoded, x, y);
    let slots: Vec<Vec<Slot>> = ranges
        .par_iter()
        .enumerate()
        .map(|(tile, range)| score_tile(Tile::new(tile as u32, view), &splats, &pairs[range.clone()], want, &behind))
        .collect();
    let mut sums = vec![Slot::default(); splats.len()];
    for (pair, slot) in pairs.iter().zip(slots.iter().flatten()) {
        sums[pair.splat as usize].add(slot);
    }
    let column = |of: fn(&Slot) -> f64| sums.iter().map(|slot| of(slot) as f32).collect();
    ViewScore {
        contribution: column(|slot| slot.contribution),
        energy: column(|slot| slot.energy),
        removal: if want >= Want::Removal { column(|slot| slot.removal) } else { Vec::new() },
    }
}

/// Sums of one Gaussian over a tile, then over the picture.
#[derive(Debug, Clone, Copy, Default)]
struct Slot {
    contribution: f64,
    energy: f64,
    removal: f64,
}

impl Slot {
    fn add(&mut self, other: &Self) {
        self.contribution += other.contribution;
        self.energy += other.energy;
        self.removal += other.removal;
    }

    fn contribute(&mut self, weight: f32) {
        let weight = f64::from(weight);
        self.contribution += weight;
        self.energy += weight * weight;
    }
}

/// Returns one slot for each pair of the tile.
fn score_tile(
    tile: Tile,
    splats: &[Splat],
    pairs: &[Pair],
    want: Want,
    behind: &impl Fn(u32, u32) -> Vec3,
) -> Vec<Slot> {
    let mut slots = vec![Slot::default(); pairs.len()];
    if want < Want::Removal {
        tile.blend(splats, pairs, |slot, _, blended| slots[slot].contribute(blended.weight));
        return slots;
    }
    let last = tile.clone().blend(splats, pairs, |_, _, _| {}).over(behind);
    tile.blend(splats, pairs, |slot, splat, blended| {
        let slot = &mut slots[slot];
        slot.contribute(blended.weight);
        let behind = (last[blended.pixel] - blended.color) / blended.transmittance;
        let change = blended.weight * (splat.color - behind);
        slot.removal += f64::from(change.length_squared());
    });
    slots
}

const SIDE: usize = TILE_SIZE as usize;
const PIXELS: usize = SIDE * SIDE;

/// The pixels of a tile while splats are blended front to back.
#[derive(Clone)]
struct Tile {
    origin: UVec2,
    width: usize,
    height: usize,
    /// Transmittance; negated once the pixel has stopped.
    transmittance: [f32; PIXELS],
    color: [Vec3; PIXELS],
    /// Number of pixels of each row that have not stopped.
    live: [usize; SIDE],
}

/// A splat blended into a pixel.
struct Blended {
    pixel: usize,
    /// α T.
    weight: f32,
    /// Transmittance after the splat.
    transmittance: f32,
    /// Color of the pixel after the splat, without the background.
    color: Vec3,
}

impl Tile {
    fn new(index: u32, view: &View) -> Self {
        let origin = tile_at(index, view.tiles()) * TILE_SIZE;
        let size = (view.size - origin).min(UVec2::splat(TILE_SIZE));
        Self {
            origin,
            width: size.x as usize,
            height: size.y as usize,
            transmittance: [1.0; PIXELS],
            color: [Vec3::ZERO; PIXELS],
            live: std::array::from_fn(|row| if row < size.y as usize { size.x as usize } else { 0 }),
        }
    }

    /// Blends the splats of the tile in order, each into all pixels that it reaches. Calls `each` with the index of the
    /// pair.
    fn blend(mut self, splats: &[Splat], pairs: &[Pair], mut each: impl FnMut(usize, &Splat, &Blended)) -> Self {
        for (number, pair) in pairs.iter().enumerate() {
            if self.live.iter().all(|&live| live == 0) {
                break;
            }
            let splat = &splats[pair.splat as usize];
            let reach = Reach::of(splat);
            for row in 0..self.height {
                if self.live[row] > 0 {
                    self.blend_row(row, splat, &reach, |blended| each(number, splat, blended));
                }
            }
        }
        self
    }

    fn blend_row(&mut self, row: usize, splat: &Splat, reach: &Reach, mut each: impl FnMut(&Blended)) {
        let dy = splat.center.y - (self.origin.y + row as u32) as f32;
        for column in reach.columns(dy, self.origin.x, self.width) {
            let pixel = row * SIDE + column;
            let before = self.transmittance[pixel];
            if before < 0.0 {
                continue;
            }
            let dx = splat.center.x - (self.origin.x + column as u32) as f32;
            match blend_step(splat.conic, splat.opacity, Vec2::new(dx, dy), before) {
                BlendStep::Skip => {}
                BlendStep::Stop => {
                    self.transmittance[pixel] = -before;
                    self.live[row] -= 1;
                }
                BlendStep::Blend { weight, transmittance } => {
                    self.transmittance[pixel] = transmittance;
                    self.color[pixel] += splat.color * weight;
                    each(&Blended { pixel, weight, transmittance, color: self.color[pixel] });
                }
            }
        }
    }

    /// Returns the final colors, composited over `behind`.
    fn over(self, behind: &impl Fn(u32, u32) -> Vec3) -> [Vec3; PIXELS] {
        let mut color = self.color;
        for row in 0..self.height {
            for column in 0..self.width {
                let pixel = row * SIDE + column;
                let back = behind(self.origin.x + column as u32, self.origin.y + row as u32);
                color[pixel] += self.transmittance[pixel].abs() * back;
            }
        }
        color
    }
}

/// The region in which the alpha of a splat can reach 1/255: an ellipse. Pixels outside are skipped, pixels inside are
/// tested.
struct Reach {
    center: f64,
    /// [Factored](crate::gaussian::conic).
    conic: [f64; 3],
    /// Bound of `dᵀ conic d`.
    energy: f64,
}

impl Reach {
    fn of(splat: &Splat) -> Self {
        Self {
            center: f64::from(splat.center.x),
            conic: splat.conic.to_array().map(f64::from),
            // With a margin for rounding.
            energy: f64::from(reach_squared(splat.opacity)) + 0.012,
        }
    }

    /// Returns the columns of a row at height `dy` below the center, of a tile that begins at pixel `first`.
    fn columns(&self, dy: f32, first: u32, width: usize) -> Range<usize> {
        let (dy, center, end) = (f64::from(dy), self.center - f64::from(first), width as f64);
        let [x, y, z] = self.conic;
        let shift = y * dy;
        // The exponent is computed in f32, from a sum of two offsets.
        let far = center.abs().max((center - end).abs()) + shift.abs();
        let energy = self.energy + 4e-6 * x.sqrt() * far - z * dy * dy;
        if energy < 0.0 {
            return 0..0;
        }
        let (middle, half) = (center + shift, (energy / x).sqrt());
        let low = (middle - half).ceil().clamp(0.0, end);
        let high = ((middle + half).floor() + 1.0).clamp(0.0, end);
        low as usize..high as usize
    }
}
