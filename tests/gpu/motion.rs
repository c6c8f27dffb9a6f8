//! Motions on the GPU.
//!
//! In: moving scenes, seen from two places at two times. Out: proof that the GPU's motions match the CPU reference and
//! the pinhole model, and that motions do not change colors. Skipped where there is no GPU.

use crate::support::gpu;
use crate::support::packed_scene::{scene, settings};
use bevy_gs4d::gaussian::{Gaussian, Harmonics};
use bevy_gs4d::internal::reference::{self, TileLists};
use bevy_gs4d::offline::compress::compress;
use bevy_gs4d::reference::Layer;
use bevy_gs4d::renderer::{ColorPrecision, Design, Instance, ViewParameters};
use bevy_gs4d::scene::RuntimeScene;
use bevy_gs4d::view::{Appearance, Background, BlendSpace, Camera, Counts, RasterFov, View};
use glam::{UVec2, Vec2, Vec3};

const DESIGNS: [Design; 2] = [Design::GlobalSort, Design::TileBins];

/// Returns the view from a place displaced by `aside`, at a time of [0, 1].
fn view(aside: f32, time: f32) -> View {
    let eye = Vec3::new(1.9 + aside, -1.2, 1.1);
    Camera::look_at(eye, Vec3::ZERO, Vec3::Z, 0.9, UVec2::new(120, 90)).view(time, RasterFov::Reference)
}

fn as_trained() -> Appearance {
    Appearance::default()
}

/// Returns the blended motions of the CPU reference, with transmittance.
fn expected(scene: &RuntimeScene, now: View, before: &View) -> Vec<(Vec2, f32)> {
    let layer = Layer { scene, view: now, appearance: as_trained() };
    let mut splats = reference::project(&layer, BlendSpace::Encoded);
    let motions = reference::motion(&layer, &splats, before);
    for (splat, motion) in splats.iter_mut().zip(motions) {
        splat.color = motion.extend(0.0);
    }
    let TileLists { pairs, ranges, visible } = reference::tile_lists(&splats, &now);
    let counts = Counts { visible, pairs: pairs.len() as u32 };
    let black = Background::Color([0.0; 3]);
    let frame = reference::blend(&splats, &pairs, &ranges, &now, black, None, BlendSpace::Encoded, counts);
    frame.picture.pixels.iter().map(|motion| motion.truncate()).zip(frame.transmittance).collect()
}

#[test]
fn motion_matches_the_cpu_reference() {
    let Some(mut headless) = gpu::headless() else { return };
    let whole = scene(3_000, 1, 0);
    let (packed, _) = compress(whole.clone(), &settings(&[16])).expect("the scene can be compressed");
    let packed = packed.into_runtime().expect("drawable");
    let (now, before) = (view(0.0, 0.4), view(0.05, 0.37));
    let previous = [before];
    for (name, scene) in [("sliced", &whole), ("packed", &packed)] {
        let expected = expected(scene, now, &before);
        let most = expected.iter().map(|(motion, _)| motion.abs().max_element()).fold(0.0, f32::max);
        assert!(most > 1.0, "{name}: the largest motion is more than a pixel: {most}");
        for design in DESIGNS {
            headless.set_design(design);
            let capture = headless.upload(scene).expect("the scene fits the GPU");
            let active = headless.active(&capture, now.time);
            let instance = Instance { capture: &capture, active: active.as_ref(), view: now, appearance: as_trained() };
            let parameters = ViewParameters { previous: Some(&previous), ..ViewParameters::default() };
            let frame = headless.render_all(&[instance], &parameters).expect("the view is drawn");
            let found = headless.read_motion().expect("motions are read back");
            assert_eq!(found.len(), expected.len(), "{name}, {design:?}: a motion for each pixel");
            let apart = found.iter().zip(&expected).map(|([x, y, _, left], (motion, transmittance))| {
                let motion = (Vec2::new(*x, *y) - *motion).abs().max_element() / most;
                motion.max((left - transmittance).abs())
            });
            let worst = apart.clone().fold(0.0, f32::max);
            let far = apart.filter(|apart| *apart > 1e-3).count();
            // A pixel may differ by more if rounding decides whether a splat is blended.
            assert!(far <= 20 && worst <= 0.05, "{name}, {design:?}: {far} pixels differ, at most by {worst}");
            let left = found.iter().zip(&frame.transmittance).map(|(motion, left)| (motion[3] - left).abs());
            let apart = left.fold(0.0, f32::max);
            assert!(apart <= 2e-4, "{name}, {design:?}: transmittances of motions and colors differ by {apart}");
        }
    }
}

#[test]
fn motions_do_not_change_colors_and_depths() {
    let Some(mut headless) = gpu::headless() else { return };
    let capture = headless.upload(&scene(3_000, 1, 0)).expect("the scene fits the GPU");
    let instances = [Instance { capture: &capture, active: None, view: view(0.0, 0.4), appearance: as_trained() }];
    let previous = [view(0.1, 0.3)];
    for design in DESIGNS {
        headless.set_design(design);
        for (depths, precision) in [(true, ColorPrecision::Single), (false, ColorPrecision::Half)] {
            let without = ViewParameters { depths, precision, ..ViewParameters::default() };
            let with = ViewParameters { previous: Some(&previous), ..without };
            let [plain, moving, again] =
                [&without, &with, &without].map(|one| headless.render_all(&instances, one).expect("the view is drawn"));
            assert!(plain.counts.visible > 500, "the scene is visible: {:?}", plain.counts);
            assert_eq!(moving, plain, "{design:?}, {precision:?}, depths {depths}: the same frame with motions");
            assert_eq!(again, plain, "{design:?}, {precision:?}, depths {depths}: the same frame after motions");
            assert!(
                headless.read_motion().expect("motions are read back").is_empty(),
                "{design:?}: motions are released"
            );
        }
    }
}

/// Returns a scene of one opaque Gaussian at the origin that moves to the right by one unit per unit of time.
fn lone() -> RuntimeScene {
    let gaussian = Gaussian {
        mean: [0.0; 3],
        mean_t: 0.0,
        velocity: [1.0, 0.0, 0.0],
        sigma_t: f32::INFINITY,
        covariance: [0.04, 0.0, 0.0, 0.04, 0.0, 0.04],
        opacity: 0.99,
        padding: 0.0,
    };
    let values = vec![0.5; 3];
    RuntimeScene::sliced(vec![gaussian], Harmonics { coefficients: 1, degree: 0, degree_t: 0, values })
}

#[test]
fn the_motion_of_a_splat_matches_the_pinhole_model() {
    let Some(mut headless) = gpu::headless() else { return };
    let capture = headless.upload(&lone()).expect("the scene fits the GPU");
    let (size, distance) = (UVec2::splat(65), 3.0);
    let camera = |aside: f32| {
        let eye = Vec3::new(aside, -distance, 0.0);
        Camera::look_at(eye, Vec3::new(aside, 0.0, 0.0), Vec3::Z, 0.8, size)
    };
    let now = camera(0.0).view(0.0, RasterFov::Reference);
    // Pixels per unit at this distance.
    let scale = now.focal().x / distance;
    let cases = [
        ("neither Gaussian nor camera moves", camera(0.0).view(0.0, RasterFov::Reference), 0.0),
        ("the Gaussian moves right", camera(0.0).view(-0.1, RasterFov::Reference), 0.1 * scale),
        ("the camera moves right", camera(-0.1).view(0.0, RasterFov::Reference), -0.1 * scale),
        ("Gaussian and camera move right", camera(-0.1).view(-0.1, RasterFov::Reference), 0.0),
    ];
    for design in DESIGNS {
        headless.set_design(design);
        for (what, before, expected) in &cases {
            let instance = Instance { capture: &capture, active: None, view: now, appearance: as_trained() };
            let parameters =
                ViewParameters { previous: Some(std::slice::from_ref(before)), ..ViewParameters::default() };
            headless.render_all(&[instance], &parameters).expect("the view is drawn");
            let motions = headless.read_motion().expect("motions are read back");
            let [x, y, _, left] = motions[(size.y / 2 * size.x + size.x / 2) as usize];
            assert!(left < 0.1, "{what}: the splat covers the middle pixel: transmittance {left}");
            let found = Vec2::new(x, y) / (1.0 - left);
            let apart = (found - Vec2::new(*expected, 0.0)).abs().max_element();
            assert!(apart <= 0.01, "{what}, {design:?}: motion {found}, expected {expected}");
        }
    }
}

#[test]
fn resources_of_motions_are_created_once_and_only_for_frames_with_motions() {
    let Some(mut headless) = gpu::headless() else { return };
    let capture = headless.upload(&lone()).expect("the scene fits the GPU");
    let view = view(0.0, 0.0);
    let instances = [Instance { capture: &capture, active: None, view, appearance: as_trained() }];
    let previous = [view];
    let with = ViewParameters { previous: Some(&previous), ..ViewParameters::default() };
    let without = ViewParameters::default();
    for design in DESIGNS {
        headless.set_design(design);
        let mut created = |parameters: &ViewParameters<'_>| {
            headless.render_all(&instances, parameters).expect("the view is drawn");
            headless.work().created()
        };
        let before = [created(&without), created(&without)];
        assert_eq!(before[0], before[1], "{design:?}: a second frame creates no resources");
        let after = [created(&with), created(&with)];
        assert!(after[0] > before[1], "{design:?}: motions need a target");
        assert_eq!(after[0], after[1], "{design:?}: the target of motions is created once");
    }
}
