//! Poses and points by the installed COLMAP, command line and Python package.
//!
//! In: pictures of a room of spotted planes, drawn here, by cameras on an arc. Out: their poses, up to a similarity,
//! and points on the planes. Programs that are not installed are reported as skipped.

use super::error::ColmapError;
use super::poses::calibrate_by;
use super::program::Program;
use super::triangulate::triangulated;
use crate::offline::work::NoProgress;
use crate::renderer::view::tests::skip;
use crate::scene::random::Random;
use crate::view::{Camera, Lens};
use glam::{DMat3, DMat4, UVec2, Vec2, Vec3};
use image::{Rgb, RgbImage};
use std::path::{Path, PathBuf};

const SIZE: UVec2 = UVec2::new(640, 480);
/// Focal length, pixels.
const FOCAL: f32 = 600.0;
/// Angle between neighbors on the arc, degrees.
const STEP: f32 = 15.0;
/// What the cameras look at, and how far they are from it.
const TARGET: Vec3 = Vec3::new(0.0, 0.3, 0.8);
const FAR: f32 = 4.0;
/// Texels across a plane, and the number of its spots.
const TEXELS: usize = 512;
const SPOTS: usize = 2500;

/// A spotted plane.
struct Plane {
    origin: Vec3,
    /// From the origin to the two corners beside it.
    sides: [Vec3; 2],
    texels: Vec<Vec3>,
}

impl Plane {
    fn new(origin: [f32; 3], sides: [[f32; 3]; 2], random: &mut Random) -> Self {
        let mut texels = vec![Vec3::splat(128.0); TEXELS * TEXELS];
        for _ in 0..SPOTS {
            let radius = [3.0f32, 5.0, 8.0, 13.0, 20.0][random.below(5)];
            let [x, y] = [(); 2].map(|()| random.in_range(0.0, TEXELS as f32));
            let color = Vec3::from([(); 3].map(|()| random.in_range(0.0, 255.0)));
            let range = |at: f32| (at - radius).max(0.0) as usize..((at + radius) as usize + 1).min(TEXELS);
            for row in range(y) {
                for column in range(x) {
                    if Vec2::new(column as f32 - x, row as f32 - y).length() < radius {
                        texels[row * TEXELS + column] = color;
                    }
                }
            }
        }
        Self { origin: origin.into(), sides: sides.map(Vec3::from), texels }
    }

    fn normal(&self) -> Vec3 {
        self.sides[0].cross(self.sides[1]).normalize()
    }

    /// Returns the distance along a ray, in lengths of its direction, and the color there.
    fn hit(&self, eye: Vec3, ray: Vec3) -> Option<(f32, Vec3)> {
        let far = self.normal().dot(self.origin - eye) / self.normal().dot(ray);
        let inside = eye + ray * far - self.origin;
        let [u, v] = self.sides.map(|side| inside.dot(side) / side.length_squared());
        let is_hit = far > 0.0 && (0.0..1.0).contains(&u) && (0.0..1.0).contains(&v);
        is_hit.then(|| (far, self.color(Vec2::new(u, v))))
    }

    /// Returns the bilinear sample of the texels.
    fn color(&self, at: Vec2) -> Vec3 {
        let at = (at * TEXELS as f32 - 0.5).clamp(Vec2::ZERO, Vec2::splat(TEXELS as f32 - 1.001));
        let (first, part) = (at.y as usize * TEXELS + at.x as usize, at.fract());
        let row = |first: usize| self.texels[first].lerp(self.texels[first + 1], part.x);
        row(first).lerp(row(first + TEXELS), part.y)
    }
}

fn room() -> Vec<Plane> {
    let mut random = Random::new(7);
    let mut plane = |origin, sides| Plane::new(origin, sides, &mut random);
    vec![
        plane([-3.0, -2.0, 2.0], [[6.0, 0.0, 0.0], [0.0, 4.0, 0.0]]),
        plane([-3.0, 1.2, 2.0], [[6.0, 0.0, 0.0], [0.0, 0.0, -4.0]]),
        plane([-0.8, -0.2, 0.3], [[1.6, 0.0, 0.3], [0.0, 1.4, 0.0]]),
    ]
}

/// Returns cameras on an arc, and what they see of planes.
fn seen(planes: &[Plane], count: usize) -> Vec<(Camera, RgbImage)> {
    let camera = |index: usize| {
        let angle = ((index as f32 - (count - 1) as f32 / 2.0) * STEP).to_radians();
        let eye = TARGET + FAR * Vec3::new(angle.sin(), -0.25, -angle.cos());
        let lens = Lens::Intrinsics { focal: Vec2::splat(FOCAL), center: SIZE.as_vec2() / 2.0 };
        Camera { lens, ..Camera::look_at(eye, TARGET, -Vec3::Y, 1.0, SIZE) }
    };
    (0..count).map(camera).map(|camera| (camera, drawn(planes, &camera))).collect()
}

fn drawn(planes: &[Plane], camera: &Camera) -> RgbImage {
    let to_world = camera.world_to_camera.inverse();
    let eye = to_world.w_axis.truncate();
    RgbImage::from_fn(SIZE.x, SIZE.y, |x, y| {
        let at = (UVec2::new(x, y).as_vec2() + 0.5 - SIZE.as_vec2() / 2.0) / FOCAL;
        let ray = to_world.transform_vector3(at.extend(1.0));
        let hits = planes.iter().filter_map(|plane| plane.hit(eye, ray));
        let nearest = hits.min_by(|a, b| a.0.total_cmp(&b.0));
        let color = nearest.map_or(Vec3::splat(40.0), |(_, color)| color);
        Rgb(color.to_array().map(|value| value.round() as u8))
    })
}

/// Writes pictures to a folder. Returns their paths, with the names of their cameras.
fn written(folder: &Path, seen: &[(Camera, RgbImage)]) -> Vec<(String, Vec<PathBuf>)> {
    let write = |(index, (_, picture)): (usize, &(Camera, RgbImage))| {
        let path = folder.join(format!("{index}.png"));
        picture.save(&path).expect("the folder can be written to");
        (format!("camera {index}"), vec![path])
    };
    seen.iter().enumerate().map(write).collect()
}

/// Checks the poses of cameras and the points of a moment.
fn check(program: &Program) {
    let (planes, name) = (room(), &program.name);
    let seen = seen(&planes, 6);
    let folder = tempfile::tempdir().expect("a temporary folder");
    let found = calibrate_by(program, &written(folder.path(), &seen), &mut NoProgress).expect("poses are found");
    let names: Vec<&str> = found.cameras.iter().map(|camera| camera.name.as_str()).collect();
    assert_eq!(names.len(), 6, "{name} places every camera: {names:?}");
    assert!(names.iter().enumerate().all(|(at, name)| *name == format!("camera {at}")), "in order: {names:?}");
    assert!(found.notes[0].contains(name), "the program is named: {:?}", found.notes);
    let truth: Vec<DMat4> = seen.iter().map(|(camera, _)| camera.world_to_camera.as_dmat4()).collect();
    let poses: Vec<DMat4> = found.cameras.iter().map(|camera| camera.world_to_camera).collect();
    let turn = |poses: &[DMat4], at: usize| DMat3::from_mat4(poses[at]);
    let between = |poses: &[DMat4], a: usize, b: usize| turn(poses, a) * turn(poses, b).transpose();
    let place = |poses: &[DMat4], at: usize| poses[at].inverse().w_axis.truncate();
    let length = |poses: &[DMat4], a: usize, b: usize| place(poses, a).distance(place(poses, b));
    let scale = length(&poses, 0, 5) / length(&truth, 0, 5);
    for (a, b) in (0..6).flat_map(|a| (a + 1..6).map(move |b| (a, b))) {
        let error = between(&poses, a, b) * between(&truth, a, b).transpose();
        let trace = error.x_axis.x + error.y_axis.y + error.z_axis.z;
        let angle = ((trace - 1.0) / 2.0).clamp(-1.0, 1.0).acos().to_degrees();
        assert!(angle < 1.0, "{name}: the angle between cameras {a} and {b} is off by {angle} degrees");
        let ratio = length(&poses, a, b) / length(&truth, a, b) / scale;
        assert!((ratio - 1.0).abs() < 0.02, "{name}: the distance of cameras {a} and {b} is off by {ratio} times");
    }

    let points = triangulated(program, &seen[1..5], 0.25, &NoProgress).expect("points are found");
    assert!(points.len() > 300, "{name} finds {} points", points.len());
    let away = |point: Vec3| planes.iter().map(move |plane| plane.normal().dot(point - plane.origin).abs());
    let nearest = |point: Vec3| away(point).fold(f32::INFINITY, f32::min);
    let near = points.iter().filter(|point| nearest(point.position) < 0.05).count();
    assert!(near * 10 > points.len() * 9, "{name}: of {} points {near} are on the planes", points.len());
    assert!(points.iter().all(|point| point.time == Some(0.25)), "{name}: points have the time of the moment");
    let is_colored = |color: Vec3| color.max_element() - color.min_element() > 0.2;
    let colored = points.iter().filter(|point| point.color.is_some_and(is_colored)).count();
    assert!(colored * 2 > points.len(), "{name}: of {} points {colored} have the colors of spots", points.len());
}

/// Checks what is said of pictures without anything in common.
fn check_empty(program: &Program) {
    let seen = seen(&[], 3);
    let folder = tempfile::tempdir().expect("a temporary folder");
    let error = calibrate_by(program, &written(folder.path(), &seen), &mut NoProgress).err();
    let is_named = |error: &ColmapError| error.to_string().contains("camera 0, camera 1, camera 2");
    assert!(error.as_ref().is_some_and(is_named), "the cameras without a pose are named: {error:?}");
    let points = triangulated(program, &seen, 0.0, &NoProgress).expect("nothing is wrong but the pictures");
    assert_eq!(points, [], "{}: nothing is seen", program.name);
}

#[test]
fn the_command_line_finds_poses_and_points() {
    match Program::command_line() {
        Some(program) => check(&program),
        None => skip::skip("colmap is not installed"),
    }
}

#[test]
fn the_command_line_finds_nothing_in_empty_pictures() {
    match Program::command_line() {
        Some(program) => check_empty(&program),
        None => skip::skip("colmap is not installed"),
    }
}

#[test]
fn the_python_package_finds_poses_and_points() {
    match Program::package() {
        Some(program) => check(&program),
        None => skip::skip("pycolmap is not installed"),
    }
}

#[test]
fn the_python_package_finds_nothing_in_empty_pictures() {
    match Program::package() {
        Some(program) => check_empty(&program),
        None => skip::skip("pycolmap is not installed"),
    }
}

#[test]
fn a_single_camera_has_no_pose_and_no_points() {
    let lone = [("lone".to_owned(), vec![PathBuf::from("0.png")]), ("dark".to_owned(), Vec::new())];
    if let Some(program) = Program::command_line().or_else(Program::package) {
        let error = calibrate_by(&program, &lone, &mut NoProgress).err();
        assert!(matches!(error, Some(ColmapError::Few { cameras: 1 })), "one camera has pictures: {error:?}");
        let points = triangulated(&program, &[], 0.0, &NoProgress).expect("nothing to do");
        assert_eq!(points, [], "no pictures, no points");
    } else {
        skip::skip("colmap is not installed");
    }
}
