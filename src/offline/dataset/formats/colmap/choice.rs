//! The models of a folder.
//!
//! In: a folder. Out: the folder of the model that is read, and a sentence if there are others. COLMAP writes a model
//! for each part of the images that it cannot connect, `sparse/0`, `sparse/1` and so on; the one with the most images
//! is read.

use super::text;
use crate::offline::dataset::formats::numbered::entries;
use crate::offline::dataset::formats::stream::Stream;
use std::path::{Path, PathBuf};

/// Folders of models. The first that has one is used.
const PLACES: [&str; 2] = ["sparse", "colmap/sparse"];
/// Fewest bytes of an image of a binary model.
const IMAGE: u64 = 73;
/// Most models that a sentence names beside the one that is read.
const NAMED: usize = 4;

/// The model that is read.
pub(crate) struct Choice {
    /// Its folder.
    pub folder: PathBuf,
    /// A sentence about the models that are not read.
    pub note: Option<String>,
}

/// Returns whether a folder has a model.
pub(crate) fn is_there(folder: &Path) -> bool {
    PLACES.iter().any(|place| !models(&folder.join(place)).is_empty())
}

/// Returns the model of a folder with the most images, the first of several; `None` if there is no model.
pub(crate) fn largest(folder: &Path) -> Option<Choice> {
    let models = PLACES.iter().map(|place| models(&folder.join(place))).find(|models| !models.is_empty())?;
    if let [model] = &models[..] {
        return Some(Choice { folder: model.clone(), note: None });
    }
    let counts: Vec<u64> = models.iter().map(|model| images(model)).collect();
    let best = (0..models.len()).rev().max_by_key(|&index| counts[index])?;
    let name = |model: &PathBuf| model.strip_prefix(folder).unwrap_or(model).display().to_string();
    let others = (0..models.len()).filter(|index| *index != best);
    let others: Vec<String> = others.map(|index| format!("{} has {}", name(&models[index]), counts[index])).collect();
    let shown = others.iter().take(NAMED).map(String::as_str).collect::<Vec<_>>().join(", ");
    let more = if others.len() > NAMED { ", ..." } else { "" };
    let (chosen, count) = (name(&models[best]), counts[best]);
    let note = format!("{chosen} is read, the model with the most images, {count}; {shown}{more}");
    Some(Choice { folder: models[best].clone(), note: Some(note) })
}

/// Returns whether the files of a model are binary; `None` if there is no model.
pub(crate) fn is_binary(model: &Path) -> Option<bool> {
    match ["cameras.bin", "cameras.txt"].map(|name| model.join(name).is_file()) {
        [true, _] => Some(true),
        [false, true] => Some(false),
        [false, false] => None,
    }
}

/// Returns the folders of models in a place: those with a number for a name, and the place itself.
fn models(place: &Path) -> Vec<PathBuf> {
    let number = |path: &PathBuf| path.file_name()?.to_str()?.parse::<u64>().ok();
    let mut numbered: Vec<PathBuf> = entries(place).unwrap_or_default();
    numbered.retain(|path| number(path).is_some());
    numbered.sort_by_key(number);
    numbered.push(place.to_owned());
    numbered.retain(|model| is_binary(model).is_some());
    numbered
}

/// Returns the number of images of a model; 0 if they cannot be read.
fn images(model: &Path) -> u64 {
    if is_binary(model) == Some(false) {
        return text::images(&model.join("images.txt")).map_or(0, |images| images.len() as u64);
    }
    let path = model.join("images.bin");
    let most = path.metadata().map_or(0, |metadata| metadata.len() / IMAGE);
    let count = Stream::open(&path).and_then(|mut stream| stream.u64());
    count.ok().filter(|count| *count <= most).unwrap_or(0)
}
