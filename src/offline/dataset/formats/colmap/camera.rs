//! The cameras of a model.
//!
//! In: the model of a lens and its parameters. Out: size, lens and distortion, or the reason why the lens cannot be
//! used.

use crate::offline::dataset::FrameProblem;
use crate::offline::dataset::cameras::distortion::Distortion;
use crate::offline::dataset::cameras::lens::{OriginalLens, checked_size};
use glam::{DVec2, UVec2};

/// A camera of a model.
pub(crate) struct ModelCamera {
    pub size: UVec2,
    pub lens: OriginalLens,
    pub distortion: Distortion,
}

/// The models of COLMAP by number: name, number of parameters, number of focal lengths.
pub(crate) const MODELS: [(&str, usize, usize); 18] = [
    ("SIMPLE_PINHOLE", 3, 1),
    ("PINHOLE", 4, 2),
    ("SIMPLE_RADIAL", 4, 1),
    ("RADIAL", 5, 1),
    ("OPENCV", 8, 2),
    ("OPENCV_FISHEYE", 8, 2),
    ("FULL_OPENCV", 12, 2),
    ("FOV", 5, 2),
    ("SIMPLE_RADIAL_FISHEYE", 4, 1),
    ("RADIAL_FISHEYE", 5, 1),
    ("THIN_PRISM_FISHEYE", 12, 2),
    ("RAD_TAN_THIN_PRISM_FISHEYE", 16, 2),
    ("SIMPLE_DIVISION", 4, 1),
    ("DIVISION", 5, 2),
    ("SIMPLE_FISHEYE", 3, 1),
    ("FISHEYE", 4, 2),
    ("EUCM", 6, 2),
    ("EQUIRECTANGULAR", 2, 0),
];

impl ModelCamera {
    /// Returns a camera with as many parameters as its model has.
    ///
    /// # Errors
    /// The reason why it cannot be used, with the remedy.
    pub(crate) fn new(model: usize, size: [u64; 2], parameters: &[f64]) -> Result<Self, String> {
        let &(name, count, focals) = MODELS.get(model).ok_or_else(|| unknown(&model.to_string()))?;
        if parameters.len() != count {
            return Err(format!("a camera of the model {name} has {} parameters, not {count}", parameters.len()));
        }
        let distortion = |fisheye, radial: &[f64], tangential: [f64; 2], denominator: [f64; 3]| {
            let mut all = [0.0; 4];
            all[..radial.len()].copy_from_slice(radial);
            Distortion { fisheye, radial: all, denominator, tangential }
        };
        let (lens, rest) = parameters.split_at(focals + 2);
        let none = [0.0; 2];
        let distortion = match (name, rest) {
            ("SIMPLE_PINHOLE" | "PINHOLE", _) => Distortion::default(),
            ("SIMPLE_RADIAL" | "RADIAL", radial) => distortion(false, radial, none, [0.0; 3]),
            ("OPENCV", &[k1, k2, p1, p2]) => distortion(false, &[k1, k2], [p1, p2], [0.0; 3]),
            ("FULL_OPENCV", &[k1, k2, p1, p2, k3, k4, k5, k6]) => {
                distortion(false, &[k1, k2, k3], [p1, p2], [k4, k5, k6])
            }
            ("OPENCV_FISHEYE" | "SIMPLE_RADIAL_FISHEYE" | "RADIAL_FISHEYE" | "SIMPLE_FISHEYE" | "FISHEYE", radial) => {
                distortion(true, radial, none, [0.0; 3])
            }
            _ => return Err(FrameProblem::CameraModel(name.to_owned()).to_string()),
        };

        let size = checked_size(size[0] as f64, size[1] as f64).map_err(|problem| problem.to_string())?;
        let (focal, center) = match *lens {
            [f, x, y] => (DVec2::splat(f), DVec2::new(x, y)),
            [fx, fy, x, y] => (DVec2::new(fx, fy), DVec2::new(x, y)),
            _ => return Err(FrameProblem::Lens.to_string()),
        };
        let is_finite = parameters.iter().all(|parameter| parameter.is_finite());
        if !is_finite {
            return Err(FrameProblem::Lens.to_string());
        }
        Ok(Self { size, lens: OriginalLens::Intrinsics { focal, center }, distortion })
    }
}

/// Returns the reason why an unknown model cannot be used.
pub(crate) fn unknown(model: &str) -> String {
    FrameProblem::CameraModel(crate::codec::text::printable(model)).to_string()
}
