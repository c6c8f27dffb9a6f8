//! A take: what several cameras that stand still filmed of the same moments.
//!
//! In: the views of a dataset, and the longest side of the pictures to work with. Out: [`Take`]: the cameras with their
//! frames in the order of time, each frame with the moment that it belongs to. Cameras have no lens distortion:
//! pictures are undistorted when they are loaded.

use crate::offline::dataset::TrainingView;
use crate::offline::dataset::selection::camera_numbers;
use crate::view::{Camera, Lens};
use glam::UVec2;
use std::path::Path;

/// The frames of several cameras.
#[derive(Debug, Clone)]
pub(crate) struct Take {
    /// Cameras, each with at least one frame.
    pub cameras: Vec<Filmed>,
    /// The moments, ascending, in the unit of timestamps.
    pub moments: Vec<f32>,
}

/// A camera that stands still, and its frames.
#[derive(Debug, Clone)]
pub(crate) struct Filmed {
    /// Its name: what the paths of its images have in common.
    pub name: String,
    /// The camera at the size of the pictures to work with.
    pub camera: Camera,
    /// Frames, ascending in time.
    pub frames: Vec<Frame>,
}

/// A picture of a take.
#[derive(Debug, Clone)]
pub(crate) struct Frame {
    /// The index of its moment in [`Take::moments`].
    pub moment: usize,
    /// The view, whose camera has the size of the pictures to work with.
    pub view: TrainingView,
}

impl Take {
    /// Groups views by camera and moment. Times that differ by at most half of the usual (median) distance between the
    /// frames of a camera are one moment. Pictures are reduced to `longest` pixels on their longer side.
    pub(crate) fn of(views: &[TrainingView], longest: u32) -> Self {
        let mut cameras: Vec<Filmed> = Vec::new();
        for (view, number) in views.iter().zip(camera_numbers(views)) {
            let number = number as usize;
            let view = TrainingView { camera: reduced(&view.camera, longest), ..view.clone() };
            if cameras.len() <= number {
                let camera = view.camera;
                cameras.push(Filmed { name: String::new(), camera, frames: Vec::new() });
            }
            cameras[number].frames.push(Frame { moment: 0, view });
        }
        for (index, camera) in cameras.iter_mut().enumerate() {
            camera.frames.sort_by(|a, b| a.view.time.total_cmp(&b.view.time));
            camera.name = name(&camera.frames).unwrap_or_else(|| format!("camera {index}"));
        }
        let moments = moments(&cameras);
        for frame in cameras.iter_mut().flat_map(|camera| &mut camera.frames) {
            frame.moment = nearest(&moments, frame.view.time);
        }
        Self { cameras, moments }
    }

    /// Returns the frame of a camera at a moment, if it has one.
    pub(crate) fn frame(&self, camera: usize, moment: usize) -> Option<&Frame> {
        let frames = &self.cameras[camera].frames;
        frames.binary_search_by_key(&moment, |frame| frame.moment).ok().map(|at| &frames[at])
    }
}

/// Returns the camera at a size whose longer side has at most `longest` pixels.
pub(crate) fn reduced(camera: &Camera, longest: u32) -> Camera {
    let side = camera.size.max_element();
    if side <= longest {
        return *camera;
    }
    let size = (camera.size.as_vec2() * (longest as f32 / side as f32)).round().as_uvec2().max(UVec2::ONE);
    let scale = size.as_vec2() / camera.size.as_vec2();
    let lens = match camera.lens {
        Lens::Intrinsics { focal, center } => Lens::Intrinsics { focal: focal * scale, center: center * scale },
        fov @ Lens::Fov { .. } => fov,
    };
    Camera { size, lens, ..*camera }
}

/// Returns the folder of the images of a camera; `None` if they are in several folders.
fn name(frames: &[Frame]) -> Option<String> {
    let folder = |frame: &Frame| frame.view.image.parent().map(Path::to_owned);
    let first = folder(frames.first()?)?;
    let is_common = frames.iter().all(|frame| folder(frame).as_ref() == Some(&first));
    is_common.then(|| first.file_name().map(|name| name.to_string_lossy().into_owned())).flatten()
}

/// Returns the distinct moments, ascending: the means of times that are closer together than half of the usual distance
/// between two frames of a camera.
fn moments(cameras: &[Filmed]) -> Vec<f32> {
    let steps = |camera: &Filmed| -> Vec<f32> {
        let between = |pair: &[Frame]| pair[1].view.time - pair[0].view.time;
        camera.frames.windows(2).map(between).filter(|&step| step > 0.0).collect()
    };
    let mut steps: Vec<f32> = cameras.iter().flat_map(steps).collect();
    steps.sort_unstable_by(f32::total_cmp);
    let near = steps.get(steps.len() / 2).map_or(0.0, |step| step / 2.0);
    let mut times: Vec<f32> = cameras
        .iter()
        .flat_map(|camera| &camera.frames)
        .map(|frame| frame.view.time)
        .filter(|time| time.is_finite())
        .collect();
    times.sort_unstable_by(f32::total_cmp);
    let mut moments: Vec<Vec<f32>> = Vec::new();
    for time in times {
        match moments.last_mut() {
            Some(moment) if time - moment[0] <= near => moment.push(time),
            _ => moments.push(vec![time]),
        }
    }
    moments.iter().map(|times| times.iter().sum::<f32>() / times.len() as f32).collect()
}

/// Returns the index of the nearest moment, of ascending ones.
fn nearest(moments: &[f32], time: f32) -> usize {
    let after = moments.partition_point(|&moment| moment < time).min(moments.len().saturating_sub(1));
    let before = after.saturating_sub(1);
    match moments.get(before).zip(moments.get(after)) {
        Some((a, b)) if (time - a).abs() <= (b - time).abs() => before,
        _ => after,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;
    use std::path::PathBuf;

    fn view(camera: usize, time: f32) -> TrainingView {
        let eye = Vec3::new(camera as f32 + 1.0, 0.0, 0.0);
        let at = Camera::look_at(eye, Vec3::ZERO, Vec3::Z, 0.7, UVec2::new(800, 400));
        TrainingView {
            name: format!("{camera}-{time}"),
            camera: at,
            time,
            original: at.size,
            image: PathBuf::from(format!("ims/cam{camera}/{time}.png")),
            mask: None,
            correction: Default::default(),
        }
    }

    #[test]
    fn frames_of_nearly_one_time_are_of_one_moment() {
        let views: Vec<_> = (0..5).flat_map(|frame| [view(0, frame as f32), view(1, frame as f32 + 0.2)]).collect();
        let take = Take::of(&views, 400);
        assert_eq!((take.cameras.len(), take.moments.len()), (2, 5), "two cameras, five moments");
        assert_eq!(take.cameras[1].name, "cam1", "the folder of its images");
        assert_eq!(take.cameras[0].camera.size, UVec2::new(400, 200), "reduced");
        let frame = take.frame(1, 3).expect("camera 1 has all moments");
        assert_eq!(frame.view.time, 3.2, "in the order of time");
        assert!((take.moments[3] - 3.1).abs() < 1e-6, "the mean of the times: {}", take.moments[3]);
    }
}
