//! Fog, shadows of meshes and the light of the surroundings on captures.
//!
//! In: flat captures made by hand and meshes of the same color, in headless apps. Out: proof that fog equals the fog of
//! Bevy's meshes and does not show black particles, that shadows and dark rooms darken captures with the components by
//! the documented factors, and that other cameras have no extra pass. Skipped without a GPU; a software driver is
//! enough.

use crate::support::blob::blob;
use crate::support::cpu_reference::{SIZE, color, difference_between, rgb, scene};
use crate::support::fixtures::{MIDDLE, front, insert, orthographic, spawn, spawn_box};
use crate::support::offscreen_app::{FOV_Y, app, picture, spawn_camera};
use crate::support::spans::has_recorded;
use bevy::camera::{Exposure, Hdr};
use bevy::light::{DirectionalLightShadowMap, NotShadowReceiver, PointLightShadowMap};
use bevy::pbr::{DistanceFog, FogFalloff};
use bevy::prelude::*;
use bevy::render::diagnostic::RenderDiagnosticsPlugin;
use bevy_gs4d::pbr::{CaptureLight, ReceivesShadows};
use bevy_gs4d::render::CaptureViewSettings;
use bevy_gs4d::scene::{Environment, RuntimeScene};
use bevy_gs4d::view::srgb::{decode, encode};
use bevy_gs4d::view::{BlendSpace, DebugView};
use image::RgbaImage;

/// The color of walls, sRGB-encoded.
const COLOR: Vec3 = Vec3::new(0.6, 0.4, 0.8);

/// Returns a flat wall through the origin that is opaque to less than an 8-bit step: three splats with an opacity of
/// 0.95 transmit 0.000125, and blending ends at 0.0001.
fn wall() -> RuntimeScene {
    scene(&[(blob(Vec3::ZERO, Vec3::new(30.0, 30.0, 1e-3), 0.95), COLOR); 3])
}

/// Spawns the same wall as an unlit mesh.
fn spawn_mesh_wall(app: &mut App) -> Entity {
    let color = Color::srgb(COLOR.x, COLOR.y, COLOR.z);
    spawn_box(app, Vec3::new(40.0, 40.0, 0.1), Vec3::new(0.0, 0.0, -0.05), color, AlphaMode::Opaque)
}

fn fog(falloff: FogFalloff) -> DistanceFog {
    DistanceFog { color: Color::srgba(0.2, 0.7, 0.3, 0.9), falloff, ..default() }
}

/// Returns a fog of each kind that changes colors strongly at a distance of 4.
fn fogs() -> [(&'static str, DistanceFog); 5] {
    let linear = FogFalloff::Linear { start: 1.0, end: 8.0 };
    let glowing = DistanceFog {
        directional_light_color: Color::srgba(1.0, 0.8, 0.5, 0.5),
        directional_light_exponent: 8.0,
        ..fog(linear.clone())
    };
    let [extinction, inscattering] = [Vec3::new(0.1, 0.2, 0.3), Vec3::new(0.3, 0.2, 0.1)];
    [
        ("linear", fog(linear)),
        ("exponential", fog(FogFalloff::Exponential { density: 0.2 })),
        ("squared", fog(FogFalloff::ExponentialSquared { density: 0.2 })),
        ("atmospheric", fog(FogFalloff::Atmospheric { extinction, inscattering })),
        ("with a glow", glowing),
    ]
}

/// Returns a picture of the capture alone and a picture of the mesh alone.
fn each(app: &mut App, capture: Entity, mesh: Entity) -> [RgbaImage; 2] {
    [(Visibility::Inherited, Visibility::Hidden), (Visibility::Hidden, Visibility::Inherited)].map(|(first, second)| {
        insert(app, capture, first);
        insert(app, mesh, second);
        picture(app, 0.0)
    })
}

/// Returns the linear light of a pixel.
fn light(picture: &RgbaImage, x: u32) -> Vec3 {
    decode(color(picture, x, MIDDLE.y) / 255.0)
}

/// Checks that a pixel of the wall has the wall's light times `factor`.
fn check(picture: &RgbaImage, x: u32, factor: Vec3, what: &str) {
    let expected = encode(decode(COLOR) * factor) * 255.0;
    let seen = color(picture, x, MIDDLE.y);
    assert!((seen - expected).abs().max_element() <= 3.0, "{what}: the pixel is {seen}, not {expected}");
}

#[test]
fn fog_equals_the_fog_of_a_mesh_at_the_same_position() {
    let Some(mut app) = app(SIZE) else { return };
    let capture = spawn(&mut app, &wall(), ());
    let mesh = spawn_mesh_wall(&mut app);
    let camera = spawn_camera(&mut app, Msaa::Off, front());
    let sun = DirectionalLight { illuminance: 600.0, ..default() };
    app.world_mut().spawn((sun, Transform::default().looking_to(Vec3::new(-0.2, -0.1, 1.0), Vec3::Y)));
    let [plain, mesh_alone] = each(&mut app, capture, mesh);
    let apart = difference_between(&plain, &mesh_alone);
    assert!(apart <= 2, "without fog the capture and the mesh differ by {apart} / 255");
    for (what, fog) in fogs() {
        insert(&mut app, camera, fog);
        let [fogged, expected] = each(&mut app, capture, mesh);
        let apart = difference_between(&fogged, &expected);
        assert!(apart <= 2, "{what}: the capture and the mesh differ by {apart} / 255");
        let changed = difference_between(&fogged, &plain);
        assert!(changed > 20, "{what}: the fog changes the picture by only {changed} / 255");
    }
}

#[test]
fn fog_is_the_same_for_every_kind_of_camera() {
    let perspective = PerspectiveProjection { fov: FOV_Y, ..default() };
    for (what, msaa, lens) in [
        ("orthographic", Msaa::Off, Projection::Orthographic(orthographic())),
        ("multisampled", Msaa::Sample4, Projection::Perspective(perspective)),
    ] {
        let Some(mut app) = app(SIZE) else { return };
        let capture = spawn(&mut app, &wall(), ());
        let mesh = spawn_mesh_wall(&mut app);
        let camera = spawn_camera(&mut app, msaa, Transform::from_xyz(0.5, 0.0, 4.0));
        insert(&mut app, camera, (lens, fog(FogFalloff::Exponential { density: 0.2 })));
        let [fogged, expected] = each(&mut app, capture, mesh);
        let apart = difference_between(&fogged, &expected);
        assert!(apart <= 2, "{what}: the capture and the mesh differ by {apart} / 255");
        let middle = light(&expected, MIDDLE.x).distance(decode(COLOR));
        assert!(middle > 0.05, "{what}: the fog is visible, {middle}");
    }
}

#[test]
fn fog_is_the_same_in_every_blend_space_and_on_hdr_targets() {
    let Some(mut app) = app(SIZE) else { return };
    spawn(&mut app, &wall(), ());
    let camera = spawn_camera(&mut app, Msaa::Off, front());
    insert(&mut app, camera, fog(FogFalloff::Linear { start: 1.0, end: 8.0 }));
    let encoded = picture(&mut app, 0.0);
    insert(&mut app, camera, CaptureViewSettings { blend_space: BlendSpace::Linear, ..default() });
    let apart = difference_between(&picture(&mut app, 0.0), &encoded);
    assert!(apart <= 2, "linear and encoded blending differ by {apart} / 255");
    insert(&mut app, camera, Hdr);
    let apart = difference_between(&picture(&mut app, 0.0), &encoded);
    assert!(apart <= 2, "HDR and 8 bits differ by {apart} / 255");
}

#[test]
fn fog_on_a_black_surface_equals_the_fog_of_a_black_mesh() {
    let Some(mut app) = app(SIZE) else { return };
    let black = scene(&[(blob(Vec3::ZERO, Vec3::new(30.0, 30.0, 1e-3), 0.95), Vec3::ZERO); 3]);
    let capture = spawn(&mut app, &black, ());
    let (size, center) = (Vec3::new(40.0, 40.0, 0.1), Vec3::new(0.0, 0.0, -0.05));
    let mesh = spawn_box(&mut app, size, center, Color::BLACK, AlphaMode::Opaque);
    let camera = spawn_camera(&mut app, Msaa::Off, front());
    for (what, fog) in fogs() {
        insert(&mut app, camera, fog);
        let [fogged, expected] = each(&mut app, capture, mesh);
        let apart = difference_between(&fogged, &expected);
        assert!(apart <= 2, "{what}: the capture and the mesh differ by {apart} / 255");
        let seen = expected.pixels().map(|pixel| pixel.0[..3].iter().max().copied()).max().flatten();
        assert!(seen > Some(40), "{what}: the fog is visible on the mesh: {seen:?}");
    }
}

#[test]
fn particles_that_are_invisible_over_black_are_invisible_in_fog() {
    let Some(mut app) = app(SIZE) else { return };
    let faint = |color: Vec3| scene(&[(blob(Vec3::ZERO, Vec3::splat(0.4), 0.3), color)]);
    let capture = spawn(&mut app, &faint(Vec3::ZERO), ());
    let camera = spawn_camera(&mut app, Msaa::Off, front());
    let brightest = |app: &mut App| picture(app, 0.0).pixels().flat_map(|pixel| pixel.0[..3].to_vec()).max();
    for (what, fog) in fogs() {
        for blend_space in [BlendSpace::Encoded, BlendSpace::Linear] {
            insert(&mut app, camera, (fog.clone(), CaptureViewSettings { blend_space, ..default() }));
            let seen = brightest(&mut app);
            assert!(seen <= Some(1), "{what}: black particles over black have the color {seen:?}");
        }
    }
    app.world_mut().despawn(capture);
    spawn(&mut app, &faint(COLOR), ());
    app.world_mut().entity_mut(camera).remove::<DistanceFog>();
    let plain = picture(&mut app, 0.0);
    insert(&mut app, camera, fog(FogFalloff::Linear { start: 1.0, end: 8.0 }));
    // The green of the fog is brighter than that of the particles.
    let [plain, fogged] = [&plain, &picture(&mut app, 0.0)].map(|picture| rgb(picture, MIDDLE.x, MIDDLE.y)[1]);
    assert!(fogged > plain + 5, "bright particles have the light of the fog: from {plain} to {fogged}");
}

#[test]
fn fog_treats_an_environment_map_as_infinitely_far() {
    let Some(mut app) = app(SIZE) else { return };
    let map = Environment { width: 8, height: 4, texels: vec![0.9; 8 * 4 * 3] };
    let behind = scene(&[(blob(Vec3::Z * 9.0, Vec3::splat(0.4), 0.98), Vec3::X)]);
    spawn(&mut app, &RuntimeScene { environment: Some(map), ..behind }, ());
    let camera = spawn_camera(&mut app, Msaa::Off, front());
    let plain = rgb(&picture(&mut app, 0.0), MIDDLE.x, MIDDLE.y);
    assert!(plain.iter().all(|value| *value > 100), "the environment map is drawn: {plain:?}");
    let color = Color::srgb(0.2, 0.7, 0.3);
    let falloff = FogFalloff::Linear { start: 1000.0, end: 2000.0 };
    insert(&mut app, camera, DistanceFog { color, falloff, ..default() });
    let seen = rgb(&picture(&mut app, 0.0), MIDDLE.x, MIDDLE.y);
    for (value, expected) in seen.into_iter().zip([51, 179, 77]) {
        assert!(value.abs_diff(expected) <= 2, "the pixel has the color of the fog, not {seen:?}");
    }
}

#[test]
fn a_mesh_casts_its_shadow_on_a_capture_with_receives_shadows() {
    let tint = LinearRgba::rgb(0.2, 0.3, 0.4);
    let in_shadow = Vec3::new(0.2, 0.3, 0.4);
    let Some(mut app) = app(SIZE) else { return };
    app.insert_resource(DirectionalLightShadowMap { size: 512 }).insert_resource(PointLightShadowMap { size: 256 });
    let capture = spawn(&mut app, &wall(), ());
    // Between the lights and the center of the wall, but not between the wall and the camera.
    spawn_box(&mut app, Vec3::splat(0.3), Vec3::new(1.75, 0.0, 1.25), Color::BLACK, AlphaMode::Opaque);
    spawn_camera(&mut app, Msaa::Off, front());
    let plain = picture(&mut app, 0.0);
    let place = Transform::from_xyz(3.5, 0.0, 2.5).looking_at(Vec3::ZERO, Vec3::Y);
    let left = 33;
    let sun = DirectionalLight { shadow_maps_enabled: true, ..default() };
    let lamp = PointLight { shadow_maps_enabled: true, range: 20.0, ..default() };
    let spot = SpotLight { shadow_maps_enabled: true, range: 20.0, outer_angle: 0.7, inner_angle: 0.6, ..default() };
    let lights = [
        ("directional", app.world_mut().spawn((sun, place, Visibility::Hidden)).id()),
        ("point", app.world_mut().spawn((lamp, place, Visibility::Hidden)).id()),
        ("spot", app.world_mut().spawn((spot, place, Visibility::Hidden)).id()),
    ];
    for (what, lamp) in lights {
        insert(&mut app, lamp, Visibility::Inherited);
        app.world_mut().entity_mut(capture).remove::<ReceivesShadows>();
        let apart = difference_between(&picture(&mut app, 0.0), &plain);
        assert_eq!(apart, 0, "{what}: without the component the picture is unchanged");
        insert(&mut app, capture, ReceivesShadows { tint, ..default() });
        let shadowed = picture(&mut app, 0.0);
        check(&shadowed, MIDDLE.x, in_shadow, &format!("{what}, in the shadow"));
        check(&shadowed, left, Vec3::ONE, &format!("{what}, outside the shadow"));
        insert(&mut app, lamp, Visibility::Hidden);
    }
    let apart = difference_between(&picture(&mut app, 0.0), &plain);
    assert_eq!(apart, 0, "without a light the picture is bit-identical");
}

#[test]
fn a_capture_with_not_shadow_receiver_is_lit_in_the_shadow_of_a_mesh() {
    let Some(mut app) = app(SIZE) else { return };
    app.insert_resource(DirectionalLightShadowMap { size: 512 });
    let tint = LinearRgba::rgb(0.2, 0.3, 0.4);
    let capture = spawn(&mut app, &wall(), (ReceivesShadows { tint, ..default() }, NotShadowReceiver));
    spawn_box(&mut app, Vec3::splat(0.3), Vec3::new(1.75, 0.0, 1.25), Color::BLACK, AlphaMode::Opaque);
    spawn_camera(&mut app, Msaa::Off, front());
    let place = Transform::from_xyz(3.5, 0.0, 2.5).looking_at(Vec3::ZERO, Vec3::Y);
    app.world_mut().spawn((DirectionalLight { shadow_maps_enabled: true, ..default() }, place));
    check(&picture(&mut app, 0.0), MIDDLE.x, Vec3::ONE, "with NotShadowReceiver");
    app.world_mut().entity_mut(capture).remove::<NotShadowReceiver>();
    check(&picture(&mut app, 0.0), MIDDLE.x, Vec3::new(0.2, 0.3, 0.4), "without NotShadowReceiver");
    insert(&mut app, capture, NotShadowReceiver);
    check(&picture(&mut app, 0.0), MIDDLE.x, Vec3::ONE, "with NotShadowReceiver again");
}

#[test]
fn capture_light_multiplies_by_the_light_of_the_surroundings() {
    let Some(mut app) = app(SIZE) else { return };
    app.insert_resource(GlobalAmbientLight::NONE);
    let capture = spawn(&mut app, &wall(), ());
    let camera = spawn_camera(&mut app, Msaa::Off, front());
    let plain = picture(&mut app, 0.0);
    insert(&mut app, capture, CaptureLight { amount: 0.0, ..default() });
    assert_eq!(
        difference_between(&picture(&mut app, 0.0), &plain),
        0,
        "an amount of 0 leaves the picture bit-identical"
    );
    insert(&mut app, capture, CaptureLight { amount: 0.75, ..default() });
    check(&picture(&mut app, 0.0), MIDDLE.x, Vec3::splat(0.25), "a dark room");

    let ambient = GlobalAmbientLight::default();
    app.insert_resource(ambient.clone());
    insert(&mut app, capture, CaptureLight::default());
    check(&picture(&mut app, 0.0), MIDDLE.x, Vec3::ONE, "Bevy's own ambient light");
    app.insert_resource(GlobalAmbientLight { brightness: 0.25 * ambient.brightness, ..ambient });
    check(&picture(&mut app, 0.0), MIDDLE.x, Vec3::splat(0.25), "a quarter of Bevy's ambient light");
    let exposure = Exposure::default().exposure();

    app.insert_resource(GlobalAmbientLight::NONE);
    let color = Color::linear_rgb(1.0, 0.5, 0.25);
    let map = EnvironmentMapLight::solid_color(&mut app.world_mut().resource_mut::<Assets<Image>>(), color);
    insert(&mut app, camera, EnvironmentMapLight { intensity: 500.0, ..map });
    insert(&mut app, capture, CaptureLight { reference: 0.8, amount: 1.0 });
    let expected = Vec3::new(1.0, 0.5, 0.25) * 500.0 * exposure / 0.8;
    check(&picture(&mut app, 0.0), MIDDLE.x, expected, "an environment map");
}

#[test]
fn neighboring_captures_have_separate_light() {
    let Some(mut app) = app(SIZE) else { return };
    app.insert_resource(GlobalAmbientLight::NONE);
    let ball = |x: f32| scene(&[(blob(Vec3::X * x, Vec3::splat(0.15), 0.98), Vec3::splat(0.8))]);
    spawn(&mut app, &ball(-1.0), CaptureLight::default());
    spawn(&mut app, &ball(1.0), ());
    spawn_camera(&mut app, Msaa::Off, front());
    let picture = picture(&mut app, 0.0);
    // One unit off-center at a distance of 4: 0.44 of half the width.
    let [left, right] = [56, 144].map(|x| rgb(&picture, x, MIDDLE.y)[0]);
    assert!(left <= 2, "the capture with CaptureLight is dark in a dark room: {left}");
    assert!(right > 190, "the other capture is not darkened: {right}");
}

#[test]
fn debug_views_are_not_shaded() {
    let Some(mut app) = app(SIZE) else { return };
    spawn(&mut app, &wall(), ());
    let camera = spawn_camera(&mut app, Msaa::Off, front());
    insert(&mut app, camera, CaptureViewSettings { debug: DebugView::Depth, ..default() });
    let plain = picture(&mut app, 0.0);
    insert(&mut app, camera, fog(FogFalloff::Exponential { density: 0.5 }));
    assert_eq!(difference_between(&picture(&mut app, 0.0), &plain), 0, "fog does not change a debug view");
}

#[test]
fn a_camera_without_shading_has_no_shade_pass() {
    let Some(mut app) = app(SIZE) else { return };
    app.add_plugins(RenderDiagnosticsPlugin);
    let capture = spawn(&mut app, &wall(), ());
    let camera = spawn_camera(&mut app, Msaa::Off, front());
    let plain = picture(&mut app, 0.0);
    // Diagnostic spans arrive some frames later.
    let wait_for = |app: &mut App, pass: &str| {
        for _ in 0..100 {
            if has_recorded(app, pass) {
                return true;
            }
            app.update();
        }
        false
    };
    assert!(wait_for(&mut app, "gs4d/composite"), "the span of the composite arrives");
    assert!(!has_recorded(&app, "gs4d/shade"), "no shade pass without fog");
    insert(&mut app, camera, fog(FogFalloff::Exponential { density: 0.5 }));
    assert!(difference_between(&picture(&mut app, 0.0), &plain) > 20, "fog changes the picture");
    assert!(wait_for(&mut app, "gs4d/shade"), "a shade pass with fog");
    app.world_mut().entity_mut(camera).remove::<DistanceFog>();
    assert_eq!(difference_between(&picture(&mut app, 0.0), &plain), 0, "without fog the picture is as before");
    insert(&mut app, capture, Visibility::Hidden);
    let hidden = picture(&mut app, 0.0);
    assert!(hidden.pixels().all(|pixel| pixel.0[..3] == [0, 0, 0]), "hidden captures are not drawn");
}
