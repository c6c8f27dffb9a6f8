//! PLY and `.splat` files of other makes.
//!
//! In: the folder `formats` of the data that `GS4D_DATA` names. Out: proof that each file has the values that an
//! independent reader finds; and, of a file that the test makes, that a sphere is drawn round.

use crate::support::other_makes::{assert_near, fixture, opacity};
use bevy_gs4d::codec::{ReadOptions, load};
use bevy_gs4d::gaussian::{Gaussian, Harmonics};
use bevy_gs4d::reference;
use bevy_gs4d::scene::{Form, GaussianScene, RuntimeScene, SceneForm};
use bevy_gs4d::view::{Camera, Lens, Picture, RasterFov};
use glam::{UVec2, Vec2, Vec3};
use std::fs;

/// The factor of the coefficient of degree 0.
const SH_C0: f32 = 0.282_094_8;

/// Returns the scene of a file of `count` Gaussians; without the file, reports the skipped test and returns `None`.
fn open(name: &str, count: usize) -> Option<GaussianScene> {
    let scene = load(&fixture(name)?, &ReadOptions::default()).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(scene.len(), count, "{name}: number of Gaussians");
    Some(scene)
}

/// Raw values of a static scene: means, logarithms of scales, unit quaternions, opacities and colors.
struct Still {
    mean: Vec<[f32; 3]>,
    log_scale: Vec<[f32; 3]>,
    rotation: Vec<[f32; 4]>,
    opacity: Vec<f32>,
    harmonics: Harmonics,
}

fn still(scene: GaussianScene) -> Still {
    let SceneForm::Trained(trained) = scene.form else { panic!("Gaussians at rest have the trained form") };
    let parameters = trained.parameters;
    let unit = |q: &[f32; 4]| {
        let length = q.iter().map(|c| c * c).sum::<f32>().sqrt();
        q.map(|c| c / length)
    };
    Still {
        rotation: parameters.rotation_l.iter().map(unit).collect(),
        opacity: parameters.opacity_logit.iter().map(|&logit| opacity(logit)).collect(),
        mean: parameters.mean,
        log_scale: parameters.log_scale,
        harmonics: trained.harmonics,
    }
}

fn moving(scene: GaussianScene) -> (Vec<Gaussian>, Harmonics) {
    let RuntimeScene { form: Form::Sliced(sliced), .. } = scene.into_runtime().expect("it can be drawn") else {
        panic!("the sliced form")
    };
    (sliced.gaussians, sliced.harmonics)
}

fn extremes(means: &[[f32; 3]]) -> [[f32; 3]; 2] {
    let extreme = |fold: fn(f32, f32) -> f32| {
        [0, 1, 2].map(|axis| means.iter().map(|mean| mean[axis]).reduce(fold).expect("a Gaussian"))
    };
    [extreme(f32::min), extreme(f32::max)]
}

#[test]
fn ply_of_other_makes_has_the_values_of_an_independent_reader() {
    let Some(cloud) = open("splat-transform/cloud_sh3.ply", 200).map(still) else { return };
    assert_near("mean", cloud.mean[0], [0.04103, 1.0878, 1.22472], 6e-6);
    assert_near("scales", cloud.log_scale[0], [-6.43256, -2.90821, -4.00843], 6e-6);
    assert_near("opacity", [cloud.opacity[0]], [0.69058], 6e-6);
    assert_eq!(cloud.harmonics.degree, 3, "degree 3");
    assert_near("color", cloud.harmonics.of(0)[..3].try_into().expect("three"), [0.15781, 0.06362, 1.04565], 6e-6);
    let rest = cloud.harmonics.of(0)[3..6].try_into().expect("three");
    assert_near("the first coefficient of degree 1", rest, [-0.00906, 0.28329, -0.00665], 6e-6);

    let Some(packed) = open("splat-transform/cloud_sh3.compressed.ply", 200).map(still) else { return };
    assert_eq!(packed.harmonics.degree, 3, "degree 3");
    for (index, mean) in packed.mean.iter().enumerate() {
        let distance = |other: &[f32; 3]| other.iter().zip(mean).map(|(a, b)| (a - b).powi(2)).sum::<f32>();
        let of = (0..200).min_by(|&a, &b| distance(&cloud.mean[a]).total_cmp(&distance(&cloud.mean[b]))).expect("one");
        assert_near("the mean of a Gaussian of the source", *mean, cloud.mean[of], 0.002);
        assert_near("its opacity", [packed.opacity[index]], [cloud.opacity[of]], 0.003);
        let expected = &cloud.harmonics.of(of)[3..];
        for (found, expected) in packed.harmonics.of(index)[3..].iter().zip(expected) {
            assert!((found - expected).abs() <= 1.0 / 60.0, "coefficient {found} of {index} is {expected}");
        }
        let turn: f32 = packed.rotation[index].iter().zip(cloud.rotation[of]).map(|(a, b)| a * b).sum();
        assert!(turn.abs() > 0.99999, "the rotation of {index}");
    }
}

#[test]
fn compressed_ply_of_playcanvas_has_the_values_of_an_independent_reader() {
    let Some(small) = open("playcanvas/test64.compressed.ply", 64).map(still) else { return };
    assert_near("least means", extremes(&small.mean)[0], [-1.39469, -0.89565, 0.29708], 6e-6);
    assert_near("rotation", small.rotation[0], [0.9347, -0.16935, -0.27026, 0.1569], 6e-6);
    assert_near("opacity", [small.opacity[0]], [48.0 / 255.0], 1e-6);
    let rest = small.harmonics.of(0)[3..6].try_into().expect("three");
    assert_near("the first coefficient of degree 1", rest, [0.04688, 0.04688, 0.01562], 6e-6);

    let Some(biker) = open("playcanvas/biker.compressed.ply", 152_746).map(still) else { return };
    let [least, most] = extremes(&biker.mean);
    assert_near("least means", least, [-0.62134, -3.18018, -0.53223], 2e-4);
    assert_near("largest means", most, [0.41431, 0.0, 0.61328], 2e-4);
    assert_near("the first mean", biker.mean[0], [-0.10449, -2.38794, -0.36084], 1.4e-4);
    assert_near("its scales", biker.log_scale[0], [-6.0625, -4.1875, -7.0625], 0.035);
    assert_near("its opacity", [biker.opacity[0]], [18.0 / 255.0], 1e-6);
    assert_near("its color", biker.harmonics.of(0)[..3].try_into().expect("three"), [0.53595, 0.5098, 0.56209], 0.014);
    let turn: f32 = biker.rotation[0].iter().zip([-0.4608, -0.06227, -0.88504, 0.02214]).map(|(a, b)| a * b).sum();
    // The file beside it has the rotation after a half turn around x: (w, x, -y, -z).
    let half: f32 = biker.rotation[0].iter().zip([-0.4608, 0.06227, -0.88504, -0.02214]).map(|(a, b)| a * b).sum();
    assert!(turn.abs().max(half.abs()) > 0.9999, "its rotation: {:?}", biker.rotation[0]);
    let mean = biker.opacity.iter().map(|&opacity| f64::from(opacity)).sum::<f64>() / 152_746.0;
    assert!((mean - 0.29663).abs() < 6e-6, "the mean opacity: {mean}");
}

#[test]
fn splat_files_have_the_values_of_an_independent_reader() {
    let Some(grid) = open("splat-transform/minimal.splat", 4).map(still) else { return };
    assert_eq!(extremes(&grid.mean), [[-1.0, 0.0, -1.0], [0.0, 0.0, 0.0]], "the corners of the grid");
    for index in 0..4 {
        assert_near("scales", grid.log_scale[index], [0.1f32.ln(); 3], 1e-6);
        assert_near("rotation", grid.rotation[index].map(f32::abs), [0.0, 0.0, 0.0, 1.0], 1e-6);
        assert_near("opacity", [grid.opacity[index]], [230.0 / 255.0], 1e-6);
        let color = grid.harmonics.of(index);
        assert_near("red and green", [color[0].abs(), color[1].abs()], [0.59082; 2], 6e-6);
        assert!((0.0..=1.0).contains(&(0.5 + SH_C0 * color[2])), "blue is a color");
    }
}

#[test]
fn moving_ply_has_the_values_of_an_independent_reader() {
    let nearest = |gaussians: &[Gaussian], mean: [f32; 3]| {
        let distance = |g: &Gaussian| g.mean.iter().zip(mean).map(|(a, b)| (a - b).powi(2)).sum::<f32>();
        *gaussians.iter().min_by(|a, b| distance(a).total_cmp(&distance(b))).expect("a Gaussian")
    };
    let Some(scene) = open("sogst/fountain_d1_sh2_seg.ply", 400) else { return };
    assert_eq!(scene.trained_with.time_interval, [0.5, 2.5], "the times of the clip");
    assert_eq!(scene.playback.duration_seconds, 2.0, "its length");
    let (gaussians, harmonics) = moving(scene);
    assert_eq!(harmonics.degree, 2, "degree 2");
    let expected = [-1.61803, 0.67541, 1.28334];
    let found = nearest(&gaussians, expected);
    assert_near("mean", found.mean, expected, 0.0024);
    assert_near("velocity", found.velocity, [-1.01329, -2.49677, -1.11242], 8e-5);
    assert_near("temporal mean", [found.mean_t], [1.23505], 0.0023);
    assert_near("temporal deviation", [found.sigma_t / 0.01359], [1.0], 0.005);
    assert_near("opacity", [found.opacity], [123.0 / 255.0], 0.003);

    let Some(scene) = open("sog4d/swarm.ply", 600) else { return };
    assert_eq!(scene.trained_with.time_interval, [1.0, 3.0], "start and duration");
    let (gaussians, _) = moving(scene);
    let expected = [-0.21281, -1.32168, -1.53185];
    let found = nearest(&gaussians, expected);
    assert_near("mean", found.mean, expected, 0.003);
    assert_near("velocity", found.velocity, [0.5937, 0.93339, 0.46199], 5e-4);
    assert_near("temporal mean", [found.mean_t], [2.66], 0.01);
    assert_near("temporal deviation", [found.sigma_t / 0.1648], [1.0], 0.02);
}

/// Returns the standard deviations of a picture across and down, pixels.
fn deviations(picture: &Picture) -> [f64; 2] {
    let UVec2 { x: width, y: height } = picture.size;
    let weighted = |value: &dyn Fn(f64, f64) -> f64| -> f64 {
        let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        pixels.map(|(x, y)| f64::from(picture.pixel(x, y).y) * value(f64::from(x), f64::from(y))).sum()
    };
    let sum = weighted(&|_, _| 1.0);
    let (x, y) = (weighted(&|x, _| x) / sum, weighted(&|_, y| y) / sum);
    [weighted(&|at, _| (at - x).powi(2)), weighted(&|_, at| (at - y).powi(2))].map(|square| (square / sum).sqrt())
}

#[test]
fn a_sphere_is_round_for_cameras_with_intrinsics() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let names = "x y z f_dc_0 f_dc_1 f_dc_2 opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3";
    let properties: String = names.split(' ').map(|name| format!("property float {name}\n")).collect();
    let scale = 0.12_f32.ln();
    let row = format!("0 0 0 1.7724539 1.7724539 1.7724539 0 {scale} {scale} {scale} 1 0 0 0");
    let path = folder.path().join("sphere.ply");
    let text = format!("ply\nformat ascii 1.0\nelement vertex 1\n{properties}end_header\n{row}\n");
    fs::write(&path, text).expect("the folder can be written to");

    let drawn = |options: &ReadOptions, center: Vec2| {
        let scene = load(&path, options).expect("a PLY of one Gaussian").into_runtime().expect("it can be drawn");
        let size = UVec2::new(96, 64);
        let lens = Lens::Intrinsics { focal: Vec2::splat(100.0), center };
        let camera = Camera { lens, ..Camera::look_at(Vec3::new(0.0, -3.0, 0.0), Vec3::ZERO, Vec3::Z, 1.0, size) };
        let view = camera.view(0.0, scene.trained_with.raster_fov);
        deviations(&reference::render(&scene, &view, scene.trained_background()).picture)
    };
    for center in [Vec2::new(48.0, 32.0), Vec2::new(30.0, 41.0)] {
        let found = drawn(&ReadOptions::default(), center);
        // 100 · 0.12 / 3 pixels plus the low-pass, without the parts whose alpha is below 1/255.
        let is_round = found.iter().all(|deviation| (deviation - 3.95).abs() < 0.03);
        assert!(is_round, "principal point at {center}: {found:?} pixels");
    }
    let placeholder = ReadOptions { raster_fov: Some(RasterFov::Reference), ..ReadOptions::default() };
    let [across, down] = drawn(&placeholder, Vec2::new(48.0, 32.0));
    assert!(across > 1.3 * down, "the placeholder of the original trainer is an option: {across} x {down}");
}
