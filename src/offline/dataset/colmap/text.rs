//! Text models: `cameras.txt` and `images.txt`.
//!
//! In: the folder of a model. Out: its cameras and images. An image has two lines, the second of which has its points.

use super::super::DatasetError;
use super::camera::{MODELS, ModelCamera, unknown};
use super::model::{Model, Registered};
use std::collections::HashMap;
use std::fs;
use std::path::Path;

pub(super) fn read(folder: &Path) -> Result<Model, DatasetError> {
    let path = folder.join("cameras.txt");
    let mut cameras = HashMap::new();
    for (number, line) in contents(&path)?.lines().enumerate().filter(|(_, line)| is_entry(line)) {
        let camera = camera(line).map_err(|reason| at(&path, number, reason))?;
        cameras.insert(camera.0, camera.1);
    }
    let source = folder.join("images.txt");
    let mut images = Vec::new();
    let text = contents(&source)?;
    let mut lines = text.lines().enumerate();
    while let Some((number, line)) = lines.next() {
        if is_entry(line) {
            images.push(image(line).map_err(|reason| at(&source, number, reason))?);
            // The points of the image, possibly none.
            lines.next();
        }
    }
    Ok(Model { source, cameras, images })
}

pub(super) fn contents(path: &Path) -> Result<String, DatasetError> {
    fs::read_to_string(path).map_err(|reason| DatasetError::Read { path: path.to_owned(), reason })
}

pub(super) fn at(path: &Path, line: usize, reason: String) -> DatasetError {
    DatasetError::Unusable { path: path.to_owned(), reason: format!("line {}: {reason}", line + 1) }
}

pub(super) fn is_entry(line: &str) -> bool {
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
