//! Picking: the Gaussian that a ray hits.
//!
//! In: Gaussians placed by hand, and a column of them with its render by the CPU reference. Out: proof that a ray hits
//! the expected Gaussian at the expected point, and that settings are respected.

use crate::support::gray::scene;
use bevy_gs4d::gaussian::{Gaussian, Harmonics};
use bevy_gs4d::internal::gaussian::alpha_at;
use bevy_gs4d::internal::reference::{self, Splat};
use bevy_gs4d::internal::scene::Bits;
use bevy_gs4d::internal::scene::SHARED_RANGES;
use bevy_gs4d::reference::Layer;
use bevy_gs4d::scene::{FilterKind, Form, PackedColors, PackedScene, Pick, PickSettings, RuntimeScene, TemporalFilter};
use bevy_gs4d::view::{Appearance, Background, BlendSpace, Camera, RasterFov};
use glam::{Affine3A, Mat4, Quat, UVec2, Vec2, Vec3};

/// Returns a Gaussian at rest that is always active.
fn still(mean: Vec3, covariance: [f32; 6], opacity: f32) -> Gaussian {
    Gaussian {
        mean: mean.to_array(),
        mean_t: 0.5,
        velocity: [0.0; 3],
        sigma_t: f32::INFINITY,
        covariance,
        opacity,
        padding: 0.0,
    }
}

/// Returns a round Gaussian on the z axis.
fn ball(z: f32, opacity: f32) -> Gaussian {
    still(Vec3::new(0.0, 0.0, z), [0.01, 0.0, 0.0, 0.01, 0.0, 0.01], opacity)
}

/// Picks along +z from the origin.
fn pick(gaussians: &[Gaussian], settings: &PickSettings) -> Option<Pick> {
    scene(gaussians).pick(Vec3::ZERO, Vec3::Z, settings)
}

fn hit(gaussians: &[Gaussian]) -> Option<(usize, f32)> {
    pick(gaussians, &PickSettings::default()).map(|pick| (pick.gaussian, pick.distance))
}

#[test]
fn a_ray_hits_a_gaussian_where_it_is_densest() {
    let scene = scene(&[ball(5.0, 0.9)]);
    let pick = scene.pick(Vec3::ZERO, Vec3::Z * 2.0, &PickSettings::default()).expect("a ray through the middle hits");
    assert_eq!(
        pick,
        Pick { gaussian: 0, distance: 2.5, point: Vec3::new(0.0, 0.0, 5.0) },
        "the distance is in lengths of the direction"
    );
    let offset =
        scene.pick(Vec3::new(0.05, 0.0, 0.0), Vec3::Z, &PickSettings::default()).expect("a ray near the middle hits");
    assert!(
        (offset.distance - 5.0).abs() < 1e-5,
        "a round Gaussian is densest at the depth of its mean, not at {}",
        offset.distance
    );
}

#[test]
fn rays_that_hit_no_gaussian_return_none() {
    let scene = scene(&[ball(5.0, 0.9)]);
    let misses = [
        (Vec3::new(1.0, 0.0, 0.0), Vec3::Z, "a parallel ray"),
        (Vec3::ZERO, Vec3::NEG_Z, "the opposite direction"),
        (Vec3::new(0.0, 0.0, 5.01), Vec3::Z, "an origin just behind the center"),
        (Vec3::ZERO, Vec3::ZERO, "no direction"),
        (Vec3::ZERO, Vec3::NAN, "a direction of NaN"),
        (Vec3::new(f32::INFINITY, 0.0, 0.0), Vec3::Z, "an infinite origin"),
    ];
    for (origin, direction, what) in misses {
        assert_eq!(scene.pick(origin, direction, &PickSettings::default()), None, "{what}");
    }
    assert_eq!(hit(&[]), None, "an empty scene");
    assert_eq!(hit(&[ball(5.0, 0.49)]), None, "an opacity below the threshold");
}

#[test]
fn the_gaussian_that_lowers_transmittance_below_one_half_is_hit() {
    assert_eq!(
        hit(&[ball(7.0, 0.9), ball(5.0, 0.9)]),
        Some((1, 5.0)),
        "the Gaussian in front is hit, independent of the order in the scene"
    );
    assert_eq!(hit(&[ball(7.0, 0.9), ball(5.0, 0.4)]), Some((0, 7.0)), "a ray passes through a faint Gaussian");
    assert_eq!(
        hit(&[ball(7.0, 0.3), ball(5.0, 0.3), ball(6.0, 0.3)]),
        Some((2, 6.0)),
        "the second Gaussian leaves a transmittance of 0.49"
    );
    let settings = PickSettings { threshold: 0.05, ..PickSettings::default() };
    let first = pick(&[ball(7.0, 0.9), ball(5.0, 0.1)], &settings).map(|pick| pick.gaussian);
    assert_eq!(first, Some(1), "with a lower threshold the faint Gaussian is hit");
    assert_eq!(hit(&[ball(5.0, 0.9), ball(5.0, 0.9)]), Some((0, 5.0)), "Gaussians at the same depth keep their order");
}

#[test]
fn settings_of_a_pick_are_respected() {
    let pair = [ball(5.0, 0.9), ball(7.0, 0.9)];
    let hit = |settings: PickSettings| pick(&pair, &settings).map(|pick| pick.gaussian);
    let base = PickSettings::default();
    assert_eq!(hit(PickSettings { max_distance: 4.0, ..base }), None, "both Gaussians are farther");
    assert_eq!(
        hit(PickSettings { opacity: 0.5, ..base }),
        Some(1),
        "at half the opacity, transmittance falls below one half at the second Gaussian"
    );
    assert_eq!(hit(PickSettings { opacity: 0.0, ..base }), None, "an opacity of 0 hides all Gaussians");
    let far = Affine3A::from_scale_rotation_translation(Vec3::ONE, Quat::IDENTITY, Vec3::new(0.0, 0.0, 7.5));
    assert_eq!(hit(PickSettings { crop: Some(far.inverse()), ..base }), Some(1), "the first Gaussian is cropped");
    let nowhere = Affine3A::from_scale(Vec3::NAN);
    assert_eq!(hit(PickSettings { crop: Some(nowhere), ..base }), None, "a crop box of NaN contains no Gaussian");
    let plane = |depth: f32| Some(Vec3::Z.extend(-depth));
    assert_eq!(
        hit(PickSettings { near_plane: plane(4.9), ..base }),
        Some(0),
        "both Gaussians are behind the near plane"
    );
    assert_eq!(hit(PickSettings { near_plane: plane(5.0), ..base }), Some(1), "the first Gaussian is before it");
    assert_eq!(hit(PickSettings { time: f32::NAN, ..base }), None, "a time of NaN");
}

#[test]
fn a_moving_gaussian_is_hit_where_it_is() {
    let mover = Gaussian { velocity: [0.0, 0.0, 4.0], sigma_t: 0.3, ..ball(5.0, 0.9) };
    let distance = |time| pick(&[mover], &PickSettings { time, ..PickSettings::default() }).map(|pick| pick.distance);
    assert_eq!(distance(0.5), Some(5.0), "at its temporal mean");
    assert_eq!(distance(0.75), Some(6.0), "a quarter later");
    assert_eq!(distance(0.1), None, "a marginal of 0.41 makes it too faint");
    let crosser = Gaussian { velocity: [4.0, 0.0, 0.0], sigma_t: f32::INFINITY, ..ball(5.0, 0.9) };
    let hits = |time| pick(&[crosser], &PickSettings { time, ..PickSettings::default() }).is_some();
    assert!(hits(0.5) && !hits(0.75), "the Gaussian has moved out of the ray");
    let opaque = Gaussian { sigma_t: 0.1, opacity: 1.0, ..mover };
    let settings = PickSettings { threshold: 0.04, ..PickSettings::default() };
    let there = |time| pick(&[opaque], &PickSettings { time, ..settings }).is_some();
    assert!(
        there(0.5 + 0.244) && !there(0.5 + 0.246),
        "a Gaussian with a marginal of at most 0.05 is absent, even with a threshold of 0.04"
    );
}

#[test]
fn gaussians_that_the_filter_leaves_out_are_not_hit() {
    let mut scene = scene(&[ball(5.0, 0.9), ball(7.0, 0.9)]);
    // Both are active in the first half of the time interval, only the second Gaussian in the second half.
    scene.filter = Some(TemporalFilter::from_bits(FilterKind::Support, 2, 2, vec![0b11, 0b10]));
    let hit = |time, use_filter| {
        let settings = PickSettings { time, use_filter, ..PickSettings::default() };
        scene.pick(Vec3::ZERO, Vec3::Z, &settings).map(|pick| pick.gaussian)
    };
    assert_eq!((hit(0.25, true), hit(0.75, true)), (Some(0), Some(1)), "inactive Gaussians are not hit");
    assert_eq!(hit(0.75, false), Some(0), "without the filter, inactive Gaussians are hit");
}

#[test]
fn absent_gaussians_are_not_decoded() {
    let brief = |z, mean_t| Gaussian { mean_t, sigma_t: 0.01 * z, ..ball(z, 0.9) };
    let gaussians = [brief(5.0, 0.3), brief(7.0, 0.4)];
    let bits = Bits {
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
    let colors = Harmonics { coefficients: 1, values: vec![0.0; gaussians.len() * 3], ..Harmonics::default() };
    let mut packed = PackedScene::encode(&gaussians, &bits, PackedColors::Whole(colors), [0.0; 2], 1.0);
    let pick = |packed: &PackedScene, time| {
        let scene = RuntimeScene { form: Form::Packed(packed.clone()), ..scene(&[]) };
        let settings = PickSettings { time, ..PickSettings::default() };
        scene.pick(Vec3::ZERO, Vec3::Z, &settings).map(|pick| pick.gaussian)
    };
    assert_eq!((pick(&packed, 0.3), pick(&packed, 0.9)), (Some(0), None), "present at its temporal mean, absent later");
    // A Gaussian cannot be decoded without the ranges of its block.
    packed.ranges.truncate(SHARED_RANGES);
    assert_eq!(pick(&packed, 0.9), None, "its temporal mean and deviation are enough to know that it is absent");
}

#[test]
fn flat_gaussians_are_hit() {
    let disc = still(Vec3::new(0.0, 0.0, 5.0), [0.04, 0.0, 0.0, 0.04, 0.0, 0.0], 0.9);
    assert_eq!(hit(&[disc]), Some((0, 5.0)), "face on");
    let scene = scene(&[disc]);
    let pick = |origin: Vec3, direction| scene.pick(origin, direction, &PickSettings::default());
    let slanted = pick(Vec3::new(-5.0, 0.0, 0.1), Vec3::new(1.0, 0.0, 1.0)).expect("at an angle");
    assert!((slanted.point.z - 5.0).abs() < 1e-4, "on the disc, not at {}", slanted.point);
    let edge = pick(Vec3::new(-3.0, 0.0, 5.0), Vec3::X).expect("exactly from its edge");
    assert!((edge.distance - 3.0).abs() < 1e-4, "at its middle, not at {}", edge.distance);
    assert_eq!(pick(Vec3::new(-3.0, 0.0, 5.002), Vec3::X), None, "a ray a hundredth of its width above misses");
    let needle = still(Vec3::new(0.0, 0.0, 5.0), [0.0, 0.0, 0.0, 0.0, 0.0, 0.04], 0.9);
    assert_eq!(hit(&[needle]), Some((0, 5.0)), "a needle, exactly from its tip");
    assert_eq!(hit(&[still(Vec3::new(0.0, 0.0, 5.0), [0.0; 6], 0.9)]), None, "a point has no extent");
}

#[test]
fn gaussians_with_an_invalid_covariance_or_mean_are_not_hit() {
    let good = ball(7.0, 0.9);
    for covariance in
        [[f32::NAN; 6], [f32::INFINITY; 6], [-0.01, 0.0, 0.0, -0.01, 0.0, -0.01], [0.01, 0.05, 0.0, 0.01, 0.0, 0.01]]
    {
        let bad = Gaussian { covariance, ..ball(5.0, 0.9) };
        assert_eq!(hit(&[bad, good]), Some((1, 7.0)), "{covariance:?} is skipped");
    }
    let nowhere = Gaussian { mean: [f32::NAN; 3], ..ball(5.0, 0.9) };
    assert_eq!(hit(&[nowhere, good]), Some((1, 7.0)), "a mean of NaN is skipped");
}

/// Returns ten Gaussians one behind the other, of about the same size on the screen, spread over it.
fn column() -> Vec<Gaussian> {
    (0..10)
        .map(|index| {
            let z = 3.0 * 1.25f32.powi(index);
            let (angle, radius) = (2.4 * index as f32, 0.13 * z);
            let mean = Vec3::new(radius * angle.cos(), 0.6 * radius * angle.sin(), z);
            let turn = if index % 2 == 1 { 1.0 } else { -1.0 };
            let covariance = [1.5, 0.3 * turn, 0.2, 1.0, -0.2 * turn, 0.8].map(|part: f32| part * (0.06 * z).powi(2));
            still(mean, covariance, 0.5 + 0.045 * index as f32)
        })
        .collect()
}

/// Returns whether a transmittance at the pixel is within 0.04 of one half; splats are in order of depth.
fn is_close(splats: &[Splat], x: u32, y: u32) -> bool {
    let mut transmittance = 1.0f32;
    splats.iter().filter(|splat| splat.is_visible()).any(|splat| {
        let offset = splat.center - Vec2::new(x as f32, y as f32);
        transmittance *= 1.0 - alpha_at(splat.conic, splat.opacity, offset).unwrap_or(0.0);
        (transmittance - 0.5).abs() < 0.04
    })
}

/// Splats are affine approximations and have a low-pass, so that their alphas differ from the alphas along the ray: for
/// this scene, transmittances are up to 0.032 apart. Pixels where a transmittance is within 0.04 of one half are not
/// compared; at all other pixels both must hit the same Gaussian. Depths are of different points (the mean of the
/// splat, the densest point).
#[test]
fn the_median_of_the_reference_render_is_hit() {
    let scene = scene(&column());
    let size = UVec2::new(48, 32);
    let camera = Camera { world_to_camera: Mat4::IDENTITY, size, lens: Camera::fov_lens(0.5, size) };
    let view = camera.view(0.5, RasterFov::Corrected);
    let layer = Layer { scene: &scene, view, appearance: Appearance::default() };
    let splats = reference::project(&layer, BlendSpace::Encoded);
    let medians = reference::render(&scene, &view, Background::None).median_depth;
    let pixels = (0..size.y).flat_map(|y| (0..size.x).map(move |x| (x, y)));
    let (mut compared, mut hits) = (0, 0);
    for ((x, y), median) in pixels.zip(medians).filter(|&((x, y), _)| !is_close(&splats, x, y)) {
        let settings = PickSettings { time: 0.5, ..PickSettings::default() };
        let pick = scene.pick(view.camera_position, view.ray(x, y), &settings);
        let expected = splats.iter().position(|splat| splat.depth == median);
        assert_eq!(pick.map(|pick| pick.gaussian), expected, "at pixel {x}, {y}");
        if let Some(pick) = pick {
            let apart = (pick.point.z - median).abs() / median;
            assert!(apart < 0.05, "at pixel {x}, {y} the depth {} is about {median}", pick.point.z);
            hits += 1;
        }
        compared += 1;
    }
    assert!(compared > 900 && hits > 400, "{compared} pixels are compared, {hits} of them hit a Gaussian");
}
