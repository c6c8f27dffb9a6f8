//! Captures that cast shadows and receive them: the shadow of a capture on itself.
//!
//! In: a ball and a wall of coarse Gaussians, made by hand, and lights of all kinds, in headless apps. Out: proof that
//! surfaces towards a light look as without their own shadow, and that one part of a capture shadows another. Skipped
//! without a GPU; a software driver is enough.

use crate::support::blob::blob;
use crate::support::cpu_reference::{color, scene};
use crate::support::fixtures::{insert, spawn};
use crate::support::offscreen_app::{FOV_Y, app, picture, spawn_camera};
use bevy::light::{CascadeShadowConfigBuilder, DirectionalLightShadowMap, PointLightShadowMap};
use bevy::prelude::*;
use bevy_gs4d::gaussian::Gaussian;
use bevy_gs4d::pbr::{CastsShadows, ReceivesShadows, ShadowResolution};
use bevy_gs4d::scene::RuntimeScene;
use bevy_gs4d::view::srgb::{decode, encode};
use image::RgbaImage;
use std::f32::consts::PI;

const SIZE: UVec2 = UVec2::splat(160);
/// Distance of the camera from the origin, along z.
const DISTANCE: f32 = 4.0;
/// The linear color factor in full shadow.
const TINT: f32 = 0.3;
/// Position of the lights.
const LIGHT: Vec3 = Vec3::new(-2.4, 1.2, 4.0);
const COLOR: Vec3 = Vec3::new(0.8, 0.7, 0.6);

/// Returns Gaussians on a sphere.
fn ball(center: Vec3, radius: f32, count: u32, extent: f32) -> Vec<(Gaussian, Vec3)> {
    let gaussian = |index: u32| {
        // A spiral of evenly spaced points.
        let z = 1.0 - 2.0 * (index as f32 + 0.5) / count as f32;
        let angle = PI * (3.0 - 5f32.sqrt()) * index as f32;
        let place = (Vec2::from_angle(angle) * (1.0 - z * z).sqrt()).extend(z) * radius;
        (blob(center + place, Vec3::splat(extent), 0.9), COLOR)
    };
    (0..count).map(gaussian).collect()
}

/// Returns a wall through the origin towards the camera, two units wide and high, of flat Gaussians in uneven depths.
fn wall() -> Vec<(Gaussian, Vec3)> {
    let gaussian = |index: i32| {
        let (column, row) = (index % 11 - 5, index / 11 - 5);
        let depth = 0.04 * (2.4 * index as f32).sin();
        let place = Vec3::new(0.2 * column as f32, 0.2 * row as f32, depth);
        (blob(place, Vec3::new(0.15, 0.15, 0.02), 0.95), COLOR)
    };
    (0..121).map(gaussian).collect()
}

/// Calls `check` with the name of each kind of light, and the pictures of a capture without and with its own shadow.
fn for_each_light(capture: &RuntimeScene, check: impl Fn(&str, &RgbaImage, &RgbaImage)) {
    let place = Transform::from_translation(LIGHT).looking_at(Vec3::ZERO, Vec3::Y);
    let sun = DirectionalLight { shadow_maps_enabled: true, ..default() };
    let cascades = CascadeShadowConfigBuilder { num_cascades: 1, maximum_distance: 8.0, ..default() }.build();
    let lamp = PointLight { shadow_maps_enabled: true, range: 30.0, ..default() };
    let spot = SpotLight { shadow_maps_enabled: true, range: 30.0, outer_angle: 0.7, inner_angle: 0.6, ..default() };
    let Some(mut app) = app(SIZE) else { return };
    app.insert_resource(DirectionalLightShadowMap { size: 512 }).insert_resource(PointLightShadowMap { size: 512 });
    let receives = ReceivesShadows { tint: LinearRgba::rgb(TINT, TINT, TINT), ..default() };
    let capture = spawn(&mut app, capture, receives);
    spawn_camera(&mut app, Msaa::Off, Transform::from_xyz(0.0, 0.0, DISTANCE));
    let lights = [
        ("sun", app.world_mut().spawn((sun, cascades, place, Visibility::Hidden)).id()),
        ("point light", app.world_mut().spawn((lamp, place, Visibility::Hidden)).id()),
        ("spot light", app.world_mut().spawn((spot, place, Visibility::Hidden)).id()),
    ];
    for (name, light) in lights {
        insert(&mut app, light, Visibility::Inherited);
        app.world_mut().entity_mut(capture).remove::<CastsShadows>();
        let without = picture(&mut app, 0.0);
        for resolution in [ShadowResolution::Full, ShadowResolution::Quarter] {
            insert(&mut app, capture, CastsShadows { resolution, ..default() });
            check(&format!("{name}, {resolution:?}"), &without, &picture(&mut app, 0.0));
        }
        insert(&mut app, light, Visibility::Hidden);
    }
}

/// Returns the largest difference, in 255ths, of the pixels whose camera ray is in `region`: the ray's point in the
/// plane z = 0.
fn largest_difference(a: &RgbaImage, b: &RgbaImage, region: impl Fn(Vec2) -> bool) -> f32 {
    let scale = DISTANCE * (FOV_Y / 2.0).tan();
    let mut largest = 0.0f32;
    let mut pixels = 0;
    for (x, y) in (0..SIZE.y).flat_map(|y| (0..SIZE.x).map(move |x| (x, y))) {
        let place = (Vec2::new(x as f32, y as f32) + 0.5) / SIZE.as_vec2() * 2.0 - 1.0;
        if region(place * Vec2::new(scale, -scale)) {
            largest = largest.max((color(a, x, y) - color(b, x, y)).abs().max_element());
            pixels += 1;
        }
    }
    assert!(pixels > 500, "the region has pixels: {pixels}");
    largest
}

#[test]
fn a_ball_of_coarse_gaussians_is_not_shadowed_on_its_lit_side() {
    let radius = 0.5;
    let ball = scene(&ball(Vec3::ZERO, radius, 150, 0.08));
    let eye = Vec3::Z * DISTANCE;
    for_each_light(&ball, |name, without, with| {
        let apart = largest_difference(without, with, |place| {
            // Where the ray meets the sphere.
            let ray = (place.extend(0.0) - eye).normalize();
            let along = -eye.dot(ray);
            let squared = radius * radius - (eye + ray * along).length_squared();
            if squared <= 0.0 {
                return false;
            }
            let normal = (eye + ray * (along - squared.sqrt())) / radius;
            normal.dot(LIGHT.normalize()) > 0.35 && normal.dot(-ray) > 0.35
        });
        assert!(apart <= 3.0, "{name}: the lit side differs by {apart} / 255 from the ball without its own shadow");
    });
}

#[test]
fn a_part_of_a_capture_shadows_another_part_but_not_itself() {
    let center = Vec3::new(-0.4, 0.2, 1.4);
    let parts = [wall(), ball(center, 0.2, 60, 0.05)].concat();
    // Where the center of the ball is seen on the wall, and where its shadow is.
    let hidden = (center * DISTANCE / (DISTANCE - center.z)).truncate();
    for_each_light(&scene(&parts), |name, without, with| {
        let ray = if name.starts_with("sun") { -LIGHT } else { center - LIGHT };
        let shadow = (center - ray * (center.z / ray.z)).truncate();
        let apart = largest_difference(without, with, |place| {
            place.abs().max_element() < 0.9 && place.distance(hidden) > 0.7 && place.distance(shadow) > 0.7
        });
        assert!(apart <= 3.0, "{name}: the lit wall differs by {apart} / 255 from the wall without its own shadow");
        let scale = DISTANCE * (FOV_Y / 2.0).tan();
        let at = ((shadow / Vec2::new(scale, -scale) * 0.5 + 0.5) * SIZE.as_vec2()).as_uvec2();
        let [plain, dark] = [without, with].map(|picture| color(picture, at.x, at.y));
        let expected = encode(decode(plain / 255.0) * TINT) * 255.0;
        assert!(
            (dark - expected).abs().max_element() <= 4.0,
            "{name}: the shadow on the wall is {dark}, not {expected}"
        );
    });
}
