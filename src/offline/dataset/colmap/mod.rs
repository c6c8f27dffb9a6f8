//! COLMAP's sparse models.
//!
//! In: a folder with `sparse/0` or `sparse` (binary or text) and `images`. Out: the views of all images. There are three kinds of images:
//!
//! * `images/NAME`: one image of a static scene, at time 0;
//! * `images/CAMERA/FRAME`, registered one by one: frames of cameras, at 30 a second;
//! * `images/CAMERA/FRAME`, of which the model has one image for each camera (`CAMERA/FRAME`, or `CAMERA.png`): a camera that does not move.

mod binary;
mod camera;
mod model;
mod points;
mod text;

use super::frame::{Frame, Mask, output_name};
use super::numbered::{images, number, times};
use super::undivided::Undivided;
use super::{CameraOptions, Clock, DatasetError, FrameProblem, TrainingView, masks, pose};
use crate::codec::text::is_obeyed;
use model::Model;
pub(super) use points::{binary_points, text_points};
use std::collections::{BTreeMap, HashSet};
use std::path::{Component, Path, PathBuf};

/// Folders of the model, the first that is there.
const MODELS: [&str; 3] = ["sparse/0", "sparse", "colmap/sparse/0"];
/// The folder of images.
const IMAGES: &str = "images";

/// Returns whether a folder has a model.
pub(super) fn is_there(folder: &Path) -> bool {
    model(folder).is_some()
}

/// Returns the file without its extension, of the first model of a folder.
fn model(folder: &Path) -> Option<PathBuf> {
    let has = |model: &PathBuf| ["cameras.bin", "cameras.txt"].iter().any(|name| model.join(name).is_file());
    MODELS.iter().map(|name| folder.join(name)).find(has)
}

/// Reads the views of a folder.
pub(super) fn read(folder: &Path, options: &CameraOptions) -> Result<Undivided, DatasetError> {
    let not_there = || DatasetError::Unusable { path: folder.to_owned(), reason: "no COLMAP model in it".to_owned() };
    let path = model(folder).ok_or_else(not_there)?;
    let mut model = if path.join("cameras.bin").is_file() { binary::read(&path)? } else { text::read(&path)? };
    for image in &mut model.images {
        if let Some(name) = image.name.strip_prefix("./") {
            image.name = name.to_owned();
        }
    }
    model.images.sort_by(|a, b| a.name.cmp(&b.name));
    let views = views(&model, folder, options)?;
    let points = ["points3D.bin", "points3D.txt"].map(|name| path.join(name)).into_iter().find(|path| path.is_file());
    let clock = if views.iter().any(|view| view.time > 0.0) { Clock::NUMBERED } else { Clock::default() };
    Ok(Undivided { source: model.source, views, splits: None, clock, points })
}

/// Returns the views of a model, whose images are sorted by name.
fn views(model: &Model, folder: &Path, options: &CameraOptions) -> Result<Vec<TrainingView>, DatasetError> {
    let mut per_camera: BTreeMap<&Path, usize> = BTreeMap::new();
    for image in &model.images {
        *per_camera.entry(parent(&image.name)).or_default() += 1;
    }
    // The frames of each image with their times; an image without frames on disk is its own and only frame.
    let mut all: Vec<(Vec<PathBuf>, bool)> = Vec::new();
    for image in &model.images {
        let path = Path::new(&image.name);
        let is_plain = |part: Component| matches!(part, Component::Normal(_));
        if image.name.contains(is_obeyed) || !path.components().all(is_plain) || path.file_stem().is_none() {
            return Err(model.failed(image)(FrameProblem::FileName(image.name.clone())));
        }
        let parent = parent(&image.name);
        let alone = per_camera.get(parent) == Some(&1);
        let camera = if parent == Path::new("") { path.with_extension("") } else { parent.to_owned() };
        let moving = parent != Path::new("") && !alone;
        let frames = if moving { Vec::new() } else { images(&folder.join(IMAGES).join(&camera))? };
        let is_video = !frames.is_empty() || parent != Path::new("");
        let frames = frames.iter().filter_map(|frame| Some(camera.join(frame.file_name()?))).collect::<Vec<_>>();
        all.push((if frames.is_empty() { vec![path.to_owned()] } else { frames }, is_video));
    }
    let numbered = all.iter().filter(|(_, is_video)| *is_video).flat_map(|(frames, _)| frames);
    let first = numbered.filter_map(|frame| number(frame)).min().unwrap_or(0);
    let (mut names, mut views) = (HashSet::new(), Vec::new());
    for (image, (frames, is_video)) in model.images.iter().zip(&all) {
        let (rotation, translation) = image.pose;
        let world_to_camera = pose::of_rotation(rotation, translation).map_err(model.failed(image))?;
        let Some(camera) = model.cameras.get(&image.camera) else {
            let reason = format!(
                "image {:?} has camera {}, which the model does not have: write the model again with COLMAP",
                image.name, image.camera
            );
            return Err(DatasetError::Unusable { path: model.source.clone(), reason });
        };
        let times = if *is_video { times(frames, first) } else { vec![0.0; frames.len()] };
        for (frame, time) in frames.iter().zip(times) {
            let file = Path::new(IMAGES).join(frame);
            let label = frame.display().to_string().replace(['/', '\\'], "_");
            let unnamed = || model.failed(image)(FrameProblem::FileName(label.clone()));
            let frame = Frame {
                name: output_name(&label, views.len(), &mut names).ok_or_else(unnamed)?,
                mask: masks::beside(folder, &file).map(|path| Mask { path, applied: false }),
                image: folder.join(file),
                time,
                world_to_camera,
                lens: camera.lens,
                distortion: camera.distortion,
            };
            views.push(frame.into_view(camera.size, options, true, model.failed(image))?);
        }
    }
    Ok(views)
}

/// Returns the folder of an image: the name of its camera, empty if there is none.
fn parent(name: &str) -> &Path {
    Path::new(name).parent().unwrap_or(Path::new(""))
}
