//! SPZ and glTF files of other makes.
//!
//! In: the files in `formats/` of the folder that `GS4D_DATA` names. Out: proof that each file has the values that an
//! independent decoder finds.

use crate::support::other_makes::{assert_near, fixture, opacity};
use bevy_gs4d::codec::{self, CodecError, ReadOptions};
use bevy_gs4d::gaussian::{Harmonics, Parameters};
use bevy_gs4d::scene::{GaussianScene, SceneForm, Trained, UpAxis};

fn load(name: &str) -> Option<Result<GaussianScene, CodecError>> {
    Some(codec::load(&fixture(name)?, &ReadOptions::default()))
}

/// Returns the Gaussians of a file.
fn trained(name: &str) -> Option<(Parameters, Harmonics)> {
    let scene = load(name)?.expect("a file that is read");
    assert_eq!(scene.playback.up, UpAxis::PosY, "{name}: +Y points up");
    match scene.form {
        SceneForm::Trained(Trained { parameters, harmonics }) => Some((parameters, harmonics)),
        SceneForm::Ready(_) => panic!("{name}: Gaussians at rest are in the trained form"),
    }
}

/// Returns a rotation of length 1 whose largest component is positive.
fn unit(rotation: [f32; 4]) -> [f32; 4] {
    let length = rotation.iter().map(|c| c * c).sum::<f32>().sqrt();
    let largest = rotation.into_iter().max_by(|a, b| a.abs().total_cmp(&b.abs())).expect("four components");
    rotation.map(|component| component / length * largest.signum())
}

#[test]
fn a_capture_of_playcanvas_in_spz_version_4_has_its_gaussians() {
    let Some((parameters, harmonics)) = trained("playcanvas/biker.spz") else { return };
    assert_eq!((parameters.len(), harmonics.degree), (152_746, 0), "Gaussians and degree");
    let bound = |start: f32, fold: fn(f32, f32) -> f32| {
        [0, 1, 2].map(|axis| parameters.mean.iter().map(|mean| mean[axis]).fold(start, fold))
    };
    assert_near("least", bound(f32::INFINITY, f32::min), [-0.62134, 0.0, -0.61328], 1e-5);
    assert_near("most", bound(f32::NEG_INFINITY, f32::max), [0.41431, 3.18018, 0.53223], 1e-5);
    assert_near("mean 0", parameters.mean[0], [-0.10449, 2.38794, 0.36084], 1e-5);
    assert_eq!(parameters.log_scale[0], [-6.0625, -4.1875, -7.0625], "scale 0");
    assert_near("rotation 0", unit(parameters.rotation_l[0]), [-0.4608, 0.06227, 0.88504, 0.02214], 1e-4);
    assert_near("opacity 0", [opacity(parameters.opacity_logit[0])], [18.0 / 255.0], 1e-6);
    assert_near("color 0", [0, 1, 2].map(|c| harmonics.of(0)[c]), [0.53595, 0.5098, 0.56209], 1e-5);
    let mean = parameters.opacity_logit.iter().map(|&logit| f64::from(opacity(logit))).sum::<f64>() / 152_746.0;
    assert!((mean - 0.29663).abs() < 1e-5, "the mean opacity is {mean}");
}

#[test]
fn the_filter_of_mip_splatting_is_that_of_the_file() {
    for (name, mip_filter) in [("cloud_mip.spz", true), ("cloud_sh3.spz", false)] {
        let Some(scene) = load(&format!("splat-transform/{name}")) else { return };
        let found = scene.expect("a file that is read").trained_with.mip_filter;
        assert_eq!(found, mip_filter, "{name}: the flag of the file");
    }
}

#[test]
fn small_spz_files_of_every_version_are_read() {
    for (name, z, red) in [
        ("minimal-v2.spz", -1.0, 1.11111),
        ("minimal-v3.spz", 1.0, 0.58824),
        ("minimal-v4.spz", 1.0, 0.58824),
        ("minimal-raw.spz", -1.0, 1.11111),
    ] {
        let Some((parameters, harmonics)) = trained(&format!("splat-transform/{name}")) else { return };
        assert_eq!(parameters.mean[..3], [[-1.0, 0.0, z], [0.0, 0.0, z], [-1.0, 0.0, 0.0]], "{name}: a grid");
        assert_eq!(parameters.log_scale[3], [-2.3125; 3], "{name}: scales");
        assert_near(name, [opacity(parameters.opacity_logit[1])], [230.0 / 255.0], 1e-6);
        assert_near(name, [0, 1, 2].map(|c| harmonics.of(2)[c]), [-red, red, 0.01307], 1e-5);
    }
}

#[test]
fn harmonics_of_spz_and_gltf_files_of_the_same_capture_agree() {
    let Some((spz, spz_colors)) = trained("splat-transform/cloud_sh3.spz") else { return };
    let Some((gltf, gltf_colors)) = trained("splat-transform/cloud_sh3.glb") else { return };
    assert_eq!((spz.len(), gltf.len()), (200, 200), "Gaussians");
    assert_eq!((spz_colors.degree, gltf_colors.degree), (3, 3), "degrees");
    assert_near("mean 0 of the glTF file", gltf.mean[0], [-0.04103, -1.0878, 1.22472], 1e-5);
    assert_near("scale 0 of the glTF file", gltf.log_scale[0], [-6.43256, -2.90821, -4.00843], 1e-4);
    // The glTF file is rotated by half a circle about z: harmonics that are odd in x and y together change their signs.
    let signs = [1, -1, 1, -1, 1, -1, 1, -1, 1, -1, 1, -1, 1, -1, 1, -1].map(|sign: i8| f32::from(sign));
    for index in 0..200 {
        let [x, y, z] = gltf.mean[index];
        assert_near("means", spz.mean[index], [-x, -y, z], 1.3e-4);
        assert_near("scales", spz.log_scale[index], gltf.log_scale[index], 0.0313);
        let [w, x, y, z] = gltf.rotation_l[index];
        let (found, expected) = (unit(spz.rotation_l[index]), unit([-z, -y, x, w]));
        let dot: f32 = found.iter().zip(expected).map(|(a, b)| a * b).sum();
        assert!(dot.abs() > 0.99999, "rotation {index}: {found:?}, not {expected:?}");
        let (found, expected) = (opacity(spz.opacity_logit[index]), opacity(gltf.opacity_logit[index]));
        assert_near("opacities", [found], [expected], 0.002);
        let (found, expected) = (spz_colors.of(index), gltf_colors.of(index));
        for (k, sign) in signs.into_iter().enumerate() {
            let color = |values: &[f32]| [0, 1, 2].map(|channel| values[k * 3 + channel]);
            let tolerance = if k == 0 { 0.0132 } else { 0.067 };
            assert_near("colors", color(found), color(expected).map(|value| sign * value), tolerance);
        }
    }
}

#[test]
fn a_capture_with_every_type_of_number_is_read() {
    let Some((parameters, harmonics)) = trained("khr/khr_conformance_matrix.glb") else { return };
    assert_eq!((parameters.len(), harmonics.degree), (15, 3), "15 primitives, of degrees 0 to 3");
    assert!(parameters.mean.iter().all(|&mean| mean == [1.0, 2.0, 3.0]), "all at one place");
    // A file of the draft: scales are logarithms.
    let scales = [[0.2, -0.1, 0.7], [1.0, -2.0, 3.0], [1.0, 0.0, -1.0], [2.0, -3.0, 4.0], [1.0, 0.0, -1.0]];
    for (found, expected) in parameters.log_scale[3..8].iter().zip(scales) {
        assert_near("scale", *found, expected, 1e-6);
    }
    for rotation in &parameters.rotation_l[..3] {
        assert_near("rotation", *rotation, [0.0, 1.0, 0.0, 0.0], 1e-6);
    }
    for (index, expected) in [(8, 0.75), (9, 64.0 / 255.0), (10, 16384.0 / 65535.0)] {
        assert_near("opacity", [opacity(parameters.opacity_logit[index])], [expected], 1e-6);
    }
    let first = harmonics.of(3);
    assert_near("the sRGB color", [first[0], first[1], first[2]], [0.1, 0.2, 0.3], 1e-6);
    // The others are linear: encoding scales the coefficients above degree 0 by one slope for each channel.
    let last = harmonics.of(14);
    let slopes = [0, 1, 2].map(|channel| last[3 + channel] / [1.1, 1.2, 1.3][channel]);
    assert_near("degree 3", [0, 1, 2].map(|c| last[27 + c] / slopes[c]), [9.1, 9.2, 9.3], 1e-4);
    assert_eq!(harmonics.of(11)[3..], [0.0; 45], "a primitive of degree 0 has no other colors");
}

#[test]
fn a_kernel_of_another_extension_is_refused_by_its_name() {
    let Some(found) = load("khr/khr_extensible_fallback.gltf") else { return };
    let message = found.expect_err("a kernel that is not drawn").to_string();
    assert!(message.contains("customShape"), "the message names the kernel: {message}");
}
