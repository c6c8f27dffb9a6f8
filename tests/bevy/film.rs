//! `testing::film`: a scene of Bevy's own means, filmed as a dataset.
//!
//! In: a moving, unlit sphere; the island of the example `film`. Out: proof that the island is a loop and stays in
//! sight, that the crate's reader opens the dataset, that the cameras project the sphere onto its pixels, that coverage
//! is right, that runs repeat to the byte, and that folders are not overwritten. Tests that draw are skipped without a
//! GPU; a software driver is enough.

#[path = "../../examples/film/island.rs"]
mod island;

use crate::support::no_gpu::no_gpu;
use bevy::ecs::system::RunSystemOnce;
use bevy::prelude::*;
use bevy_gs4d::offline::dataset::{CameraOptions, Dataset, Split, TrainingView};
use bevy_gs4d::testing::{self, Film, FilmError, Filmed, HoldOut, Rig, has_gpu};
use bevy_gs4d::view::RasterFov;
use std::collections::BTreeMap;
use std::path::Path;

const SIZE: UVec2 = UVec2::splat(64);
const TIMES: [f32; 3] = [0.0, 0.25, 1.0];

#[derive(Component)]
struct Ball;

/// Returns the center of the sphere after `seconds`.
fn center(seconds: f32) -> Vec3 {
    Vec3::new(0.5 * seconds, 0.3 * seconds, -0.4 * seconds)
}

/// Moves the sphere by the app's own time, as a simulation.
fn advance(time: Res<Time>, mut ball: Single<&mut Transform, With<Ball>>) {
    ball.translation += center(time.delta_secs());
}

/// Films a sphere that moves by itself, from six cameras at three times.
fn film_into(folder: &Path) -> Result<Filmed, FilmError> {
    let mut app = testing::app(SIZE);
    app.add_systems(Update, advance);
    let mesh = app.world_mut().resource_mut::<Assets<Mesh>>().add(Sphere::new(0.6));
    let material = StandardMaterial { base_color: Color::srgb_u8(200, 100, 50), unlit: true, ..default() };
    let material = app.world_mut().resource_mut::<Assets<StandardMaterial>>().add(material);
    app.world_mut().spawn((Ball, Mesh3d(mesh), MeshMaterial3d(material), Transform::default()));
    let own = app.world_mut().spawn(Camera3d::default()).id();
    let film = Film {
        size: SIZE,
        hold_out: HoldOut { test_cameras: 3, validation_cameras: 0, test_times: 0, validation_times: 3 },
        ..Film::new(Rig::hemisphere(Vec3::ZERO, 5.0, 6), TIMES.into())
    };
    let mut shown = Vec::new();
    let filmed = testing::film(&mut app, &film, folder, |_, _| {}, |done, all| shown.push((done, all)))?;
    assert_eq!(shown, (1..=18).map(|done| (done, 18)).collect::<Vec<_>>(), "every picture is reported once");
    assert!(app.world().get::<Camera>(own).is_some_and(|own| own.is_active), "the app's own camera is active again");
    Ok(filmed)
}

/// Checks the picture of one view.
fn check(view: &TrainingView) {
    let name = &view.name;
    let picture = image::open(&view.image).expect("the picture is on disk").into_rgba8();
    assert_eq!((UVec2::from(picture.dimensions()), view.camera.size), (SIZE, SIZE), "the size of {name}");
    for (x, y) in [(0, 0), (63, 0), (0, 63), (63, 63)] {
        assert_eq!(picture.get_pixel(x, y).0, [0; 4], "nothing is in the corners of {name}");
    }
    // Seconds equal the time from 0 to 1 because the film lasts a second.
    let seen = view.camera.view(view.time, RasterFov::Reference);
    let position = seen.world_to_camera.transform_point3(center(view.time));
    let ndc = Vec2::new(
        seen.projection.x * position.x + seen.projection.z * position.z,
        seen.projection.y * position.y + seen.projection.w * position.z,
    ) / position.z;
    let expected = (ndc + 1.0) / 2.0 * SIZE.as_vec2();
    let covered = picture
        .enumerate_pixels()
        .map(|(x, y, pixel)| Vec3::new(x as f32 + 0.5, y as f32 + 0.5, 1.0) * f32::from(pixel.0[3]));
    let sum: Vec3 = covered.sum();
    let centroid = sum.truncate() / sum.z;
    assert!(centroid.distance(expected) < 1.5, "the sphere of {name} is at {expected}, its pixels at {centroid}");
    let middle = expected.as_uvec2();
    assert_eq!(picture.get_pixel(middle.x, middle.y).0, [200, 100, 50, 255], "the middle of the sphere in {name}");
    let mut edge = picture.pixels().filter(|pixel| (64..255).contains(&pixel.0[3])).peekable();
    assert!(edge.peek().is_some(), "the edge of the sphere in {name} is partly covered");
    for pixel in edge {
        let far = [200_u8, 100, 50].iter().zip(pixel.0).any(|(expected, value)| expected.abs_diff(value) > 2);
        assert!(!far, "straight alpha keeps the color at the edge of {name}: {:?}", pixel.0);
    }
}

/// Returns the files of a folder and its subfolders by path.
fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut found = BTreeMap::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(next) = folders.pop() {
        for entry in std::fs::read_dir(next).expect("the folder can be read") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                folders.push(path);
            } else {
                let name = path.strip_prefix(folder).expect("inside").display().to_string();
                found.insert(name, std::fs::read(&path).expect("the file can be read"));
            }
        }
    }
    found
}

#[test]
fn a_filmed_scene_is_a_dataset_whose_cameras_project_the_scene_onto_its_pixels() {
    if !has_gpu() {
        no_gpu();
        return;
    }
    let temporary = tempfile::tempdir().expect("a temporary folder");
    let [first, second] = ["first", "second"].map(|name| temporary.path().join(name));
    let filmed = film_into(&first).expect("the scene is filmed");
    // Cameras 2 and 5 are for the test; of the others, the middle time is for validation.
    assert_eq!(filmed, Filmed { train: 8, validation: 4, test: 6 }, "the splits by camera and by time");
    for (split, count, expected) in
        [(Split::Train, 8, &[0.0, 1.0][..]), (Split::Val, 4, &[0.25]), (Split::Test, 6, &TIMES)]
    {
        let dataset = Dataset::open(&first, split, &CameraOptions::default()).expect("the dataset is readable");
        dataset.require_images().expect("all pictures are on disk");
        assert_eq!(dataset.views.len(), count, "the number of views of {split:?}");
        let mut times: Vec<f32> = dataset.views.iter().map(|view| view.time).collect();
        times.dedup();
        assert_eq!(times, expected, "the times of {split:?}");
        dataset.views.iter().for_each(check);
    }

    film_into(&second).expect("the scene is filmed again");
    let [one, other] = [&first, &second].map(|folder| files(folder));
    assert_eq!(one.len(), 18 + 3, "18 pictures and 3 camera files");
    for (name, bytes) in &one {
        assert!(other.get(name) == Some(bytes), "{name} is the same in both runs");
    }
    assert_eq!(one.len(), other.len(), "both runs write the same files");
}

#[test]
fn a_folder_with_files_is_not_filmed_into() {
    if !has_gpu() {
        no_gpu();
        return;
    }
    let folder = tempfile::tempdir().expect("a temporary folder");
    std::fs::write(folder.path().join("notes.txt"), "mine").expect("the folder can be written to");
    let error = film_into(folder.path()).expect_err("the folder is not empty").to_string();
    let name = folder.path().display().to_string();
    assert!(error.contains(&name) && error.contains("name a new folder"), "the folder and the remedy: {error}");
    assert_eq!(files(folder.path()).len(), 1, "nothing is written");
}

/// Returns the places of everything of the island at a time: poses, then the vertices of all meshes.
fn places(world: &mut World, seconds: f32) -> (Vec<Transform>, Vec<[f32; 3]>) {
    island::place(world, seconds);
    let poses = world.query::<&Transform>().iter(world).copied().collect();
    let meshes: Vec<_> = world.query::<&Mesh3d>().iter(world).map(|mesh| mesh.id()).collect();
    let assets = world.resource::<Assets<Mesh>>();
    let points = |mesh| assets.get(mesh)?.attribute(Mesh::ATTRIBUTE_POSITION)?.as_float3().map(<[_]>::to_vec);
    (poses, meshes.into_iter().filter_map(points).flatten().collect())
}

#[test]
fn the_island_is_a_loop_that_depends_on_the_time_alone() {
    let mut world = World::new();
    world.init_resource::<Assets<Mesh>>();
    world.init_resource::<Assets<StandardMaterial>>();
    world.run_system_once(island::spawn).expect("the scene is spawned");
    let first = places(&mut world, 0.0);
    let later = places(&mut world, 1.3);
    let last = places(&mut world, island::SECONDS);
    assert_eq!(places(&mut world, 1.3), later, "the same time shows the same scene");
    let far = |(poses, points): &(Vec<Transform>, Vec<[f32; 3]>)| {
        let poses = poses.iter().zip(&first.0).map(|(one, other)| one.translation.distance(other.translation));
        let points = points.iter().zip(&first.1).map(|(one, other)| Vec3::from(*one).distance(Vec3::from(*other)));
        [poses.fold(0.0, f32::max), points.fold(0.0, f32::max)]
    };
    assert!(far(&last).iter().all(|far| *far < 1e-4), "the end of the loop is its beginning: {:?}", far(&last));
    assert!(far(&later).iter().all(|far| *far > 0.02), "things and cloth move: {:?}", far(&later));
    let half = island::DISTANCE * (std::f32::consts::FRAC_PI_8).tan();
    for pose in later.0.iter().filter(|pose| pose.translation.length() < 2.0) {
        let far = pose.translation.distance(island::CENTER);
        assert!(far < half, "{} is in sight of the cameras: {far} of {half}", pose.translation);
    }
}
