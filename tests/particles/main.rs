//! Captures among the particles of `bevy_hanabi`, in headless apps.
//!
//! In: a capture of one opaque splat, and an effect of one particle in front of it or behind it. Out: a test that the
//! particle hides the capture or is hidden by it, with and without multisampling, with and without HDR. Skipped without
//! a GPU (a software driver counts).

use bevy::camera::Hdr;
use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::prelude::*;
use bevy_gs4d::asset::GaussianCapture;
use bevy_gs4d::gaussian::{Gaussian, Harmonics};
use bevy_gs4d::prelude::*;
use bevy_gs4d::scene::RuntimeScene;
use bevy_gs4d::testing::{self, RgbaImage};
use bevy_hanabi::{
    Attribute, ColorOverLifetimeModifier, EffectAsset, ExprWriter, Gradient, HanabiPlugin, ParticleEffect,
    SetAttributeModifier, SizeOverLifetimeModifier, SpawnerSettings,
};
use std::time::Duration;

const SIZE: UVec2 = UVec2::new(160, 120);

/// Returns a capture of one red splat at the origin, nearly opaque in its middle.
fn red() -> GaussianCapture {
    let splat = Gaussian {
        mean: [0.0; 3],
        mean_t: 0.5,
        velocity: [0.0; 3],
        sigma_t: f32::INFINITY,
        covariance: [0.16, 0.0, 0.0, 0.16, 0.0, 0.16],
        opacity: 0.98,
        padding: 0.0,
    };
    // The first harmonic is 0.282; the evaluation adds one half to colors.
    let values = [1.0, 0.0, 0.0].map(|color: f32| (color - 0.5) / 0.282_094_79).to_vec();
    let harmonics = Harmonics { coefficients: 1, degree: 0, degree_t: 0, values };
    GaussianCapture::new(RuntimeScene::sliced(vec![splat], harmonics))
}

/// Returns an effect of one green particle at rest, half a unit wide.
fn green() -> EffectAsset {
    let writer = ExprWriter::new();
    let start = |attribute, value| SetAttributeModifier::new(attribute, value);
    let position = start(Attribute::POSITION, writer.lit(Vec3::ZERO).expr());
    let age = start(Attribute::AGE, writer.lit(0.0).expr());
    let lifetime = start(Attribute::LIFETIME, writer.lit(1e6).expr());
    EffectAsset::new(16, SpawnerSettings::once(1.0.into()), writer.finish())
        .init(position)
        .init(age)
        .init(lifetime)
        .render(ColorOverLifetimeModifier::new(Gradient::constant(Vec4::new(0.0, 1.0, 0.0, 1.0))))
        .render(SizeOverLifetimeModifier { gradient: Gradient::constant(Vec3::splat(0.5)), screen_space_size: false })
}

/// Returns the picture of a capture and of a particle at `z`, seen from +z.
fn seen(msaa: Msaa, hdr: bool, z: f32) -> RgbaImage {
    let mut app = testing::app(SIZE);
    app.add_plugins((GaussianCapturePlugins, HanabiPlugin)).insert_resource(ClearColor(Color::BLACK));
    let world = app.world_mut();
    let capture = world.resource_mut::<Assets<GaussianCapture>>().add(red());
    world.spawn(GaussianCapture3d(capture));
    let effect = world.resource_mut::<Assets<EffectAsset>>().add(green());
    world.spawn((ParticleEffect::new(effect), Transform::from_xyz(0.0, 0.0, z)));
    let mut camera = world.spawn((Camera3d::default(), msaa, Tonemapping::None, Transform::from_xyz(0.0, 0.0, 4.0)));
    if hdr {
        camera.insert(Hdr);
    }
    let mut picture = || testing::picture(&mut app, Duration::from_millis(50)).expect("the app draws without an error");
    // Spawning particles and compiling their pipelines takes some frames.
    (0..5).for_each(|_| drop(picture()));
    picture()
}

#[test]
fn particles_and_captures_hide_each_other() {
    if !testing::has_gpu() {
        println!("skipped: particles_and_captures_hide_each_other: no GPU");
        return;
    }
    for (msaa, hdr) in [(Msaa::Off, false), (Msaa::Sample4, false), (Msaa::Off, true), (Msaa::Sample4, true)] {
        let middle = |z| seen(msaa, hdr, z).get_pixel(SIZE.x / 2, SIZE.y / 2).0;
        let [r, g, b, _] = middle(2.0);
        assert!(
            r < 20 && g > 235 && b < 20,
            "{msaa:?}, HDR {hdr}: a particle in front hides the capture: {r}, {g}, {b}"
        );
        let [r, g, b, _] = middle(-2.0);
        assert!(
            r > 235 && g < 50 && b < 20,
            "{msaa:?}, HDR {hdr}: the capture hides a particle behind it: {r}, {g}, {b}"
        );
    }
}
