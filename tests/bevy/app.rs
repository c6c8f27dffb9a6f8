//! Captures in Bevy apps without a window: pixels, transforms, viewports and time.
//!
//! In: small scenes made by hand. Out: proof that Bevy's pixels equal the CPU reference, that meshes hide the splats
//! behind them, and that transforms, viewports, multisampling and time have their documented effect. Skipped without a
//! GPU; a software driver is enough.

use crate::support::cpu_reference::{DURATION, SIZE, difference, difference_between, eye, rgb, view, view_of};
use crate::support::fixtures::{self, BLACK, lone, spawn, spawn_flat_box};
use crate::support::offscreen_app::{app, picture, spawn_camera};
use bevy::camera::Viewport;
use bevy::prelude::*;
use bevy_gs4d::asset::GaussianCapture;
use bevy_gs4d::offline;
use bevy_gs4d::playback::{Playback, Repeat};
use bevy_gs4d::scene::{GaussianScene, RuntimeScene, Sliced};
use bevy_gs4d::testing::{self, Offscreen, TestingError};
use bevy_gs4d::view::Background;
use bevy_gs4d::{GaussianCapture3d, GaussianCapturePlugins, codec, reference};
use std::time::Duration;

/// The color of boxes.
const GREEN: Color = Color::srgb(0.0, 1.0, 0.0);

/// Returns overlapping Gaussians of different shapes: one is tilted, two move.
fn crowd() -> RuntimeScene {
    let mut scene = fixtures::crowd();
    let tilted = &mut scene.form.as_sliced_mut().expect("sliced").gaussians[1];
    tilted.covariance = [0.09, 0.04, -0.02, 0.05, 0.01, 0.03];
    scene
}

#[test]
fn pixels_match_the_cpu_reference() {
    let Some(mut app) = app(SIZE) else { return };
    let scene = crowd();
    let entity = spawn(&mut app, &scene, Transform::default());
    spawn_camera(&mut app, Msaa::Off, eye());
    for time in [0.0, 0.5, 0.875] {
        app.world_mut().entity_mut(entity).insert(Playback::paused_at(time * DURATION));
        let expected = reference::render(&scene, &view(&eye(), SIZE, time), BLACK).picture;
        let apart = difference(&picture(&mut app, 0.0), &expected);
        assert!(apart <= 2.0, "at time {time} Bevy and the CPU reference differ by {apart} / 255");
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
    assert!(apart <= 2.0, "over a clear color Bevy and the CPU reference differ by {apart} / 255");
}

#[test]
fn an_hdr_camera_has_the_same_colors() {
    let Some(mut app) = app(SIZE) else { return };
    let scene = crowd();
    spawn(&mut app, &scene, Transform::default());
    let camera = spawn_camera(&mut app, Msaa::Off, eye());
    app.world_mut().entity_mut(camera).insert(bevy::camera::Hdr);
    let expected = reference::render(&scene, &view(&eye(), SIZE, 0.0), BLACK).picture;
    let apart = difference(&picture(&mut app, 0.0), &expected);
    assert!(apart <= 2.0, "with an HDR target Bevy and the CPU reference differ by {apart} / 255");
}

#[test]
fn meshes_hide_only_the_splats_behind_them() {
    let front = Transform::from_xyz(0.0, 0.0, 4.0);
    let [left, right] = [SIZE.x / 2 - 8, SIZE.x / 2 + 8];
    for (depth, hides) in [(1.5, true), (-1.5, false)] {
        let Some(mut app) = app(SIZE) else { return };
        spawn(&mut app, &lone(Vec3::X), Transform::default());
        spawn_camera(&mut app, Msaa::Off, front);
        // The right half of the view.
        spawn_flat_box(&mut app, Vec3::new(6.0, 12.0, 0.1), Vec3::new(3.0, 0.0, depth), GREEN);
        let picture = picture(&mut app, 0.0);
        let [[r, g, _], [x, y, _]] = [left, right].map(|x| rgb(&picture, x, SIZE.y / 2));
        assert!(r > 200 && g < 60, "next to the mesh the pixel shows the Gaussian, not {r}, {g}");
        if hides {
            assert_eq!((x, y), (0, 255), "a mesh in front hides the Gaussian");
        } else {
            assert!(x > 200 && y < 60, "the Gaussian hides a mesh behind it, not {x}, {y}");
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
    assert!(apart <= 2.0, "Bevy and the reference with the transform in its view differ by {apart} / 255");
    let expected = reference::render(&moved(&scene, &entity), &view(&eye(), SIZE, 0.0), BLACK).picture;
    let apart = difference(&picture, &expected);
    assert!(apart <= 2.0, "Bevy and the reference with transformed Gaussians differ by {apart} / 255");
}

#[test]
fn a_small_capture_that_is_enlarged_has_the_near_limit_and_the_filter_that_it_was_trained_with() {
    const SCALE: f32 = 100.0;
    let Some(mut app) = app(SIZE) else { return };
    let mut scene = moved(&crowd(), &Transform::from_scale(Vec3::splat(SCALE.recip())));
    (scene.trained_with.near, scene.trained_with.mip_filter) = (0.002, true);
    let entity = Transform::from_scale(Vec3::splat(SCALE));
    spawn(&mut app, &scene, entity);
    spawn_camera(&mut app, Msaa::Off, eye());
    let picture = picture(&mut app, 0.0);
    let view = view_of(&eye(), &entity, SIZE, 0.0).with_optics(scene.trained_with.optics());
    let expected = reference::render(&scene, &view, BLACK).picture;
    assert!(expected.pixels.iter().any(|pixel| pixel.max_element() > 0.3), "the capture is not behind its near limit");
    let apart = difference(&picture, &expected);
    assert!(apart <= 2.0, "Bevy and the CPU reference differ by {apart} / 255");
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
fn rotating_the_entity_equals_rotating_the_camera_back() {
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
    assert!(rgb(&turned, SIZE.x / 2, SIZE.y / 2) != [0; 3], "the capture is in the picture");
    let apart = difference_between(&turned, &moved);
    assert!(apart <= 2, "the two pictures differ by {apart} / 255");
}

#[test]
fn two_halves_of_a_scene_draw_as_one_capture() {
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
    assert!(apart <= 2.0, "two halves and the whole scene differ by {apart} / 255");
}

#[test]
fn a_multisampled_camera_draws_the_capture() {
    let Some(mut app) = app(SIZE) else { return };
    let scene = crowd();
    spawn(&mut app, &scene, Transform::default());
    spawn_camera(&mut app, Msaa::Sample4, eye());
    let expected = reference::render(&scene, &view(&eye(), SIZE, 0.0), BLACK).picture;
    let apart = difference(&picture(&mut app, 0.0), &expected);
    assert!(apart <= 2.0, "without meshes multisampling has no effect, yet the pictures differ by {apart} / 255");
}

#[test]
fn a_viewport_has_its_own_view_and_the_rest_stays_clear() {
    let Some(mut app) = app(SIZE) else { return };
    let (corner, size) = (UVec2::new(60, 30), UVec2::new(100, 90));
    let scene = crowd();
    spawn(&mut app, &scene, Transform::default());
    let camera = spawn_camera(&mut app, Msaa::Off, eye());
    let viewport = Viewport { physical_position: corner, physical_size: size, ..default() };
    app.world_mut().entity_mut(camera).insert(Camera { viewport: Some(viewport), ..default() });
    // A mesh behind the capture: its depth must be read with the viewport's offset.
    spawn_flat_box(&mut app, Vec3::new(40.0, 40.0, 0.1), Vec3::new(0.0, 0.0, -6.0), GREEN);
    let mut picture = picture(&mut app, 0.0);
    assert_eq!(rgb(&picture, 20, 20), [0, 0, 0], "outside the viewport the target keeps the clear color");
    let inside = image::imageops::crop(&mut picture, corner.x, corner.y, size.x, size.y).to_image();
    let background = Background::Color([0.0, 1.0, 0.0]);
    let expected = reference::render(&scene, &view(&eye(), size, 0.0), background).picture;
    let apart = difference(&inside, &expected);
    assert!(apart <= 2.0, "inside the viewport Bevy and the CPU reference differ by {apart} / 255");
}

#[test]
fn hidden_and_flattened_captures_are_not_drawn() {
    let Some(mut app) = app(SIZE) else { return };
    let hidden = spawn(&mut app, &lone(Vec3::X), Transform::default());
    app.world_mut().entity_mut(hidden).insert(Visibility::Hidden);
    spawn(&mut app, &lone(Vec3::X), Transform::from_scale(Vec3::new(1.0, 0.0, 1.0)));
    spawn_camera(&mut app, Msaa::Off, eye());
    let nothing = picture(&mut app, 0.0);
    assert!(nothing.pixels().all(|pixel| pixel.0[0] == 0), "a hidden and a flattened capture are not drawn");
    app.world_mut().entity_mut(hidden).insert(Visibility::Inherited);
    assert!(
        rgb(&picture(&mut app, 0.0), SIZE.x / 2, SIZE.y / 2)[0] > 200,
        "the capture is drawn after it is shown again"
    );
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
    assert!(apart <= 2.0, "after half a second Bevy and the CPU reference differ by {apart} / 255");
    let time = |app: &App| app.world().get::<Playback>(entity).expect("still there").time;
    assert_eq!(time(&app), 0.5, "playback is at half a second");

    app.world_mut().resource_mut::<Time<Virtual>>().pause();
    picture(&mut app, 0.25);
    assert_eq!(time(&app), 0.5, "playback pauses with the virtual clock");
    app.world_mut().resource_mut::<Time<Virtual>>().unpause();
    picture(&mut app, 1.75);
    assert_eq!(time(&app), 0.25, "playback loops at the end");
    let once = Playback { repeat: Repeat::Once, ..Playback::default() };
    app.world_mut().entity_mut(entity).insert(once);
    picture(&mut app, 5.0);
    assert_eq!(
        *app.world().get::<Playback>(entity).expect("still there"),
        Playback { time: DURATION, playing: false, ..once },
        "playback without repeat stops at the end"
    );
}

#[test]
fn a_package_loads_from_a_folder_and_a_broken_one_is_an_error() {
    let Some(mut app) = app(SIZE) else { return };
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (good, broken) = (folder.path().join("crowd.gs4d"), folder.path().join("broken.gs4d"));
    let scene = crowd();
    offline::work::save(&good, &GaussianScene::from(scene.clone()), &codec::package::WriteSettings::default())
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
    assert!(apart <= 2.0, "the loaded capture and its scene differ by {apart} / 255");

    let handle: Handle<GaussianCapture> = app.world().resource::<AssetServer>().load(broken);
    app.world_mut().entity_mut(entity).insert(GaussianCapture3d(handle));
    let failure = testing::settle(&mut app).expect_err("a flipped bit is an error").to_string();
    assert!(failure.contains("broken.gs4d"), "the message names the file: {failure}");
}

#[test]
fn captures_play_in_an_app_without_a_renderer() {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, AssetPlugin::default(), GaussianCapturePlugins));
    let handle = app.world_mut().resource_mut::<Assets<GaussianCapture>>().add(GaussianCapture::new(crowd()));
    let entity = app.world_mut().spawn((GaussianCapture3d(handle), Playback::default())).id();
    app.insert_resource(bevy::time::TimeUpdateStrategy::ManualDuration(Duration::from_millis(100)));
    for _ in 0..4 {
        app.update();
    }
    let time = app.world().get::<Playback>(entity).expect("a required component").time;
    assert!((0.29..0.41).contains(&time), "captures play without a renderer: {time}");
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
    assert_eq!(taken.len(), 3, "the requested number of pictures");
    for (index, taken) in (0u8..).zip(&taken) {
        let time = 0.25 * f32::from(index);
        app.world_mut().entity_mut(entity).insert(Playback::paused_at(time));
        let apart = difference_between(taken, &picture(&mut app, 0.0));
        assert_eq!(apart, 0, "picture {index} and the picture at {time} s differ by {apart} / 255");
    }
    assert!(difference_between(&taken[0], &taken[2]) > 10, "the pictures show motion");
}

#[test]
fn settling_names_a_required_asset_that_fails_to_load() {
    #[derive(Resource)]
    struct Poster(Handle<Image>);

    let Some(mut app) = app(SIZE) else { return };
    let poster = Poster(app.world().resource::<AssetServer>().load("there-is-none.png"));
    app.insert_resource(poster);
    testing::wait_for(&mut app, |world| vec![world.resource::<Poster>().0.id().untyped()]);
    let failure = testing::settle(&mut app).expect_err("there is no such file");
    assert!(matches!(failure, TestingError::Asset(_)), "the error is a load error: {failure}");
    assert!(failure.to_string().contains("there-is-none.png"), "{failure} names the file");
}

#[test]
fn a_picture_without_an_offscreen_target_is_an_error() {
    let Some(mut app) = app(SIZE) else { return };
    app.world_mut().remove_resource::<Offscreen>();
    let refused = testing::picture(&mut app, Duration::ZERO);
    assert!(matches!(refused, Err(TestingError::NotOffscreen)), "{:?} names the missing target", refused.err());
}
