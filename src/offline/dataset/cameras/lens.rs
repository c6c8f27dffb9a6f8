//! Picture sizes and lenses of training views.
//!
//! In: sizes, focal lengths and angles of a camera file, in pixels of the original pictures, and the requested size or
//! resolution. Out: the size to render at, its [`Lens`] and its [`Distortion`], or an error for a lens that cannot be
//! used.

use glam::{DVec2, UVec2};
use serde::Deserialize;
use serde_json::Value;

use super::distortion::Distortion;
use crate::codec::text::printable;
use crate::offline::dataset::{DatasetError, FrameProblem, MAX_SIDE};
use crate::view::{Camera, Lens};

/// The largest width with the resolution −1, pixels.
const AUTOMATIC_WIDTH: f64 = 1600.0;

/// Entries of camera files that distort the picture unless they are 0, `false` or lists of zeros: radial and tangential
/// coefficients as COLMAP, OpenCV and nerfstudio name them, a fisheye lens, an f-theta lens, and a rolling shutter as
/// instant-ngp names them.
const DISTORTING: [&str; 16] = [
    "k1",
    "k2",
    "k3",
    "k4",
    "k5",
    "k6",
    "p1",
    "p2",
    "distortion_params",
    "is_fisheye",
    "rolling_shutter",
    "ftheta_p0",
    "ftheta_p1",
    "ftheta_p2",
    "ftheta_p3",
    "ftheta_p4",
];

/// The entry that names the camera model, and the models that are pinhole cameras if every coefficient is 0.
const CAMERA_MODEL: &str = "camera_model";
const PINHOLES: [&str; 3] = ["PINHOLE", "SIMPLE_PINHOLE", "OPENCV"];

/// The models whose coefficients are undone, and whether they are fisheye lenses. Without a model, the first one.
const MODELS: [(&str, bool); 4] =
    [("OPENCV", false), ("SIMPLE_RADIAL", false), ("RADIAL", false), ("OPENCV_FISHEYE", true)];

/// The entries of coefficients that are undone: four radial and two tangential coefficients.
const COEFFICIENTS: [&str; 6] = ["k1", "k2", "k3", "k4", "p1", "p2"];

/// Largest distance of the principal point of a golden view from the center of the picture, pixels: the error of a
/// rounded decimal number.
const CENTERED: f64 = 1e-3;

/// Largest shift of a pixel by a skew that is left out, pixels.
const SKEWED: f64 = 0.5;

/// The camera entries of a file or of one of its frames.
#[derive(Debug, Clone, Copy, Default, Deserialize)]
#[serde(default, expecting = "an object")]
pub(crate) struct LensEntries {
    w: Option<f64>,
    h: Option<f64>,
    fl_x: Option<f64>,
    fl_y: Option<f64>,
    cx: Option<f64>,
    cy: Option<f64>,
    camera_angle_x: Option<f64>,
}

/// A lens in pixels of the original pictures, whose size may not be known yet.
#[derive(Debug, Clone, Copy)]
pub(crate) enum OriginalLens {
    /// Horizontal field of view in radians.
    Angle(f64),
    /// Tangents of the half-angles.
    Tangents(DVec2),
    /// Focal lengths and principal point.
    Intrinsics { focal: DVec2, center: DVec2 },
}

impl LensEntries {
    /// Returns these entries, with missing entries replaced by the entries of the whole file.
    pub(crate) fn or(self, file: &Self) -> Self {
        Self {
            w: self.w.or(file.w),
            h: self.h.or(file.h),
            fl_x: self.fl_x.or(file.fl_x),
            fl_y: self.fl_y.or(file.fl_y),
            cx: self.cx.or(file.cx),
            cy: self.cy.or(file.cy),
            camera_angle_x: self.camera_angle_x.or(file.camera_angle_x),
        }
    }

    /// Returns the picture size in pixels; `None` unless both sides are given.
    pub(crate) fn size(&self) -> Result<Option<UVec2>, FrameProblem> {
        self.w.zip(self.h).map(|(width, height)| checked_size(width, height)).transpose()
    }

    /// Returns the lens of the intrinsics; `None` unless all four entries are given.
    pub(crate) fn intrinsics(&self) -> Option<OriginalLens> {
        let focal = DVec2::new(self.fl_x?, self.fl_y?);
        Some(OriginalLens::Intrinsics { focal, center: DVec2::new(self.cx?, self.cy?) })
    }

    /// Returns the lens: intrinsics if all four entries are given, as in the original, else the field of view.
    pub(crate) fn lens(&self) -> Result<OriginalLens, FrameProblem> {
        if let Some(lens) = self.intrinsics() {
            return Ok(lens);
        }
        let angle = self.camera_angle_x.ok_or(FrameProblem::NoLens)?;
        if angle > 0.0 && angle < std::f64::consts::PI {
            Ok(OriginalLens::Angle(angle))
        } else {
            Err(FrameProblem::FieldOfView(angle))
        }
    }
}

impl OriginalLens {
    /// Returns the lens for pictures that are smaller than the original pictures by `divisor`, with the same field of
    /// view.
    pub(crate) fn scaled(self, original: UVec2, divisor: DVec2) -> Result<Lens, FrameProblem> {
        let lens = match self {
            Self::Angle(angle) => Camera::fov_lens(angle, original),
            Self::Tangents(tan) => Lens::Fov { tan: tan.as_vec2() },
            Self::Intrinsics { focal, center } => {
                Lens::Intrinsics { focal: (focal / divisor).as_vec2(), center: (center / divisor).as_vec2() }
            }
        };
        let (positive, offset) = match lens {
            Lens::Fov { tan } => (tan, glam::Vec2::ZERO),
            Lens::Intrinsics { focal, center } => (focal, center),
        };
        let usable = positive.is_finite() && positive.min_element() > 0.0 && offset.is_finite();
        if usable { Ok(lens) } else { Err(FrameProblem::Lens) }
    }
}

/// Checks that a frame is the picture of a pinhole camera. An entry of the frame replaces the entry of the whole file;
/// `null` is no entry.
pub(crate) fn check_pinhole(frame: &Value, file: &Value) -> Result<(), FrameProblem> {
    let entry = |name| [frame, file].into_iter().filter_map(|from| from.get(name)).find(|value| !value.is_null());
    if let Some(model) = entry(CAMERA_MODEL) {
        let is_pinhole = |model: &str| PINHOLES.iter().any(|name| model.eq_ignore_ascii_case(name));
        if !model.as_str().is_some_and(is_pinhole) {
            let shown = model.as_str().map_or_else(|| model.to_string(), str::to_owned);
            return Err(FrameProblem::CameraModel(printable(&shown)));
        }
    }
    let refused = |name: &'static str| Some((name, entry(name).filter(|value| !is_zero(value))?));
    DISTORTING.into_iter().find_map(refused).map_or(Ok(()), |(name, value)| Err(distorted(name, value)))
}

/// Returns the distortion of a frame of the Blender form. An entry of the frame replaces the entry of the whole file;
/// `null` is no entry.
pub(crate) fn distortion(frame: &Value, file: &Value) -> Result<Distortion, FrameProblem> {
    let entry = |name| [frame, file].into_iter().filter_map(|from| from.get(name)).find(|value| !value.is_null());
    let model = entry(CAMERA_MODEL).and_then(Value::as_str);
    let model = MODELS.iter().find(|(name, _)| model.unwrap_or("OPENCV").eq_ignore_ascii_case(name));
    let Some(&(_, fisheye)) = model.filter(|_| entry(CAMERA_MODEL).is_none_or(Value::is_string)) else {
        check_pinhole(frame, file)?;
        return Ok(Distortion::default());
    };
    let undone = |name: &str| COEFFICIENTS.contains(&name) && !(fisheye && name.starts_with('p'));
    let is_refused = |name: &str, value: &Value| !(is_zero(value) || undone(name) && value.is_number());
    let refused = |name: &'static str| Some((name, entry(name).filter(|value| is_refused(name, value))?));
    if let Some((name, value)) = DISTORTING.into_iter().find_map(refused) {
        return Err(distorted(name, value));
    }
    let value = |name| entry(name).and_then(Value::as_f64).unwrap_or(0.0);
    Ok(Distortion {
        fisheye,
        radial: ["k1", "k2", "k3", "k4"].map(value),
        denominator: [0.0; 3],
        tangential: if fisheye { [0.0; 2] } else { ["p1", "p2"].map(value) },
    })
}

fn distorted(entry: &'static str, value: &Value) -> FrameProblem {
    FrameProblem::Distorted { entry, value: printable(&value.to_string()) }
}

fn is_zero(value: &Value) -> bool {
    match value {
        Value::Null | Value::Bool(false) => true,
        Value::Number(number) => number.as_f64() == Some(0.0),
        Value::Array(values) => values.iter().all(is_zero),
        Value::Bool(true) | Value::String(_) | Value::Object(_) => false,
    }
}

/// Checks that a coordinate of the principal point, if given, is half the side of the picture.
pub(crate) fn check_centered(entry: &'static str, found: Option<f64>, side: f64) -> Result<(), FrameProblem> {
    let center = side / 2.0;
    match found {
        Some(found) if (found - center).abs() > CENTERED => Err(FrameProblem::PrincipalPoint { entry, found, center }),
        _ => Ok(()),
    }
}

/// Checks that the skew of a lens, which is left out, moves no pixel by more than half a pixel. The skew is the shift
/// per unit of the vertical coordinate at distance 1; all values are pixels.
pub(crate) fn check_skew(skew: f64, focal: f64, center: f64, height: f64) -> Result<(), FrameProblem> {
    let shift = skew * center.abs().max((height - center).abs()) / focal;
    if skew == 0.0 || shift.abs() <= SKEWED {
        Ok(())
    } else {
        Err(FrameProblem::Distorted { entry: "skew", value: skew.to_string() })
    }
}

/// Returns a picture size from a file: whole numbers, possibly written as `400.0`.
pub(crate) fn checked_size(width: f64, height: f64) -> Result<UVec2, FrameProblem> {
    let side =
        |value: f64| (value.fract() == 0.0 && (1.0..=f64::from(MAX_SIDE)).contains(&value)).then_some(value as u32);
    side(width).zip(side(height)).map(UVec2::from).ok_or(FrameProblem::Size { width, height })
}

/// Returns the size at a resolution and the divisor for focal lengths (the original divides them by the requested
/// factor, not by the ratio of the rounded sizes).
pub(crate) fn reduced(original: UVec2, resolution: Option<i32>) -> Result<(UVec2, f64), DatasetError> {
    let full = original.as_dvec2();
    let (size, divisor) = match resolution {
        None => (full, 1.0),
        // Halves are rounded to the even number, as by the `round` of Python.
        Some(divisor @ (1 | 2 | 3 | 4 | 8)) => (full / f64::from(divisor), f64::from(divisor)),
        Some(-1) => rounded_down(full, (full.x / AUTOMATIC_WIDTH).max(1.0)),
        Some(width) => rounded_down(full, full.x / f64::from(width)),
    };
    let size = DVec2::new(size.x.round_ties_even(), size.y.round_ties_even());
    let usable = size.min_element() >= 1.0 && size.max_element() <= f64::from(MAX_SIDE);
    match resolution {
        Some(resolution) if !usable => Err(DatasetError::Resolution { resolution, original }),
        _ => Ok((size.as_uvec2(), divisor)),
    }
}

/// Divides and rounds down, as the original does if the divisor comes from a width, but makes that width exact:
/// in the original, 1601 pixels limited to 1600 become 1599, because the division is rounded.
fn rounded_down(full: DVec2, divisor: f64) -> (DVec2, f64) {
    ((full / divisor + 1e-6).floor(), divisor)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn size_at(width: u32, height: u32, resolution: i32) -> Option<(u32, u32)> {
        reduced(UVec2::new(width, height), Some(resolution)).ok().map(|(size, _)| (size.x, size.y))
    }

    #[test]
    fn resolutions_give_the_sizes_of_the_original() {
        assert_eq!(size_at(800, 800, 2), Some((400, 400)), "D-NeRF");
        assert_eq!(size_at(2704, 2028, 2), Some((1352, 1014)), "N3V");
        assert_eq!(size_at(13, 9, 2), Some((6, 4)), "6.5 and 4.5 round to even");
        assert_eq!(size_at(10, 14, 4), Some((2, 4)), "2.5 and 3.5 round to even");
        assert_eq!(size_at(800, 600, -1), Some((800, 600)), "a width below 1600 is unchanged");
        assert_eq!(size_at(3200, 2000, -1), Some((1600, 1000)), "a width above 1600 is limited to 1600");
        assert_eq!(size_at(1601, 1000, -1), Some((1600, 999)), "999.4 is rounded down, the width is exactly 1600");
        assert_eq!(size_at(800, 600, 200), Some((200, 150)), "a target width");
    }

    #[test]
    fn unusable_resolutions_are_refused() {
        for resolution in [0, -2, i32::MIN, i32::MAX, MAX_SIDE as i32 + 1] {
            assert_eq!(size_at(800, 600, resolution), None, "resolution {resolution}");
        }
        assert_eq!(size_at(3, 3, 8), None, "a size of 0 pixels");
    }

    #[test]
    fn focal_lengths_are_divided_by_the_factor_not_by_the_size_ratio() {
        let (size, divisor) = reduced(UVec2::new(13, 9), Some(2)).expect("a valid resolution");
        assert_eq!((size, divisor), (UVec2::new(6, 4), 2.0), "13 / 6 is not 2");
    }

    #[test]
    fn a_skew_of_less_than_half_a_pixel_is_left_out() {
        // At the lower side of a picture of 1000 pixels, 600 below the center, the shift is 600 / 1200 of the skew.
        for (skew, is_left_out) in
            [(0.0, true), (0.9, true), (-0.9, true), (1.1, false), (-1.1, false), (f64::NAN, false)]
        {
            assert_eq!(check_skew(skew, 1200.0, 400.0, 1000.0).is_ok(), is_left_out, "a skew of {skew}");
        }
        let error = check_skew(2.5, 1200.0, 400.0, 1000.0).expect_err("a large skew").to_string();
        assert!(error.contains("skew is not 0 but 2.5"), "{error}");
    }

    #[test]
    fn sizes_from_files_are_checked() {
        assert_eq!(checked_size(400.0, 300.0).ok(), Some(UVec2::new(400, 300)), "whole numbers");
        for bad in [0.0, -1.0, 0.5, 1e9, f64::NAN, f64::INFINITY] {
            assert!(checked_size(bad, 10.0).is_err() && checked_size(10.0, bad).is_err(), "{bad}");
        }
    }
}
