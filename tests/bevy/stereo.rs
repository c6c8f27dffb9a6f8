//! Two eyes in Bevy apps without a window: their disparity, and their pictures compared to single cameras.
//!
//! In: small scenes made by hand, heads with two eyes. Out: proof that the disparity is that of pinhole cameras, that
//! both eyes' pictures equal pictures of single cameras at the same time, and that halves of one target equal two
//! targets. Skipped without a GPU; a software driver is enough.

use crate::support::blob::blob;
use crate::support::cpu_reference::{DURATION, SIZE, add, difference_between, scene};
use crate::support::offscreen_app::{FOV_Y, app, picture, spawn_camera};
use bevy::camera::RenderTarget;
use bevy::core_pipeline::tonemapping::{DebandDither, Tonemapping};
use bevy::math::DVec3;
use bevy::prelude::*;
use bevy::render::render_resource::Extent3d;
use bevy_gs4d::GaussianCapture3d;
use bevy_gs4d::gaussian::Gaussian;
use bevy_gs4d::playback::Playback;
use bevy_gs4d::render::CaptureStatistics;
use bevy_gs4d::scene::{RuntimeScene, TemporalFilter};
use bevy_gs4d::stereo::{EyeTargets, StereoRig, spawn_stereo};
use bevy_gs4d::testing::{self, Offscreen};
use image::RgbaImage;
use image::imageops::crop_imm;

/// Much larger than for people, so that the disparity is many pixels.
const RIG: StereoRig = StereoRig { ipd: 0.2 };

/// Returns a round Gaussian and its color.
fn splat(mean: Vec3, deviation: f32, velocity: Vec3, color: Vec3) -> (Gaussian, Vec3) {
    let at_rest = blob(mean, Vec3::splat(deviation), 0.9);
    (Gaussian { mean_t: 0.0, velocity: velocity.to_array(), sigma_t: 10.0, ..at_rest }, color)
}

/// Returns one small white Gaussian near the origin that rises by 0.8 units over the time interval.
fn dot() -> RuntimeScene {
    scene(&[splat(Vec3::new(0.1, -0.2, 0.0), 0.05, Vec3::new(0.0, 0.8, 0.0), Vec3::ONE)])
}

/// Returns overlapping Gaussians at different depths, some of them moving.
fn crowd() -> RuntimeScene {
    scene(&[
        splat(Vec3::new(0.3, 0.1, 0.6), 0.2, Vec3::ZERO, Vec3::new(0.9, 0.2, 0.1)),
        splat(Vec3::new(-0.3, 0.2, -0.4), 0.3, Vec3::X, Vec3::new(0.1, 0.7, 0.3)),
        splat(Vec3::new(0.0, -0.3, 0.2), 0.1, Vec3::new(-0.5, 0.6, 0.4), Vec3::new(0.2, 0.3, 1.0)),
        splat(Vec3::new(0.1, 0.0, -1.5), 0.6, Vec3::ZERO, Vec3::splat(0.8)),
    ])
}

fn spawn(app: &mut App, scene: &RuntimeScene, playback: Playback) {
    let handle = add(app, scene);
    app.world_mut().spawn((GaussianCapture3d(handle), playback));
}

/// An app with a stereo rig.
struct StereoApp {
    app: App,
    head: Entity,
    /// The target of the right eye; `None` if both eyes draw side by side.
    right: Option<Offscreen>,
}

impl StereoApp {
    fn new(scene: &RuntimeScene, head: Transform, separate: bool) -> Option<Self> {
        Self::of_size(SIZE, scene, head, separate)
    }

    /// Like [`new`](Self::new), with `eye` pixels for each eye.
    fn of_size(eye: UVec2, scene: &RuntimeScene, head: Transform, separate: bool) -> Option<Self> {
        let size = if separate { eye } else { eye * UVec2::new(2, 1) };
        let mut app = app(size)?;
        spawn(&mut app, scene, Playback::default());
        let target = RenderTarget::default();
        let right = separate.then(|| Offscreen::new(&mut app.world_mut().resource_mut::<Assets<Image>>(), eye));
        let targets = match &right {
            Some(right) => EyeTargets::Separate([target, right.target()]),
            None => EyeTargets::SideBySide(target),
        };
        let stereo = spawn_stereo(&mut app.world_mut().commands(), RIG, targets);
        app.world_mut().flush();
        app.world_mut().entity_mut(stereo.head).insert(head);
        for eye in stereo.eyes {
            let lens = Projection::Perspective(PerspectiveProjection { fov: FOV_Y, ..default() });
            app.world_mut().entity_mut(eye).insert((lens, Msaa::Off, Tonemapping::None, DebandDither::Disabled));
        }
        Some(Self { app, head: stereo.head, right })
    }

    /// Returns the pictures of the left and the right eye after `seconds` more.
    fn eyes(&mut self, seconds: f32) -> [RgbaImage; 2] {
        let left = picture(&mut self.app, seconds);
        match &self.right {
            Some(right) => [left, testing::read(&mut self.app, right).expect("the right eye has drawn")],
            None => [0, SIZE.x].map(|corner| crop_imm(&left, corner, 0, SIZE.x, SIZE.y).to_image()),
        }
    }
}

/// Returns the number of lists of active Gaussians that have been written so far.
fn activated(app: &App) -> u64 {
    app.world().resource::<CaptureStatistics>().work().activated()
}

/// Returns the picture of a single camera of a scene paused at `seconds`; `None` if there is no GPU.
fn mono(scene: &RuntimeScene, seconds: f32, pose: Transform) -> Option<RgbaImage> {
    let mut app = app(SIZE)?;
    spawn(&mut app, scene, Playback::paused_at(seconds));
    spawn_camera(&mut app, Msaa::Off, pose);
    Some(picture(&mut app, 0.0))
}

/// Returns the centroid of the light in pixels.
fn centroid(picture: &RgbaImage) -> Vec2 {
    let mut sum = DVec3::ZERO;
    for (x, y, pixel) in picture.enumerate_pixels() {
        let weight = f64::from(pixel.0[0]);
        sum += weight * DVec3::new(f64::from(x) + 0.5, f64::from(y) + 0.5, 1.0);
    }
    assert!(sum.z > 0.0, "the picture is not black");
    Vec2::new((sum.x / sum.z) as f32, (sum.y / sum.z) as f32)
}

/// Returns the focal length in pixels.
fn focal() -> f32 {
    SIZE.y as f32 / 2.0 / (FOV_Y / 2.0).tan()
}

#[test]
fn disparity_is_focal_length_times_distance_over_depth() {
    let Some(mut stereo) = StereoApp::new(&dot(), Transform::default(), false) else { return };
    for depth in [1.5, 2.0, 3.0, 5.0] {
        stereo.app.world_mut().entity_mut(stereo.head).insert(Transform::from_xyz(0.0, 0.0, depth));
        let [left, right] = stereo.eyes(0.0).map(|picture| centroid(&picture));
        let (disparity, expected) = (left.x - right.x, focal() * RIG.ipd / depth);
        // The rounding of pixels to 8 bits moves the centroid by less than 0.1 pixels.
        assert!(
            (disparity - expected).abs() < 0.1,
            "the disparity at depth {depth} is {disparity} pixels, not {expected}"
        );
        assert!(
            (left.y - right.y).abs() < 0.1,
            "the heights in both pictures are equal, not {} and {}",
            left.y,
            right.y
        );
        let middle = (left.x + right.x) / 2.0 - SIZE.x as f32 / 2.0;
        let expected = focal() * 0.1 / depth;
        assert!(
            (middle - expected).abs() < 0.1,
            "the mean of both eyes is {middle} pixels right of the center, not {expected}"
        );
    }
}

#[test]
fn the_distance_between_the_eyes_may_change_at_any_time() {
    let Some(mut stereo) = StereoApp::new(&dot(), Transform::from_xyz(0.0, 0.0, 3.0), false) else { return };
    for ipd in [0.2, 0.3, 0.0] {
        stereo.app.world_mut().entity_mut(stereo.head).insert(StereoRig { ipd });
        let pictures = stereo.eyes(0.0);
        let [left, right] = [&pictures[0], &pictures[1]].map(centroid);
        let expected = focal() * ipd / 3.0;
        assert!(
            (left.x - right.x - expected).abs() < 0.1,
            "the disparity is {} pixels, not {expected}",
            left.x - right.x
        );
        if ipd == 0.0 {
            assert_eq!(
                difference_between(&pictures[0], &pictures[1]),
                0,
                "eyes at the same position have the same picture"
            );
        }
    }
}

#[test]
fn each_eye_draws_the_picture_of_a_single_camera_at_its_pose() {
    let head = Transform::from_xyz(0.5, 0.4, 3.0).looking_at(Vec3::ZERO, Vec3::Y);
    let Some(mut stereo) = StereoApp::new(&crowd(), head, false) else { return };
    for (seconds, step) in [(0.0, 0.0), (0.75, 0.75)] {
        for (eye, side) in stereo.eyes(step).into_iter().zip([-0.5, 0.5]) {
            let pose = head * Transform::from_xyz(side * RIG.ipd, 0.0, 0.0);
            let Some(expected) = mono(&crowd(), seconds, pose) else { return };
            // 1 / 255, since the two poses are products in a different order and round differently.
            let apart = difference_between(&eye, &expected);
            assert!(apart <= 1, "at {seconds} s the eye at {side} and a single camera differ by {apart} / 255");
        }
    }
}

#[test]
fn both_eyes_draw_the_same_time() {
    let Some(mut stereo) = StereoApp::new(&dot(), Transform::from_xyz(0.0, 0.0, 3.0), false) else { return };
    let at_first = stereo.eyes(0.0).map(|picture| centroid(&picture).y);
    let later = stereo.eyes(0.5).map(|picture| centroid(&picture).y);
    // A quarter of the scene's duration.
    let expected = focal() * 0.8 * 0.25 / 3.0;
    for (first, later) in at_first.into_iter().zip(later) {
        assert!(
            (first - later - expected).abs() < 0.1,
            "the Gaussian rose by {} pixels, not {expected}",
            first - later
        );
    }
}

#[test]
fn two_halves_and_two_targets_have_the_same_pictures() {
    let head = Transform::from_xyz(-0.3, 0.2, 2.5).looking_at(Vec3::ZERO, Vec3::Y);
    let apps = [false, true].map(|separate| StereoApp::new(&crowd(), head, separate));
    let [Some(mut halves), Some(mut pair)] = apps else { return };
    let (halves, pair) = (halves.eyes(0.25), pair.eyes(0.25));
    for (index, name) in ["left", "right"].into_iter().enumerate() {
        assert_eq!(difference_between(&halves[index], &pair[index]), 0, "the pictures of the {name} eye are equal");
    }
    // The Gaussians with red light are 2 to 4 units away.
    let disparity = centroid(&halves[0]).x - centroid(&halves[1]).x;
    let [least, most] = [4.5, 1.5].map(|depth| focal() * RIG.ipd / depth);
    assert!((least..most).contains(&disparity), "the pictures of the two eyes are shifted by {disparity} pixels");
}

#[test]
fn halves_follow_a_resized_target() {
    let head = Transform::from_xyz(-0.3, 0.2, 2.5).looking_at(Vec3::ZERO, Vec3::Y);
    let larger = SIZE + UVec2::new(50, 30);
    let apps = [SIZE, larger].map(|eye| StereoApp::of_size(eye, &crowd(), head, false));
    let [Some(mut stereo), Some(mut expected)] = apps else { return };
    stereo.eyes(0.0);
    let mut offscreen = stereo.app.world_mut().resource_mut::<Offscreen>();
    offscreen.size = larger * UVec2::new(2, 1);
    let (image, size) = (offscreen.image.clone(), offscreen.size);
    let size = Extent3d { width: size.x, height: size.y, depth_or_array_layers: 1 };
    let mut images = stereo.app.world_mut().resource_mut::<Assets<Image>>();
    images.get_mut(&image).expect("the app's own picture").resize(size);
    let pictures = [&mut stereo, &mut expected].map(|stereo| picture(&mut stereo.app, 0.0));
    assert_eq!(
        difference_between(&pictures[0], &pictures[1]),
        0,
        "the resized target has the picture of a target created at this size"
    );
}

#[test]
fn both_eyes_share_one_active_list() {
    let mut filtered = crowd();
    let interval = filtered.trained_with.time_interval;
    filtered.filter = Some(TemporalFilter::support(filtered.iter(), interval, 0.05, 4));
    let Some(mut stereo) = StereoApp::new(&filtered, Transform::from_xyz(0.0, 0.0, 4.0), false) else { return };
    stereo.eyes(0.0);
    let made = activated(&stereo.app);
    stereo.eyes(0.2 * DURATION);
    assert_eq!(activated(&stereo.app), made, "no list is written inside a segment");
    let eyes = stereo.eyes(0.1 * DURATION);
    assert_eq!(activated(&stereo.app), made + 1, "one list is written for both eyes in the next segment");
    let Some(mut plain) = StereoApp::new(&crowd(), Transform::from_xyz(0.0, 0.0, 4.0), false) else { return };
    let expected = plain.eyes(0.3 * DURATION);
    for (eye, expected) in eyes.iter().zip(&expected) {
        assert_eq!(difference_between(eye, expected), 0, "the filter changes no pixel");
    }
}
