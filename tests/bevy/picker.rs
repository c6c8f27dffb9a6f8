//! The picker in Bevy apps: rays in world space against captures that are placed, played, cropped and hidden.
//!
//! In: small scenes made by hand. Out: proof that a ray hits the visible Gaussians at their visible positions. Needs
//! neither a GPU nor a window. `tests/core/pick.rs` and `scene::pick` test rays against the Gaussians themselves.

use crate::support::gray::scene;
use bevy::ecs::system::RunSystemOnce;
use bevy::prelude::*;
use bevy_gs4d::asset::GaussianCapture;
use bevy_gs4d::gaussian::Gaussian;
use bevy_gs4d::picker::{CaptureHit, CapturePicker};
use bevy_gs4d::playback::{ClipFade, Playback};
use bevy_gs4d::render::{CaptureSettings, CropBox};
use bevy_gs4d::scene::{FilterKind, RuntimeScene, TemporalFilter};
use bevy_gs4d::{GaussianCapture3d, GaussianCapturePlugins};
use std::f32::consts::FRAC_PI_2;

/// Returns a round Gaussian at `mean` with a standard deviation of 0.1.
fn ball(mean: Vec3, opacity: f32) -> Gaussian {
    Gaussian {
        mean: mean.to_array(),
        mean_t: 0.0,
        velocity: [0.0; 3],
        sigma_t: f32::INFINITY,
        covariance: [0.01, 0.0, 0.0, 0.01, 0.0, 0.01],
        opacity,
        padding: 0.0,
    }
}

fn app() -> App {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, AssetPlugin::default(), GaussianCapturePlugins));
    app
}

/// Spawns a capture with a transform, paused at its start. The app has no plugins for transforms and visibility, so
/// both are set here.
fn place(app: &mut App, scene: RuntimeScene, transform: Transform) -> Entity {
    let handle = app.world_mut().resource_mut::<Assets<GaussianCapture>>().add(GaussianCapture::new(scene));
    let seen = (GlobalTransform::from(transform), InheritedVisibility::VISIBLE);
    app.world_mut().spawn((GaussianCapture3d(handle), Playback::paused_at(0.0), transform, seen)).id()
}

fn cast(app: &mut App, ray: Ray3d) -> Option<CaptureHit> {
    app.world_mut()
        .run_system_once(move |picker: CapturePicker| picker.cast(ray))
        .expect("the app has the picker's resources")
}

fn cast_on(app: &mut App, entity: Entity, ray: Ray3d) -> Option<CaptureHit> {
    let system = move |picker: CapturePicker| picker.cast_on(entity, ray);
    app.world_mut().run_system_once(system).expect("the app has the picker's resources")
}

/// Returns a ray from +5 on the z axis towards the origin.
fn ahead() -> Ray3d {
    Ray3d::new(Vec3::new(0.0, 0.0, 5.0), Dir3::NEG_Z)
}

/// Returns the index of the Gaussian that [`ahead`] hits; `None` if it hits none.
fn hit(app: &mut App) -> Option<usize> {
    cast(app, ahead()).map(|hit| hit.gaussian)
}

fn set(app: &mut App, entity: Entity, settings: CaptureSettings) {
    app.world_mut().entity_mut(entity).insert(settings);
}

#[test]
fn hits_are_in_world_space_for_every_transform() {
    let mean = Vec3::new(0.5, -0.2, 0.3);
    let transforms = [
        Transform::IDENTITY,
        Transform::from_xyz(1.0, 2.0, 3.0).with_rotation(Quat::from_rotation_y(FRAC_PI_2)),
        Transform::from_xyz(-4.0, 0.0, 1.0)
            .with_rotation(Quat::from_euler(EulerRot::XYZ, 0.3, -1.1, 2.0))
            .with_scale(Vec3::new(2.0, 0.5, 30.0)),
        Transform::from_scale(Vec3::new(-0.01, 0.02, 0.01)),
    ];
    for transform in transforms {
        let mut app = app();
        let entity = place(&mut app, scene(&[ball(mean, 0.9)]), transform);
        let target = transform.transform_point(mean);
        for direction in [Dir3::X, Dir3::NEG_Y, Dir3::Z] {
            let ray = Ray3d::new(target - *direction * 7.0, direction);
            let hit = cast(&mut app, ray).expect("a ray through the center hits");
            assert_eq!((hit.entity, hit.gaussian), (entity, 0), "entity and Gaussian of the hit, {transform:?}");
            assert!((hit.distance - 7.0).abs() < 1e-3, "the distance is 7, not {}, {transform:?}", hit.distance);
            assert!(hit.point.distance(target) < 1e-3, "the point is {target}, not {}, {transform:?}", hit.point);
            let back = Ray3d::new(target + *direction * 7.0, direction);
            assert_eq!(cast(&mut app, back), None, "a capture behind the ray's origin is not hit, {transform:?}");
        }
    }
}

#[test]
fn the_nearest_visible_capture_is_hit() {
    let mut app = app();
    let front = place(&mut app, scene(&[ball(Vec3::ZERO, 0.9)]), Transform::from_xyz(0.0, 0.0, 2.0));
    let back = place(&mut app, scene(&[ball(Vec3::ZERO, 0.9)]), Transform::from_xyz(0.0, 0.0, -2.0));
    let middle = place(&mut app, scene(&[ball(Vec3::ZERO, 0.9)]), Transform::IDENTITY);
    let entity = |app: &mut App| cast(app, ahead()).map(|hit| hit.entity);
    assert_eq!(entity(&mut app), Some(front), "the nearest capture is hit");
    app.world_mut().entity_mut(front).insert(InheritedVisibility::HIDDEN);
    assert_eq!(entity(&mut app), Some(middle), "the ray passes through a hidden capture");
    let on = [front, back].map(|entity| cast_on(&mut app, entity, ahead()).map(|hit| hit.distance));
    assert_eq!(on, [Some(3.0), Some(7.0)], "cast_on hits one capture, hidden or not");
    let bystander = app.world_mut().spawn_empty().id();
    assert_eq!(cast_on(&mut app, bystander, ahead()), None, "an entity without a capture is not hit");
}

#[test]
fn hits_follow_the_time_of_playback() {
    let mut app = app();
    let mover = Gaussian { velocity: [0.0, 0.0, 4.0], ..ball(Vec3::ZERO, 0.9) };
    let entity = place(&mut app, scene(&[mover]), Transform::IDENTITY);
    for (seconds, distance) in [(0.0, 5.0), (0.5, 3.0), (1.0, 1.0), (9.0, 1.0)] {
        app.world_mut().entity_mut(entity).insert(Playback::paused_at(seconds));
        let hit = cast(&mut app, ahead()).map(|hit| hit.distance);
        assert_eq!(
            hit,
            Some(distance),
            "the distance at {seconds} s; past the end the Gaussian is at its last position"
        );
    }
}

#[test]
fn filter_opacity_fade_and_crop_apply_to_rays() {
    let mut app = app();
    let pair = [ball(Vec3::Z, 0.9), ball(Vec3::NEG_Z, 0.9)];
    // In the second half of the time only the farther Gaussian is active.
    let filter = TemporalFilter::from_bits(FilterKind::Support, 2, 2, vec![0b11, 0b10]);
    let entity = place(&mut app, RuntimeScene { filter: Some(filter), ..scene(&pair) }, Transform::IDENTITY);
    assert_eq!(hit(&mut app), Some(0), "the nearer Gaussian is hit");
    app.world_mut().entity_mut(entity).insert(Playback::paused_at(0.75));
    assert_eq!(hit(&mut app), Some(1), "the filter excludes the nearer Gaussian");
    set(&mut app, entity, CaptureSettings { filter: false, ..default() });
    assert_eq!(hit(&mut app), Some(0), "without the filter the nearer Gaussian is hit");
    set(&mut app, entity, CaptureSettings { filter: false, opacity: 0.5, ..default() });
    assert_eq!(hit(&mut app), Some(1), "at half opacity the nearer Gaussian absorbs less than half of the light");
    app.world_mut().entity_mut(entity).insert(ClipFade(0.5));
    assert_eq!(hit(&mut app), None, "faded, both Gaussians absorb less than half of the light");
    let crop = CropBox { center: Vec3::NEG_Z, half_size: Vec3::splat(0.5), rotation: Quat::IDENTITY };
    set(&mut app, entity, CaptureSettings { filter: false, crop: Some(crop), ..default() });
    app.world_mut().entity_mut(entity).remove::<ClipFade>();
    assert_eq!(hit(&mut app), Some(1), "the crop excludes the nearer Gaussian");
}

#[test]
fn gaussians_that_add_up_beyond_three_standard_deviations_are_hit() {
    let mut app = app();
    place(&mut app, scene(&[ball(Vec3::ZERO, 1.0); 200]), Transform::IDENTITY);
    // Each has an alpha of exp(-3.2² / 2) = 0.006: 116 of them absorb half of the light.
    let at_distance = |app: &mut App, deviations: f32| {
        cast(app, Ray3d::new(Vec3::new(0.1 * deviations, 0.0, 5.0), Dir3::NEG_Z)).map(|hit| hit.gaussian)
    };
    assert_eq!(at_distance(&mut app, 3.2), Some(115), "the 116th Gaussian is hit");
    assert_eq!(at_distance(&mut app, 3.4), None, "alphas below 1/255 do not add up");
}

#[test]
fn flat_empty_and_unloaded_captures_are_not_hit() {
    let mut app = app();
    let flat = place(&mut app, scene(&[ball(Vec3::ZERO, 0.9)]), Transform::from_scale(Vec3::ZERO));
    assert_eq!(cast_on(&mut app, flat, ahead()), None, "a capture with scale 0 is not hit");
    let empty = place(&mut app, scene(&[]), Transform::IDENTITY);
    assert_eq!(cast_on(&mut app, empty, ahead()), None, "an empty capture is not hit");
    let unloaded = app.world_mut().spawn((GaussianCapture3d::default(), InheritedVisibility::VISIBLE)).id();
    assert_eq!(cast_on(&mut app, unloaded, ahead()), None, "an unloaded capture is not hit");
    assert_eq!(hit(&mut app), None, "none of the captures is hit");
}
