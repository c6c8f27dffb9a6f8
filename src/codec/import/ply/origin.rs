//! Places far from 0, such as map coordinates, for which single precision has too few digits.
//!
//! In: the places of the Gaussians of a file in double precision, and their scales. Out: the origin that means are
//! relative to, 0 unless the places are far; sentences about it, and about digits that single precision does not have.

use super::header::Comments;
use super::table::Column;
use crate::codec::import::error::ImportError;
use crate::codec::import::in_pieces::middle_scale;
use glam::DVec3;

/// The comment with the origin in files of this crate: x, y and z.
pub(crate) const ORIGIN: &str = "gs4d.origin";

/// Places are far if the center of a scene is more than this many times its radius from 0.
const FAR: f64 = 1024.0;
/// The smallest radius of a scene, in scales of a Gaussian: a few Gaussians in one place have no other size.
const SMALLEST_RADIUS: f64 = 64.0;
/// Steps of single precision above this part of a Gaussian's scale are stated.
const COARSE: f64 = 0.125;
/// Most Gaussians that the center is taken from.
const MOST: usize = 1 << 16;

/// The places of Gaussians, in the coordinates of a file.
pub(super) struct Places<'a> {
    /// Number of Gaussians.
    pub count: usize,
    /// Whether the file has them in double precision.
    pub is_double: bool,
    /// Returns the place of a Gaussian.
    pub at: &'a (dyn Fn(usize) -> [f64; 3] + Sync),
}

/// Returns the origin that the comments of a file give.
///
/// # Errors
/// A comment that does not have three finite numbers.
pub(super) fn of_comments(comments: &Comments) -> Result<Option<[f64; 3]>, ImportError> {
    let Some(text) = comments.value(ORIGIN) else { return Ok(None) };
    let numbers: Option<Vec<f64>> = text.split_ascii_whitespace().map(|word| word.parse().ok()).collect();
    let origin = numbers.and_then(|numbers| <[f64; 3]>::try_from(numbers).ok());
    let is_finite = |origin: &[f64; 3]| origin.iter().all(|number| number.is_finite());
    origin.filter(is_finite).map(Some).ok_or_else(|| {
        ImportError::damaged(format!("its comment {ORIGIN} has \"{}\", not three numbers", text.escape_debug()))
    })
}

/// Returns the values of three columns in a row.
pub(super) fn place(columns: &[Column<'_>; 3], row: usize) -> [f64; 3] {
    std::array::from_fn(|axis| columns[axis].f64(row))
}

impl Places<'_> {
    /// Returns the origin of the places: that which is given, else the center in whole units if it is far, else 0.
    /// Sentences are added to `lost`.
    pub(super) fn origin(&self, log_scale: &[[f32; 3]], given: Option<[f64; 3]>, lost: &mut Vec<String>) -> [f64; 3] {
        let Some(middle) = Middle::of(self, log_scale) else { return given.unwrap_or_default() };
        let origin = given.unwrap_or_else(|| middle.origin());
        lost.extend(middle.sentence(origin, self.is_double));
        origin
    }

    /// Returns the mean of a Gaussian, relative to an origin.
    pub(super) fn mean(&self, index: usize, origin: [f64; 3]) -> [f32; 3] {
        let place = (self.at)(index);
        std::array::from_fn(|axis| (place[axis] - origin[axis]) as f32)
    }
}

/// The middle of the Gaussians, without those that are far from the others.
struct Middle {
    /// The median of each coordinate.
    center: [f64; 3],
    /// The distance from the center within which nine of ten are.
    radius: f64,
    /// The median of their middle scales.
    scale: f64,
}

impl Middle {
    /// Returns the middle of some of the Gaussians; `None` without a place that single precision could have.
    fn of(places: &Places<'_>, log_scale: &[[f32; 3]]) -> Option<Self> {
        let rows = || (0..places.count).step_by(places.count.div_ceil(MOST).max(1));
        let is_usable = |place: &[f64; 3]| place.iter().all(|&value| (value as f32).is_finite());
        let all: Vec<[f64; 3]> = rows().map(|row| (places.at)(row)).filter(is_usable).collect();
        let center = [0, 1, 2].map(|axis| quantile(all.iter().map(|place| place[axis]), 0.5));
        let from_center = |place: &[f64; 3]| DVec3::from(*place).distance(DVec3::from(center));
        let scales = rows().filter_map(|row| log_scale.get(row)).map(|&scale| f64::from(middle_scale(scale)));
        (!all.is_empty()).then(|| Self {
            center,
            radius: quantile(all.iter().map(from_center), 0.9),
            scale: quantile(scales.filter(|scale| scale.is_finite()), 0.5),
        })
    }

    /// Returns the coordinate of the center that is farthest from 0, without its sign.
    fn farthest(&self) -> f64 {
        self.center.iter().fold(0.0, |most, value| value.abs().max(most))
    }

    fn origin(&self) -> [f64; 3] {
        let radius = self.radius.max(SMALLEST_RADIUS * self.scale);
        let is_far = self.farthest() > FAR * radius;
        // Adding 0 makes −0 positive.
        if is_far { self.center.map(|value| value.round() + 0.0) } else { [0.0; 3] }
    }

    /// Returns the sentence about places with this origin; `None` if they are near 0 and lose no digits.
    fn sentence(&self, origin: [f64; 3], is_double: bool) -> Option<String> {
        let farthest = self.farthest() as f32;
        let step = f64::from(farthest.next_up()) - f64::from(farthest);
        let [x, y, z] = origin;
        let relative = format!("Its places are relative to ({x}, {y}, {z}), the origin of the capture");
        let single = format!("single precision has steps of {step} units at {farthest}");
        match (origin != [0.0; 3], is_double) {
            (true, true) => Some(format!("{relative}: {single}.")),
            (true, false) => Some(format!("{relative}. Digits were lost when it was written: {single}.")),
            (false, _) if self.scale > 0.0 && step > COARSE * self.scale => {
                let scale = self.scale;
                Some(format!("Its places are rounded: {single}, and the middle scale of its Gaussians is {scale:.3e}."))
            }
            (false, _) => None,
        }
    }
}

/// Returns a quantile of the values, `part` from 0 to 1; 0 without values.
fn quantile(values: impl Iterator<Item = f64>, part: f64) -> f64 {
    let mut values: Vec<f64> = values.collect();
    let index = (values.len().saturating_sub(1) as f64 * part) as usize;
    if values.is_empty() { 0.0 } else { *values.select_nth_unstable_by(index, f64::total_cmp).1 }
}
