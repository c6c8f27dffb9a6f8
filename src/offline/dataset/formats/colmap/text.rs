//! Text models: `cameras.txt` and `images.txt`.
//!
//! In: the folder of a model. Out: its cameras and images. An image has two lines, the second of which has its points;
//! where the second lines are left out, or empty, every line is an image. Names are in UTF-8 or Latin-1.

use super::camera::{MODELS, ModelCamera, unknown};
use super::model::{Model, Registered};
use crate::offline::dataset::DatasetError;
use crate::offline::dataset::formats::files::utf8_or_latin1;
use std::collections::HashMap;
use std::fs;
use std::path::Path;

pub(crate) fn read(folder: &Path) -> Result<Model, DatasetError> {
    let path = folder.join("cameras.txt");
    let mut cameras = HashMap::new();
    for (number, line) in contents(&path)?.lines().enumerate().filter(|(_, line)| is_entry(line)) {
        let (id, camera) = camera(line).map_err(|reason| at(&path, number, reason))?;
        if cameras.insert(id, camera).is_some() {
            return Err(at(&path, number, twice(id)));
        }
    }
    let source = folder.join("images.txt");
    let images = images(&source)?;
    Ok(Model { source, cameras, images })
}

/// Reads the images of `images.txt`.
///
/// # Errors
/// A file that cannot be read; a line that is neither an image nor the points of the image before it.
pub(crate) fn images(path: &Path) -> Result<Vec<Registered>, DatasetError> {
    let mut images = Vec::new();
    // Whether the points of the image before may follow.
    let mut has_points = false;
    for (number, line) in contents(path)?.lines().enumerate().filter(|(_, line)| is_entry(line)) {
        match image(line) {
            _ if has_points && is_points(line) => has_points = false,
            Ok(image) => {
                images.push(image);
                has_points = true;
            }
            Err(reason) if has_points => {
                let reason =
                    format!("neither the points of an image, X Y POINT3D_ID each, nor an image: an image {reason}");
                return Err(at(path, number, reason));
            }
            Err(reason) => return Err(at(path, number, reason)),
        }
    }
    Ok(images)
}

/// Returns whether a line is the points of an image: X, Y and the number of a point for each.
fn is_points(line: &str) -> bool {
    let words: Vec<&str> = line.split_whitespace().collect();
    words.len().is_multiple_of(3) && words.iter().all(|word| word.parse::<f64>().is_ok())
}

/// Reads a file, without a byte order mark. Lines that are not UTF-8 are read as Latin-1.
pub(crate) fn contents(path: &Path) -> Result<String, DatasetError> {
    let bytes = fs::read(path).map_err(|reason| DatasetError::Read { path: path.to_owned(), reason })?;
    let text = String::from_utf8(bytes).unwrap_or_else(|error| {
        let lines = error.as_bytes().split(|byte| *byte == b'\n').map(utf8_or_latin1);
        lines.collect::<Vec<_>>().join("\n")
    });
    Ok(text.strip_prefix('\u{feff}').map(str::to_owned).unwrap_or(text))
}

/// Returns the reason why a camera that is in a model twice cannot be used.
pub(crate) fn twice(camera: u32) -> String {
    format!("camera {camera} is in it twice: remove one, or write the model again with COLMAP")
}

pub(crate) fn at(path: &Path, line: usize, reason: String) -> DatasetError {
    DatasetError::Unusable { path: path.to_owned(), reason: format!("line {}: {reason}", line + 1) }
}

pub(crate) fn is_entry(line: &str) -> bool {
    let line = line.trim_start();
    !line.is_empty() && !line.starts_with('#')
}

/// Reads `ID MODEL WIDTH HEIGHT PARAMETERS`.
fn camera(line: &str) -> Result<(u32, ModelCamera), String> {
    let mut words = line.split_whitespace();
    let form = || "must be ID MODEL WIDTH HEIGHT and the parameters: write the model again with COLMAP".to_owned();
    let (Some(id), Some(name), Some(width), Some(height)) = (words.next(), words.next(), words.next(), words.next())
    else {
        return Err(form());
    };
    let id = id.parse().map_err(|_| form())?;
    let model = MODELS.iter().position(|(known, ..)| *known == name).ok_or_else(|| unknown(name))?;
    let size = [width.parse().map_err(|_| form())?, height.parse().map_err(|_| form())?];
    let parameters: Vec<f64> = words.map(|word| word.parse().map_err(|_| form())).collect::<Result<_, _>>()?;
    Ok((id, ModelCamera::new(model, size, &parameters)?))
}

/// Reads `ID QW QX QY QZ TX TY TZ CAMERA NAME`.
fn image(line: &str) -> Result<Registered, String> {
    let form = || "must be ID QW QX QY QZ TX TY TZ CAMERA NAME: write the model again with COLMAP".to_owned();
    // The name may contain spaces.
    let mut rest = line.trim();
    let mut words = [""; 9];
    for word in &mut words {
        let (first, after) = rest.split_once(char::is_whitespace).ok_or_else(form)?;
        (*word, rest) = (first, after.trim_start());
    }
    let mut numbers = [0.0; 7];
    for (number, word) in numbers.iter_mut().zip(&words[1..8]) {
        *number = word.parse().map_err(|_| form())?;
    }
    let [w, x, y, z, tx, ty, tz] = numbers;
    let camera = words[8].parse().map_err(|_| form())?;
    Ok(Registered { name: rest.to_owned(), camera, pose: ([w, x, y, z], [tx, ty, tz]) })
}
