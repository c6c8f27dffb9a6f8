//! Shadows that captures cast on a floor, compared to shadows of meshes with the same outline.
//!
//! In: a ball of opaque Gaussians, a mesh of the same size, lights of all kinds, in headless apps. Out: proof that both
//! darken the same pixels, that shadows follow the capture's time and end with the capture, that only captures with the
//! component, and without Bevy's `NotShadowCaster`, cast shadows, whether a camera sees them or not, and that a contact
//! shadow darkens only the ground beneath its capture. Skipped without a GPU; a software driver is enough.

use crate::support::blob::blob;
use crate::support::cpu_reference::{DURATION, difference_between, rgb, scene};
use crate::support::fixtures::{insert, spawn};
use crate::support::offscreen_app::{FOV_Y, app, picture, spawn_camera};
use bevy::camera::Hdr;
use bevy::camera::visibility::{RenderLayers, ViewVisibility, VisibilityRange};
use bevy::light::{CascadeShadowConfigBuilder, DirectionalLightShadowMap, NotShadowCaster, PointLightShadowMap};
use bevy::prelude::*;
use bevy_gs4d::GaussianCapture3d;
use bevy_gs4d::asset::CaptureState;
use bevy_gs4d::gaussian::Gaussian;
use bevy_gs4d::pbr::{CaptureContactShadow, CastsShadows, ShadowResolution};
use bevy_gs4d::playback::Playback;
use bevy_gs4d::render::CaptureSettings;
use bevy_gs4d::scene::{FilterKind, RuntimeScene, TemporalFilter};
use image::RgbaImage;
use std::f32::consts::PI;

const SIZE: UVec2 = UVec2::splat(160);
/// Radius of the balls, in their own units.
const RADIUS: f32 = 0.5;
/// The layer of objects that cast shadows but are not drawn by the camera.
const UNSEEN: usize = 1;

/// Returns an opaque ball with a radius of [`RADIUS`] to a few hundredths, which moves by `velocity` over its duration.
fn ball(velocity: Vec3) -> RuntimeScene {
    let count = 2000;
    let gaussian = |index: u32| {
        // A spiral of evenly spaced points. Half of the light is absorbed slightly outside the points.
        let z = 1.0 - 2.0 * (index as f32 + 0.5) / count as f32;
        let angle = PI * (3.0 - 5f32.sqrt()) * index as f32;
        let place = (Vec2::from_angle(angle) * (1.0 - z * z).sqrt()).extend(z) * (0.9 * RADIUS);
        let gaussian = Gaussian { velocity: velocity.to_array(), ..blob(place, Vec3::splat(0.018), 0.98) };
        (gaussian, Vec3::splat(0.5))
    };
    scene(&(0..count).map(gaussian).collect::<Vec<_>>())
}

/// Returns an app with a floor, a camera above it, and a light.
fn scenery(camera: Transform, light: impl Bundle) -> Option<App> {
    let mut app = app(SIZE)?;
    app.insert_resource(DirectionalLightShadowMap { size: 512 });
    app.insert_resource(PointLightShadowMap { size: 256 });
    let floor = app.world_mut().resource_mut::<Assets<Mesh>>().add(Plane3d::new(Vec3::Y, Vec2::splat(6.0)));
    let gray = StandardMaterial { base_color: Color::linear_rgb(0.1, 0.1, 0.1), reflectance: 0.0, ..default() };
    let gray = app.world_mut().resource_mut::<Assets<StandardMaterial>>().add(gray);
    app.world_mut().spawn((Mesh3d(floor), MeshMaterial3d(gray)));
    spawn_camera(&mut app, Msaa::Off, camera);
    app.world_mut().spawn((light, RenderLayers::from_layers(&[0, UNSEEN])));
    Some(app)
}

fn spawn_mesh_ball(app: &mut App, bundle: impl Bundle) -> Entity {
    let mesh = Sphere::new(RADIUS).mesh().uv(48, 32);
    let mesh = app.world_mut().resource_mut::<Assets<Mesh>>().add(mesh);
    let material = app.world_mut().resource_mut::<Assets<StandardMaterial>>().add(StandardMaterial::default());
    app.world_mut().spawn((Mesh3d(mesh), MeshMaterial3d(material), bundle)).id()
}

fn above(height: f32) -> Transform {
    Transform::from_xyz(0.0, height, 0.0).looking_at(Vec3::ZERO, Vec3::NEG_Z)
}

/// Returns a directional light along `direction`.
fn sun(direction: Vec3) -> impl Bundle {
    // One cascade for the distances of these tests.
    let cascades = CascadeShadowConfigBuilder { num_cascades: 1, maximum_distance: 7.0, ..default() }.build();
    let light = DirectionalLight { shadow_maps_enabled: true, ..default() };
    (light, cascades, Transform::default().looking_to(direction, Vec3::Y))
}

fn lamp(place: Vec3) -> impl Bundle {
    (PointLight { shadow_maps_enabled: true, ..default() }, Transform::from_translation(place))
}

fn spot(place: Vec3) -> impl Bundle {
    let pose = Transform::from_translation(place).looking_at(Vec3::new(0.2, 0.0, -0.1), Vec3::Y);
    (SpotLight { shadow_maps_enabled: true, ..default() }, pose)
}

/// Returns a mask of the pixels that are lit in the first picture and much darker in the second.
fn darkened(lit: &RgbaImage, shaded: &RgbaImage) -> Vec<bool> {
    let is_darker = |(lit, shaded): (&image::Rgba<u8>, &image::Rgba<u8>)| {
        let [lit, shaded] = [lit, shaded].map(|pixel| u32::from(pixel.0[1]));
        lit > 40 && 10 * shaded < 6 * lit
    };
    lit.pixels().zip(shaded.pixels()).map(is_darker).collect()
}

fn count(mask: &[bool]) -> usize {
    mask.iter().filter(|pixel| **pixel).count()
}

/// Returns the intersection over union of two masks.
fn overlap(a: &[bool], b: &[bool]) -> f32 {
    let pairs = || a.iter().zip(b);
    let both = pairs().filter(|(a, b)| **a && **b).count();
    let either = pairs().filter(|(a, b)| **a || **b).count();
    both as f32 / either.max(1) as f32
}

/// Returns the mean position of the pixels of a mask.
fn middle(mask: &[bool]) -> Vec2 {
    let places = mask.iter().enumerate().filter(|(_, pixel)| **pixel);
    let sum: Vec2 = places.map(|(at, _)| Vec2::new((at as u32 % SIZE.x) as f32, (at as u32 / SIZE.x) as f32)).sum();
    sum / count(mask).max(1) as f32
}

/// Checks that captures at these places darken the same pixels as meshes at these places.
fn check_shadows(name: &str, app: &mut App, places: &[Transform], layer: usize, least: f32) {
    let lit = picture(app, 0.0);
    let layer = RenderLayers::layer(layer);
    let meshes: Vec<_> = places.iter().map(|place| spawn_mesh_ball(app, (*place, layer.clone()))).collect();
    let expected = darkened(&lit, &picture(app, 0.0));
    assert!(
        count(&expected) > 300,
        "{name}: the shadows of meshes cover more than 300 pixels, not {}",
        count(&expected)
    );
    assert!(count(&expected) < expected.len() / 2, "{name}: the shadows of meshes cover less than half of the picture");
    for mesh in meshes {
        app.world_mut().despawn(mesh);
    }
    let scene = ball(Vec3::ZERO);
    for place in places {
        spawn(app, &scene, (*place, layer.clone(), CastsShadows::default()));
    }
    let shadow = darkened(&lit, &picture(app, 0.0));
    let fraction = overlap(&shadow, &expected);
    assert!(fraction >= least, "{name}: the overlap of the shadows of captures and meshes is {fraction}, not {least}");
}

#[test]
fn captures_cast_the_same_shadows_as_meshes_with_their_outline() {
    let place = [Transform::from_xyz(0.1, 1.0, -0.2)];
    let Some(mut app) = scenery(above(5.0), sun(Vec3::new(-0.3, -1.0, 0.2))) else { return };
    check_shadows("sun", &mut app, &place, UNSEEN, 0.9);
    let Some(mut app) = scenery(above(5.0), lamp(Vec3::new(0.5, 3.0, 0.3))) else { return };
    check_shadows("point light", &mut app, &place, UNSEEN, 0.9);
    let Some(mut app) = scenery(above(5.0), spot(Vec3::new(0.6, 3.0, 0.8))) else { return };
    check_shadows("spot light", &mut app, &place, UNSEEN, 0.9);
}

#[test]
fn a_point_light_casts_shadows_to_all_sides() {
    let Some(mut app) = scenery(above(10.0), lamp(Vec3::Y * 1.5)) else { return };
    // None of the places is at the center of a cube face.
    let places = [(1.2, 0.2), (-0.3, 1.2), (-1.2, -0.25), (0.15, -1.2)];
    let place = |(x, z)| Transform::from_xyz(x, 0.9, z).with_scale(Vec3::splat(0.5));
    // These shadows are small, so their edges reduce the overlap.
    check_shadows("four sides", &mut app, &places.map(place), UNSEEN, 0.8);
}

#[test]
fn a_capture_behind_the_camera_casts_its_shadow() {
    // Above the camera, in front of the near plane of the sun's cascade.
    let Some(mut app) = scenery(above(2.5), sun(Vec3::new(-0.3, -1.0, 0.2))) else { return };
    check_shadows("behind", &mut app, &[Transform::from_xyz(1.2, 4.0, -0.8)], 0, 0.9);
    let mut captures = app.world_mut().query_filtered::<&ViewVisibility, With<CastsShadows>>();
    assert!(captures.iter(app.world()).all(|visibility| !visibility.get()), "no camera sees the capture");
}

#[test]
fn a_shadow_follows_the_time_and_visibility_of_its_capture() {
    let Some(mut app) = scenery(above(5.0), sun(Vec3::NEG_Y)) else { return };
    let lit = picture(&mut app, 0.0);
    let unseen = RenderLayers::layer(UNSEEN);
    let place = Transform::from_xyz(0.0, 1.0, 0.0);
    let capture = spawn(&mut app, &ball(Vec3::X), (place, unseen, CastsShadows::default()));
    let shadow = |app: &mut App, seconds| {
        insert(app, capture, Playback::paused_at(seconds));
        darkened(&lit, &picture(app, 0.0))
    };
    let [start, end] = [0.0, DURATION].map(|seconds| shadow(&mut app, seconds));
    assert!(
        count(&start) > 300 && count(&end) > 300,
        "shadows at start and end cover {} and {} pixels",
        count(&start),
        count(&end)
    );
    let moved = middle(&end) - middle(&start);
    // The size of one unit on the floor, in pixels.
    let unit = SIZE.y as f32 / (2.0 * 5.0 * (FOV_Y / 2.0).tan());
    assert!((moved - Vec2::new(unit, 0.0)).length() < 3.0, "the shadow moves by {moved}, not by {unit} to the right");
    insert(&mut app, capture, CaptureSettings { opacity: 0.0, ..default() });
    assert_eq!(count(&shadow(&mut app, 0.0)), 0, "a transparent capture casts no shadow");
    insert(&mut app, capture, CaptureSettings::default());
    insert(&mut app, capture, Visibility::Hidden);
    assert_eq!(count(&shadow(&mut app, 0.0)), 0, "a hidden capture casts no shadow");
    insert(&mut app, capture, Visibility::Inherited);
    assert!(count(&shadow(&mut app, 0.0)) > 300, "a capture that is shown again casts a shadow");
    app.world_mut().despawn(capture);
    assert_eq!(count(&darkened(&lit, &picture(&mut app, 0.0))), 0, "a despawned capture casts no shadow");
}

#[test]
fn only_captures_with_the_component_cast_shadows_on_layers_of_the_light() {
    let Some(mut app) = scenery(above(5.0), sun(Vec3::NEG_Y)) else { return };
    let lit = picture(&mut app, 0.0);
    let place = Transform::from_xyz(0.0, 1.0, 0.0);
    let capture = spawn(&mut app, &ball(Vec3::ZERO), (place, RenderLayers::layer(UNSEEN)));
    let seen = |app: &mut App| count(&darkened(&lit, &picture(app, 0.0)));
    assert_eq!(seen(&mut app), 0, "no shadow without the component");
    let sharp = CastsShadows { resolution: ShadowResolution::Full, ..default() };
    insert(&mut app, capture, sharp);
    let full = seen(&mut app);
    assert!(full > 300, "a shadow with the component");
    insert(&mut app, capture, CastsShadows { resolution: ShadowResolution::Quarter, ..sharp });
    let quarter = seen(&mut app);
    let ratio = quarter as f32 / full as f32;
    // Every splat grows by half of a coarse pixel, which is 0.07 units wide.
    assert!(
        (0.9..1.6).contains(&ratio),
        "the shadow at a quarter of the resolution has a similar size: {quarter} and {full} pixels"
    );
    insert(&mut app, capture, RenderLayers::layer(7));
    assert_eq!(seen(&mut app), 0, "no shadow on a layer that the light does not have");
    insert(&mut app, capture, RenderLayers::layer(UNSEEN));
    app.world_mut().entity_mut(capture).remove::<CastsShadows>();
    assert_eq!(seen(&mut app), 0, "no shadow after the component is removed");
}

#[test]
fn a_capture_with_not_shadow_caster_or_out_of_range_casts_no_shadow() {
    for (name, light) in [("sun", 0), ("point light", 1), ("spot light", 2)] {
        let app = match light {
            0 => scenery(above(5.0), sun(Vec3::NEG_Y)),
            1 => scenery(above(5.0), lamp(Vec3::Y * 3.0)),
            _ => scenery(above(5.0), spot(Vec3::Y * 3.0)),
        };
        let Some(mut app) = app else { return };
        let lit = picture(&mut app, 0.0);
        let place = Transform::from_xyz(0.0, 1.0, 0.0);
        let layer = RenderLayers::layer(UNSEEN);
        let capture = spawn(&mut app, &ball(Vec3::ZERO), (place, layer, CastsShadows::default(), NotShadowCaster));
        let seen = |app: &mut App| count(&darkened(&lit, &picture(app, 0.0)));
        assert_eq!(seen(&mut app), 0, "{name}: no shadow with NotShadowCaster");
        app.world_mut().entity_mut(capture).remove::<NotShadowCaster>();
        let without = seen(&mut app);
        assert!(without > 300, "{name}: {without} pixels of shadow after the component is removed");
        insert(&mut app, capture, NotShadowCaster);
        assert_eq!(seen(&mut app), 0, "{name}: no shadow after the component is inserted again");
        app.world_mut().entity_mut(capture).remove::<NotShadowCaster>();
        insert(&mut app, capture, VisibilityRange::abrupt(0.0, 2.0));
        assert_eq!(seen(&mut app), 0, "{name}: no shadow out of range of the camera");
    }
}

/// Returns the pixel of a point in a camera's picture.
fn pixel_of(camera: &Transform, point: Vec3) -> UVec2 {
    let seen = camera.to_matrix().inverse().transform_point3(point);
    let place = Vec2::new(seen.x, -seen.y) / (-seen.z * (FOV_Y / 2.0).tan());
    ((place * 0.5 + 0.5) * SIZE.as_vec2()).as_uvec2()
}

#[test]
fn a_contact_shadow_darkens_only_the_ground_beneath_its_capture() {
    let camera = Transform::from_xyz(0.0, 1.2, 4.0).looking_at(Vec3::Y * 0.2, Vec3::Y);
    let Some(mut app) = scenery(camera, sun(Vec3::NEG_Y)) else { return };
    // The ball stands on the ground.
    let capture = spawn(&mut app, &ball(Vec3::ZERO), Transform::from_xyz(0.0, RADIUS, 0.0));
    let without = picture(&mut app, 0.0);
    insert(&mut app, capture, CaptureContactShadow { strength: 1.0, ..default() });
    let with = picture(&mut app, 0.0);
    let green = |picture: &RgbaImage, point| {
        let at = pixel_of(&camera, point);
        i32::from(rgb(picture, at.x, at.y)[1])
    };
    let both = |point| [green(&without, point), green(&with, point)];
    let [before, after] = both(Vec3::new(0.0, 0.0, 0.52));
    assert!(
        before > 60 && 10 * after < 9 * before,
        "the floor in front of the ball is darkened: from {before} to {after}"
    );
    for place in [Vec3::new(1.1, 0.0, 0.0), Vec3::new(-1.1, 0.0, 0.5), Vec3::new(0.0, 0.0, 1.3)] {
        let [before, after] = both(place);
        assert!(before > 60 && (before - after).abs() <= 1, "the floor at {place} is unchanged: {before} and {after}");
    }
    // On the ball, in front of the darkest part of the floor.
    let [before, after] = both(Vec3::new(0.0, 0.15, 0.27));
    assert!(before > 60 && (before - after).abs() <= 6, "the capture itself is not darkened: {before} and {after}");

    insert(&mut app, capture, Transform::from_xyz(0.0, 9.0, 0.0));
    let away = picture(&mut app, 0.0);
    assert!(
        (green(&away, Vec3::Z * 0.52) - green(&without, Vec3::Z * 0.52)).abs() <= 1,
        "a capture far above the ground has no contact shadow"
    );
    insert(&mut app, capture, Transform::from_xyz(0.0, RADIUS, 0.0));
    assert_eq!(
        difference_between(&picture(&mut app, 0.0), &with),
        0,
        "the contact shadow returns with the capture on the ground"
    );
    app.world_mut().entity_mut(capture).remove::<CaptureContactShadow>();
    assert_eq!(
        difference_between(&picture(&mut app, 0.0), &without),
        0,
        "no contact shadow after the component is removed"
    );
}

#[test]
fn only_a_capture_that_is_drawn_has_a_contact_shadow() {
    let Some(mut app) = scenery(above(5.0), sun(Vec3::NEG_Y)) else { return };
    let lit = picture(&mut app, 0.0);
    let place = Transform::from_xyz(0.0, RADIUS, 0.0);
    // The filter belongs to a smaller scene.
    let filter = TemporalFilter::from_bits(FilterKind::Support, 1, 2, vec![0b11]);
    let refused = RuntimeScene { filter: Some(filter), ..ball(Vec3::ZERO) };
    let refused = spawn(&mut app, &refused, (place, CaptureContactShadow { strength: 1.0, ..default() }));
    let seen = picture(&mut app, 0.0);
    let state = app.world().get::<CaptureState>(refused).expect("a required component");
    assert!(matches!(state, CaptureState::Failed(_)), "the invalid capture has failed: {state:?}");
    assert_eq!(difference_between(&seen, &lit), 0, "a failed capture has no contact shadow");
    app.world_mut().despawn(refused);

    let shadow = CaptureContactShadow { strength: 1.0, ..default() };
    let capture = spawn(&mut app, &ball(Vec3::ZERO), (place, shadow));
    let seen = picture(&mut app, 0.0);
    // Next to the ball, which hides the center of the shadow.
    let ground = pixel_of(&above(5.0), Vec3::X * 0.6);
    let [lit_ground, dark_ground] = [&lit, &seen].map(|picture| rgb(picture, ground.x, ground.y)[1]);
    assert!(dark_ground + 10 < lit_ground, "the ground is darkened: from {lit_ground} to {dark_ground}");
    app.world_mut().entity_mut(capture).remove::<GaussianCapture3d>();
    assert_eq!(difference_between(&picture(&mut app, 0.0), &lit), 0, "no contact shadow without the capture");
}

#[test]
fn every_camera_draws_the_same_contact_shadow() {
    let fog = |camera: &mut EntityWorldMut, density| {
        let falloff = FogFalloff::Exponential { density };
        camera.insert(DistanceFog { color: Color::BLACK, falloff, ..default() });
    };
    let four_samples = |camera: &mut EntityWorldMut| {
        camera.insert(Msaa::Sample4);
    };
    let high_range = |camera: &mut EntityWorldMut| {
        camera.insert(Hdr);
    };
    // The brightness of the ground relative to the unshadowed ground, in 255ths.
    let shown = |adjust: &dyn Fn(&mut EntityWorldMut), layer: usize| {
        let mut app = scenery(above(5.0), sun(Vec3::NEG_Y))?;
        let camera = app.world_mut().query_filtered::<Entity, With<Camera3d>>().single(app.world()).expect("one");
        adjust(&mut app.world_mut().entity_mut(camera));
        let place = Transform::from_xyz(0.0, RADIUS, 0.0);
        let capture = spawn(&mut app, &ball(Vec3::ZERO), (place, RenderLayers::layer(layer)));
        let ground = pixel_of(&above(5.0), Vec3::X * 0.6);
        let [before, after] = [false, true].map(|shadow| {
            if shadow {
                insert(&mut app, capture, CaptureContactShadow { strength: 1.0, ..default() });
            }
            f32::from(rgb(&picture(&mut app, 0.0), ground.x, ground.y)[1])
        });
        Some(after * 255.0 / before)
    };
    let Some(plain) = shown(&|_| {}, 0) else { return };
    assert!((20.0..225.0).contains(&plain), "next to the ball the ground has {plain} / 255 of its light");
    let same: [(&str, &dyn Fn(&mut EntityWorldMut)); 3] = [
        ("four samples", &four_samples),
        ("high dynamic range", &high_range),
        ("clear air", &|camera| fog(camera, 0.0)),
    ];
    for (name, adjust) in same {
        let Some(other) = shown(adjust, 0) else { return };
        assert!((other - plain).abs() < 3.0, "{name}: {other} / 255 of the light, not {plain}");
    }
    let Some(foggy) = shown(&|camera| fog(camera, 0.2), 0) else { return };
    assert!(
        plain + 10.0 < foggy && foggy < 250.0,
        "fog weakens the contact shadow: {foggy} / 255 of the light, {plain} without fog"
    );
    assert_eq!(shown(&|_| {}, UNSEEN), Some(255.0), "a camera without the capture's layer draws no contact shadow");
}
