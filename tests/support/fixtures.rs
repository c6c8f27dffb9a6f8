//! Captures placed in headless apps, and meshes among them.
//!
//! In: an app, scenes, components of their entities and cameras. Out: entities, and the comparison of the app's picture
//! with the picture of the CPU reference, or of the renderer without Bevy.

use crate::support::blob::blob;
use crate::support::cpu_reference::{DURATION, SIZE, add, difference, scene};
use crate::support::flat::Flat;
use crate::support::offscreen_app::picture;
use bevy::camera::ScalingMode;
use bevy::prelude::*;
use bevy_gs4d::GaussianCapture3d;
use bevy_gs4d::gaussian::Gaussian;
use bevy_gs4d::playback::Playback;
use bevy_gs4d::reference::{self, Layer};
use bevy_gs4d::renderer::{Headless, Instance, ViewParameters};
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use bevy_gs4d::scene::{RuntimeScene, TemporalFilter};
use bevy_gs4d::view::{Appearance, Background, BlendSpace, DebugView, Picture, View};

/// A black background.
pub const BLACK: Background = Background::Color([0.0; 3]);
/// The pixel in the middle of a picture.
pub const MIDDLE: UVec2 = UVec2::new(SIZE.x / 2, SIZE.y / 2);

/// Returns a scene of five overlapping Gaussians, two of which move.
pub fn crowd() -> RuntimeScene {
    let moving = |gaussian: Gaussian, velocity: [f32; 3]| Gaussian { velocity, sigma_t: 0.4, ..gaussian };
    scene(&[
        (blob(Vec3::new(0.4, -0.1, 0.0), Vec3::new(0.3, 0.1, 0.2), 0.9), Vec3::new(0.9, 0.2, 0.1)),
        (blob(Vec3::new(-0.3, 0.2, 0.1), Vec3::new(0.3, 0.2, 0.1), 0.8), Vec3::new(0.1, 0.7, 0.3)),
        (moving(blob(Vec3::new(0.0, 0.3, 0.5), Vec3::splat(0.15), 0.7), [0.9, -0.3, 0.2]), Vec3::new(0.2, 0.3, 1.0)),
        (moving(blob(Vec3::new(0.2, -0.4, -0.6), Vec3::splat(0.3), 0.95), [-0.5, 0.4, 0.0]), Vec3::new(0.8, 0.8, 0.2)),
        (blob(Vec3::new(-0.7, -0.5, -0.2), Vec3::new(0.05, 0.3, 0.05), 0.6), Vec3::splat(0.9)),
    ])
}

/// Returns a scene of one Gaussian at the origin.
pub fn lone(color: Vec3) -> RuntimeScene {
    scene(&[(blob(Vec3::ZERO, Vec3::splat(0.4), 0.98), color)])
}

/// Returns a moving scene of two seconds with +z up, with a filter of half-second segments if `filtered`.
pub fn synthetic(count: usize, seed: u64, filtered: bool) -> RuntimeScene {
    let settings = SynthSettings { count, seed, degree: 0, degree_t: 0, duration_seconds: DURATION };
    let mut scene = synthesize(&settings).into_runtime().expect("synthetic scenes can be drawn");
    if filtered {
        let interval = scene.trained_with.time_interval;
        scene.filter = Some(TemporalFilter::support(scene.iter(), interval, 0.05, 4));
    }
    scene
}

/// Returns the pose of a camera that sees a scene of [`synthetic`].
pub fn synthetic_eye() -> Transform {
    Transform::from_xyz(0.5, -3.0, 1.5).looking_at(Vec3::ZERO, Vec3::Z)
}

/// Spawns a capture, paused at its start, with the components of `bundle`.
pub fn spawn(app: &mut App, scene: &RuntimeScene, bundle: impl Bundle) -> Entity {
    let handle = add(app, scene);
    app.world_mut().spawn((GaussianCapture3d(handle), Playback::paused_at(0.0), bundle)).id()
}

/// Inserts or replaces components of an entity.
pub fn insert(app: &mut App, entity: Entity, bundle: impl Bundle) {
    app.world_mut().entity_mut(entity).insert(bundle);
}

/// Checks that the app's picture equals `expected` up to the rounding to 8 bits and the GPU's arithmetic.
pub fn check(app: &mut App, expected: &Picture, what: &str) {
    let apart = difference(&picture(app, 0.0), expected);
    assert!(apart <= 2.0, "{what}: Bevy and the CPU reference differ by {apart} / 255");
}

/// Returns the CPU reference's picture of one capture over black.
pub fn reference_picture(scene: &RuntimeScene, view: View, appearance: Appearance) -> Picture {
    reference::render_layers(&[Layer { scene, view, appearance }], BLACK, BlendSpace::Encoded).picture
}

/// Returns a debug view of one capture over black, as the renderer draws it without Bevy.
pub fn debug_picture(headless: &mut Headless, scene: &RuntimeScene, view: View, debug: DebugView) -> Picture {
    let capture = headless.upload(scene).expect("the scene fits on the GPU");
    let instance = Instance { capture: &capture, active: None, view, appearance: Appearance::default() };
    let parameters = ViewParameters { background: BLACK, debug, ..ViewParameters::default() };
    headless.render_all(&[instance], &parameters).expect("the scene is drawn").picture
}

/// Returns the pose of a camera that looks straight at the origin from four units away.
pub fn front() -> Transform {
    Transform::from_xyz(0.0, 0.0, 4.0)
}

/// Returns an orthographic projection with a view three units high.
pub fn orthographic() -> OrthographicProjection {
    let scaling_mode = ScalingMode::FixedVertical { viewport_height: 3.0 };
    OrthographicProjection { scaling_mode, ..OrthographicProjection::default_3d() }
}

/// Spawns an unlit box of one color, of Bevy's standard material, which has fog and tonemapping.
pub fn spawn_box(app: &mut App, size: Vec3, center: Vec3, color: Color, alpha_mode: AlphaMode) -> Entity {
    let material = StandardMaterial { base_color: color, unlit: true, alpha_mode, ..default() };
    spawn_cuboid(app, size, center, material)
}

/// Spawns an opaque box of one color, of the material [`Flat`], which a software driver compiles faster.
pub fn spawn_flat_box(app: &mut App, size: Vec3, center: Vec3, color: Color) -> Entity {
    spawn_cuboid(app, size, center, Flat { color: color.into() })
}

fn spawn_cuboid<M: Material>(app: &mut App, size: Vec3, center: Vec3, material: M) -> Entity {
    let mesh = app.world_mut().resource_mut::<Assets<Mesh>>().add(Cuboid::from_size(size));
    let material = app.world_mut().resource_mut::<Assets<M>>().add(material);
    app.world_mut().spawn((Mesh3d(mesh), MeshMaterial3d(material), Transform::from_translation(center))).id()
}
