//! Footage as views: the pictures of all cameras, with poses and times.
//!
//! In: the folder of a dataset, or of footage with the cameras that were found for it. Out: [`Source`]: the views of
//! all splits, each with the name of its camera and its own name.

use super::names;
use crate::offline::dataset::formats::footage::{self, Calibration};
use crate::offline::dataset::formats::video::Videos;
use crate::offline::dataset::formats::{easyvolcap, nerfstudio, pose2sim};
use crate::offline::dataset::selection::camera_numbers;
use crate::offline::dataset::{CameraOptions, Clock, Dataset, DatasetError, Split, TrainingView, require_images};
use crate::offline::footage::FootageError;
use crate::offline::footage::take::Take;
use crate::offline::work::Progress;
use crate::scene::Origin;
use std::collections::HashMap;
use std::iter::zip;
use std::path::{Path, PathBuf};

/// Of footage that is not divided, one of this many cameras is for the test; none if there are fewer.
const TEST: usize = 8;

/// A picture of footage.
#[derive(Debug, Clone)]
pub(super) struct Shot {
    pub view: TrainingView,
    pub split: Split,
    /// The index of its camera in [`Source::cameras`].
    pub camera: usize,
    /// Its name, which no other of its camera has.
    pub name: String,
}

/// Footage.
#[derive(Debug, Clone)]
pub(super) struct Source {
    /// The names of the cameras.
    pub cameras: Vec<String>,
    pub shots: Vec<Shot>,
    /// The meaning of the times of the views.
    pub clock: Clock,
    /// The file of points that the footage comes with, and the origin that views are counted from.
    pub points: Option<(PathBuf, Origin)>,
}

impl Source {
    /// Reads a dataset of any format. Videos are decoded. Of a rig that is not divided and has fewer than eight
    /// cameras, all are trained on.
    ///
    /// # Errors
    /// Cameras or images that cannot be used, or are missing.
    pub(super) fn of_dataset(folder: &Path, progress: &mut dyn Progress) -> Result<Self, FootageError> {
        let (mut views, mut clock, mut points) = (Vec::<(TrainingView, Split)>::new(), Clock::default(), None);
        for split in Split::ALL {
            match Dataset::open_with_progress(folder, split, &CameraOptions::default(), progress) {
                // The test split of a folder may be its validation split.
                Ok(dataset) if dataset.split == split => {
                    dataset.note(progress);
                    clock = dataset.clock;
                    points = points.or(dataset.points.filter(|path| path.is_file()).map(|path| (path, dataset.origin)));
                    views.extend(dataset.views.into_iter().map(|view| (view, split)));
                }
                Ok(_) => {}
                Err(DatasetError::NoSplit { .. } | DatasetError::EmptySplit { .. }) if split != Split::Train => {}
                Err(error) => return Err(error.into()),
            }
        }
        let all: Vec<TrainingView> = views.iter().map(|(view, _)| view.clone()).collect();
        if cameras_of(&camera_numbers(&all)) < TEST && is_undivided_rig(folder) {
            // Its first camera was for the test.
            views.sort_by_key(|(_, split)| *split == Split::Train);
            views.iter_mut().for_each(|(_, split)| *split = Split::Train);
        }
        Self::of(views, clock, points)
    }

    /// Reads footage whose cameras have been found. Videos are decoded.
    ///
    /// # Errors
    /// As [`of_dataset`](Self::of_dataset).
    pub(super) fn of_cameras(
        folder: &Path,
        cameras: Calibration,
        progress: &mut dyn Progress,
    ) -> Result<Self, FootageError> {
        let all = footage::read(folder, cameras, &CameraOptions::default(), Videos::Decode(progress))?;
        all.notes.iter().for_each(|note| progress.note(&format!("note: {}: {note}", folder.display())));
        let numbers = camera_numbers(&all.views);
        let count = cameras_of(&numbers);
        let split = |number: u32| {
            let is_test = count >= TEST && (number as usize).is_multiple_of(TEST);
            if is_test { Split::Test } else { Split::Train }
        };
        let views = zip(all.views, numbers).map(|(view, number)| (view, split(number))).collect();
        Self::of(views, all.clock, all.points.map(|path| (path, all.origin)))
    }

    fn of(
        views: Vec<(TrainingView, Split)>,
        clock: Clock,
        points: Option<(PathBuf, Origin)>,
    ) -> Result<Self, FootageError> {
        let (views, splits): (Vec<TrainingView>, Vec<Split>) = views.into_iter().unzip();
        require_images(&views)?;
        let numbers: Vec<usize> = camera_numbers(&views).into_iter().map(|number| number as usize).collect();
        let cameras = names::of_cameras(&views, &numbers);
        let names = names::of_frames(&views, &numbers);
        let shot = |(((view, split), camera), name)| Shot { view, split, camera, name };
        let shots = zip(zip(zip(views, splits), numbers), names).map(shot).collect();
        Ok(Self { cameras, shots, clock, points })
    }

    /// Returns the footage with these cameras for the test, by name, and the others to train on.
    ///
    /// # Errors
    /// A name of no camera, no camera to train on.
    pub(super) fn tested_by(mut self, test: &[String]) -> Result<Self, FootageError> {
        let test: Vec<usize> = test.iter().map(|name| self.camera(name)).collect::<Result<_, _>>()?;
        for shot in &mut self.shots {
            shot.split = if test.contains(&shot.camera) { Split::Test } else { Split::Train };
        }
        let is_trained = self.shots.iter().any(|shot| shot.split == Split::Train);
        if is_trained { Ok(self) } else { Err(FootageError::NothingToTrainOn) }
    }

    /// Returns the index of the camera of a name.
    ///
    /// # Errors
    /// A name of no camera.
    pub(super) fn camera(&self, name: &str) -> Result<usize, FootageError> {
        let found = self.cameras.iter().position(|camera| camera == name);
        let (name, known) = (name.to_owned(), self.cameras.join(", "));
        found.ok_or(FootageError::NoCamera { name, known })
    }

    /// Returns the views of all splits.
    pub(super) fn views(&self) -> Vec<TrainingView> {
        self.shots.iter().map(|shot| shot.view.clone()).collect()
    }

    /// Returns the cameras to train on, with pictures of at most `longest` pixels on their longer side, by the names
    /// they have here; and the name of each frame, by the path of its image.
    pub(super) fn take(&self, longest: u32) -> (Take, HashMap<&Path, &str>) {
        let trained: Vec<&Shot> = self.shots.iter().filter(|shot| shot.split == Split::Train).collect();
        let views: Vec<TrainingView> = trained.iter().map(|shot| shot.view.clone()).collect();
        let mut take = Take::of(&views, longest);
        let cameras: HashMap<&Path, usize> = trained.iter().map(|shot| (&*shot.view.image, shot.camera)).collect();
        for camera in &mut take.cameras {
            let first = camera.frames.first().and_then(|frame| cameras.get(&*frame.view.image));
            if let Some(&index) = first {
                camera.name.clone_from(&self.cameras[index]);
            }
        }
        let names = self.shots.iter().map(|shot| (&*shot.view.image, &*shot.name)).collect();
        (take, names)
    }
}

/// Returns the number of cameras, by the number of each view's camera.
fn cameras_of(numbers: &[u32]) -> usize {
    numbers.iter().max().map_or(0, |most| *most as usize + 1)
}

/// Returns whether a folder is a calibrated rig that does not say which of its cameras are for the test.
fn is_undivided_rig(folder: &Path) -> bool {
    if Split::ALL.iter().any(|split| folder.join(split.file_name()).is_file()) {
        return false;
    }
    if nerfstudio::is_there(folder) {
        return nerfstudio::read(folder, &CameraOptions::default()).is_ok_and(|all| all.splits.is_none());
    }
    easyvolcap::is_there(folder) || pose2sim::is_there(folder)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::offline::work::NoProgress;
    use crate::view::Camera;
    use glam::{DMat4, DVec4, UVec2, Vec3};
    use image::RgbImage;
    use serde_json::{Value, json};
    use std::fs;

    /// Writes a dataset of so many cameras with two pictures each.
    fn write(folder: &Path, cameras: usize, split: Option<&str>) {
        let size = UVec2::new(8, 6);
        let mut frames = Vec::new();
        for camera in 0..cameras {
            let eye = Vec3::new(3.0, camera as f32 - 1.0, 1.0);
            let pose = Camera::look_at(eye, Vec3::ZERO, Vec3::Z, 0.8, size).world_to_camera.as_dmat4();
            let to_world = pose.inverse() * DMat4::from_diagonal(DVec4::new(1.0, -1.0, -1.0, 1.0));
            let rows: Vec<[f64; 4]> = (0..4).map(|row| to_world.row(row).to_array()).collect();
            fs::create_dir_all(folder.join(format!("cam{camera}"))).expect("the folder can be made");
            for frame in 0..2 {
                let file = format!("cam{camera}/{frame}.png");
                RgbImage::new(size.x, size.y).save(folder.join(&file)).expect("the folder can be written to");
                let mut entry = json!({ "file_path": file, "time": frame, "transform_matrix": rows });
                if let Some(split) = split.filter(|_| camera == 0) {
                    entry["split"] = Value::from(split);
                } else if split.is_some() {
                    entry["split"] = Value::from("train");
                }
                frames.push(entry);
            }
        }
        let file = json!({ "camera_angle_x": 0.8, "w": size.x, "h": size.y, "frames": frames });
        fs::write(folder.join("transforms.json"), file.to_string()).expect("the folder can be written to");
    }

    #[test]
    fn few_cameras_are_all_trained_on_unless_the_dataset_names_some_for_the_test() {
        for (cameras, split, tested) in [(4, None, 0), (4, Some("test"), 2), (9, None, 4)] {
            let folder = tempfile::tempdir().expect("a temporary folder");
            write(folder.path(), cameras, split);
            let source = Source::of_dataset(folder.path(), &mut NoProgress).expect("it can be read");
            let count = source.shots.iter().filter(|shot| shot.split == Split::Test).count();
            assert_eq!(count, tested, "pictures for the test, of {cameras} cameras, {split:?}");
            let first = if tested > 0 { "cam1" } else { "cam0" };
            assert_eq!((&*source.cameras[0], source.cameras.len()), (first, cameras), "those to train on first");
        }
    }
}
