//! Captures in real Bevy apps without a window: what is drawn, where, and when.
//!
//! In: small scenes made by hand. Out: proof that Bevy's pixels are those of the CPU reference, that meshes hide what
//! is behind them, and that transforms, viewports, multisampling and time have their documented effect. Skipped where
//! there is no GPU, not even a software one.

use crate::support::cpu_reference::{DURATION, SIZE, difference, difference_between, eye, rgb, view, view_of};
use crate::support::fixtures::{self, BLACK, lone, spawn, spawn_box};
use crate::support::offscreen_app::{app, picture, spawn_camera};
use bevy::camera::Viewport;
use bevy::prelude::*;
use bevy_gs4d::asset::GaussianCapture;
use bevy_gs4d::offline;
use bevy_gs4d::playback::{Playback, Repeat};
use bevy_gs4d::scene::{GaussianScene, RuntimeScene, Sliced};
use bevy_gs4d::testing::{self, Offscreen, TestingError};
use bevy_gs4d::view::Background;
use bevy_gs4d::{GaussianCapture3d, GaussianCapturePlugin, codec, reference};
use std::time::Duration;

/// The color of boxes.
const GREEN: Color = Color::srgb(0.0, 1.0, 0.0);

/// Returns overlapping Gaussians of all kinds of shapes: one is tilted, two move.
fn crowd() -> RuntimeScene {
    let mut scene = fixtures::crowd();
    let tilted = &mut scene.form.as_sliced_mut().expect("sliced").gaussians[1];
    tilted.covariance = [0.09, 0.04, -0.02, 0.05, 0.01, 0.03];
    scene
}

#[test]
fn bevy_draws_what_the_cpu_twin_draws() {
    let Some(mut app) = app(SIZE) else { return };
    let scene = crowd();
    let entity = spawn(&mut app, &scene, Transform::default());
    spawn_camera(&mut app, Msaa::Off, eye());
    for time in [0.0, 0.5, 0.875] {
        app.world_mut().entity_mut(entity).insert(Playback::paused_at(time * DURATION));
        let expected = reference::render(&scene, &view(&eye(), SIZE, time), BLACK).picture;
        let apart = difference(&picture(&mut app, 0.0), &expected);
        assert!(apart <= 2.0, "at {time} Bevy and the CPU reference are {apart} / 255 apart");
    }
}

#[test]
fn a_capture_blends_over_the_clear_color_as_encoded_values() {
    let Some(mut app) = app(SIZE) else { return };
    let scene = crowd();
    spawn(&mut app, &scene, Transform::default());
    spawn_camera(&mut app, Msaa::Off, eye());
    app.insert_resource(ClearColor(Color::srgb(0.2, 0.5, 0.9)));
    let expected = reference::render(&scene, &view(&eye(), SIZE, 0.0), Background::Color([0.2, 0.5, 0.9])).picture;
    let apart = difference(&picture(&mut app, 0.0), &expected);
    assert!(apart <= 2.0, "over a color Bevy and the CPU reference are {apart} / 255 apart");
}

#[test]
fn an_hdr_camera_shows_the_same_colors() {
    let Some(mut app) = app(SIZE) else { return };
    let scene = crowd();
    spawn(&mut app, &scene, Transform::default());
    let camera = spawn_camera(&mut app, Msaa::Off, eye());
    app.world_mut().entity_mut(camera).insert(bevy::camera::Hdr);
    let expected = reference::render(&scene, &view(&eye(), SIZE, 0.0), BLACK).picture;
    let apart = difference(&picture(&mut app, 0.0), &expected);
    assert!(apart <= 2.0, "through an HDR target Bevy and the CPU reference are {apart} / 255 apart");
}

#[test]
fn meshes_hide_what_is_behind_them_and_nothing_else() {
    let front = Transform::from_xyz(0.0, 0.0, 4.0);
    let [left, right] = [SIZE.x / 2 - 8, SIZE.x / 2 + 8];
    for (depth, hides) in [(1.5, true), (-1.5, false)] {
        let Some(mut app) = app(SIZE) else { return };
        spawn(&mut app, &lone(Vec3::X), Transform::default());
        spawn_camera(&mut app, Msaa::Off, front);
        // The right half of the view.
        spawn_box(&mut app, Vec3::new(6.0, 12.0, 0.1), Vec3::new(3.0, 0.0, depth), GREEN, AlphaMode::Opaque);
        let picture = picture(&mut app, 0.0);
        let [[r, g, _], [x, y, _]] = [left, right].map(|x| rgb(&picture, x, SIZE.y / 2));
        assert!(r > 200 && g < 60, "beside the mesh the Gaussian shows, not {r}, {g}");
        if hides {
            assert_eq!((x, y), (0, 255), "a mesh in front hides the Gaussian");
        } else {
            assert!(x > 200 && y < 60, "a mesh behind is hidden by the Gaussian, not {x}, {y}");
        }
    }
}

#[test]
fn a_transform_moves_positions_and_shapes() {
    let entity = Transform {
        translation: Vec3::new(0.2, -0.3, 0.1),
        rotation: Quat::from_euler(EulerRot::YXZ, 0.7, -0.4, 1.1),
        scale: Vec3::new(1.4, 0.6, 0.9),
    };
    let Some(mut app) = app(SIZE) else { return };
    let scene = crowd();
    spawn(&mut app, &scene, entity);
    spawn_camera(&mut app, Msaa::Off, eye());
    let picture = picture(&mut app, 0.0);
    let expected = reference::render(&scene, &view_of(&eye(), &entity, SIZE, 0.0), BLACK).picture;
    let apart = difference(&picture, &expected);
    assert!(apart <= 2.0, "the reference with the transform in its view is {apart} / 255 apart");
    let expected = reference::render(&moved(&scene, &entity), &view(&eye(), SIZE, 0.0), BLACK).picture;
    let apart = difference(&picture, &expected);
    assert!(apart <= 2.0, "the reference with every Gaussian transformed is {apart} / 255 apart");
}

/// Returns the scene with every Gaussian transformed.
fn moved(scene: &RuntimeScene, transform: &Transform) -> RuntimeScene {
    let matrix = Mat3::from_mat4(transform.to_matrix());
    let mut moved = scene.clone();
    for gaussian in &mut moved.form.as_sliced_mut().expect("sliced").gaussians {
        let [xx, xy, xz, yy, yz, zz] = gaussian.covariance;
        let covariance = Mat3::from_cols_array(&[xx, xy, xz, xy, yy, yz, xz, yz, zz]);
        let c = matrix * covariance * matrix.transpose();
        gaussian.mean = transform.transform_point(Vec3::from(gaussian.mean)).to_array();
        gaussian.velocity = (matrix * Vec3::from(gaussian.velocity)).to_array();
        gaussian.covariance = [c.x_axis.x, c.x_axis.y, c.x_axis.z, c.y_axis.y, c.y_axis.z, c.z_axis.z];
    }
    moved
}

#[test]
fn turning_the_entity_is_turning_the_camera_back() {
    let turn =
        Transform::from_rotation(Quat::from_euler(EulerRot::XYZ, 0.5, 1.9, -0.3)).with_translation(Vec3::X * 0.3);
    let back = Transform::from_matrix(turn.to_matrix().inverse() * eye().to_matrix());
    let pictures = [(turn, eye()), (Transform::default(), back)].map(|(entity, camera)| {
        let mut app = app(SIZE)?;
        spawn(&mut app, &crowd(), entity);
        spawn_camera(&mut app, Msaa::Off, camera);
        Some(picture(&mut app, 0.0))
    });
    let [Some(turned), Some(moved)] = pictures else { return };
    assert!(rgb(&turned, SIZE.x / 2, SIZE.y / 2) != [0; 3], "something is seen");
    let apart = difference_between(&turned, &moved);
    assert!(apart <= 2, "the two are {apart} / 255 apart");
}

#[test]
fn two_captures_interleave_as_one() {
    let Some(mut app) = app(SIZE) else { return };
    let whole = crowd();
    let part = |keep: fn(usize) -> bool| {
        let mut part = whole.clone();
        let Sliced { gaussians, harmonics } = part.form.as_sliced_mut().expect("sliced");
        *gaussians = whole.iter().enumerate().filter(|(i, _)| keep(*i)).map(|(_, g)| g).collect();
        let colors = harmonics.values.chunks(3).enumerate().filter(|(i, _)| keep(*i));
        harmonics.values = colors.flat_map(|(_, color)| color.to_vec()).collect();
        part
    };
    spawn(&mut app, &part(|i| i % 2 == 0), Transform::default());
    spawn(&mut app, &part(|i| i % 2 == 1), Transform::default());
    spawn_camera(&mut app, Msaa::Off, eye());
    let expected = reference::render(&whole, &view(&eye(), SIZE, 0.0), BLACK).picture;
    let apart = difference(&picture(&mut app, 0.0), &expected);
    assert!(apart <= 2.0, "two halves and the whole are {apart} / 255 apart");
}

#[test]
fn a_multisampled_camera_shows_the_capture_too() {
    let Some(mut app) = app(SIZE) else { return };
    let scene = crowd();
    spawn(&mut app, &scene, Transform::default());
    spawn_camera(&mut app, Msaa::Sample4, eye());
    let expected = reference::render(&scene, &view(&eye(), SIZE, 0.0), BLACK).picture;
    let apart = difference(&picture(&mut app, 0.0), &expected);
    assert!(apart <= 2.0, "without meshes multisampling changes nothing, yet they are {apart} / 255 apart");
}

#[test]
fn a_viewport_gets_its_own_view_and_leaves_the_rest_alone() {
    let Some(mut app) = app(SIZE) else { return };
    let (corner, size) = (UVec2::new(60, 30), UVec2::new(100, 90));
    let scene = crowd();
    spawn(&mut app, &scene, Transform::default());
    let camera = spawn_camera(&mut app, Msaa::Off, eye());
    let viewport = Viewport { physical_position: corner, physical_size: size, ..default() };
    app.world_mut().entity_mut(camera).insert(Camera { viewport: Some(viewport), ..default() });
    // A mesh behind everything: its depth is read at the viewport's place, too.
    spawn_box(&mut app, Vec3::new(40.0, 40.0, 0.1), Vec3::new(0.0, 0.0, -6.0), GREEN, AlphaMode::Opaque);
    let mut picture = picture(&mut app, 0.0);
    assert_eq!(rgb(&picture, 20, 20), [0, 0, 0], "outside the viewport the target is as cleared");
    let inside = image::imageops::crop(&mut picture, corner.x, corner.y, size.x, size.y).to_image();
    let background = Background::Color([0.0, 1.0, 0.0]);
    let expected = reference::render(&scene, &view(&eye(), size, 0.0), background).picture;
    let apart = difference(&inside, &expected);
    assert!(apart <= 2.0, "inside it Bevy and the CPU reference are {apart} / 255 apart");
}

#[test]
fn hidden_and_flattened_captures_are_not_drawn() {
    let Some(mut app) = app(SIZE) else { return };
    let hidden = spawn(&mut app, &lone(Vec3::X), Transform::default());
    app.world_mut().entity_mut(hidden).insert(Visibility::Hidden);
    spawn(&mut app, &lone(Vec3::X), Transform::from_scale(Vec3::new(1.0, 0.0, 1.0)));
    spawn_camera(&mut app, Msaa::Off, eye());
    let nothing = picture(&mut app, 0.0);
    assert!(nothing.pixels().all(|pixel| pixel.0[0] == 0), "nothing red may show");
    app.world_mut().entity_mut(hidden).insert(Visibility::Inherited);
    assert!(rgb(&picture(&mut app, 0.0), SIZE.x / 2, SIZE.y / 2)[0] > 200, "until it is shown again");
}

#[test]
fn playback_follows_the_clock() {
    let Some(mut app) = app(SIZE) else { return };
    let scene = crowd();
    let entity = spawn(&mut app, &scene, Transform::default());
    spawn_camera(&mut app, Msaa::Off, eye());
    testing::settle(&mut app).expect("the app runs");
    app.world_mut().entity_mut(entity).insert(Playback::default());
    // Half a second of two is a quarter of the interval from 0 to 1.
    let expected = reference::render(&scene, &view(&eye(), SIZE, 0.25), BLACK).picture;
    let apart = difference(&picture(&mut app, 0.5), &expected);
    assert!(apart <= 2.0, "after half a second Bevy and the CPU reference are {apart} / 255 apart");
    let time = |app: &App| app.world().get::<Playback>(entity).expect("still there").time;
    assert_eq!(time(&app), 0.5, "the clock stands at half a second");

    app.world_mut().resource_mut::<Time<Virtual>>().pause();
    picture(&mut app, 0.25);
    assert_eq!(time(&app), 0.5, "with the virtual clock paused, so is playback");
    app.world_mut().resource_mut::<Time<Virtual>>().unpause();
    picture(&mut app, 1.75);
    assert_eq!(time(&app), 0.25, "past the end it starts over");
    let once = Playback { repeat: Repeat::Once, ..Playback::default() };
    app.world_mut().entity_mut(entity).insert(once);
    picture(&mut app, 5.0);
    assert_eq!(
        *app.world().get::<Playback>(entity).expect("still there"),
        Playback { time: DURATION, playing: false, ..once }
    );
}

#[test]
fn a_package_loads_from_a_folder_and_a_broken_one_is_an_error() {
    let Some(mut app) = app(SIZE) else { return };
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (good, broken) = (folder.path().join("crowd.gs4d"), folder.path().join("broken.gs4d"));
    let scene = crowd();
    offline::save(&good, &GaussianScene::from(scene.clone()), &codec::package::WriteSettings::default())
        .expect("saved");
    let mut bytes = std::fs::read(&good).expect("just written");
    let last = bytes.len() - 1;
    bytes[last] ^= 1;
    std::fs::write(&broken, bytes).expect("a second file");

    let handle = app.world().resource::<AssetServer>().load(good);
    let entity = app.world_mut().spawn((GaussianCapture3d(handle), Playback::paused_at(0.0))).id();
    spawn_camera(&mut app, Msaa::Off, eye());
    let expected = reference::render(&scene, &view(&eye(), SIZE, 0.0), BLACK).picture;
    let apart = difference(&picture(&mut app, 0.0), &expected);
    assert!(apart <= 2.0, "the loaded capture and its scene are {apart} / 255 apart");

    let handle: Handle<GaussianCapture> = app.world().resource::<AssetServer>().load(broken);
    app.world_mut().entity_mut(entity).insert(GaussianCapture3d(handle));
    let failure = testing::settle(&mut app).expect_err("a flipped bit is noticed").to_string();
    assert!(failure.contains("broken.gs4d"), "the message names the file: {failure}");
}

#[test]
fn the_plugin_does_without_a_renderer() {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, AssetPlugin::default(), GaussianCapturePlugin));
    let handle = app.world_mut().resource_mut::<Assets<GaussianCapture>>().add(GaussianCapture::new(crowd()));
    let entity = app.world_mut().spawn((GaussianCapture3d(handle), Playback::default())).id();
    app.insert_resource(bevy::time::TimeUpdateStrategy::ManualDuration(Duration::from_millis(100)));
    for _ in 0..4 {
        app.update();
    }
    let time = app.world().get::<Playback>(entity).expect("a required component").time;
    assert!((0.29..0.41).contains(&time), "captures play without being drawn: {time}");
}

#[test]
fn pictures_are_taken_at_even_steps_from_the_start() {
    let Some(mut app) = app(SIZE) else { return };
    let folder = tempfile::tempdir().expect("a temporary folder");
    let entity = spawn(&mut app, &crowd(), Transform::default());
    app.world_mut().entity_mut(entity).insert(Playback::default());
    spawn_camera(&mut app, Msaa::Off, eye());
    let paths = testing::pictures(&mut app, folder.path(), 3, Duration::from_millis(250)).expect("the app draws");
    let taken: Vec<_> = paths.iter().map(|path| image::open(path).expect("a whole picture").into_rgba8()).collect();
    assert_eq!(taken.len(), 3, "as many as asked for");
    for (index, taken) in (0u8..).zip(&taken) {
        let time = 0.25 * f32::from(index);
        app.world_mut().entity_mut(entity).insert(Playback::paused_at(time));
        let apart = difference_between(taken, &picture(&mut app, 0.0));
        assert_eq!(apart, 0, "picture {index} and that of {time} s are {apart} / 255 apart");
    }
    assert!(difference_between(&taken[0], &taken[2]) > 10, "while something moves");
}

#[test]
fn what_is_waited_for_and_cannot_be_loaded_is_named() {
    #[derive(Resource)]
    struct Poster(Handle<Image>);

    let Some(mut app) = app(SIZE) else { return };
    let poster = Poster(app.world().resource::<AssetServer>().load("there-is-none.png"));
    app.insert_resource(poster);
    testing::wait_for(&mut app, |world| vec![world.resource::<Poster>().0.id().untyped()]);
    let failure = testing::settle(&mut app).expect_err("there is no such file");
    assert!(matches!(failure, TestingError::Asset(_)), "it cannot be loaded: {failure}");
    assert!(failure.to_string().contains("there-is-none.png"), "{failure} names the file");
}

#[test]
fn without_something_to_draw_into_there_is_no_picture() {
    let Some(mut app) = app(SIZE) else { return };
    app.world_mut().remove_resource::<Offscreen>();
    let refused = testing::picture(&mut app, Duration::ZERO);
    assert!(matches!(refused, Err(TestingError::NotOffscreen)), "{:?} says so", refused.err());
}
