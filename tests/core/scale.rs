//! Scenes of any scale: the same scene in units, in thousandths of a unit and in thousands of units.
//!
//! In: a PLY of three Gaussians, made here at several scales. Out: proof that its near limit, the cameras around it and
//! its pictures follow the scale, so that a scene of millimeters is seen like one of meters.

use bevy_gs4d::internal::codec::read_bytes;
use bevy_gs4d::offline::draw::orbit;
use bevy_gs4d::reference::render;
use bevy_gs4d::scene::RuntimeScene;
use bevy_gs4d::view::{Background, Camera, NEAR, Picture, RasterFov};
use glam::{UVec2, Vec3};
use std::path::Path;

const BLACK: Background = Background::Color([0.0; 3]);
/// The first coefficient of a channel of full brightness.
const BRIGHT: f32 = 1.772_453_9;
/// The properties of a PLY of Gaussians without further harmonics.
const NAMES: [&str; 14] = [
    "x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2",
    "rot_3",
];
/// Means in a scene of the scale 1; the radius of its core is 0.54 units.
const MEANS: [[f32; 3]; 3] = [[-0.5, 0.1, 0.0], [0.4, 0.0, 0.2], [0.1, 0.3, -0.3]];

/// Returns three opaque Gaussians, red, green and blue, of a deviation of 0.05 times the scale.
fn imported(scale: f32) -> RuntimeScene {
    let properties: String = NAMES.iter().map(|name| format!("property float {name}\n")).collect();
    let header = format!("ply\nformat binary_little_endian 1.0\nelement vertex 3\n{properties}end_header\n");
    let mut bytes = header.into_bytes();
    for (index, mean) in MEANS.into_iter().enumerate() {
        let mut color = [-BRIGHT; 3];
        color[index] = BRIGHT;
        let (mean, scales) = (mean.map(|value| value * scale), [(0.05 * scale).ln(); 3]);
        let values = [&mean[..], &color, &[4.6], &scales, &[1.0, 0.0, 0.0, 0.0]].concat();
        bytes.extend(values.into_iter().flat_map(f32::to_le_bytes));
    }
    let (scene, _) = read_bytes(Path::new("scene.ply"), &bytes).expect("a readable PLY");
    scene.into_runtime().expect("it can be drawn")
}

/// Returns the number of pixels that are brighter than 40 of 255.
fn lit(picture: &Picture) -> usize {
    picture.pixels.iter().filter(|pixel| pixel.max_element() * 255.0 > 40.0).count()
}

#[test]
fn the_near_limit_of_an_import_follows_its_scale_up_to_that_of_the_original() {
    let near = |scale| imported(scale).trained_with.near;
    assert_eq!([1e5, 1000.0, 10.0].map(near), [NEAR; 3], "scenes of several units have the near limit of the original");
    for scale in [1.0, 0.05, 0.001] {
        let expected = 0.1 * 0.536 * scale;
        assert!((near(scale) / expected - 1.0).abs() < 1e-2, "a tenth of the radius at {scale}: {}", near(scale));
    }
}

#[test]
fn a_scene_has_the_same_picture_at_every_scale() {
    let picture = |scale: f32| {
        let scene = imported(scale);
        let eye = Vec3::new(0.3, -2.0, 0.8) * scale;
        let camera = Camera::look_at(eye, Vec3::ZERO, Vec3::Z, 0.7, UVec2::new(60, 48));
        render(&scene, &camera.view(0.0, scene.trained_with.optics()), BLACK).picture
    };
    let usual = picture(1.0);
    assert!(lit(&usual) > 100, "{} pixels show the scene", lit(&usual));
    for scale in [0.05, 0.001, 1000.0] {
        let found = picture(scale);
        let apart =
            found.pixels.iter().zip(&usual.pixels).map(|(a, b)| (*a - *b).abs().max_element()).fold(0.0, f32::max);
        assert!(apart < 5e-3, "at the scale {scale} pixels differ by {apart}");
    }
}

#[test]
fn the_near_limit_of_the_original_hides_a_scene_of_millimeters() {
    let scene = imported(0.001);
    let camera = Camera::look_at(Vec3::new(0.0, -0.002, 0.0), Vec3::ZERO, Vec3::Z, 0.7, UVec2::splat(32));
    let [original, own] = [RasterFov::Corrected.into(), scene.trained_with.optics()]
        .map(|optics| lit(&render(&scene, &camera.view(0.0, optics), BLACK).picture));
    assert_eq!(original, 0, "everything is nearer than 0.2 units");
    assert!(own > 20, "{own} pixels show the scene with its own near limit");
}

#[test]
fn orbits_fill_the_picture_at_every_scale() {
    let filled = |scale: f32| {
        let scene = imported(scale);
        let shots = orbit(&scene, 1, UVec2::splat(120)).expect("it has Gaussians");
        lit(&render(&scene, &shots[0].view(&scene), BLACK).picture)
    };
    let usual = filled(1.0);
    assert!((700..1000).contains(&usual), "about 840 pixels show the scene: {usual}");
    for scale in [1e-5, 0.001, 0.05, 1000.0, 2e5] {
        let found = filled(scale);
        assert!(found.abs_diff(usual) * 10 <= usual, "at the scale {scale} {found} pixels in place of {usual}");
    }
}
