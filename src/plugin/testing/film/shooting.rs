//! Pictures with coverage of every camera at every time, in one pass forward in time.
//!
//! In: an app and a [`Film`]. Out: the dataset's files, with the places of the scene's points at each time; the app at
//! the last time, with its own cameras as before.
//!
//! One camera is moved from pose to pose. Bevy sizes its lists of lights by the counts of the previous frame, so a
//! picture is drawn twice, and more often the first time at a pose. The camera draws in linear light over transparent
//! black, so that a pixel holds its color times its coverage. Pictures are encoded and written on other threads while
//! the next ones are drawn.

use super::error::FilmError;
use super::files::Files;
use super::hold_out::{HoldOut, Split};
use super::points::places;
use super::rig::Rig;
use crate::plugin::component::GaussianCapture3d;
use crate::plugin::testing::pipelines::pipelines_are_ready;
use crate::plugin::testing::readback::read_half;
use crate::plugin::testing::stepping::advance_by;
use crate::plugin::testing::waiting::load;
use crate::plugin::testing::{Offscreen, TestingError, settle};
use bevy::app::App;
use bevy::asset::Assets;
use bevy::camera::{Camera, Camera3d, ClearColorConfig, Hdr, PerspectiveProjection, Projection};
use bevy::color::Color;
use bevy::core_pipeline::tonemapping::{DebandDither, Tonemapping};
use bevy::ecs::entity::Entity;
use bevy::ecs::world::{EntityWorldMut, World};
use bevy::image::Image;
use bevy::render::RenderApp;
use bevy::render::render_resource::PollType;
use bevy::render::renderer::RenderDevice;
use bevy::render::view::Msaa;
use bevy::transform::components::Transform;
use glam::{UVec2, Vec3};
use std::f32::consts::PI;
use std::path::Path;
use std::time::Duration;

/// Fraction of a step between the shutters of two successive cameras: the golden ratio.
const GOLDEN: f64 = 0.618_033_988_749_895;

/// What is filmed, and how.
#[derive(Debug, Clone)]
pub struct Film {
    /// The cameras.
    pub rig: Rig,
    /// The times in seconds from the call of [`film`], in any order; equal times count once.
    pub times: Vec<f32>,
    /// Width and height of the pictures in pixels.
    pub size: UVec2,
    /// Vertical field of view (radians), near and far plane of every camera. The aspect ratio is that of the pictures.
    pub lens: PerspectiveProjection,
    /// The samples for each pixel. Without multisampling, coverage is 0 or 1 at the edges of meshes.
    pub msaa: Msaa,
    /// Whether each camera has its own offset of the shutter: camera `i` films after the fraction `fract(i φ)` of the
    /// step from each time to the next (φ: the golden ratio), and at the last time itself. Cameras times times are as
    /// many different moments: a capture trained on them has no moment without a picture near it. No effect on a path.
    pub stagger: bool,
    /// The pictures that are not for training.
    pub hold_out: HoldOut,
    /// Inserts components that the camera needs, such as fog, before those of the film: lens, target, clear color.
    pub prepare_camera: fn(&mut EntityWorldMut<'_>),
}

impl Film {
    /// Returns a film of 512x512 pictures with the default lens of Bevy, four samples for each pixel, no staggered
    /// shutters and the default [`HoldOut`].
    pub fn new(rig: Rig, times: Vec<f32>) -> Self {
        Self {
            rig,
            times,
            size: UVec2::splat(512),
            lens: PerspectiveProjection::default(),
            msaa: Msaa::Sample4,
            stagger: false,
            hold_out: HoldOut::default(),
            prepare_camera: |_| {},
        }
    }
}

/// The number of pictures of a dataset.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Filmed {
    /// Pictures for training, `transforms_train.json`.
    pub train: usize,
    /// Pictures for validation, `transforms_val.json`.
    pub validation: usize,
    /// Pictures for the test, `transforms_test.json`.
    pub test: usize,
}

/// Films the scene of an app into `folder`, as a dataset in the Blender form for `gs4d train --data FOLDER`.
///
/// For each time in increasing order, the app advances to it as by [`step`](crate::testing::step), `set_time` receives
/// the world and the time in seconds, and every camera of the rig draws while no time passes; with
/// [staggered](Film::stagger) shutters, the app advances to the moment of each camera. A scene that the app's own time
/// moves, such as a simulation, needs nothing in `set_time`: `|_, _| {}`. A picture takes two updates; the first
/// picture of a pose, scenes with captures and apps with pipelined rendering take more. The app's own cameras are
/// inactive meanwhile. `progress` receives the number of pictures drawn and the number of all pictures.
///
/// The pictures are 8-bit RGBA with straight alpha, which is the coverage: 1 on opaque meshes, 0 where nothing is
/// drawn. Times become 0 to 1 in the camera files, from the first time to the last; the entry `seconds` has seconds.
///
/// If the scene has entities with a [`FilmedPoint`](super::FilmedPoint), their tracks are written to `points.json`.
///
/// # Errors
/// A film without cameras, times or pictures for training; a folder that is not empty; two points of one name; errors
/// of drawing and writing.
///
/// # Examples
///
/// ```no_run
/// use bevy::prelude::*;
/// use bevy_gs4d::testing::{self, Film, Rig};
///
/// let mut app = testing::app(UVec2::splat(64));
/// // Add the plugins and systems of the scene here.
/// let mut film = Film::new(Rig::hemisphere(Vec3::ZERO, 4.0, 60), (0..24).map(|frame| frame as f32 / 24.0).collect());
/// film.size = UVec2::new(800, 800);
/// let filmed = testing::film(&mut app, &film, "dataset".as_ref(), |_, _| {}, |done, all| println!("{done}/{all}"))?;
/// println!("{} pictures for training", filmed.train);
/// # Ok::<(), testing::FilmError>(())
/// ```
pub fn film(
    app: &mut App,
    film: &Film,
    folder: &Path,
    mut set_time: impl FnMut(&mut World, f32),
    mut progress: impl FnMut(usize, usize),
) -> Result<Filmed, FilmError> {
    let times = check(film)?;
    let seconds = [times[0], times[times.len() - 1]].map(|time| time.as_secs_f32());
    let mut files = Files::begin(folder, film.size, film.lens.fov, seconds)?;
    settle(app)?;
    check_size(app, film.size)?;
    let offscreen = Offscreen::hdr(&mut app.world_mut().get_resource_or_init::<Assets<Image>>(), film.size);
    let others = deactivate_cameras(app.world_mut());
    let camera = spawn_camera(app.world_mut(), film, &offscreen);
    let shot = shoot(app, film, &times, camera, &offscreen, &mut files, &mut set_time, &mut progress);
    app.world_mut().despawn(camera);
    for other in others {
        if let Some(mut other) = app.world_mut().get_mut::<Camera>(other) {
            other.is_active = true;
        }
    }
    shot?;
    let [train, validation, test] = files.finish()?;
    Ok(Filmed { train, validation, test })
}

/// Returns the times of a film in increasing order, each once.
fn check(film: &Film) -> Result<Vec<Duration>, FilmError> {
    let poses = &film.rig.poses;
    if poses.is_empty() || film.times.is_empty() {
        return Err(FilmError::Empty { cameras: poses.len(), times: film.times.len() });
    }
    let duration = |time: &f32| Duration::try_from_secs_f32(*time).map_err(|_| FilmError::Time(*time));
    let mut times = film.times.iter().map(duration).collect::<Result<Vec<_>, _>>()?;
    times.sort();
    times.dedup();
    if film.rig.is_path && poses.len() != times.len() {
        return Err(FilmError::Path { poses: poses.len(), times: times.len() });
    }
    let usable = |pose: &Transform| pose.translation.is_finite() && pose.rotation.is_normalized();
    if let Some(camera) = poses.iter().position(|pose| !usable(pose)) {
        return Err(FilmError::Pose(camera));
    }
    if !(film.lens.fov > 0.0 && film.lens.fov < PI) {
        return Err(FilmError::FieldOfView(film.lens.fov));
    }
    let splits = |time: usize| film.rig.at(time).map(move |camera| (camera, time));
    let mut pictures = (0..times.len()).flat_map(splits);
    if !pictures.any(|(camera, time)| film.hold_out.split(camera, time, times.len()) == Split::Train) {
        return Err(FilmError::NoTraining);
    }
    Ok(times)
}

/// Checks that the GPU can draw pictures of a size.
fn check_size(app: &App, size: UVec2) -> Result<(), FilmError> {
    let device = app.world().get_resource::<RenderDevice>().ok_or(TestingError::NoRenderer)?;
    let largest = device.limits().max_texture_dimension_2d;
    if size.min_element() == 0 || size.max_element() > largest {
        return Err(FilmError::Size { width: size.x, height: size.y, largest });
    }
    Ok(())
}

/// Makes the cameras of the app inactive and returns those that were active.
fn deactivate_cameras(world: &mut World) -> Vec<Entity> {
    let mut active = Vec::new();
    for (entity, mut camera) in world.query::<(Entity, &mut Camera)>().iter_mut(world) {
        if camera.is_active {
            camera.is_active = false;
            active.push(entity);
        }
    }
    active
}

fn spawn_camera(world: &mut World, film: &Film, offscreen: &Offscreen) -> Entity {
    let mut camera = world.spawn(Camera3d::default());
    (film.prepare_camera)(&mut camera);
    let clear_color = ClearColorConfig::Custom(Color::NONE);
    camera.insert((
        Camera { clear_color, ..Camera::default() },
        Hdr,
        offscreen.target(),
        Projection::Perspective(film.lens.clone()),
        film.msaa,
        Tonemapping::None,
        DebandDither::Disabled,
    ));
    camera.id()
}

fn shoot(
    app: &mut App,
    film: &Film,
    times: &[Duration],
    camera: Entity,
    offscreen: &Offscreen,
    files: &mut Files<'_>,
    set_time: &mut impl FnMut(&mut World, f32),
    progress: &mut impl FnMut(usize, usize),
) -> Result<(), FilmError> {
    let all = (0..times.len()).map(|time| film.rig.at(time).len()).sum();
    let mut done = 0;
    let mut now = Duration::ZERO;
    let mut is_set = false;
    for index in 0..times.len() {
        for (nth, (moment, place)) in moments(film, times, index).into_iter().enumerate() {
            let seconds = moment.as_secs_f32();
            // Cameras have no scale.
            let pose = Transform { scale: Vec3::ONE, ..film.rig.poses[place] };
            app.world_mut().entity_mut(camera).insert(pose);
            advance_by(app, moment - now)?;
            if !is_set || moment > now {
                set_time(app.world_mut(), seconds);
                (now, is_set) = (moment, true);
            }
            wait_for_gpu(app)?;
            // Lists of lights grow over some updates at the first picture of a pose.
            if index == 0 || film.rig.is_path {
                settle(app)?;
            }
            draw(app)?;
            // The first camera films at the time itself.
            if nth == 0 {
                files.add_points(seconds, places(app.world_mut()))?;
            }
            let picture = read_half(app, offscreen)?;
            let split = film.hold_out.split(place, index, times.len());
            files.add(split, [place, index], seconds, &pose, picture)?;
            done += 1;
            progress(done, all);
        }
    }
    Ok(())
}

/// Waits until the GPU has finished the last update, and what it has counted for the next one has arrived.
fn wait_for_gpu(app: &App) -> Result<(), TestingError> {
    let device = app.world().get_resource::<RenderDevice>().ok_or(TestingError::NoRenderer)?;
    device.poll(PollType::wait_indefinitely()).map(drop).map_err(|_| TestingError::Readback)
}

/// Runs the app until it has drawn a complete picture.
fn draw(app: &mut App) -> Result<(), TestingError> {
    // Otherwise rendering is pipelined: the picture of an update is drawn during the next.
    let draws_at_once = app.get_sub_app(RenderApp).is_some();
    if !draws_at_once || app.world_mut().query::<&GaussianCapture3d>().iter(app.world()).next().is_some() {
        return settle(app);
    }
    let mut is_complete = false;
    while !is_complete {
        // An update in which pipelines are compiled may leave out what they draw.
        is_complete = pipelines_are_ready(app)?;
        load(app)?;
    }
    Ok(())
}

/// Returns the moments from a time to the next, with the camera that films at each, in increasing order.
fn moments(film: &Film, times: &[Duration], time: usize) -> Vec<(Duration, usize)> {
    let next = times.get(time + 1).filter(|_| film.stagger && !film.rig.is_path);
    let span = next.map_or(Duration::ZERO, |next| *next - times[time]);
    let moment = |place: usize| (times[time] + span.mul_f64((place as f64 * GOLDEN).fract()), place);
    let mut moments: Vec<_> = film.rig.at(time).map(moment).collect();
    moments.sort();
    moments
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn staggered_cameras_film_at_different_moments_inside_the_interval() {
        let film = Film { stagger: true, ..Film::new(Rig::ring(Vec3::ZERO, 2.0, 0.5, 24), vec![0.0, 0.5, 2.0]) };
        let times = check(&film).expect("the film can be drawn");
        let all: Vec<Vec<_>> = (0..3).map(|time| moments(&film, &times, time)).collect();
        for (time, moments) in all.iter().enumerate() {
            let mut cameras: Vec<usize> = moments.iter().map(|(_, camera)| *camera).collect();
            cameras.sort_unstable();
            assert_eq!(cameras, (0..24).collect::<Vec<_>>(), "every camera films once from time {time} on");
        }
        let mut different: Vec<Duration> = all[..2].iter().flatten().map(|(moment, _)| *moment).collect();
        assert!(different.is_sorted(), "the app's time runs forward");
        different.dedup();
        assert_eq!(different.len(), 48, "no two cameras film at the same moment before the last time");
        let gaps = all[0].windows(2).map(|pair| (pair[1].0 - pair[0].0).as_secs_f64()).fold(0.0, f64::max);
        assert!(gaps < 0.5 / 12.0, "the moments are spread over the step, at most {gaps} s apart");
        assert!(all[2].iter().all(|(moment, _)| *moment == Duration::from_secs(2)), "all film the last time itself");
        let steady = Film { stagger: false, ..film };
        let together = moments(&steady, &times, 1).iter().all(|(moment, _)| *moment == times[1]);
        assert!(together, "without staggering, all cameras film at the time itself");
    }

    #[test]
    fn films_that_cannot_be_drawn_are_refused_with_the_remedy() {
        let ring = || Rig::ring(Vec3::ZERO, 2.0, 0.5, 4);
        let refused = |film: Film| check(&film).expect_err("it cannot be drawn").to_string();
        let good = Film::new(ring(), vec![0.5, 0.0, 0.5]);
        let times = check(&good).expect("it can be drawn");
        assert_eq!(times, [Duration::ZERO, Duration::from_millis(500)], "times are sorted, each once");
        assert!(refused(Film::new(ring(), vec![])).contains("one time"), "no times");
        assert!(refused(Film::new(ring(), vec![-1.0])).contains("-1 s"), "a negative time");
        assert!(refused(Film::new(ring(), vec![f32::NAN])).contains("NaN s"), "a time that is not finite");
        let path = Rig::path(vec![Transform::IDENTITY; 3]);
        assert!(refused(Film::new(path, vec![0.0, 1.0])).contains("3 poses for 2"), "a path of another length");
        let lost = Rig::path(vec![Transform::from_xyz(f32::NAN, 0.0, 0.0)]);
        assert!(refused(Film::new(lost, vec![0.0])).contains("camera 0"), "a pose that is not finite");
        let hold_out = HoldOut { test_cameras: 1, ..HoldOut::NOTHING };
        assert!(refused(Film { hold_out, ..good }).contains("fewer cameras"), "no picture for training");
    }
}
