//! Names of cameras and frames, from those of their images.
//!
//! In: views, and the number of the camera of each. Out: for each camera a name that no other has, for each frame a
//! name that no other of its camera has. Both can be names of files.

use crate::codec::text::is_obeyed;
use crate::offline::dataset::TrainingView;
use std::collections::HashSet;
use std::ffi::OsStr;
use std::path::Path;

/// A folder of images inside that of their camera.
const IMAGES: &str = "images";

/// Returns the name of each camera: that of the folder of its images, if they are in one.
pub(super) fn of_cameras(views: &[TrainingView], numbers: &[usize]) -> Vec<String> {
    let count = numbers.iter().max().map_or(0, |most| most + 1);
    let mut folders: Vec<Option<&Path>> = vec![None; count];
    let mut is_common = vec![true; count];
    for (view, &camera) in views.iter().zip(numbers) {
        let folder = view.image.parent();
        is_common[camera] &= folders[camera].is_none() || folders[camera] == folder;
        folders[camera] = folder;
    }
    let mut taken = HashSet::new();
    let name = |camera: usize| {
        let folder = folders[camera].filter(|_| is_common[camera]);
        let mut name = folder.and_then(of_folder).unwrap_or_else(|| format!("camera{camera}"));
        while !taken.insert(name.clone()) {
            name = format!("{name}-{camera}");
        }
        name
    };
    (0..count).map(name).collect()
}

/// Returns the name of each frame: that of its image, without the extension.
pub(super) fn of_frames(views: &[TrainingView], numbers: &[usize]) -> Vec<String> {
    let mut taken = HashSet::new();
    let name = |(index, (view, &camera)): (usize, (&TrainingView, &usize))| {
        let mut name = view.image.file_stem().map_or_else(|| index.to_string(), plain);
        while !taken.insert((camera, name.clone())) {
            name = format!("{name}-{index}");
        }
        name
    };
    views.iter().zip(numbers).enumerate().map(name).collect()
}

/// Returns the name of a folder of images, or of the folder with it.
fn of_folder(folder: &Path) -> Option<String> {
    let outer = folder.parent().filter(|_| folder.file_name().is_some_and(|name| name == IMAGES));
    outer.and_then(Path::file_name).or(folder.file_name()).map(plain)
}

/// Returns a name without control characters and without characters that divide paths.
fn plain(name: &OsStr) -> String {
    let plain = |c: char| if is_obeyed(c) || "/\\:".contains(c) { '_' } else { c };
    name.to_string_lossy().chars().map(plain).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::view::Camera;
    use glam::{UVec2, Vec3};

    fn view(image: &str) -> TrainingView {
        let camera = Camera::look_at(Vec3::X, Vec3::ZERO, Vec3::Z, 0.7, UVec2::splat(8));
        let (name, original, correction) = (image.to_owned(), camera.size, Default::default());
        TrainingView { name, camera, time: 0.0, original, image: image.into(), mask: None, correction }
    }

    #[test]
    fn cameras_have_the_names_of_the_folders_of_their_images() {
        let images = ["a/left/1.png", "a/left/2.png", "a/right/images/1.png", "b/left/1.png", "a/1.png", "b/1.png"];
        let views = images.map(view);
        let names = of_cameras(&views, &[0, 0, 1, 2, 3, 3]);
        assert_eq!(names, ["left", "right", "left-2", "camera3"], "a name twice, and images in two folders");
    }

    #[test]
    fn frames_of_one_camera_have_different_names() {
        let views = ["a/1.png", "a/1.jpg", "b/1.png", "b/x\u{1b}y.png"].map(view);
        assert_eq!(of_frames(&views, &[0, 0, 1, 1]), ["1", "1-1", "1", "x_y"], "the stems of the images");
    }
}
