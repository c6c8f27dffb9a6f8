//! Google Immersive (`DeepView`): `models.json` with a video or a folder of frames for each camera.
//!
//! In: a folder. Out: the views of all cameras at all frames. The file has a list of cameras: name, position, rotation
//! from the world to the camera as a vector, focal length, principal point, size, and a fisheye lens with two
//! coefficients, of which the formula is that of OpenCV. `footage` finds the frames by the names of the cameras.
//! `camera_0001` is the test camera, as in published figures.
//!
//! Pictures become pinhole pictures of the same focal length or longer, so that they lose their border: a note says how
//! much.

use super::footage::{self, Calibration, RigCamera};
use super::json;
use super::undivided::Undivided;
use super::video::Videos;
use crate::codec::text::printable;
use crate::offline::dataset::cameras::distortion::Distortion;
use crate::offline::dataset::cameras::lens::{OriginalLens, checked_size};
use crate::offline::dataset::cameras::pose;
use crate::offline::dataset::{CameraOptions, DatasetError, FrameProblem, Split, TrainingView};
use crate::view::Lens;
use glam::{DQuat, DVec2, DVec3};
use serde::Deserialize;
use serde_json::Value;
use std::f64::consts::PI;
use std::path::Path;

/// Name of the file of cameras.
const CAMERAS: &str = "models.json";
/// The test camera.
const TEST: &str = "camera_0001";
/// Projections of fisheye lenses and of others.
const FISHEYE: &str = "fisheye";
const PINHOLES: [&str; 2] = ["perspective", "pinhole"];
/// Largest number of radial coefficients.
const COEFFICIENTS: usize = 4;
/// Bisections of an angle.
const BISECTIONS: usize = 40;

/// A camera of the file.
#[derive(Deserialize)]
#[serde(expecting = "an object")]
struct Model {
    name: String,
    position: [f64; 3],
    /// Axis of the rotation from the world to the camera, times its angle in radians.
    orientation: [f64; 3],
    focal_length: f64,
    principal_point: [f64; 2],
    width: f64,
    height: f64,
    pixel_aspect_ratio: Option<f64>,
    #[serde(default)]
    radial_distortion: Vec<f64>,
    projection_type: Option<String>,
}

/// Returns whether a folder has the file with a list of cameras, or one that is no JSON.
pub(crate) fn is_there(folder: &Path) -> bool {
    let path = folder.join(CAMERAS);
    let is_camera = |entry: &Value| ["orientation", "focal_length"].iter().all(|name| entry.get(name).is_some());
    let are_cameras = |list: Value| list.as_array().is_some_and(|list| list.first().is_some_and(is_camera));
    path.is_file() && json::read(&path).map_or(true, are_cameras)
}

/// Reads the views of a folder.
pub(crate) fn read(folder: &Path, options: &CameraOptions, videos: Videos<'_>) -> Result<Undivided, DatasetError> {
    let source = folder.join(CAMERAS);
    let list = json::read(&source)?;
    let entries = list.as_array().map_or(&[][..], Vec::as_slice);
    let mut models = Vec::new();
    for (frame, entry) in entries.iter().enumerate() {
        let model = Model::deserialize(entry).map_err(FrameProblem::Malformed);
        let camera = model.and_then(|model| model.camera());
        models.push(camera.map_err(|problem| DatasetError::Frame { path: source.clone(), frame, problem })?);
    }
    let widths: Vec<Option<f64>> = models.iter().map(fisheye_width).collect();
    let test = models.iter().position(|camera| camera.name == TEST);
    let calibration = Calibration { source, cameras: models, notes: Vec::new() };
    let (mut all, cameras) = footage::read_with_cameras(folder, calibration, options, videos)?;
    // Footage has the names of the cameras but for letter case and signs.
    let is_test = |camera: &usize| Some(*camera) == test;
    if cameras.iter().any(is_test) && !cameras.iter().all(is_test) {
        let split = |camera: &usize| Some(if is_test(camera) { Split::Test } else { Split::Train });
        all.splits = Some(cameras.iter().map(split).collect());
        all.notes.push(format!("{TEST} is the test camera, as in published figures"));
    }
    all.notes.extend(narrowed(&all.views, &cameras, &widths));
    Ok(all)
}

impl Model {
    fn camera(self) -> Result<RigCamera, FrameProblem> {
        let axis = DVec3::from(self.orientation);
        if !axis.length().is_finite() {
            return Err(FrameProblem::Matrix("has an orientation that is too large".into()));
        }
        let turn = DQuat::from_scaled_axis(axis);
        let translation = -(turn * DVec3::from(self.position));
        let focal = DVec2::new(1.0, self.pixel_aspect_ratio.unwrap_or(1.0)) * self.focal_length;
        Ok(RigCamera {
            size: Some(checked_size(self.width, self.height)?),
            world_to_camera: pose::of_rotation([turn.w, turn.x, turn.y, turn.z], translation.to_array())?,
            lens: OriginalLens::Intrinsics { focal, center: DVec2::from(self.principal_point) },
            distortion: self.distortion()?,
            name: self.name,
        })
    }

    fn distortion(&self) -> Result<Distortion, FrameProblem> {
        let given = &self.radial_distortion;
        let mut radial = [0.0; COEFFICIENTS];
        let Some(used) = radial.get_mut(..given.len()) else {
            let value = printable(&format!("{given:?}"));
            return Err(FrameProblem::Distorted { entry: "radial_distortion", value });
        };
        used.copy_from_slice(given);
        let projection = self.projection_type.as_deref().unwrap_or(FISHEYE);
        let fisheye = projection.eq_ignore_ascii_case(FISHEYE);
        if fisheye || PINHOLES.iter().any(|pinhole| projection.eq_ignore_ascii_case(pinhole)) {
            Ok(Distortion { fisheye, radial, ..Distortion::default() })
        } else {
            Err(FrameProblem::CameraModel(printable(projection)))
        }
    }
}

/// Returns the angle that the pictures of a fisheye lens are wide, radians; `None` of another lens.
fn fisheye_width(camera: &RigCamera) -> Option<f64> {
    let (OriginalLens::Intrinsics { focal, center }, true) = (camera.lens, camera.distortion.fisheye) else {
        return None;
    };
    let width = f64::from(camera.size?.x);
    Some([center.x, width - center.x].map(|side| angle(side / focal.x, camera.distortion.radial)).iter().sum())
}

/// Returns the angle between the axis of a fisheye lens and a place at this distance from the center of its pictures,
/// in focal lengths; radians, at most half a turn.
fn angle(distance: f64, [k1, k2, k3, k4]: [f64; COEFFICIENTS]) -> f64 {
    let (mut low, mut high) = (0.0, PI);
    for _ in 0..BISECTIONS {
        let middle = 0.5 * (low + high);
        let a2 = middle * middle;
        let distorted = middle * (1.0 + a2 * (k1 + a2 * (k2 + a2 * (k3 + a2 * k4))));
        if distorted < distance { low = middle } else { high = middle }
    }
    high
}

/// Returns a sentence about the border that pictures of fisheye lenses lose, by the camera that loses most. `cameras`
/// are those of the views, `widths` the angles that the pictures of each camera are wide.
fn narrowed(views: &[TrainingView], cameras: &[usize], widths: &[Option<f64>]) -> Option<String> {
    let kept = |(camera, width): (usize, &Option<f64>)| {
        let width = (*width)?;
        let view = views.get(cameras.iter().position(|of_view| *of_view == camera)?)?;
        let Lens::Intrinsics { focal, center } = view.camera.lens else { return None };
        let sides = [center.x, view.camera.size.x as f32 - center.x].map(|side| f64::from(side / focal.x).atan());
        Some([width, sides.iter().sum()].map(f64::to_degrees))
    };
    let lost = |[width, kept]: &[f64; 2]| width - kept;
    let most = widths.iter().enumerate().filter_map(kept).max_by(|a, b| lost(a).total_cmp(&lost(b)));
    let [width, kept] = most.filter(|most| lost(most) >= 1.0)?;
    Some(format!(
        "pictures of fisheye lenses, up to {width:.0} degrees wide, become pinhole pictures of {kept:.0} degrees: what \
         lies further out is left out"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_of_a_fisheye_lens_are_found_from_distances() {
        let coefficients = [0.097, -0.017, 0.0, 0.0];
        for expected in [0.1f64, 0.7, 1.2] {
            let distance = expected + 0.097 * expected.powi(3) - 0.017 * expected.powi(5);
            let found = angle(distance, coefficients);
            assert!((found - expected).abs() < 1e-9, "{expected} radians, not {found}");
        }
        assert!((angle(9.0, [0.0; 4]) - PI).abs() < 1e-9, "half a turn at most");
    }
}
