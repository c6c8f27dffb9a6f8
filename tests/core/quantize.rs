//! Quantization and the packed form in packages.
//!
//! In: synthetic scenes; with `GS4D_DATA` set, trained captures. Out: proof that the packed form keeps attributes and
//! pictures within its steps, and that packages store the packed form bit for bit.

use crate::support::data;
use crate::support::packed_scene::{BLACK, scene, settings, view};
use bevy_gs4d::codec::ReadOptions;
use bevy_gs4d::codec::{self, package};
use bevy_gs4d::gaussian::Gaussian;
use bevy_gs4d::internal::offline::compress::roundings;
use bevy_gs4d::internal::scene::Bits;
use bevy_gs4d::internal::scene::{is_filler, morton_order};
use bevy_gs4d::offline::compress::{CompressError, CompressSettings, Quality, compress};
use bevy_gs4d::offline::dataset::{CameraFile, CameraOptions};
use bevy_gs4d::offline::forms::{ConvertSettings, TargetForm, convert};
use bevy_gs4d::offline::measure::SquaredError;
use bevy_gs4d::reference;
use bevy_gs4d::scene::{FilterKind, Form, GaussianScene, RuntimeScene, SceneForm, TemporalFilter};
use bevy_gs4d::view::{Camera, RasterFov, View};
use glam::{UVec2, Vec3};
use std::io::Cursor;

fn pack(scene: &GaussianScene) -> Vec<u8> {
    let mut bytes = Vec::new();
    package::write(&mut bytes, scene, &package::WriteSettings { level: 3 }).expect("the package can be written");
    bytes
}

fn psnr(a: &RuntimeScene, b: &RuntimeScene, view: &View) -> f64 {
    let [a, b] = [a, b].map(|scene| reference::render(scene, view, BLACK).picture.clamped());
    SquaredError::of(&a, &b).expect("the same size").psnr()
}

/// Returns the order in which a scene is packed.
fn order(scene: &RuntimeScene) -> Vec<u32> {
    morton_order(&scene.form.as_sliced().expect("sliced").gaussians)
}

/// Returns each Gaussian of the scene with its packed form, matched by Morton order.
fn matched(scene: &RuntimeScene, packed: &RuntimeScene) -> Vec<(Gaussian, Gaussian)> {
    let order = order(scene);
    order.iter().enumerate().map(|(to, &from)| (scene.gaussian(from as usize), packed.gaussian(to))).collect()
}

#[test]
fn every_attribute_stays_within_its_step() {
    let scene = scene(3_000, 0, 0);
    let fine = Bits {
        mean: 16,
        mean_t: 16,
        velocity: 16,
        sigma_t: 15,
        scale: 16,
        rotation: 16,
        opacity: 16,
        base: 10,
        escape: 0.0,
    };
    let coarse =
        Bits { mean: 12, mean_t: 10, velocity: 9, sigma_t: 8, scale: 9, rotation: 9, opacity: 8, base: 8, escape: 0.0 };
    for bits in [fine, coarse] {
        let settings = CompressSettings { geometry: Some(bits), ..settings(&[]) };
        let (packed, _) = compress(scene.clone(), &settings).expect("compression succeeds");
        let packed = packed.into_runtime().expect("the scene can be drawn");
        let step = |bits: u32, range: f32| 0.51 * range / ((1u32 << bits) - 1) as f32 + 2e-6 * range.max(1.0);
        for (a, b) in matched(&scene, &packed) {
            for axis in 0..3 {
                assert!((a.mean[axis] - b.mean[axis]).abs() <= step(bits.mean, 2.4), "mean {a:?} {b:?}");
            }
            assert!((a.mean_t - b.mean_t).abs() <= step(bits.mean_t, 1.2), "temporal mean {a:?} {b:?}");
            assert!((a.opacity - b.opacity).abs() <= step(bits.opacity, 1.0), "opacity {a:?} {b:?}");
            assert_eq!(
                a.sigma_t.is_finite(),
                b.sigma_t.is_finite(),
                "a Gaussian is present at every time in both scenes or in neither"
            );
            if a.sigma_t.is_finite() {
                assert!((a.sigma_t.ln() - b.sigma_t.ln()).abs() <= step(bits.sigma_t, 5.0), "deviation {a:?} {b:?}");
            } else {
                assert_eq!(b.velocity, [0.0; 3], "no velocity");
            }
            let size = a.covariance[0] + a.covariance[3] + a.covariance[5];
            let apart = a.covariance.iter().zip(b.covariance).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            let allowed = if bits.scale == 16 { 2e-3 } else { 0.08 };
            assert!(apart <= allowed * size, "covariance {a:?} {b:?}");
        }
    }
}

#[test]
fn roundings_are_the_changes_of_each_gaussian_by_compression() {
    let (scene, settings) = (scene(2_000, 0, 0), settings(&[]));
    let gaussians = &scene.form.as_sliced().expect("sliced").gaussians;
    let bits = settings.geometry.expect("the quality has bits of geometry");
    let roundings = roundings(gaussians, &bits, scene.trained_with.time_span()).expect("the Gaussians can be packed");
    let (packed, _) = compress(scene.clone(), &settings).expect("compression succeeds");
    let packed = packed.into_runtime().expect("the scene can be drawn");
    for (to, from) in order(&scene).into_iter().enumerate() {
        let (a, b) = (roundings[from as usize].apply(&gaussians[from as usize]), packed.gaussian(to));
        assert!((a.mean_at(0.3) - b.mean_at(0.3)).length() < 1e-5, "place of {from}: {a:?} is {b:?}");
        assert!((a.marginal(0.3) - b.marginal(0.3)).abs() < 1e-5, "presence of {from}: {a:?} is {b:?}");
        assert!((a.opacity - b.opacity).abs() < 1e-6, "opacity of {from}: {a:?} is {b:?}");
        let apart = a.covariance.iter().zip(b.covariance).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        let size = b.covariance[0] + b.covariance[3] + b.covariance[5];
        assert!(apart < 1e-5 * size, "shape of {from}: {a:?} is {b:?}");
    }
}

#[test]
fn temporal_means_far_from_the_interval_do_not_lower_the_precision_of_other_gaussians() {
    let mut scene = RuntimeScene { filter: None, ..scene(4_000, 0, 0) };
    let Form::Sliced(sliced) = &mut scene.form else { panic!("sliced") };
    for (index, gaussian) in sliced.gaussians.iter_mut().enumerate() {
        match index % 10 {
            // A long lifespan with motion: the same positions within the interval.
            0 => {
                let away = [-250.0, 90.0, 400.0][index / 10 % 3];
                for (mean, velocity) in gaussian.mean.iter_mut().zip(gaussian.velocity) {
                    *mean += velocity * (away - gaussian.mean_t);
                }
                (gaussian.mean_t, gaussian.sigma_t) = (away, 300.0);
            }
            // Absent during the whole interval.
            1 => (gaussian.mean_t, gaussian.sigma_t) = (1e30, 0.1),
            _ => {}
        }
    }
    let (packed, _) = compress(scene.clone(), &settings(&[])).expect("compression succeeds");
    let packed = packed.into_runtime().expect("the scene can be drawn");
    for time in [0.1, 0.5, 0.9] {
        let found = psnr(&scene, &packed, &view(time));
        assert!(found >= 47.0, "the PSNR of balanced geometry: {found:.1} dB at {time}");
    }
}

/// Returns a scene in which every 150th Gaussian is faint and at this distance from the others, in any direction.
fn with_strays(mut scene: RuntimeScene, distance: f32) -> RuntimeScene {
    let gaussians = &mut scene.form.as_sliced_mut().expect("sliced").gaussians;
    for (index, gaussian) in gaussians.iter_mut().enumerate().step_by(150) {
        let angle = index as f32;
        let direction = Vec3::new((1.3 * angle).sin(), (0.7 * angle).cos(), (2.1 * angle).sin());
        gaussian.mean = (direction.normalize() * distance).to_array();
        (gaussian.velocity, gaussian.opacity) = ([0.0; 3], 0.05);
    }
    scene
}

#[test]
fn strays_do_not_lower_the_precision_of_other_gaussians() {
    let plain = RuntimeScene { filter: None, ..scene(3_000, 0, 0) };
    for quality in [Quality::Balanced, Quality::VisuallyLossless] {
        let settings = CompressSettings { codebooks: Vec::new(), ..CompressSettings::from(quality) };
        let compressed = |scene: &RuntimeScene| {
            let (packed, report) = compress(scene.clone(), &settings).expect("compression succeeds");
            let packed = packed.into_runtime().expect("the scene can be drawn");
            let found = [0.1, 0.5, 0.9].map(|time| psnr(scene, &packed, &view(time)));
            assert_eq!(packed.len(), scene.len() + report.fillers, "every Gaussian, and the fillers");
            (found.into_iter().fold(f64::INFINITY, f64::min), report.fillers)
        };
        let (expected, fillers) = compressed(&plain);
        assert_eq!(fillers, 0, "no block needs fillers");
        for distance in [30.0, 1e3, 1e6] {
            let (found, fillers) = compressed(&with_strays(plain.clone(), distance));
            println!("{quality:?}, strays at {distance}: {found:.1} dB, {expected:.1} without");
            let least = (expected - 1.5).min(quality.promise().expect("it has a promise"));
            assert!(found >= least, "{quality:?}, strays at {distance}: {found:.1} dB, {expected:.1} without");
            assert!(fillers < 256, "{quality:?}, strays at {distance}: one block is filled: {fillers}");
        }
    }
}

#[test]
fn objects_far_apart_keep_their_precision() {
    let mut both = RuntimeScene { filter: None, ..scene(4_000, 0, 0) };
    let away = Vec3::new(1e3, -200.0, 0.0);
    for gaussian in both.form.as_sliced_mut().expect("sliced").gaussians.iter_mut().skip(1).step_by(2) {
        gaussian.mean = (Vec3::from(gaussian.mean) + away).to_array();
    }
    let (packed, _) = compress(both.clone(), &settings(&[])).expect("compression succeeds");
    let packed = packed.into_runtime().expect("the scene can be drawn");
    for center in [Vec3::ZERO, away] {
        let eye = center + Vec3::new(1.9, -1.2, 1.1);
        let camera = Camera::look_at(eye, center, Vec3::Z, 0.9, UVec2::new(120, 90));
        let found = psnr(&both, &packed, &camera.view(0.4, RasterFov::Reference));
        assert!(found >= 46.0, "the object at {center}: {found:.1} dB");
    }
}

#[test]
fn extreme_values_of_a_few_gaussians_do_not_lower_the_precision_of_the_others() {
    let mut scene = RuntimeScene { filter: None, ..scene(3_000, 0, 0) };
    let is_extreme = |index: u32| index.is_multiple_of(150);
    let gaussians = &mut scene.form.as_sliced_mut().expect("sliced").gaussians;
    for (index, gaussian) in gaussians.iter_mut().enumerate().step_by(150) {
        gaussian.opacity = 0.05;
        gaussian.covariance = [1e24, 0.0, 0.0, 1e24, 0.0, 1e24];
        (gaussian.sigma_t, gaussian.velocity) =
            if index.is_multiple_of(300) { (1e-20, [0.0; 3]) } else { (0.5, [2e4, 0.0, 0.0]) };
    }
    let (packed, _) = compress(scene.clone(), &settings(&[])).expect("compression succeeds");
    let packed = packed.into_runtime().expect("the scene can be drawn");
    for (place, &index) in order(&scene).iter().enumerate().filter(|(_, index)| !is_extreme(**index)) {
        let (a, b) = (scene.gaussian(index as usize), packed.gaussian(place));
        let size = a.covariance[0] + a.covariance[3] + a.covariance[5];
        let apart = a.covariance.iter().zip(b.covariance).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(apart <= 0.08 * size, "the shape of {index}: {a:?} is {b:?}");
        if a.sigma_t.is_finite() {
            assert!((a.sigma_t / b.sigma_t).ln().abs() <= 0.05, "the lifespan of {index}: {a:?} is {b:?}");
            let displacement = (Vec3::from(a.velocity) - Vec3::from(b.velocity)) * a.sigma_t.min(1.0);
            assert!(displacement.length() <= 0.02, "the motion of {index}: {a:?} is {b:?}");
        }
    }
}

#[test]
fn roundings_with_strays_are_those_of_the_gaussians_and_not_of_fillers() {
    let (scene, settings) = (with_strays(scene(3_000, 0, 0), 1e3), settings(&[]));
    let gaussians = &scene.form.as_sliced().expect("sliced").gaussians;
    let bits = settings.geometry.expect("the quality has bits of geometry");
    let roundings = roundings(gaussians, &bits, scene.trained_with.time_span()).expect("the Gaussians can be packed");
    assert_eq!(roundings.len(), scene.len(), "one for each Gaussian");
    let (packed, _) = compress(scene.clone(), &settings).expect("compression succeeds");
    let packed = packed.into_runtime().expect("the scene can be drawn");
    let order = order(&scene);
    for (place, &index) in order.iter().enumerate() {
        let (a, b) = (roundings[index as usize].apply(&gaussians[index as usize]), packed.gaussian(place));
        let is_near = Vec3::from(a.mean).distance(Vec3::from(b.mean)) <= 1e-6 * Vec3::from(b.mean).length() + 1e-5;
        assert!(is_near, "the place of {index}: {a:?} is {b:?}");
        let opacity = if is_filler(&order, place) { 0.0 } else { a.opacity };
        assert!((b.opacity - opacity).abs() < 1e-6, "the opacity of {index}: {a:?} is {b:?}");
    }
}

#[test]
fn compression_keeps_pictures_within_the_promised_psnr() {
    let scene = scene(20_000, 1, 0);
    let lowest = |settings: &CompressSettings| {
        let (packed, _) = compress(scene.clone(), settings).expect("compression succeeds");
        let packed = packed.into_runtime().expect("the scene can be drawn");
        [0.05, 0.4, 0.9].map(|time| psnr(&scene, &packed, &view(time))).into_iter().fold(f64::INFINITY, f64::min)
    };
    let geometry = lowest(&settings(&[]));
    assert!(geometry >= 47.0, "balanced geometry, colors without codebooks: {geometry:.1} dB");
    let balanced = lowest(&CompressSettings::from(Quality::Balanced));
    assert!(balanced >= 44.0 && balanced >= geometry - 4.0, "balanced: {balanced:.1} dB, geometry alone {geometry:.1}");
    let exact = lowest(&CompressSettings::from(Quality::VisuallyLossless));
    assert!(exact >= 55.0, "visually lossless: {exact:.1} dB");
    let coded = [&[256][..], &[256, 256], &[256, 256, 256]].map(|codebooks| lowest(&settings(codebooks)));
    assert!(coded.is_sorted(), "each further codebook raises the PSNR, even of random colors: {coded:.1?} dB");
    assert!(balanced > coded[2], "the codebooks of the quality are better: {balanced:.1} and {coded:.1?} dB");
    let (_, report) = compress(scene.clone(), &settings(&[256, 256])).expect("compression succeeds");
    assert!(report.memory_after < report.memory_before / 2, "half the memory or less: {report:?}");
}

#[test]
fn the_filter_follows_the_order_of_the_gaussians() {
    let mut scene = scene(2_000, 0, 0);
    // Not a support filter, which would be computed again.
    scene.filter = scene.filter.map(|filter| TemporalFilter { kind: FilterKind::KeyFrame, ..filter });
    let (packed, _) = compress(scene.clone(), &settings(&[])).expect("compression succeeds");
    let order = order(&scene);
    let (before, after) = (scene.filter.expect("a filter"), packed.filter.expect("the filter is kept"));
    for segment in 0..before.segments {
        for (to, &from) in order.iter().enumerate() {
            assert_eq!(after.is_active(segment, to), before.is_active(segment, from as usize), "{to} was {from}");
        }
    }
}

#[test]
fn a_support_filter_of_a_packed_scene_changes_no_picture() {
    let (packed, _) = compress(scene(3_000, 0, 0), &settings(&[])).expect("compression succeeds");
    let filtered = packed.into_runtime().expect("the scene can be drawn");
    let active = filtered.filter.as_ref().map_or(1.0, TemporalFilter::active_share);
    assert!(active < 0.95, "some Gaussians are inactive: {active}");
    let free = RuntimeScene { filter: None, ..filtered.clone() };
    for step in 0..=27 {
        let view = view(step as f32 / 27.0);
        let [with, without] = [&filtered, &free].map(|scene| reference::render(scene, &view, BLACK).picture);
        assert!(with == without, "at {}: every visible Gaussian is active", view.time);
    }
}

#[test]
fn velocities_do_not_depend_on_the_bits_of_lifespans() {
    let scene = scene(3_000, 0, 0);
    let coarse = Bits {
        mean: 16,
        mean_t: 16,
        velocity: 16,
        sigma_t: 4,
        scale: 8,
        rotation: 8,
        opacity: 8,
        base: 8,
        escape: 0.0,
    };
    let settings = CompressSettings { geometry: Some(coarse), ..settings(&[]) };
    let (packed, _) = compress(scene.clone(), &settings).expect("compression succeeds");
    let packed = packed.into_runtime().expect("the scene can be drawn");
    let fastest = scene.iter().map(|g| Vec3::from(g.velocity).length()).fold(0.0, f32::max);
    for (a, b) in matched(&scene, &packed).into_iter().filter(|(a, _)| a.sigma_t.is_finite()) {
        let apart = (Vec3::from(a.velocity) - Vec3::from(b.velocity)).length();
        assert!(apart <= 2e-3 * fastest, "{a:?} {b:?}");
    }
}

#[test]
fn packed_scenes_and_invalid_codebooks_are_refused() {
    let small = scene(100, 1, 0);
    let (packed, _) = compress(small.clone(), &settings(&[8])).expect("compression succeeds");
    let again = compress(packed.into_runtime().expect("drawable"), &settings(&[8]));
    assert!(matches!(again, Err(CompressError::AlreadyPacked)), "packed twice");
    for codebooks in [vec![0], vec![70_000], vec![4; 5]] {
        let refused = compress(small.clone(), &settings(&codebooks));
        assert!(matches!(refused, Err(CompressError::Codebooks(_))), "{codebooks:?}");
    }
    let alone = CompressSettings { geometry: None, ..settings(&[8]) };
    assert!(matches!(compress(small, &alone), Err(CompressError::CodebooksAlone)), "codebooks without geometry");
}

#[test]
fn values_that_the_packed_form_cannot_hold_are_refused() {
    let (mut far, mut bright) = (scene(300, 0, 0), scene(300, 0, 0));
    let gaussians = &mut far.form.as_sliced_mut().expect("sliced").gaussians;
    (gaussians[7].mean, gaussians[8].mean) = ([3e38; 3], [-3e38; 3]);
    bright.form.as_sliced_mut().expect("sliced").harmonics.values[..2].copy_from_slice(&[3e38, -3e38]);
    for (what, scene) in [("means", far), ("colors", bright)] {
        let refused = compress(scene, &settings(&[8]));
        assert!(matches!(refused, Err(CompressError::Range(_))), "{what} that are too far apart");
    }
    for color_step in [f32::INFINITY, f32::NAN, -1.0, f32::from_bits(1), f32::MIN_POSITIVE.next_down()] {
        let refused = compress(scene(50, 1, 0), &CompressSettings { color_step, ..settings(&[]) });
        assert!(matches!(refused, Err(CompressError::ColorStep(_))), "a step of {color_step}");
    }
}

#[test]
fn steps_of_any_size_leave_colors_finite() {
    let scene = scene(300, 1, 0);
    for color_step in [f32::MIN_POSITIVE, f32::MAX] {
        let settings = CompressSettings { color_step, ..settings(&[]) };
        let (packed, _) = compress(scene.clone(), &settings).expect("compression succeeds");
        packed.into_runtime().unwrap_or_else(|error| panic!("a step of {color_step}: {error}"));
    }
}

#[test]
fn degrees_of_coded_colors_can_be_lowered() {
    let (packed, _) = compress(scene(500, 3, 2), &settings(&[16, 16])).expect("compression succeeds");
    let lowered = |degree, degree_t| {
        let settings =
            ConvertSettings { form: None, sh_degree: degree, sh_degree_t: degree_t, ..ConvertSettings::default() };
        convert(packed.clone(), &settings).expect("the conversion succeeds")
    };
    assert!(lowered(None, None) == packed, "without options the scene is unchanged");
    for (degree, degree_t, coefficients) in [(Some(0), None, 1), (Some(2), None, 9), (None, Some(1), 32)] {
        let converted = lowered(degree, degree_t);
        assert_eq!(converted.form.color_degrees().coefficients, coefficients, "{degree:?} and {degree_t:?}");
        assert!(pack(&converted).len() < pack(&packed).len(), "{degree:?} and {degree_t:?}: the package is smaller");
    }
    let runtime = ConvertSettings { form: Some(TargetForm::Runtime), ..ConvertSettings::default() };
    let degrees = convert(lowered(Some(1), None), &runtime).expect("the scene can be unpacked").form.color_degrees();
    assert_eq!((degrees.degree, degrees.coefficients), (1, 4), "unpacking keeps the lowered degree");
}

#[test]
fn scenes_of_few_gaussians_are_compressed() {
    for count in [0, 1, 2, 255, 256, 257] {
        let scene = scene(count, 3, 2);
        for codebooks in [&[][..], &[16, 16, 16, 16]] {
            let (packed, _) = compress(scene.clone(), &settings(codebooks)).expect("compression succeeds");
            let read = package::read(Cursor::new(pack(&packed))).expect("the package can be read");
            assert_eq!(read, packed, "{count} Gaussians, bit for bit");
            assert_eq!(read.into_runtime().expect("drawable").len(), count, "every Gaussian");
        }
    }
}

#[test]
fn packages_store_the_packed_form_bit_for_bit() {
    for (degree, degree_t, codebooks) in
        [(3, 2, &[32, 16, 8][..]), (2, 0, &[16]), (1, 0, &[]), (0, 0, &[4]), (3, 1, &[9, 9, 9, 9])]
    {
        let (packed, _) = compress(scene(700, degree, degree_t), &settings(codebooks)).expect("compression succeeds");
        let bytes = pack(&packed);
        let read = package::read(Cursor::new(&bytes)).expect("the package can be read");
        assert_eq!(read, packed, "degree {degree} and {degree_t}");
        let info = package::inspect(Cursor::new(&bytes)).expect("the package can be inspected");
        assert_eq!(info.header.requires, ["packed", "filter"], "older readers must refuse the package");
        let back = read.unpacked();
        let is_sliced = matches!(back.form, SceneForm::Ready(Form::Sliced(_)));
        assert!(is_sliced && back.len() == 700, "it can be unpacked");
        let is_consistent = back.form.harmonics().is_some_and(|harmonics| harmonics.is_consistent(700));
        assert!(is_consistent, "every coefficient is present");
    }
}

#[test]
fn unpacking_changes_no_picture() {
    let (packed, _) = compress(scene(1_500, 3, 2), &settings(&[64, 32])).expect("compression succeeds");
    let unpacked = packed.clone().unpacked().into_runtime().expect("drawable");
    let packed = packed.into_runtime().expect("drawable");
    for time in [0.1, 0.7] {
        let found = psnr(&packed, &unpacked, &view(time));
        assert!(found >= 100.0, "at {time}: {found:.1} dB");
    }
}

#[test]
fn every_flipped_bit_of_a_packed_package_is_detected() {
    let (packed, _) = compress(scene(40, 1, 0), &settings(&[4, 2])).expect("compression succeeds");
    let bytes = pack(&packed);
    for bit in 0..bytes.len() * 8 {
        let mut damaged = bytes.clone();
        damaged[bit / 8] ^= 1 << (bit % 8);
        assert!(package::read(Cursor::new(damaged)).is_err(), "bit {bit}");
    }
}

#[test]
fn a_trained_capture_reaches_the_targets_of_the_balanced_quality() {
    let Some(data) = data::data() else { return };
    // As in the demo: 45,000 Gaussians; the larger captures take minutes in a build without optimization.
    let scene = codec::load(&data.join("toybox/toybox_45k.pth"), &ReadOptions::default()).expect("the checkpoint");
    let scene = scene.into_runtime().expect("drawable");
    let (packed, _) =
        compress(scene.clone(), &CompressSettings::from(Quality::Balanced)).expect("compression succeeds");
    let mut bytes = Vec::new();
    package::write(&mut bytes, &packed, &package::WriteSettings { level: 19 }).expect("the package can be written");
    let info = package::inspect(Cursor::new(&bytes)).expect("the package can be inspected");
    let books = |name: &str| name.starts_with("codebook");
    let (codebooks, rest): (Vec<_>, Vec<_>) = info.header.sections.iter().partition(|section| books(&section.name));
    let size = |sections: &[&package::Section]| sections.iter().map(|section| section.length).sum::<usize>();
    let each = size(&rest) as f64 / 45_000.0;
    assert!(each <= 24.0, "at most 24 bytes per Gaussian: {each:.2}");
    assert!(size(&codebooks) <= 1_000_000, "codebooks of at most 1 MB: {} bytes", size(&codebooks));
    let packed = packed.into_runtime().expect("drawable");
    let Form::Packed(records) = &packed.form else { panic!("the scene is packed") };
    assert_eq!(size_of_val(&records.records[..]), 45_000 * 32, "32 bytes for each Gaussian");
    let views = CameraFile::load(&data.join("toybox/golden_45k.json"), &CameraOptions::default()).expect("cameras");
    for shot in views {
        let found = psnr(&scene, &packed, &shot.camera.view(shot.time, RasterFov::Reference));
        assert!(found >= 48.0, "{}: {found:.2} dB, more than `Quality::Balanced` promises", shot.name);
    }
}
