//! `testing::film`: a scene of Bevy's own means, filmed as a dataset.
//!
//! In: a moving, unlit sphere with a point; the island of the example `film`. Out: proof that the island is a loop,
//! stays in sight and has ten points, that the crate's reader opens the dataset, that the cameras project the sphere
//! onto its pixels, that coverage is right, that points have their places, that runs repeat to the byte, and that
//! folders are not overwritten. Tests that draw are skipped without a GPU; a software driver is enough.

#[path = "../../examples/film/island.rs"]
mod island;

use crate::support::no_gpu::no_gpu;
use bevy::ecs::system::RunSystemOnce;
use bevy::prelude::*;
use bevy_gs4d::offline::dataset::{CameraOptions, Dataset, Split, TrainingView};
use bevy_gs4d::offline::sockets::KnownPoint;
use bevy_gs4d::scene::Origin;
use bevy_gs4d::testing::{self, Film, FilmError, Filmed, FilmedPoint, HoldOut, Rig, has_gpu};
use bevy_gs4d::view::RasterFov;
use std::collections::BTreeMap;
use std::path::Path;

const SIZE: UVec2 = UVec2::splat(64);
const TIMES: [f32; 3] = [0.0, 0.25, 1.0];
/// The place of a point that is hidden at the first time.
const LATE: Vec3 = Vec3::new(1.0, 2.0, -3.0);

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

/// Films a sphere that moves by itself, with a point on its side, from six cameras at three times.
fn film_into(folder: &Path) -> Result<Filmed, FilmError> {
    let mut app = testing::app(SIZE);
    app.add_systems(Update, advance);
    let mesh = app.world_mut().resource_mut::<Assets<Mesh>>().add(Sphere::new(0.6));
    let material = StandardMaterial { base_color: Color::srgb_u8(200, 100, 50), unlit: true, ..default() };
    let material = app.world_mut().resource_mut::<Assets<StandardMaterial>>().add(material);
    app.world_mut()
        .spawn((Ball, Mesh3d(mesh), MeshMaterial3d(material), Transform::default()))
        .with_child((FilmedPoint::new("side"), Transform::from_xyz(0.6, 0.0, 0.0)));
    let late = (FilmedPoint::new("late"), Transform::from_translation(LATE), Visibility::Hidden);
    let late = app.world_mut().spawn(late).id();
    let show = |world: &mut World, seconds: f32| {
        if seconds > 0.2 {
            world.entity_mut(late).insert(Visibility::Inherited);
        }
    };
    let own = app.world_mut().spawn(Camera3d::default()).id();
    let film = Film {
        size: SIZE,
        hold_out: HoldOut { test_cameras: 3, validation_cameras: 0, test_times: 0, validation_times: 3 },
        ..Film::new(Rig::hemisphere(Vec3::ZERO, 5.0, 6), TIMES.into())
    };
    let mut shown = Vec::new();
    let filmed = testing::film(&mut app, &film, folder, show, |done, all| shown.push((done, all)))?;
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

/// Checks the tracks of the points.
fn check_points(path: &Path) {
    let points = KnownPoint::read(path, &Origin::default()).expect("the file has known points");
    let [late, side] = points.as_slice() else { panic!("two points, not {points:?}") };
    assert_eq!((late.name.as_str(), side.name.as_str()), ("late", "side"), "the names");
    let there = Some(LATE.to_array());
    assert_eq!(late.track, [(0.0, None), (0.25, there), (1.0, there)], "a point is not there while it is hidden");
    assert_eq!(side.track.len(), TIMES.len(), "every time once");
    for ((time, place), expected) in side.track.iter().zip(TIMES) {
        let place = Vec3::from(place.expect("it is never hidden"));
        // Seconds equal the time from 0 to 1, as above.
        let far = place.distance(center(expected) + Vec3::X * 0.6);
        assert!(*time == expected && far < 1e-4, "the point on the sphere is {far} off at {time}");
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

    check_points(&first.join("points.json"));

    film_into(&second).expect("the scene is filmed again");
    let [one, other] = [&first, &second].map(|folder| files(folder));
    assert_eq!(one.len(), 18 + 4, "18 pictures, 3 camera files and the points");
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

/// Returns the place of each named point of the island at a time, world space.
fn points(world: &mut World, seconds: f32) -> BTreeMap<String, Vec3> {
    island::place(world, seconds);
    let mut points = world.query::<(&FilmedPoint, &Transform, &ChildOf)>();
    let world = &*world;
    let place = |(point, pose, parent): (&FilmedPoint, &Transform, &ChildOf)| {
        let parent = world.get::<Transform>(parent.parent()).expect("a point is on a thing with a pose");
        (point.0.clone(), parent.transform_point(pose.translation))
    };
    points.iter(world).map(place).collect()
}

/// Returns a world with the island.
fn island_world() -> World {
    let mut world = World::new();
    world.init_resource::<Assets<Mesh>>();
    world.init_resource::<Assets<StandardMaterial>>();
    world.run_system_once(island::spawn).expect("the scene is spawned");
    world
}

#[test]
fn the_island_has_ten_points_of_which_two_stand_still() {
    let mut world = island_world();
    assert_eq!(world.query::<&FilmedPoint>().iter(&world).count(), 10, "the points");
    let (first, later) = (points(&mut world, 1.8), points(&mut world, 2.1));
    assert_eq!(first.len(), 10, "each has a name of its own: {first:?}");
    let standing = first.iter().filter(|(name, place)| later.get(*name) == Some(*place));
    let standing: Vec<&str> = standing.map(|(name, _)| name.as_str()).collect();
    assert_eq!(standing, ["gate", "stone"], "the others move: {first:?} and then {later:?}");
    let hidden = |visibility: &&Visibility| **visibility == Visibility::Hidden;
    let count = world.query_filtered::<&Visibility, With<FilmedPoint>>().iter(&world).filter(hidden).count();
    assert_eq!(count, 0, "all can be seen in the middle of the loop");
    points(&mut world, 0.0);
    let count = world.query_filtered::<&Visibility, With<FilmedPoint>>().iter(&world).filter(hidden).count();
    assert_eq!(count, 2, "the petals are hidden before they fall");
}

#[test]
fn the_island_is_a_loop_that_depends_on_the_time_alone() {
    let mut world = island_world();
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

#[test]
fn a_take_is_a_longer_loop_whose_parts_differ() {
    let mut world = island_world();
    world.insert_resource(island::Take { seconds: 3.0 * island::SECONDS });
    let color = |world: &mut World| world.query::<&DirectionalLight>().single(world).expect("one sun").color;
    let first = places(&mut world, 0.0).0;
    let begin = color(&mut world);
    let [later, again, last] =
        [1.3, 1.3 + island::SECONDS, 3.0 * island::SECONDS].map(|time| places(&mut world, time).0);
    assert_eq!(color(&mut world), begin, "the light of the end is that of the beginning");
    places(&mut world, 1.5 * island::SECONDS);
    assert_ne!(color(&mut world), begin, "the light of the middle is another");
    let moved = |one: &[Transform], other: &[Transform]| {
        one.iter().zip(other).filter(|(one, other)| one.translation.distance(other.translation) > 0.02).count()
    };
    assert_eq!(moved(&first, &last), 0, "the end of the take is its beginning");
    assert!(moved(&later, &again) > 100, "petals fall along other ways in each loop: {}", moved(&later, &again));
}
