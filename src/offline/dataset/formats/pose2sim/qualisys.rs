//! Qualisys' calibrations, `*.qca.txt`: XML.
//!
//! In: a file with an element `camera` for each camera, in which are `fov_video`, `transform` and `intrinsic`. Out: the
//! cameras with OpenCV's axes, places in meters.
//!
//! `transform` has the place of a camera in millimeters and its axes in the world as rows: to the right, up and
//! backwards. `intrinsic` has lengths in 64ths of a pixel of the whole sensor. `video_resolution` tells by how much the
//! pictures are smaller than the 1080 lines of the sensor.

use crate::codec::text::printable;
use crate::offline::dataset::cameras::lens::checked_size;
use crate::offline::dataset::cameras::opencv;
use crate::offline::dataset::formats::footage::{Calibration, RigCamera, listed};
use crate::offline::dataset::{DatasetError, FrameProblem};
use glam::{DVec2, DVec3, UVec2};
use std::collections::HashMap;
use std::path::Path;
use xml::attribute::OwnedAttribute;
use xml::reader::{EventReader, ParserConfig2, XmlEvent};

/// Parts of a pixel in the file.
const PARTS: f64 = 64.0;
/// Lines of the whole sensor.
const LINES: f64 = 1080.0;
/// Millimeters of a meter.
const MILLIMETERS: f64 = 1000.0;
/// The element of a camera.
const CAMERA: &str = "camera";
/// The elements that cameras have.
const PLACE: &str = "transform";
const LENS: &str = "intrinsic";
const FIELD: &str = "fov_video";

/// The attributes of an element.
struct Attributes(HashMap<String, String>);

/// The element of a camera and those in it.
struct Element {
    own: Attributes,
    inside: HashMap<String, Attributes>,
}

/// Reads a calibration.
///
/// # Errors
/// A file that cannot be read, is no XML or has no calibrated cameras; an attribute that is missing or wrong.
pub(super) fn read(path: &Path) -> Result<Calibration, DatasetError> {
    let unusable = |reason: String| DatasetError::Unusable { path: path.to_owned(), reason };
    let elements = elements(&Calibration::bytes(path)?).map_err(unusable)?;
    let (mut cameras, mut uncalibrated) = (Vec::new(), Vec::new());
    for (index, element) in elements.iter().enumerate() {
        let name = element.own.text("serial").map_or_else(|| format!("{}", index + 1), str::to_owned);
        if !element.is_calibrated() {
            uncalibrated.push(name);
            continue;
        }
        let shown = printable(&name);
        cameras.push(element.camera(name).map_err(|reason| unusable(format!("camera {shown}: {reason}")))?);
    }
    if cameras.is_empty() {
        return Err(unusable(format!(
            "no element {CAMERA} in it has {PLACE} and {LENS}: it is no calibration, as Qualisys writes it"
        )));
    }
    let mut notes = vec!["its places are in millimeters, and are read in meters".to_owned()];
    if !uncalibrated.is_empty() {
        notes.push(format!("cameras that are not calibrated are left out: {}", listed(uncalibrated.into_iter())));
    }
    Ok(Calibration { source: path.to_owned(), cameras, notes })
}

/// Returns the elements of the cameras.
fn elements(bytes: &[u8]) -> Result<Vec<Element>, String> {
    let mut config = ParserConfig2::new();
    config.ignore_invalid_encoding_declarations = true;
    let (mut elements, mut is_inside): (Vec<Element>, bool) = (Vec::new(), false);
    for event in EventReader::new_with_config(bytes, config) {
        let event = event.map_err(|error| {
            format!("no XML, {}: export the calibration again with Qualisys", printable(&error.to_string()))
        })?;
        match event {
            XmlEvent::StartElement { name, attributes, .. } if name.local_name == CAMERA => {
                elements.push(Element { own: Attributes::of(attributes), inside: HashMap::new() });
                is_inside = true;
            }
            XmlEvent::StartElement { name, attributes, .. } if is_inside => {
                if let Some(element) = elements.last_mut() {
                    element.inside.insert(name.local_name, Attributes::of(attributes));
                }
            }
            XmlEvent::EndElement { name } if name.local_name == CAMERA => is_inside = false,
            _ => {}
        }
    }
    Ok(elements)
}

impl Element {
    /// Returns whether the camera has a place and a lens. The file has cameras for markers, too, which may have none.
    fn is_calibrated(&self) -> bool {
        self.own.text("calibrated") != Some("false") && [PLACE, LENS].iter().all(|name| self.inside.contains_key(*name))
    }

    fn element(&self, name: &str) -> Result<&Attributes, String> {
        self.inside.get(name).ok_or_else(|| format!("it has no {name}: export the calibration again"))
    }

    fn camera(&self, name: String) -> Result<RigCamera, String> {
        let named = |problem: FrameProblem| problem.to_string();
        let (lens, scale) = (self.element(LENS)?, self.scale()?);
        let field = self.inside.get(FIELD).map(Field::of).transpose()?;
        let corner = field.as_ref().map_or(DVec2::ZERO, |field| field.corner);
        let focal = lens.pair(["focalLengthU", "focalLengthV"])? / PARTS * scale;
        let center = (lens.pair(["centerPointU", "centerPointV"])? / PARTS - corner) * scale;
        let skew = lens.number_or_0("skew")? / PARTS * scale;
        let matrix = [focal.x, skew, center.x, 0.0, focal.y, center.y, 0.0, 0.0, 1.0];
        let (rotation, translation) = self.element(PLACE)?.pose()?;
        Ok(RigCamera {
            name,
            size: field.map(|field| field.size(scale)).transpose().map_err(named)?,
            world_to_camera: opencv::pose_of_rows(&rotation, translation).map_err(named)?,
            lens: opencv::lens(&matrix).map_err(named)?,
            distortion: opencv::distortion(&lens.coefficients()?).map_err(named)?,
        })
    }

    /// Returns the size of the pictures as a share of the sensor.
    fn scale(&self) -> Result<f64, String> {
        let Some(text) = self.own.text("video_resolution").map(str::trim).filter(|text| !text.is_empty()) else {
            return Ok(1.0);
        };
        let lines: Option<u32> = text.strip_suffix(['p', 'P']).and_then(|lines| lines.parse().ok());
        let lines = lines.map(f64::from).filter(|lines| (1.0..=LINES).contains(lines));
        let wrong = || format!("its video_resolution is {:?}, and must be 1080p, 720p or 540p", printable(text));
        Ok(lines.ok_or_else(wrong)? / LINES)
    }
}

/// The part of the sensor that the video shows.
struct Field {
    /// The first pixel.
    corner: DVec2,
    /// Columns and lines.
    sides: DVec2,
}

impl Field {
    fn of(attributes: &Attributes) -> Result<Self, String> {
        let corner = attributes.pair(["left", "top"])?;
        Ok(Self { corner, sides: attributes.pair(["right", "bottom"])? - corner + 1.0 })
    }

    /// Returns the size of the pictures, pixels.
    fn size(&self, scale: f64) -> Result<UVec2, FrameProblem> {
        let sides = (self.sides * scale).round();
        checked_size(sides.x, sides.y)
    }
}

impl Attributes {
    fn of(attributes: Vec<OwnedAttribute>) -> Self {
        Self(attributes.into_iter().map(|attribute| (attribute.name.local_name, attribute.value)).collect())
    }

    fn text(&self, name: &str) -> Option<&str> {
        self.0.get(name).map(String::as_str)
    }

    fn number(&self, name: &str) -> Result<f64, String> {
        let text = self.text(name).ok_or_else(|| format!("it has no {name}: export the calibration again"))?;
        let number: Option<f64> = text.trim().parse().ok();
        number.filter(|number| number.is_finite()).ok_or_else(|| {
            format!("its {name} is {:?}, which is no number: export the calibration again", printable(text))
        })
    }

    /// Returns a number that is 0 if it is not there.
    fn number_or_0(&self, name: &str) -> Result<f64, String> {
        if self.0.contains_key(name) { self.number(name) } else { Ok(0.0) }
    }

    /// Returns the distortion as OpenCV orders it: k1, k2, p1, p2 and k3.
    fn coefficients(&self) -> Result<[f64; 5], String> {
        let [k1, k2, p1, p2] =
            ["radialDistortion1", "radialDistortion2", "tangentalDistortion1", "tangentalDistortion2"]
                .map(|name| self.number(name));
        Ok([k1?, k2?, p1?, p2?, self.number_or_0("radialDistortion3")?])
    }

    fn pair(&self, names: [&str; 2]) -> Result<DVec2, String> {
        Ok(DVec2::new(self.number(names[0])?, self.number(names[1])?))
    }

    fn triple(&self, names: [&str; 3]) -> Result<DVec3, String> {
        Ok(DVec3::new(self.number(names[0])?, self.number(names[1])?, self.number(names[2])?))
    }

    /// Returns the rotation to the camera with OpenCV's axes, row by row, and the translation in meters.
    fn pose(&self) -> Result<([f64; 9], [f64; 3]), String> {
        let [right, up, backwards] =
            [["r11", "r12", "r13"], ["r21", "r22", "r23"], ["r31", "r32", "r33"]].map(|names| self.triple(names));
        let axes = [right?, -up?, -backwards?];
        let place = self.triple(["x", "y", "z"])? / MILLIMETERS;
        let mut rotation = [0.0; 9];
        for (row, axis) in rotation.chunks_exact_mut(3).zip(&axes) {
            row.copy_from_slice(&axis.to_array());
        }
        Ok((rotation, axes.map(|axis| -axis.dot(place))))
    }
}
