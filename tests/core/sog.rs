//! The SOG family: files of other makes.
//!
//! In: the files of `formats/` in the folder of `GS4D_DATA`. Out: proof that each file has the values that another
//! decoder finds.

use crate::support::other_makes::{fixture, opacity};
use crate::support::trained::trained;
use bevy_gs4d::codec::{self, ReadOptions};
use bevy_gs4d::gaussian::{Gaussian, Harmonics};
use bevy_gs4d::scene::{ActiveSets, FilterKind, Form, GaussianScene, SceneForm, Trained, UpAxis};
use glam::{Mat3, Quat, Vec3};

/// Returns the scene of a file; without the file, reports the skipped test and returns `None`.
fn load(name: &str) -> Option<GaussianScene> {
    Some(codec::load(&fixture(name)?, &ReadOptions::default()).unwrap_or_else(|error| panic!("{error}")))
}

fn moving(scene: &GaussianScene) -> (&[Gaussian], &Harmonics) {
    match &scene.form {
        SceneForm::Ready(Form::Sliced(sliced)) => (&sliced.gaussians, &sliced.harmonics),
        form => panic!("moving Gaussians are sliced: {form:?}"),
    }
}

/// Checks that numbers agree to half a unit of the last of five digits, and to rounding in single precision.
fn check(what: &str, found: &[f32], expected: &[f32]) {
    assert_eq!(found.len(), expected.len(), "{what}");
    for (found, expected) in found.iter().zip(expected) {
        assert!((found - expected).abs() <= 6e-6 + expected.abs() * 2e-6, "{what}: {found} is {expected}");
    }
}

/// One Gaussian as the other decoder finds it: mean, logarithms of scales, quaternion w x y z, opacity, coefficients of
/// degree 0, and the first of degree 1.
struct Expected {
    mean: [f32; 3],
    log_scale: [f32; 3],
    rotation: [f32; 4],
    opacity: f32,
    color: [f32; 3],
    rest: Option<[f32; 3]>,
}

fn check_at_rest(scene: &GaussianScene, index: usize, expected: &Expected) {
    let Trained { parameters, harmonics } = trained(scene);
    check("mean", &parameters.mean[index], &expected.mean);
    check("scales", &parameters.log_scale[index], &expected.log_scale);
    let found = parameters.rotation_l[index];
    let sign = if found[0] * expected.rotation[0] < 0.0 { -1.0 } else { 1.0 };
    check("rotation", &found.map(|component| component * sign), &expected.rotation);
    check("opacity", &[opacity(parameters.opacity_logit[index])], &[expected.opacity]);
    check("color", &harmonics.of(index)[..3], &expected.color);
    if let Some(rest) = &expected.rest {
        check("degree 1", &harmonics.of(index)[3..6], rest);
    }
}

/// Returns the Gaussian at a mean, with its index.
fn nearest(gaussians: &[Gaussian], mean: [f32; 3]) -> (usize, &Gaussian) {
    let distance = |gaussian: &Gaussian| Vec3::from(gaussian.mean).distance(Vec3::from(mean));
    let found = gaussians.iter().enumerate().min_by(|a, b| distance(a.1).total_cmp(&distance(b.1)));
    found.expect("has Gaussians")
}

fn check_moving(scene: &GaussianScene, expected: &Expected, velocity: [f32; 3], lifespan: [f32; 2]) {
    let (gaussians, harmonics) = moving(scene);
    let (index, found) = nearest(gaussians, expected.mean);
    check("mean", &found.mean, &expected.mean);
    check("velocity", &found.velocity, &velocity);
    check("lifespan", &[found.mean_t, found.sigma_t], &lifespan);
    check("opacity", &[found.opacity], &[expected.opacity]);
    check("color", &harmonics.of(index)[..3], &expected.color);
    if let Some(rest) = &expected.rest {
        check("degree 1", &harmonics.of(index)[3..6], rest);
    }
    let [w, x, y, z] = expected.rotation;
    let axes = Mat3::from_quat(Quat::from_xyzw(x, y, z, w).normalize());
    let variances = expected.log_scale.map(|scale| (2.0 * scale).exp());
    let covariance = axes * Mat3::from_diagonal(variances.into()) * axes.transpose();
    let [xx, xy, xz, yy, yz, zz] = found.covariance;
    let own = Mat3::from_cols_array(&[xx, xy, xz, xy, yy, yz, xz, yz, zz]);
    let largest = variances.into_iter().fold(0.0, f32::max);
    assert!(own.abs_diff_eq(covariance, largest * 1e-4), "covariance {own} is {covariance}");
}

#[test]
fn a_sog_of_splat_transform_has_the_values_that_another_decoder_finds() {
    let Some(scene) = load("splat-transform/cloud_sh3.sog") else { return };
    assert_eq!((scene.len(), scene.playback.up), (200, UpAxis::NegY), "all Gaussians, as trained");
    assert_eq!(scene.playback.duration_seconds, 0.0, "a still");
    let first = Expected {
        mean: [0.39335, -1.71067, -1.45],
        log_scale: [-3.08785, -4.41625, -4.21931],
        rotation: [-0.45199, -0.00277, -0.61283, 0.64818],
        opacity: 0.60392,
        color: [0.22894, 0.06753, -0.03773],
        rest: Some([0.02016, 0.0821, 0.04079]),
    };
    check_at_rest(&scene, 0, &first);
    let last = Expected {
        mean: [0.90794, 1.46509, 2.12935],
        log_scale: [-3.17972, -3.27378, -4.34808],
        rotation: [0.80791, 0.42426, 0.20797, -0.35217],
        opacity: 0.83529,
        color: [1.70874, 0.47525, 0.92987],
        rest: Some([-0.05498, 0.07198, 0.19099]),
    };
    check_at_rest(&scene, 199, &last);
    assert_eq!(trained(&scene).harmonics.degree, 3, "all coefficients");
}

#[test]
fn an_unbundled_sog_is_read_from_the_files_beside_its_meta_json() {
    let Some(scene) = load("playcanvas/playbot/6_0/meta.json") else { return };
    assert_eq!((scene.len(), trained(&scene).harmonics.degree), (1873, 2), "all Gaussians");
    let first = Expected {
        mean: [-1.0038, -0.021, -1.00188],
        log_scale: [-7.58423, -4.58216, -4.25363],
        rotation: [0.63501, 0.16915, 0.29671, 0.6929],
        opacity: 254.0 / 255.0,
        color: [-1.25724, -1.30115, -1.25724],
        rest: Some([-0.10898, -0.10898, -0.10172]),
    };
    check_at_rest(&scene, 0, &first);
}

#[test]
fn the_finest_level_that_exists_of_a_streamed_sog_is_read() {
    let Some(scene) = load("playcanvas/playbot/lod-meta.json") else { return };
    let Some(alone) = load("playcanvas/playbot/5_0/meta.json") else { return };
    assert_eq!(scene.len(), 3000, "level 5: the folders of levels 0 to 4 are not there");
    assert_eq!(trained(&scene), trained(&alone), "the Gaussians of its only file");
}

#[test]
fn a_streamed_sog_without_any_level_is_refused_with_the_missing_files() {
    let Some(from) = fixture("playcanvas/playbot/lod-meta.json") else { return };
    let alone = tempfile::tempdir().expect("a temporary folder");
    let path = alone.path().join("lod-meta.json");
    std::fs::copy(from, &path).expect("the file is copied");
    let message = codec::load(&path, &ReadOptions::default()).expect_err("no folders").to_string();
    assert!(message.contains("0_0/meta.json") && message.contains("6_0/meta.json"), "{message}");
}

#[test]
fn a_streamed_sogst_has_the_values_that_another_decoder_finds() {
    let Some(scene) = load("sogst/fountain_d1_sh2_seg.sogst") else { return };
    assert_eq!(scene.len(), 398, "two have no opacity");
    assert_eq!(scene.trained_with.time_interval, [0.5, 2.5], "absolute seconds");
    assert_eq!((scene.playback.duration_seconds, scene.playback.up), (2.0, UpAxis::NegY), "as it is played");
    let middle = Expected {
        mean: [-1.61803, 0.67541, 1.28334],
        log_scale: [-4.44654, -3.02623, -4.28974],
        rotation: [0.69463, -0.56291, 0.03605, -0.44645],
        opacity: 0.48235,
        color: [-1.38066, 0.84157, -1.23376],
        rest: Some([-0.03484, 0.00065, 0.07367]),
    };
    check_moving(&scene, &middle, [-1.01329, -2.49677, -1.11242], [1.23505, 0.01359]);
}

#[test]
fn curved_paths_of_a_sogst_are_followed_by_straight_pieces() {
    let Some(scene) = load("sogst/arc_d2_sh0_mono.sogst") else { return };
    let (gaussians, _) = moving(&scene);
    let filter = scene.filter.as_ref().expect("pieces have windows");
    assert_eq!(filter.kind, FilterKind::Window, "the windows are part of the capture");
    // Gaussian 80 of the file.
    let [mean, velocity, accel] =
        [[-0.31692, 0.42279, -1.9819], [0.99146, -1.27857, 0.55449], [0.71012, -4.50129, 0.42817]].map(Vec3::from);
    let is_own =
        |gaussian: &&Gaussian| (gaussian.mean_t - 1.23605).abs() < 1e-5 && (gaussian.sigma_t - 0.54814).abs() < 1e-5;
    assert!(gaussians.iter().filter(is_own).count() > 1, "a curved path has several pieces");
    for step in 0..=150 {
        let time = step as f32 / 100.0;
        let segment = filter.segment_of(time, scene.trained_with.time_interval);
        let active = |(index, _): &(usize, &Gaussian)| filter.is_active(segment, *index);
        let places: Vec<Vec3> = gaussians
            .iter()
            .enumerate()
            .filter(active)
            .map(|(_, gaussian)| gaussian)
            .filter(is_own)
            .map(|gaussian| gaussian.mean_at(time))
            .collect();
        let since = time - 1.23605;
        let expected = mean + velocity * since + accel * since * since;
        let distance = places.iter().map(|place| place.distance(expected)).fold(f32::INFINITY, f32::min);
        // A quarter of its middle scale, exp(-3.20934).
        assert!(distance < 0.25 * 0.0404 + 1e-4, "{distance} from the path at {time}");
    }
}

#[test]
fn both_encodings_of_a_sog4d_have_the_values_that_another_decoder_finds() {
    for (name, lifespan) in [("kmeans", [2.66152, 0.16509]), ("q16", [2.66039, 0.1647])] {
        let Some(scene) = load(&format!("sog4d/swarm_{name}.sog4d")) else { return };
        assert_eq!((scene.len(), scene.trained_with.time_interval), (600, [1.0, 3.0]), "{name}");
        let first = Expected {
            mean: [-0.21281, -1.32168, -1.53185],
            log_scale: [-4.17557, -4.49674, -5.17033],
            rotation: [-0.56291, 0.1747, 0.32444, 0.73983],
            opacity: 0.68235,
            color: [0.49658, -0.66941, -1.06699],
            rest: None,
        };
        check_moving(&scene, &first, [0.5937, 0.93339, 0.46199], lifespan);
    }
}

#[test]
fn a_continuous_tsog_has_the_values_that_another_decoder_finds() {
    let Some(scene) = load("tsog/made_here_continuous16.tsog") else { return };
    assert_eq!((scene.len(), scene.playback.up), (63, UpAxis::PosY), "one of 64 has no opacity; y up");
    assert_eq!((scene.trained_with.time_interval, scene.playback.duration_seconds), ([0.0, 1.0], 2.5), "a clip");
    let first = Expected {
        mean: [-0.80193, -1.32435, -0.24838],
        log_scale: [-4.01846, -3.19531, -3.33134],
        rotation: [0.04159, -0.68492, -0.21352, 0.69538],
        opacity: 0.61176,
        color: [-0.68975, -0.30155, 1.33052],
        rest: None,
    };
    check_moving(&scene, &first, [0.59073, 0.53035, 0.03502], [0.56506, 0.02477]);
}

#[test]
fn a_discrete_tsog_shows_each_gaussian_in_its_frame() {
    let Some(scene) = load("tsog/made_here_discrete5.tsog") else { return };
    let filter = scene.filter.as_ref().expect("frames are windows");
    assert!(matches!(filter.sets, ActiveSets::Intervals(_)) && filter.kind == FilterKind::Window, "one frame each");
    assert_eq!(filter.active_counts(0..63), [13, 13, 13, 11, 13], "codes beyond the last frame belong to it");
    assert!(filter.is_active(4, 62), "code 65535");
    assert_eq!(scene.playback.duration_seconds, 5.0 / 12.0, "five frames at 12 a second");
}
