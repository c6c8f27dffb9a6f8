//! How the picture of a standing camera has moved.
//!
//! In: two small pictures of one camera, which pixels stand still. Out: [`Motion`]: the scale, the turn and the shift
//! from one to the other. Patches with texture are searched within 8 pixels (normalized cross-correlation), and a
//! similarity is fitted to their displacements (least squares; displacements that do not fit are rejected). Where masks
//! leave too few patches, they are not used: the fit to most of the patches rejects what moves.

use super::evidence::Sample;
use super::plane::{Plane, median};
use glam::Vec2;

/// Patches along the longer and the shorter side.
const PATCHES: [u32; 2] = [12, 8];
/// Half of the side of a patch, and the farthest displacement, pixels.
const HALF: u32 = 8;
const FAR: u32 = 8;
/// Shifts along one axis.
const SHIFTS: usize = 2 * FAR as usize + 1;
/// Least standard deviation of the values of a patch, and least correlation of a match.
const TEXTURE: f32 = 4.0;
const ALIKE: f32 = 0.8;
/// Share of the pixels of a patch that may move.
const MOVING: f32 = 0.1;
/// Fewest matches of a fit, and its rounds.
const FEWEST: usize = 6;
const ROUNDS: usize = 8;
/// Residual below which no match is rejected, pixels.
const FITS: f32 = 0.5;
/// Largest median residual of matches that agree, pixels.
const AGREES: f32 = 1.0;

/// A displacement of the picture: a point at `p` from the middle moves by `growth * p + turn * (-p.y, p.x) + shift`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Motion {
    /// Scale, less 1.
    pub growth: f32,
    /// Tangent of the angle of the turn.
    pub turn: f32,
    /// Shift of the middle, pixels.
    pub shift: Vec2,
}

/// The result of a comparison.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Registered {
    /// The picture has moved so.
    Moved(Motion),
    /// The patches are not found again.
    Lost,
    /// Too few patches have texture and stand still.
    Bare,
}

/// Returns how the picture has moved from one sample to another one of the same camera.
pub(super) fn registered(from: &Sample, to: &Sample) -> Registered {
    let masked = compared(from, to, true);
    if masked != Registered::Bare {
        return masked;
    }
    match compared(from, to, false) {
        moved @ Registered::Moved(_) => moved,
        // What moves may fill the picture.
        Registered::Lost | Registered::Bare => Registered::Bare,
    }
}

/// Returns how the picture has moved, by what stands still or by the whole picture.
fn compared(from: &Sample, to: &Sample, is_masked: bool) -> Registered {
    let size = from.gray.size;
    if size != to.gray.size || size.min_element() <= 2 * (HALF + FAR) + 1 {
        return Registered::Bare;
    }
    let [long, short] = PATCHES;
    let [columns, rows] = if size.y > size.x { [short, long] } else { [long, short] };
    let margin = HALF + FAR;
    let center = |index: u32, count: u32, length: u32| {
        ((2 * index + 1) * length / (2 * count)).clamp(margin, length - 1 - margin)
    };
    let (mut tried, mut matches) = (0, Vec::new());
    for row in 0..rows {
        for column in 0..columns {
            let (x, y) = (center(column, columns, size.x), center(row, rows, size.y));
            let Some(patch) = Patch::of(from, to, [x, y], is_masked) else { continue };
            tried += 1;
            if let Some(displacement) = patch.found(&to.gray) {
                let place = Vec2::new(x as f32, y as f32) - size.as_vec2() / 2.0;
                matches.push((place, displacement));
            }
        }
    }
    if tried < 2 * FEWEST {
        return Registered::Bare;
    }
    let fewest = if is_masked { tried / 8 } else { matches.len() / 2 };
    fit(&matches, FEWEST.max(fewest)).map_or(Registered::Lost, Registered::Moved)
}

impl Registered {
    /// Returns the motion, if one was found.
    pub(super) fn motion(self) -> Option<Motion> {
        match self {
            Self::Moved(motion) => Some(motion),
            Self::Lost | Self::Bare => None,
        }
    }
}

impl Motion {
    /// Returns the displacement of a point, pixels from the middle.
    fn at(&self, place: Vec2) -> Vec2 {
        self.growth * place + self.turn * place.perp() + self.shift
    }

    /// Returns the similarity of least squares.
    fn of(matches: &[(Vec2, Vec2)]) -> Self {
        let count = matches.len().max(1) as f32;
        let middle = matches.iter().map(|(place, _)| *place).sum::<Vec2>() / count;
        let mean = matches.iter().map(|(_, moved)| *moved).sum::<Vec2>() / count;
        let (mut along, mut across, mut square) = (0.0, 0.0, 0.0);
        for (place, moved) in matches {
            let (place, moved) = (*place - middle, *moved - mean);
            along += place.dot(moved);
            across += place.perp().dot(moved);
            square += place.length_squared();
        }
        let (growth, turn) = (along / square.max(1.0), across / square.max(1.0));
        Self { growth, turn, shift: mean - growth * middle - turn * middle.perp() }
    }
}

/// Returns the similarity that at least `fewest` matches agree on, to a pixel.
fn fit(matches: &[(Vec2, Vec2)], fewest: usize) -> Option<Motion> {
    let mut kept = matches.to_vec();
    let mut motion = Motion::of(&kept);
    for _ in 0..ROUNDS {
        let residual = |(place, moved): &(Vec2, Vec2)| (*moved - motion.at(*place)).length();
        let limit = (3.0 * median(kept.iter().map(residual).collect())?).max(FITS);
        let next: Vec<(Vec2, Vec2)> = matches.iter().filter(|pair| residual(pair) <= limit).copied().collect();
        if next.len() < fewest || next == kept {
            break;
        }
        motion = Motion::of(&next);
        kept = next;
    }
    let left = median(kept.iter().map(|(place, moved)| (*moved - motion.at(*place)).length()).collect())?;
    (kept.len() >= fewest && left <= AGREES).then_some(motion)
}

/// A square of a picture.
struct Patch {
    x: u32,
    y: u32,
    /// Values less their mean, of length 1.
    values: Vec<f32>,
}

impl Patch {
    /// Returns the patch around a pixel; `None` if it has no texture or, by masks if they are used, moves.
    fn of(from: &Sample, to: &Sample, [x, y]: [u32; 2], is_masked: bool) -> Option<Self> {
        let mut values = Vec::new();
        let mut moving = 0_usize;
        for row in y - HALF..=y + HALF {
            for column in x - HALF..=x + HALF {
                values.push(from.gray.at(column, row));
                moving += usize::from(is_masked && !(from.stands(column, row) && to.stands(column, row)));
            }
        }
        let count = values.len() as f32;
        let mean = values.iter().sum::<f32>() / count;
        values.iter_mut().for_each(|value| *value -= mean);
        let length = values.iter().map(|value| value * value).sum::<f32>().sqrt();
        values.iter_mut().for_each(|value| *value /= length.max(1e-6));
        let is_usable = length >= TEXTURE * count.sqrt() && moving as f32 <= MOVING * count;
        is_usable.then_some(Self { x, y, values })
    }

    /// Returns its displacement in another picture, pixels; `None` if nothing there is alike.
    fn found(&self, other: &Plane) -> Option<Vec2> {
        let mut scores = [[-1.0_f32; SHIFTS]; SHIFTS];
        let mut best = (-1.0, 0, 0);
        for (down, line) in scores.iter_mut().enumerate() {
            for (across, score) in line.iter_mut().enumerate() {
                *score = self.correlation(other, across as u32, down as u32);
                if *score > best.0 {
                    best = (*score, across, down);
                }
            }
        }
        let (score, across, down) = best;
        let is_inside = |at: usize| at > 0 && at + 1 < SHIFTS;
        if score < ALIKE || !is_inside(across) || !is_inside(down) {
            return None;
        }
        let peak = |before: f32, after: f32| {
            let curvature = before - 2.0 * score + after;
            if curvature < -1e-6 { 0.5 * (before - after) / curvature } else { 0.0 }
        };
        let x = across as f32 + peak(scores[down][across - 1], scores[down][across + 1]);
        let y = down as f32 + peak(scores[down - 1][across], scores[down + 1][across]);
        Some(Vec2::new(x, y) - FAR as f32)
    }

    /// Returns the correlation with the patch of another picture that is shifted by so many pixels, less 8.
    fn correlation(&self, other: &Plane, across: u32, down: u32) -> f32 {
        let side = 2 * HALF as usize + 1;
        let width = other.size.x as usize;
        let first = (self.y + down - FAR - HALF) as usize * width + (self.x + across - FAR - HALF) as usize;
        let (mut sum, mut square, mut product) = (0.0_f32, 0.0_f32, 0.0_f32);
        for (row, values) in self.values.chunks_exact(side).enumerate() {
            let line = &other.values[first + row * width..][..side];
            for (own, value) in values.iter().zip(line) {
                sum += value;
                square += value * value;
                product += own * value;
            }
        }
        let spread = square - sum * sum / self.values.len() as f32;
        if spread > 1.0 { product / spread.sqrt() } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::super::evidence::tests::textured;
    use super::*;

    fn motion(scale: f32, shift: f32) -> Registered {
        let sample = |scale, shift| Sample::new(0, textured(scale, shift, 1.0), None);
        registered(&sample(1.0, 0.0), &sample(scale, shift))
    }

    #[test]
    fn scale_and_shift_are_found() {
        let still = motion(1.0, 0.0).motion().expect("the same picture is found");
        assert!(still.growth.abs() < 1e-4 && still.shift.length() < 0.05, "nothing has moved: {still:?}");
        let zoomed = motion(1.04, 0.0).motion().expect("it is found at 1.04");
        assert!((zoomed.growth - 0.04).abs() < 0.006, "a scale of 1.04: {zoomed:?}");
        let shifted = motion(1.0, 3.0).motion().expect("it is found 3 pixels away");
        assert!((shifted.shift - Vec2::new(3.0, 0.0)).length() < 0.1, "to the right: {shifted:?}");
    }

    #[test]
    fn masks_that_leave_too_little_are_not_used() {
        let all = || Some(image::GrayImage::from_pixel(4, 4, image::Luma([255])));
        let sample = |shift| Sample::new(0, textured(1.0, shift, 1.0), all());
        let shifted = registered(&sample(0.0), &sample(3.0)).motion().expect("it is found by the whole picture");
        assert!((shifted.shift - Vec2::new(3.0, 0.0)).length() < 0.1, "to the right: {shifted:?}");
        assert_eq!(registered(&sample(0.0), &sample(300.0)), Registered::Bare, "nothing is known of the background");
    }

    #[test]
    fn a_picture_of_something_else_is_lost_and_a_flat_one_is_bare() {
        assert_eq!(motion(1.0, 300.0), Registered::Lost, "other blocks");
        let flat = Sample::new(0, image::RgbImage::from_pixel(160, 120, image::Rgb([80; 3])), None);
        assert_eq!(registered(&flat, &flat), Registered::Bare, "no texture");
    }
}
