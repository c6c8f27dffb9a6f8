//! Datasets of nerfstudio, COLMAP and N3V.
//!
//! In: small folders made here, of a rig of cameras whose projections are computed here with sines and cosines. Out:
//! proof that every reader projects known points to the same pixels, and of splits, times, masks, distortion and wrong
//! folders.

use super::{Folder, with};
use bevy_gs4d::internal::offline::dataset::{CloudPoint, PointCloud};
use bevy_gs4d::offline::dataset::{CameraOptions, Dataset, Split, TrainingView};
use bevy_gs4d::scene::Origin;
use bevy_gs4d::view::Lens;
use glam::{UVec2, Vec3};
use image::{GrayImage, Luma, Rgb, RgbImage, Rgba, RgbaImage};
use serde_json::{Value, json};

const WIDTH: u32 = 40;
const HEIGHT: u32 = 30;
const FOCAL: [f64; 2] = [50.0, 52.0];
const CENTER: [f64; 2] = [19.0, 16.0];
/// A point in front of all cameras.
const POINT: [f64; 3] = [0.3, -0.2, 0.4];

/// A camera on a circle of radius 5 in the plane y = 0.5, that looks towards the axis, horizontally: right, down and
/// forward in the world, position.
struct Rig {
    right: [f64; 3],
    down: [f64; 3],
    forward: [f64; 3],
    position: [f64; 3],
}

impl Rig {
    fn new(index: usize) -> Self {
        let (sin, cos) = (0.2 * index as f64).sin_cos();
        Self {
            right: [cos, 0.0, -sin],
            down: [0.0, -1.0, 0.0],
            forward: [-sin, 0.0, -cos],
            position: [5.0 * sin, 0.5, 5.0 * cos],
        }
    }

    /// Returns the pixel of [`POINT`].
    fn pixel(&self, focal: [f64; 2], center: [f64; 2]) -> [f64; 2] {
        let from = [0, 1, 2].map(|axis| POINT[axis] - self.position[axis]);
        let along = |axis: &[f64; 3]| (0..3).map(|i| axis[i] * from[i]).sum::<f64>();
        let depth = along(&self.forward);
        [focal[0] * along(&self.right) / depth + center[0], focal[1] * along(&self.down) / depth + center[1]]
    }

    /// Returns the camera-to-world matrix with OpenGL axes.
    fn to_world(&self) -> Value {
        let row = |i: usize| json!([self.right[i], -self.down[i], -self.forward[i], self.position[i]]);
        json!([row(0), row(1), row(2), [0, 0, 0, 1]])
    }

    /// Returns the quaternion (w, x, y, z) and the translation from the world to the camera.
    fn to_camera(&self) -> ([f64; 4], [f64; 3]) {
        let rows = [self.right, self.down, self.forward];
        let translation = rows.map(|row| -(0..3).map(|i| row[i] * self.position[i]).sum::<f64>());
        // The angle of these rotations is 180 degrees, about an axis (x, 0, z): R = 2 a aT - 1.
        let x = ((1.0 + rows[0][0]) / 2.0).sqrt();
        ([0.0, x, 0.0, rows[0][2] / (2.0 * x)], translation)
    }

    /// Returns a row of `poses_bounds.npy`.
    fn row(&self, focal: f64) -> Vec<f64> {
        let intrinsics = [f64::from(HEIGHT), f64::from(WIDTH), focal];
        let rows =
            (0..3).flat_map(|i| [self.down[i], self.right[i], -self.forward[i], self.position[i], intrinsics[i]]);
        rows.chain([0.1, 100.0]).collect()
    }
}

/// Returns the pixel of [`POINT`] in a view.
fn pixel(view: &TrainingView) -> [f64; 2] {
    let at = view.camera.world_to_camera.transform_point3(Vec3::from(POINT.map(|value| value as f32)));
    let Lens::Intrinsics { focal, center } = view.camera.lens else { panic!("an intrinsics camera") };
    [f64::from(focal.x * at.x / at.z + center.x), f64::from(focal.y * at.y / at.z + center.y)]
}

#[track_caller]
fn assert_pixel(view: &TrainingView, expected: [f64; 2]) {
    let found = pixel(view);
    let off = (found[0] - expected[0]).abs().max((found[1] - expected[1]).abs());
    assert!(off < 1e-3, "{}: the point is at {expected:?}, not {found:?}", view.name);
}

pub(super) fn open(folder: &Folder, split: Split) -> Dataset {
    Dataset::open(folder.path(), split, &CameraOptions::default()).expect("a valid dataset")
}

pub(super) fn refused(folder: &Folder, part: &str) {
    let error = Dataset::open(folder.path(), Split::Train, &CameraOptions::default()).expect_err(part).to_string();
    assert!(error.contains(part), "{part:?} is not in: {error}");
}

pub(super) fn names(views: &[TrainingView]) -> Vec<&str> {
    views.iter().map(|view| view.name.as_str()).collect()
}

pub(super) fn times(views: &[TrainingView]) -> Vec<f32> {
    views.iter().map(|view| view.time).collect()
}

pub(super) fn picture(folder: &Folder, name: &str, color: [u8; 3]) {
    let path = folder.path().join(name);
    std::fs::create_dir_all(path.parent().expect("a folder")).expect("the folder can be made");
    RgbImage::from_pixel(WIDTH, HEIGHT, Rgb(color)).save(path).expect("an image");
}

pub(super) fn nerfstudio(cameras: usize) -> Value {
    let frame = |index| {
        let file = format!("images/f{index:02}.png");
        json!({ "file_path": file, "transform_matrix": Rig::new(index).to_world() })
    };
    json!({
        "camera_model": "OPENCV", "w": WIDTH, "h": HEIGHT, "fl_x": FOCAL[0], "fl_y": FOCAL[1],
        "cx": CENTER[0], "cy": CENTER[1],
        "ply_file_path": "points.ply", "frames": (0..cameras).map(frame).collect::<Vec<_>>(),
    })
}

#[test]
fn nerfstudio_projects_points_as_its_cameras_do() {
    let folder = Folder::new();
    let mut json = nerfstudio(10);
    json["frames"][9]["fl_x"] = json!(80.0);
    for index in 0..10 {
        json["frames"][index]["time"] = json!(if index == 9 { 0.25 } else { 0.5 });
        json["frames"][index]["frame_number"] = json!(index);
    }
    folder.write_json("transforms.json", &json);
    let (train, test) = (open(&folder, Split::Train), open(&folder, Split::Test));
    assert_eq!(names(&test.views), ["f00", "f08"], "every eighth camera is for the test");
    assert_eq!(train.views.len(), 8, "all other cameras are trained on");
    for (view, index) in train.views.iter().zip([1, 2, 3, 4, 5, 6, 7]) {
        assert_pixel(view, Rig::new(index).pixel(FOCAL, CENTER));
    }
    assert_pixel(&train.views[7], Rig::new(9).pixel([80.0, FOCAL[1]], CENTER));
    assert_eq!((train.views[7].time, train.views[0].time), (0.25, 0.5), "the times, not the numbers of the frames");
    assert_eq!(train.points, Some(folder.path().join("points.ply")), "the file of points");
    refused_split(&folder);
}

#[track_caller]
fn refused_split(folder: &Folder) {
    let error = Dataset::open(folder.path(), Split::Val, &CameraOptions::default()).expect_err("no such split");
    assert!(error.to_string().contains("Val"), "the split is named: {error}");
}

#[test]
fn without_times_the_first_frame_number_is_time_0() {
    let folder = Folder::new();
    let mut json = nerfstudio(4);
    for index in 0..4 {
        json["frames"][index]["frame_number"] = json!(1000 + 3 * index);
        json["frames"][index]["split"] = json!("train");
    }
    folder.write_json("transforms.json", &json);
    let times: Vec<f32> = open(&folder, Split::Train).views.iter().map(|view| view.time).collect();
    assert_eq!(times, [0.0, 0.1, 0.2, 0.3], "thirty frames a second");
}

#[test]
fn masks_in_a_folder_are_found_beside_blender_images() {
    let folder = Folder::new();
    let frame =
        |index| json!({ "file_path": format!("./train/f{index}"), "transform_matrix": Rig::new(index).to_world() });
    let json = json!({ "camera_angle_x": 0.8, "frames": [frame(0), frame(1)] });
    folder.write_json("transforms_train.json", &json);
    for name in ["train/f0.png", "train/f1.png"] {
        picture(&folder, name, [200, 100, 50]);
    }
    std::fs::create_dir_all(folder.path().join("masks/train")).expect("the folder can be made");
    let mask = GrayImage::from_fn(WIDTH, HEIGHT, |x, _| Luma([if x < WIDTH / 2 { 255 } else { 0 }]));
    mask.save(folder.path().join("masks/train/f0.png")).expect("a mask");
    let views = open(&folder, Split::Train).views;
    let image = views[0].load_covered().expect("the image and its mask");
    assert_eq!((image.texels[0], image.texels[WIDTH as usize - 1]), ([200, 100, 50, 255], [0; 4]), "masked");
    assert!(!views[1].load_covered().expect("the image").has_gaps, "an image without a mask");
}

#[test]
fn splits_in_a_nerfstudio_file_are_kept() {
    let folder = Folder::new();
    let mut json = nerfstudio(4);
    json["train_filenames"] = json!(["./images/f03.png", "images/f01.png"]);
    json["test_filenames"] = json!(["images/f00.png"]);
    json["val_filenames"] = json!(["images/f02.png"]);
    folder.write_json("transforms.json", &json);
    assert_eq!(names(&open(&folder, Split::Train).views), ["f01", "f03"], "the list of training views");
    assert_eq!(names(&open(&folder, Split::Test).views), ["f00"], "the list of test views");
    assert_eq!(names(&open(&folder, Split::Val).views), ["f02"], "the list of validation views");
    let mut json = nerfstudio(4);
    for (frame, split) in
        json["frames"].as_array_mut().expect("frames").iter_mut().zip(["test", "train", "train", "val"])
    {
        frame["split"] = json!(split);
    }
    folder.write_json("transforms.json", &json);
    assert_eq!(names(&open(&folder, Split::Train).views), ["f01", "f02"], "the entries of the frames");
}

#[test]
fn masks_of_a_folder_multiply_the_image() {
    let folder = Folder::new();
    folder.write_json("transforms.json", &nerfstudio(3));
    picture(&folder, "images/f01.png", [200, 100, 50]);
    std::fs::create_dir(folder.path().join("masks")).expect("the folder can be made");
    let mask = GrayImage::from_fn(WIDTH, HEIGHT, |x, _| Luma([if x < WIDTH / 2 { 255 } else { 0 }]));
    mask.save(folder.path().join("masks/f01.png")).expect("a mask");
    let train = open(&folder, Split::Train);
    let image = train.views[0].load_covered().expect("the image and its mask");
    assert_eq!(image.texels[0], [200, 100, 50, 255], "a pixel inside the mask");
    assert_eq!(image.texels[WIDTH as usize - 1], [0, 0, 0, 0], "a pixel outside the mask");
    assert_eq!(train.views[1].mask, None, "a view without a mask");
}

#[test]
fn images_of_16_bits_are_read() {
    let folder = Folder::new();
    folder.write_json("transforms.json", &nerfstudio(3));
    std::fs::create_dir(folder.path().join("images")).expect("the folder can be made");
    let deep = image::ImageBuffer::<Rgba<u16>, _>::from_pixel(WIDTH, HEIGHT, Rgba([65535, 257 * 100, 0, 65535]));
    deep.save(folder.path().join("images/f01.png")).expect("an image of 16 bits");
    let image = open(&folder, Split::Train).views[0].load_covered().expect("an image of 16 bits");
    assert_eq!(image.texels[0], [255, 100, 0, 255], "16 bits are rounded to 8");
    let clear = RgbaImage::from_pixel(WIDTH, HEIGHT, Rgba([200, 100, 50, 0]));
    clear.save(folder.path().join("images/f02.png")).expect("an image");
    let image = open(&folder, Split::Train).views[1].load_covered().expect("an image with alpha");
    assert_eq!(image.texels[0], [0; 4], "alpha is coverage");
}

#[test]
fn distortion_is_undone_when_an_image_is_loaded() {
    let folder = Folder::new();
    let mut json = nerfstudio(3);
    json["k1"] = json!(-0.2);
    json["p1"] = json!(0.004);
    folder.write_json("transforms.json", &json);
    std::fs::create_dir(folder.path().join("images")).expect("the folder can be made");
    // A ramp: the value of a distorted pixel is its column, times 6.
    let ramp = RgbImage::from_fn(WIDTH, HEIGHT, |x, _| Rgb([(6 * x) as u8, 0, 0]));
    ramp.save(folder.path().join("images/f01.png")).expect("an image");
    let view = &open(&folder, Split::Train).views[0];
    assert_pixel(view, Rig::new(1).pixel(FOCAL, CENTER));
    let image = view.load_covered().expect("the image");
    for (column, row) in [(0u32, 0u32), (39, 0), (5, 20), (19, 16), (33, 27)] {
        let x = (f64::from(column) + 0.5 - CENTER[0]) / FOCAL[0];
        let y = (f64::from(row) + 0.5 - CENTER[1]) / FOCAL[1];
        let r2 = x * x + y * y;
        let source = FOCAL[0] * (x * (1.0 - 0.2 * r2) + 2.0 * 0.004 * x * y) + CENTER[0] - 0.5;
        let found = f64::from(image.texels[(row * WIDTH + column) as usize][0]);
        assert!((found - 6.0 * source).abs() <= 1.01, "pixel {column} {row} comes from column {source}: {found}");
    }
    assert!(!image.has_gaps, "every pixel has a source");
}

/// Writes a COLMAP model as text. Each image has its name, its camera in the rig, and the number of its lens.
pub(super) fn colmap_text(folder: &Folder, model: &str, images: &[(&str, usize)]) {
    folder.write("sparse/0/cameras.txt", format!("# cameras\n7 {model}\n"));
    let mut text = "# images\n".to_owned();
    for (index, (name, camera)) in images.iter().enumerate() {
        let ([w, x, y, z], [tx, ty, tz]) = Rig::new(*camera).to_camera();
        text += &format!("{} {w} {x} {y} {z} {tx} {ty} {tz} 7 {name}\n1.5 2.5 -1 3.5 4.5 12\n", index + 1);
    }
    folder.write("sparse/0/images.txt", text);
}

pub(super) const PINHOLE: &str = "PINHOLE 40 30 50 52 19 16";

/// Writes the same as binary files.
pub(super) fn colmap_binary(folder: &Folder, images: &[(&str, usize)]) {
    let mut cameras = 1u64.to_le_bytes().to_vec();
    cameras.extend(7u32.to_le_bytes());
    cameras.extend(1i32.to_le_bytes());
    cameras.extend([u64::from(WIDTH), u64::from(HEIGHT)].iter().flat_map(|side| side.to_le_bytes()));
    cameras.extend([FOCAL[0], FOCAL[1], CENTER[0], CENTER[1]].iter().flat_map(|value| value.to_le_bytes()));
    folder.write("sparse/0/cameras.bin", cameras);
    let mut bytes = (images.len() as u64).to_le_bytes().to_vec();
    for (index, (name, camera)) in images.iter().enumerate() {
        let (rotation, translation) = Rig::new(*camera).to_camera();
        bytes.extend((index as u32 + 1).to_le_bytes());
        bytes.extend(rotation.iter().chain(&translation).flat_map(|value| value.to_le_bytes()));
        bytes.extend(7u32.to_le_bytes());
        bytes.extend(name.bytes().chain([0]));
        bytes.extend(2u64.to_le_bytes());
        bytes.extend([0; 48]);
    }
    folder.write("sparse/0/images.bin", bytes);
    folder.write("sparse/0/points3D.bin", 0u64.to_le_bytes());
}

#[test]
fn colmap_models_project_points_as_their_cameras_do() {
    let files: Vec<String> = (0..9).map(|index| format!("view {index}.jpg")).collect();
    let images: Vec<(&str, usize)> = files.iter().map(String::as_str).zip(0..).collect();
    let (text, binary) = (Folder::new(), Folder::new());
    colmap_text(&text, PINHOLE, &images);
    colmap_binary(&binary, &images);
    for folder in [&text, &binary] {
        let (train, test) = (open(folder, Split::Train), open(folder, Split::Test));
        assert_eq!(names(&test.views), ["view 0", "view 8"], "every eighth camera is for the test");
        assert_eq!(train.views.len(), 7, "the other cameras are trained on");
        for (view, index) in train.views.iter().zip(1..) {
            assert_pixel(view, Rig::new(index).pixel(FOCAL, CENTER));
            assert_eq!((view.time, view.original), (0.0, UVec2::new(WIDTH, HEIGHT)), "a static scene");
        }
    }
    assert_eq!(open(&binary, Split::Train).points, Some(binary.path().join("sparse/0/points3D.bin")), "points");
}

/// Returns a PLY file of two points, of which the second has no finite place, with these encodings and bytes.
fn points_ply(encoding: &str, color: &str, rows: &[u8]) -> Vec<u8> {
    let colors = ["red", "green", "blue"].map(|name| format!("property {color} {name}\n")).concat();
    let header = format!(
        "ply\nformat {encoding} 1.0\nelement vertex 2\nproperty float x\nproperty double y\nproperty float z\n\
         {colors}property float time\nend_header\n"
    );
    [header.as_bytes(), rows].concat()
}

#[test]
fn files_of_points_have_places_colors_and_times() {
    let folder = Folder::new();
    let row = |x: f32, time: f32| {
        let place = [&x.to_le_bytes()[..], &(-1.5f64).to_le_bytes(), &0.25f32.to_le_bytes()].concat();
        [&place[..], &[51, 102, 255], &time.to_le_bytes()].concat()
    };
    let mut track = 9u64.to_le_bytes().to_vec();
    track.extend([2.0, -1.5, 0.25].into_iter().flat_map(f64::to_le_bytes));
    track.extend([51, 102, 255]);
    track.extend(0.5f64.to_le_bytes());
    track.extend(3u64.to_le_bytes());
    let whole = [&1u64.to_le_bytes()[..], &track, &[7; 24]].concat();
    let files = [
        (
            "a.ply",
            points_ply("binary_little_endian", "uchar", &[row(2.0, 0.75), row(f32::NAN, 0.75)].concat()),
            Some(0.75),
        ),
        ("b.ply", points_ply("ascii", "float", b"2 -1.5 0.25 0.2 0.4 1 0.75\ninf -1.5 0.25 0 0 0 1\n"), Some(0.75)),
        ("points3D.bin", whole.clone(), None),
        ("points3D.txt", b"# a comment\n9 2 -1.5 0.25 51 102 255 0.5 1 0 2 7\n".to_vec(), None),
    ];
    for (name, bytes, time) in files {
        folder.write(name, bytes);
        let PointCloud(points) = PointCloud::load(&folder.path().join(name), &Origin::default()).expect(name);
        let expected = CloudPoint {
            position: Vec3::new(2.0, -1.5, 0.25),
            color: Some(Vec3::new(0.2, 0.4, 1.0)),
            time,
            velocity: Vec3::ZERO,
        };
        assert_eq!(points, [expected], "{name}: one finite point");
    }
    let refused = [
        ("cut.bin", whole[..whole.len() - 1].to_vec(), "cut off"),
        ("many.bin", u64::MAX.to_le_bytes().to_vec(), "cut off"),
        ("words.txt", b"9 2 -1.5 0.25 51 102 256 0.5\n".to_vec(), "line 1: must be ID X Y Z R G B"),
        ("cut.ply", points_ply("binary_little_endian", "uchar", &row(2.0, 0.75)), "the file is cut"),
        ("faces.ply", b"ply\nformat ascii 1.0\nelement face 0\nend_header\n".to_vec(), "no element vertex"),
        (
            "flat.ply",
            b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n1\n".to_vec(),
            "no property y",
        ),
        ("points.obj", b"v 1 2 3\n".to_vec(), "it is no file of points"),
    ];
    for (name, bytes, reason) in refused {
        folder.write(name, bytes);
        let error = PointCloud::load(&folder.path().join(name), &Origin::default()).expect_err(name).to_string();
        assert!(error.contains(name) && error.contains(reason), "{name}, {reason}: {error}");
    }
}

#[test]
fn frames_of_colmap_cameras_have_times() {
    let folder = Folder::new();
    // The model has the first frame of each camera, or an image by the name of the camera.
    colmap_text(&folder, PINHOLE, &[("cam0/005.png", 0), ("cam1.png", 1), ("cam2/005.png", 2)]);
    for camera in 0..3 {
        for frame in [5, 6, 20] {
            picture(&folder, &format!("images/cam{camera}/{frame:03}.png"), [1, 2, 3]);
        }
    }
    let (train, test) = (open(&folder, Split::Train), open(&folder, Split::Test));
    assert_eq!(names(&test.views), ["cam0_005", "cam0_006", "cam0_020"], "the frames of the first camera");
    assert_eq!(train.views.len(), 6, "the frames of two cameras");
    assert_eq!(train.views[2].time, 0.5, "frame 20 is 15 frames after the first frame");
    assert_pixel(&train.views[5], Rig::new(2).pixel(FOCAL, CENTER));
    train.require_images().expect("every frame is on disk");
}

#[test]
fn colmap_models_that_cannot_be_used_are_refused_by_name() {
    let folder = Folder::new();
    let images = [("a.png", 0), ("b.png", 1)];
    for (model, part) in [
        ("FOV 40 30 50 52 19 16 0.5", "FOV"),
        ("THIN_PRISM_FISHEYE 40 30 50 52 19 16 0 0 0 0 0 0 0 0", "THIN_PRISM_FISHEYE"),
        ("NEW 40 30 50", "NEW"),
        ("PINHOLE 40 30 50 52 19", "parameters"),
        ("PINHOLE 0 30 50 52 19 16", "0x30"),
        ("PINHOLE 40 30 -50 52 19 16", "focal"),
        ("SIMPLE_RADIAL 40 30 50 19 16 -30", "folds"),
    ] {
        colmap_text(&folder, model, &images);
        refused(&folder, part);
    }
    for model in [
        "SIMPLE_PINHOLE 40 30 50 19 16",
        "SIMPLE_RADIAL 40 30 50 19 16 0.01",
        "RADIAL 40 30 50 19 16 0.01 0.02",
        "OPENCV 40 30 50 52 19 16 0.01 0 0 0.001",
        "OPENCV_FISHEYE 40 30 50 52 19 16 0.01 0 0 0",
        "FULL_OPENCV 40 30 50 52 19 16 0.01 0 0 0 0 0.01 0 0",
        "SIMPLE_RADIAL_FISHEYE 40 30 50 19 16 0.01",
        "RADIAL_FISHEYE 40 30 50 19 16 0.01 0",
    ] {
        colmap_text(&folder, model, &images);
        assert_eq!(open(&folder, Split::Train).views.len(), 1, "{model} can be undone");
    }
    colmap_text(&folder, PINHOLE, &[("a.png", 0)]);
    refused(&folder, "one view");
    colmap_text(&folder, PINHOLE, &[("./a1.png", 0), ("./b2.png", 1)]);
    assert_eq!(open(&folder, Split::Train).views[0].time, 0.0, "images of one folder are not frames of a camera");
    colmap_text(&folder, PINHOLE, &[("../a.png", 0), ("b.png", 1)]);
    refused(&folder, "../a.png");
    let binary = Folder::new();
    colmap_binary(&binary, &images);
    let whole = std::fs::read(binary.path().join("sparse/0/images.bin")).expect("just written");
    for length in 0..whole.len() {
        binary.write("sparse/0/images.bin", &whole[..length]);
        refused(&binary, "images.bin");
    }
}

/// Writes `poses_bounds.npy` with a row for each camera of the rig.
pub(super) fn n3v(folder: &Folder, cameras: usize) {
    let header = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': ({cameras}, 17), }}\n");
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.bytes());
    bytes.extend((0..cameras).flat_map(|index| Rig::new(index).row(FOCAL[0])).flat_map(f64::to_le_bytes));
    folder.write("poses_bounds.npy", bytes);
}

#[test]
fn n3v_projects_points_as_its_cameras_do() {
    let folder = Folder::new();
    n3v(&folder, 3);
    // Numbers may be missing, and frames may lie in three places.
    for place in ["cam00", "frames/cam02", "cam05/images"] {
        for frame in 0..3 {
            picture(&folder, &format!("{place}/{frame:04}.png"), [9, 9, 9]);
        }
    }
    let (train, test) = (open(&folder, Split::Train), open(&folder, Split::Test));
    assert_eq!(names(&test.views), ["cam00_0000", "cam00_0001", "cam00_0002"], "the first camera is for the test");
    assert_eq!(train.views.len(), 6, "two cameras of three frames");
    let center = [f64::from(WIDTH) / 2.0, f64::from(HEIGHT) / 2.0];
    for (view, index) in train.views.iter().zip([1, 1, 1, 2, 2, 2]) {
        assert_pixel(view, Rig::new(index).pixel([FOCAL[0]; 2], center));
    }
    assert_eq!(train.views[2].time, 2.0 / 30.0, "30 frames a second");
    train.require_images().expect("every frame is on disk");
}

#[test]
fn n3v_folders_need_a_camera_for_each_row() {
    let folder = Folder::new();
    n3v(&folder, 3);
    picture(&folder, "cam00/0000.png", [9, 9, 9]);
    refused(&folder, "3 cameras, and 1 videos");
    folder.write("poses_bounds.npy", b"\x93NUMPY");
    refused(&folder, "poses_bounds.npy");
}

#[test]
fn cameras_at_one_place_are_refused() {
    let folder = Folder::new();
    let mut json = nerfstudio(3);
    for frame in json["frames"].as_array_mut().expect("frames") {
        for row in 0..3 {
            frame["transform_matrix"][row][3] = json!(row);
        }
    }
    folder.write_json("transforms.json", &json);
    refused(&folder, "all 3 views are taken from the same place");
    for frame in json["frames"].as_array_mut().expect("frames") {
        frame["transform_matrix"] = Rig::new(0).to_world();
    }
    folder.write_json("transforms.json", &json);
    refused(&folder, "all 3 views are taken from the same place");
    for index in 0..3 {
        json["frames"][index]["time"] = json!(if index == 1 { 0.5 } else { 0.0 });
    }
    folder.write_json("transforms.json", &json);
    assert_eq!(open(&folder, Split::Train).views.len(), 2, "a camera that stands still may have several times");
    folder.write_json("transforms.json", &nerfstudio(1));
    refused(&folder, "one view");
}

#[test]
fn paths_with_control_characters_are_refused() {
    let folder = Folder::new();
    for (pointer, part) in
        [("/ply_file_path", "ply_file_path has control characters"), ("/frames/1/mask_path", "frame 1")]
    {
        folder.write_json("transforms.json", &with(nerfstudio(3), pointer, json!("a\u{1b}[2J.png")));
        refused(&folder, part);
    }
}

#[test]
fn frames_may_have_their_own_sizes_and_images_must_match_them() {
    let folder = Folder::new();
    let mut json = nerfstudio(3);
    json["frames"][2]["w"] = json!(2 * WIDTH);
    json["frames"][2]["fl_x"] = json!(2.0 * FOCAL[0]);
    folder.write_json("transforms.json", &json);
    for name in ["f01", "f02"] {
        picture(&folder, &format!("images/{name}.png"), [9, 9, 9]);
    }
    let views = open(&folder, Split::Train).views;
    assert_eq!(views[1].camera.size, UVec2::new(2 * WIDTH, HEIGHT), "the size of the frame");
    assert!(views[0].load_covered().is_ok(), "an image of the size of the file");
    let error = views[1].load_covered().expect_err("an image of another aspect ratio").to_string();
    for part in ["f02.png: 40 x 30 pixels", "80 x 30"] {
        assert!(error.contains(part), "{part:?} is not in: {error}");
    }
}
