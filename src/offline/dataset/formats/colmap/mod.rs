//! COLMAP's sparse models.
//!
//! In: a folder with a model (binary or text) in `sparse/N`, `sparse` or the same inside `colmap`, and with `images`.
//! Out: the views of all images. There are three kinds of images:
//!
//! * `images/NAME`, and `images/FOLDER/NAME` if folders are no cameras (`layout`): one image of a static scene, at time
//!   0;
//! * `images/CAMERA/FRAME`, registered one by one: frames of cameras, at 30 a second;
//! * `images/CAMERA/FRAME`, of which the model has one image for each camera (`CAMERA/FRAME`, or `CAMERA.png`): a
//!   camera that does not move.

mod binary;
mod camera;
mod choice;
mod layout;
mod model;
mod points;
mod text;

use super::files::{OnDisk, with_slashes};
use super::masks;
use super::numbered::{images, number, times};
use super::undivided::Undivided;
use crate::codec::text::{is_obeyed, printable};
use crate::offline::dataset::cameras::frame::{Frame, Mask, output_name};
use crate::offline::dataset::cameras::placing::{Placed, Unplaced, place};
use crate::offline::dataset::cameras::pose;
use crate::offline::dataset::{CameraOptions, Clock, DatasetError, FrameProblem};
use choice::Choice;
pub(crate) use choice::is_there;
use layout::{IMAGES, Layout, parent};
use model::Model;
pub(crate) use points::{binary_points, text_points};
use std::collections::{BTreeMap, HashSet};
use std::path::{Component, Path, PathBuf};

/// The frames of an image of a model, as paths in the folder of images. An image without further frames is its own and
/// only frame.
struct Frames {
    paths: Vec<PathBuf>,
    /// Whether their numbers are times.
    are_timed: bool,
}

/// Reads the views of a folder.
pub(crate) fn read(folder: &Path, options: &CameraOptions) -> Result<Undivided, DatasetError> {
    let not_there = || DatasetError::Unusable { path: folder.to_owned(), reason: "no COLMAP model in it".to_owned() };
    let Choice { folder: path, note } = choice::largest(folder).ok_or_else(not_there)?;
    let is_binary = choice::is_binary(&path) == Some(true);
    let mut model = if is_binary { binary::read(&path)? } else { text::read(&path)? };
    let mut notes: Vec<String> = note.into_iter().chain(tidy(&mut model)?).collect();
    let names = model.images.iter().map(|image| image.name.as_str());
    let layout = if options.is_static { Layout::at_rest() } else { Layout::of(names, folder)? };
    let frames = all_frames(&model, folder, &layout, options.is_static)?;
    let files = OnDisk::default();
    let Placed { views, origin, notes: undone } = placed(&model, folder, &frames, &files, options)?;
    notes.extend([layout.note, still(&frames), files.note()].into_iter().flatten().chain(undone));
    let points = ["points3D.bin", "points3D.txt"].map(|name| path.join(name)).into_iter().find(|path| path.is_file());
    let clock = if views.iter().any(|view| view.time > 0.0) { Clock::NUMBERED } else { Clock::default() };
    Ok(Undivided { source: model.source, views, splits: None, clock, points, notes, origin })
}

/// Returns the model of a folder with the most images; `None` if there is no model.
///
/// # Errors
/// A model that cannot be read.
pub(crate) fn largest(folder: &Path) -> Result<Option<Model>, DatasetError> {
    let Some(Choice { folder, .. }) = choice::largest(folder) else { return Ok(None) };
    let is_binary = choice::is_binary(&folder) == Some(true);
    Ok(Some(if is_binary { binary::read(&folder)? } else { text::read(&folder)? }))
}

/// Makes paths of the names of images, and sorts images by name. Returns a sentence if images are left out.
///
/// # Errors
/// An image that is registered twice with different poses.
fn tidy(model: &mut Model) -> Result<Option<String>, DatasetError> {
    for image in &mut model.images {
        image.name = plain(&image.name);
    }
    model.images.sort_by(|a, b| a.name.cmp(&b.name));
    let repeated: Vec<_> = model.images.windows(2).filter(|pair| pair[0].name == pair[1].name).collect();
    let Some(&[first, _]) = repeated.first() else { return Ok(None) };
    if let Some([image, _]) = repeated.iter().find(|pair| pair[0].pose != pair[1].pose) {
        let reason = format!(
            "image {} is in it twice, with different poses: remove one, or write the model again with COLMAP",
            printable(&image.name)
        );
        return Err(DatasetError::Unusable { path: model.source.clone(), reason });
    }
    let (count, name) = (repeated.len(), printable(&first.name));
    model.images.dedup_by(|a, b| a.name == b.name);
    Ok(Some(format!("images that are in the model twice are used once: {count}, the first of them {name}")))
}

/// Returns a name with slashes, without `./` before it.
fn plain(name: &str) -> String {
    let name = with_slashes(name);
    name.strip_prefix("./").unwrap_or(&name).to_owned()
}

/// Returns the frames of each image.
fn all_frames(model: &Model, folder: &Path, layout: &Layout, is_static: bool) -> Result<Vec<Frames>, DatasetError> {
    let mut per_camera: BTreeMap<&Path, usize> = BTreeMap::new();
    for image in &model.images {
        *per_camera.entry(parent(&image.name)).or_default() += 1;
    }
    let mut all = Vec::new();
    for image in &model.images {
        let path = Path::new(&image.name);
        let is_plain = |part: Component| matches!(part, Component::Normal(_));
        if image.name.contains(is_obeyed) || !path.components().all(is_plain) || path.file_stem().is_none() {
            return Err(model.failed(image)(FrameProblem::FileName(image.name.clone())));
        }
        let parent = parent(&image.name);
        let is_inside = parent != Path::new("");
        let camera = if is_inside { parent.to_owned() } else { path.with_extension("") };
        let is_still = if is_inside { layout.is_rig && per_camera.get(parent) == Some(&1) } else { !is_static };
        let found = if is_still { images(&folder.join(IMAGES).join(&camera))? } else { Vec::new() };
        let are_timed = !found.is_empty() || is_inside && layout.is_rig;
        let mut paths: Vec<PathBuf> = found.iter().filter_map(|frame| Some(camera.join(frame.file_name()?))).collect();
        if paths.is_empty() {
            paths.push(path.to_owned());
        }
        all.push(Frames { paths, are_timed });
    }
    Ok(all)
}

/// Returns a sentence about the cameras that do not move, if there are any.
fn still(frames: &[Frames]) -> Option<String> {
    let count = frames.iter().filter(|frames| frames.paths.len() > 1).count();
    (count > 0)
        .then(|| format!("cameras that do not move, with one image in the model and all frames on disk: {count}"))
}

/// Returns the views of a model, whose images are sorted by name.
fn placed(
    model: &Model,
    folder: &Path,
    frames: &[Frames],
    files: &OnDisk,
    options: &CameraOptions,
) -> Result<Placed, DatasetError> {
    let timed = frames.iter().filter(|frames| frames.are_timed).flat_map(|frames| &frames.paths);
    let first = timed.filter_map(|frame| number(frame)).min().unwrap_or(0);
    let (mut names, mut unplaced) = (HashSet::new(), Vec::new());
    for (image, Frames { paths, are_timed }) in model.images.iter().zip(frames) {
        let (rotation, translation) = image.pose;
        let world_to_camera = pose::of_rotation(rotation, translation).map_err(model.failed(image))?;
        let camera = model.camera_of(image)?;
        let times = if *are_timed { times(paths, first) } else { vec![0.0; paths.len()] };
        for (path, time) in paths.iter().zip(times) {
            let label = path.display().to_string().replace(['/', '\\'], "_");
            let unnamed = || model.failed(image)(FrameProblem::FileName(label.clone()));
            let file = files.find(folder, Path::new(IMAGES).join(path));
            let frame = Frame {
                name: output_name(&label, unplaced.len(), &mut names).ok_or_else(unnamed)?,
                mask: masks::beside(folder, &file).map(|path| Mask { path, applied: false }),
                image: file,
                time,
                world_to_camera,
                lens: camera.lens,
                distortion: camera.distortion,
            };
            unplaced.push(Unplaced { frame, original: camera.size, failed: model.failed(image) });
        }
    }
    place(unplaced, options, true)
}
