//! Captures among transparent items: glass, gizmos, wireframes and refraction in front of and behind them, and the sky.
//!
//! In: small scenes made by hand and panes of glass, in headless apps. Out: proof that items behind a capture show
//! through it and items in front cover it, with the colors computed from pictures of each alone, with and without
//! multisampling and HDR. Skipped without a GPU; a software driver is enough.

use crate::support::blob::blob;
use crate::support::cpu_reference::{SIZE, color, difference_between, eye, rgb, scene};
use crate::support::fixtures::{MIDDLE, crowd, front, insert, lone, spawn, spawn_box, spawn_flat_box};
use crate::support::offscreen_app::{app, picture, spawn_camera};
use crate::support::skip::skip;
use bevy::camera::{Exposure, Hdr, Viewport};
use bevy::core_pipeline::oit::OrderIndependentTransparencySettings;
use bevy::light::{Atmosphere, atmosphere::ScatteringMedium, light_consts};
use bevy::pbr::AtmosphereSettings;
use bevy::pbr::wireframe::{Wireframe, WireframeColor, WireframePlugin};
use bevy::prelude::*;
use bevy::render::renderer::{RenderAdapterInfo, RenderDevice};
use bevy::render::settings::WgpuFeatures;
use bevy_gs4d::render::CaptureViewSettings;
use bevy_gs4d::view::BlendSpace;
use bevy_gs4d::view::srgb::{decode, encode};
use image::RgbaImage;

/// Picture size of tests that need many pictures.
const SMALL: UVec2 = UVec2::new(96, 72);
/// The clear color.
const WALL: Color = Color::srgb(0.3, 0.6, 0.2);
/// The color of the glass, sRGB-encoded, and its opacity.
const GLASS: Vec3 = Vec3::new(0.1, 0.4, 0.9);
const OPACITY: f32 = 0.5;
/// Positions of a pane in front of and behind captures at the origin, seen from [`front`].
const BEFORE: f32 = 2.0;
const BEHIND: f32 = -2.0;

/// Spawns a pane that covers the view.
fn spawn_pane(app: &mut App, opacity: f32, z: f32) -> Entity {
    let color = Color::srgba(GLASS.x, GLASS.y, GLASS.z, opacity);
    spawn_box(app, Vec3::new(12.0, 12.0, 0.01), Vec3::Z * z, color, AlphaMode::Blend)
}

fn color_at(picture: &RgbaImage, x: u32, y: u32) -> Vec3 {
    color(picture, x, y) / 255.0
}

/// Checks every pixel against a color computed from other pictures. The tolerance covers the rounding of all pictures
/// to 8 bits, which linear light amplifies for dark colors.
fn check_pixels(picture: &RgbaImage, expected: impl Fn(u32, u32) -> Vec3, what: &str) {
    for y in 0..picture.height() {
        for x in 0..picture.width() {
            let (seen, expected) = (color_at(picture, x, y) * 255.0, expected(x, y) * 255.0);
            let apart = (seen - expected).abs().max_element();
            assert!(apart <= 2.5, "{what}: pixel {x}, {y} is {seen}, which differs by {apart} from {expected}");
        }
    }
}

#[test]
fn glass_and_captures_blend_in_the_order_of_their_distance() {
    let [encoded, linear] = [BlendSpace::Encoded, BlendSpace::Linear];
    let cases = [
        (Msaa::Sample4, false, encoded),
        (Msaa::Off, false, encoded),
        (Msaa::Sample4, true, encoded),
        (Msaa::Off, true, encoded),
        (Msaa::Sample4, false, linear),
    ];
    for (msaa, hdr, blend_space) in cases {
        let Some(mut app) = app(SMALL) else { return };
        let name = format!("{msaa:?}, HDR {hdr}, {blend_space:?}");
        let capture = spawn(&mut app, &crowd(), ());
        let camera = spawn_camera(&mut app, msaa, front());
        insert(&mut app, camera, CaptureViewSettings { blend_space, ..default() });
        if hdr {
            insert(&mut app, camera, Hdr);
        }
        let [over_black, over_white, over_wall] = [Color::BLACK, Color::WHITE, WALL].map(|behind| {
            app.insert_resource(ClearColor(behind));
            picture(&mut app, 0.0)
        });
        let pane = spawn_pane(&mut app, OPACITY, BEHIND);
        insert(&mut app, capture, Visibility::Hidden);
        let glass = picture(&mut app, 0.0);
        insert(&mut app, capture, Visibility::Inherited);
        // In the blend space of captures: their added light and their transmittance.
        let is_linear = blend_space == BlendSpace::Linear;
        let to: fn(Vec3) -> Vec3 = if is_linear { decode } else { |color| color };
        let from: fn(Vec3) -> Vec3 = if is_linear { encode } else { |color| color };
        let behind = |x, y| {
            let [added, whole, glass] = [&over_black, &over_white, &glass].map(|picture| to(color_at(picture, x, y)));
            from(added + (whole - added) * glass)
        };
        let before = |x, y| encode(decode(color_at(&over_wall, x, y)).lerp(decode(GLASS), OPACITY));
        check_pixels(&picture(&mut app, 0.0), behind, &format!("{name}, behind"));
        insert(&mut app, pane, Transform::from_xyz(0.0, 0.0, BEFORE));
        check_pixels(&picture(&mut app, 0.0), before, &format!("{name}, in front"));
        insert(&mut app, pane, Transform::from_xyz(0.0, 0.0, BEHIND));
        check_pixels(&picture(&mut app, 0.0), behind, &format!("{name}, behind again"));
        let faint = (0..SMALL.x).any(|x| {
            let seen = color_at(&over_white, x, SMALL.y / 2) - color_at(&over_black, x, SMALL.y / 2);
            (0.2..0.8).contains(&seen.x)
        });
        assert!(faint, "{name}: the capture has soft edges");
    }
}

#[test]
fn captures_between_two_panes_cover_the_rear_one_only() {
    for msaa in [Msaa::Off, Msaa::Sample4] {
        let Some(mut app) = app(SIZE) else { return };
        spawn(&mut app, &lone(Vec3::X), ());
        spawn_camera(&mut app, msaa, front());
        let green = Color::srgba(0.0, 1.0, 0.0, 0.5);
        spawn_box(&mut app, Vec3::new(12.0, 12.0, 0.01), Vec3::Z * BEHIND, green, AlphaMode::Blend);
        spawn_pane(&mut app, OPACITY, BEFORE);
        let picture = picture(&mut app, 0.0);
        // Red and blue; the front pane also adds some of both, and as much green as over black.
        let [r, g, b] = rgb(&picture, MIDDLE.x, MIDDLE.y);
        assert!(
            r > 170 && b > 150 && g < 90,
            "{msaa:?}: the capture hides the green pane and not the blue one: {r}, {g}, {b}"
        );
        let beside = rgb(&picture, 10, 10);
        assert!(beside[0] < 40 && beside[1] > 140, "{msaa:?}: next to the capture both panes are visible: {beside:?}");
    }
}

#[test]
fn all_captures_of_a_view_are_ordered_at_the_nearest_one() {
    let Some(mut app) = app(SIZE) else { return };
    spawn(&mut app, &lone(Vec3::X), Transform::from_xyz(0.0, 0.0, -1.0));
    let near = spawn(&mut app, &lone(Vec3::X), Transform::from_xyz(0.0, 0.0, 1.0));
    spawn_camera(&mut app, Msaa::Sample4, front());
    spawn_pane(&mut app, OPACITY, 0.0);
    let blue = |app: &mut App| rgb(&picture(app, 0.0), MIDDLE.x, MIDDLE.y)[2];
    let both = blue(&mut app);
    assert!(both < 60, "the pane is behind both captures, not {both}");
    insert(&mut app, near, Visibility::Hidden);
    let far = blue(&mut app);
    assert!(far > 150, "the pane is in front of the farther capture alone, not {far}");
}

#[test]
fn a_capture_with_its_center_behind_the_camera_is_behind_glass() {
    let Some(mut app) = app(SIZE) else { return };
    let heap = |z: f32| (blob(Vec3::Z * z, Vec3::splat(0.4), 0.98), Vec3::X);
    // The center is ten units from the origin, the camera four.
    spawn(&mut app, &scene(&[heap(0.0), heap(20.0)]), ());
    spawn_camera(&mut app, Msaa::Sample4, front());
    spawn_pane(&mut app, OPACITY, BEFORE);
    let [r, _, b] = rgb(&picture(&mut app, 0.0), MIDDLE.x, MIDDLE.y);
    assert!(r > 170 && b > 150, "the pane is over the capture, not {r}, {b}");
}

#[test]
fn fully_transparent_glass_changes_no_pixel() {
    for (msaa, hdr) in [(Msaa::Off, false), (Msaa::Sample4, false), (Msaa::Off, true), (Msaa::Sample4, true)] {
        let Some(mut app) = app(SMALL) else { return };
        app.insert_resource(ClearColor(WALL));
        spawn(&mut app, &crowd(), ());
        spawn_flat_box(&mut app, Vec3::splat(0.3), Vec3::ZERO, Color::srgb(0.8, 0.6, 0.2));
        let camera = spawn_camera(&mut app, msaa, eye());
        if hdr {
            insert(&mut app, camera, Hdr);
        }
        let without = picture(&mut app, 0.0);
        let pane = spawn_pane(&mut app, 0.0, BEFORE);
        for (place, z) in [("in front", BEFORE), ("behind", BEHIND)] {
            insert(&mut app, pane, Transform::from_xyz(0.0, 0.0, z));
            let apart = difference_between(&picture(&mut app, 0.0), &without);
            assert!(apart <= 1, "{msaa:?}, HDR {hdr}: clear glass {place} changes pixels by {apart} / 255");
        }
    }
}

#[test]
fn glass_in_front_of_captures_is_drawn_only_in_the_viewport() {
    let Some(mut app) = app(SIZE) else { return };
    let (corner, size) = (UVec2::new(60, 30), UVec2::new(100, 90));
    spawn(&mut app, &lone(Vec3::X), ());
    let camera = spawn_camera(&mut app, Msaa::Sample4, front());
    let viewport = Viewport { physical_position: corner, physical_size: size, ..default() };
    insert(&mut app, camera, Camera { viewport: Some(viewport), ..default() });
    spawn_pane(&mut app, OPACITY, BEFORE);
    let picture = picture(&mut app, 0.0);
    let middle = corner + size / 2;
    let [r, _, b] = rgb(&picture, middle.x, middle.y);
    assert!(r > 170 && b > 150, "the pane is over the capture at the center of the viewport, not {r}, {b}");
    assert_eq!(rgb(&picture, 20, 20), [0, 0, 0], "outside the viewport the target keeps the clear color");
    assert!(rgb(&picture, corner.x + 2, corner.y + 2)[2] > 150, "the pane reaches the corner of the viewport");
}

#[test]
fn gizmos_and_captures_hide_each_other_per_pixel() {
    #[derive(Resource)]
    struct Place(f32);

    for msaa in [Msaa::Off, Msaa::Sample4] {
        let Some(mut app) = app(SIZE) else { return };
        app.insert_resource(Place(0.0)).add_systems(Update, |mut gizmos: Gizmos, place: Res<Place>| {
            let end = Vec3::new(3.0, 0.0, place.0);
            gizmos.line(end.with_x(-3.0), end, Color::srgb(0.0, 1.0, 0.0));
        });
        app.world_mut().resource_mut::<GizmoConfigStore>().config_mut::<DefaultGizmoConfigGroup>().0.line.width = 6.0;
        spawn(&mut app, &lone(Vec3::X), ());
        spawn_camera(&mut app, msaa, front());
        // With a pane in front, a part of the transparent phase is drawn after captures.
        for glass in [false, true] {
            if glass {
                spawn_pane(&mut app, 0.0, BEFORE);
            }
            for (z, shows) in [(1.0, true), (-1.0, false)] {
                app.insert_resource(Place(z));
                let picture = picture(&mut app, 0.0);
                let [r, g, _] = rgb(&picture, MIDDLE.x, MIDDLE.y);
                let name = format!("{msaa:?}, glass {glass}, a line at {z}");
                assert_eq!(g > 200, shows, "{name}: the green of the line is {g}");
                assert_eq!(r > 200, !shows, "{name}: the red of the capture is {r}");
                assert!(rgb(&picture, 10, MIDDLE.y)[1] > 200, "{name}: the line is visible next to the capture");
            }
        }
    }
}

#[test]
fn wireframes_keep_captures_in_multisampled_pictures() {
    let Some(mut app) = app(SIZE) else { return };
    app.add_plugins(WireframePlugin::default());
    spawn(&mut app, &lone(Vec3::X), ());
    spawn_camera(&mut app, Msaa::Sample4, front());
    // At the edge of the capture.
    let green = Color::srgb(0.0, 0.4, 0.0);
    let mesh = spawn_box(&mut app, Vec3::splat(0.6), Vec3::X, green, AlphaMode::Opaque);
    let without = picture(&mut app, 0.0);
    let needed = WgpuFeatures::POLYGON_MODE_LINE | WgpuFeatures::IMMEDIATES;
    if !app.world().resource::<RenderDevice>().features().contains(needed) {
        skip("this GPU draws no wireframes");
        return;
    }
    insert(&mut app, mesh, (Wireframe, WireframeColor { color: Color::WHITE }));
    let with = picture(&mut app, 0.0);
    let lines = with.pixels().zip(without.pixels()).filter(|(a, b)| a.0[2] > b.0[2].saturating_add(60)).count();
    assert!(lines > 20, "lines are drawn: {lines} pixels");
    for x in MIDDLE.x - 20..MIDDLE.x {
        let [seen, expected] = [&with, &without].map(|picture| rgb(picture, x, MIDDLE.y));
        let apart = seen.iter().zip(expected).map(|(a, b)| a.abs_diff(b)).max().unwrap_or_default();
        assert!(apart <= 1, "column {x} of the capture is {seen:?}, not {expected:?}");
    }
    assert!(rgb(&with, MIDDLE.x, MIDDLE.y)[0] > 200, "the capture is in the picture");
}

#[test]
fn captures_show_through_transmissive_meshes_in_front_and_cover_those_behind() {
    for msaa in [Msaa::Off, Msaa::Sample4] {
        let Some(mut app) = app(SIZE) else { return };
        spawn(&mut app, &lone(Vec3::ONE), ());
        spawn_camera(&mut app, msaa, front());
        // Green, clear and without a reflection, over the right half of the view.
        let glass = StandardMaterial {
            base_color: Color::srgb(0.0, 1.0, 0.0),
            specular_transmission: 1.0,
            perceptual_roughness: 0.0,
            reflectance: 0.0,
            ior: 1.0,
            ..default()
        };
        let glass = app.world_mut().resource_mut::<Assets<StandardMaterial>>().add(glass);
        let mesh = app.world_mut().resource_mut::<Assets<Mesh>>().add(Cuboid::new(6.0, 12.0, 0.01));
        let place = Transform::from_xyz(3.0, 0.0, 1.5);
        let pane = app.world_mut().spawn((Mesh3d(mesh), MeshMaterial3d(glass), place)).id();
        // At equal distances from the center, where the Gaussian has the same brightness.
        let sides = |app: &mut App| {
            let picture = picture(app, 0.0);
            [MIDDLE.x - 9, MIDDLE.x + 8].map(|x| rgb(&picture, x, MIDDLE.y))
        };
        let [beside, [r, g, b]] = sides(&mut app);
        assert!(
            beside.iter().all(|value| *value > 200),
            "{msaa:?}: next to the glass the capture is white: {beside:?}"
        );
        assert!(
            g.abs_diff(beside[1]) <= 3,
            "{msaa:?}: through the glass the green of the capture is {g}, not {}",
            beside[1]
        );
        assert!(r < 30 && b < 30, "{msaa:?}: the green glass absorbs red and blue: {r}, {b}");
        insert(&mut app, pane, Transform::from_xyz(3.0, 0.0, -1.5));
        let [beside, over] = sides(&mut app);
        let apart = beside.iter().zip(over).map(|(a, b)| a.abs_diff(b)).max().unwrap_or_default();
        assert!(apart <= 3, "{msaa:?}: in front of the glass the capture is {over:?}, next to it {beside:?}");
    }
}

#[test]
fn captures_are_drawn_over_the_atmosphere() {
    for msaa in [Msaa::Off, Msaa::Sample4] {
        let Some(mut app) = app(SIZE) else { return };
        let medium = app.world_mut().resource_mut::<Assets<ScatteringMedium>>().add(ScatteringMedium::default());
        app.world_mut().spawn(Atmosphere::earth(medium));
        let sun = DirectionalLight { illuminance: light_consts::lux::RAW_SUNLIGHT, ..default() };
        app.world_mut().spawn((sun, Transform::default().looking_to(Vec3::new(0.0, -0.3, -1.0), Vec3::Y)));
        let camera = spawn_camera(&mut app, msaa, front());
        insert(&mut app, camera, Hdr);
        let capture = spawn(&mut app, &lone(Vec3::X), ());
        let alone = picture(&mut app, 0.0);
        if app.world().resource::<RenderAdapterInfo>().device_type == wgpu::DeviceType::Cpu {
            skip("Bevy's atmosphere crashes the software driver, without captures too");
            return;
        }
        insert(&mut app, camera, (AtmosphereSettings::default(), Exposure { ev100: 13.0 }));
        insert(&mut app, capture, Visibility::Hidden);
        let sky = picture(&mut app, 0.0);
        insert(&mut app, capture, Visibility::Inherited);
        let both = picture(&mut app, 0.0);
        let [r, g, b] = rgb(&sky, MIDDLE.x, 10);
        assert!(b > 60 && b > r, "{msaa:?}: the sky is blue: {r}, {g}, {b}");
        assert_eq!(rgb(&both, 4, 10), rgb(&sky, 4, 10), "{msaa:?}: the sky is unchanged next to the capture");
        let [seen, expected] = [&both, &alone].map(|picture| color(picture, MIDDLE.x, MIDDLE.y));
        let apart = (seen - expected).abs().max_element();
        // The capture transmits 2 %.
        assert!(apart <= 8.0, "{msaa:?}: the capture covers the sky: {seen}, not {expected}");
    }
}

#[test]
fn order_independent_glass_is_depth_tested_against_captures() {
    let Some(mut app) = app(SIZE) else { return };
    spawn(&mut app, &lone(Vec3::X), ());
    let camera = spawn_camera(&mut app, Msaa::Off, front());
    let pane = spawn_pane(&mut app, OPACITY, BEFORE);
    // At the center of the capture, and next to it.
    let each = |app: &mut App| {
        [BEFORE, BEHIND].map(|z| {
            insert(app, pane, Transform::from_xyz(0.0, 0.0, z));
            let picture = picture(app, 0.0);
            [MIDDLE, UVec2::new(4, 10)].map(|place| color(&picture, place.x, place.y))
        })
    };
    let ordered = each(&mut app);
    insert(&mut app, camera, OrderIndependentTransparencySettings::default());
    let resolved = each(&mut app);
    for (seen, expected) in resolved.iter().flatten().zip(ordered.iter().flatten()) {
        let apart = (*seen - *expected).abs().max_element();
        // The capture transmits 2 % of the background, but its depth hides the glass fully.
        assert!(apart <= 8.0, "order-independent glass gives {resolved:?}, sorted glass {ordered:?}");
    }
}
