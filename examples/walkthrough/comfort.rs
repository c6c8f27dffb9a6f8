//! Comfort: a vignette that closes while the body moves, and a black curtain that covers the view during a teleport.
//!
//! In: the motion of the body. Out: for each eye a ring (the vignette) and a curtain, meshes that only this eye sees.

use super::body::{Body, Moves};
use super::path::wrapped;
use super::teleport::Teleport;
use bevy::asset::RenderAssetUsages;
use bevy::camera::visibility::{NoFrustumCulling, RenderLayers};
use bevy::mesh::{Indices, PrimitiveTopology};
use bevy::prelude::*;
use std::f32::consts::TAU;

/// Distance from the eye in meters: behind the near plane (0.1 for a headset), in front of the scene.
const DISTANCE: f32 = 0.15;
/// Radii of the closed ring, as tangents of the angle from the view direction, with the opacity at each radius.
const RADII: [(f32, f32); 3] = [(0.45, 0.0), (0.75, 1.0), (12.0, 1.0)];
/// Factor on the ring's size just before it disappears.
const OPEN: f32 = 4.0;
const SEGMENTS: u32 = 48;
/// Time in which the ring closes or opens, in seconds.
const EASE: f32 = 0.25;
/// Speed at which the ring closes fully, in meters or radians per second.
const FAST: f32 = 0.8;
/// Speeds in meters and radians per second above which a motion is a jump: a teleport or a snap turn.
const JUMP: [f32; 2] = [12.0, 10.0];

/// The index of an eye's camera; 0 is the left eye.
#[derive(Component)]
pub struct EyeView(pub usize);

#[derive(Component)]
struct Ring;

#[derive(Component)]
struct Curtain;

/// Whether the vignette is on, and how far it is closed, from 0 to 1.
#[derive(Resource)]
pub struct Comfort {
    pub vignette: bool,
    closed: f32,
}

impl Default for Comfort {
    fn default() -> Self {
        Self { vignette: true, closed: 0.0 }
    }
}

/// Meshes and materials of rings and curtains.
#[derive(Resource)]
struct Cloth {
    ring: Handle<Mesh>,
    curtain: Handle<Mesh>,
    edge: Handle<StandardMaterial>,
    dark: Handle<StandardMaterial>,
}

impl FromWorld for Cloth {
    fn from_world(world: &mut World) -> Self {
        let mut meshes = world.resource_mut::<Assets<Mesh>>();
        let (ring, curtain) = (meshes.add(ring()), meshes.add(Rectangle::new(24.0, 24.0)));
        let mut materials = world.resource_mut::<Assets<StandardMaterial>>();
        let black = StandardMaterial {
            base_color: Color::BLACK,
            alpha_mode: AlphaMode::Blend,
            unlit: true,
            cull_mode: None,
            ..default()
        };
        let (edge, dark) = (materials.add(black.clone()), materials.add(black));
        Self { ring, curtain, edge, dark }
    }
}

/// Adds rings and curtains to all eyes. Add it after `DefaultPlugins`.
pub struct ComfortPlugin;

impl Plugin for ComfortPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<Comfort>()
            .init_resource::<Cloth>()
            .add_systems(Update, (hang, close, darken).chain().after(Moves));
    }
}

/// Returns a ring around the −z axis at distance 1: clear inside, black outside.
fn ring() -> Mesh {
    let (mut positions, mut colors, mut indices) = (Vec::new(), Vec::new(), Vec::new());
    for (radius, alpha) in RADII {
        for segment in 0..SEGMENTS {
            let (sin, cos) = (segment as f32 / SEGMENTS as f32 * TAU).sin_cos();
            positions.push([radius * cos, radius * sin, 0.0]);
            colors.push([1.0, 1.0, 1.0, alpha]);
        }
    }
    for band in 0..RADII.len() as u32 - 1 {
        for segment in 0..SEGMENTS {
            let next = (segment + 1) % SEGMENTS;
            let [a, b] = [segment, next].map(|segment| band * SEGMENTS + segment);
            let [c, d] = [a, b].map(|inner| inner + SEGMENTS);
            indices.extend([a, c, b, b, c, d]);
        }
    }
    let normals = vec![[0.0, 0.0, 1.0]; positions.len()];
    Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::default())
        .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, positions)
        .with_inserted_attribute(Mesh::ATTRIBUTE_NORMAL, normals)
        .with_inserted_attribute(Mesh::ATTRIBUTE_COLOR, colors)
        .with_inserted_indices(Indices::U32(indices))
}

/// Adds a ring and a curtain to every new eye, on a separate render layer.
fn hang(mut commands: Commands, cloth: Res<Cloth>, eyes: Query<(Entity, &EyeView), Added<EyeView>>) {
    for (eye, view) in &eyes {
        let layer = 1 + view.0;
        commands.entity(eye).insert(RenderLayers::layer(0).with(layer));
        let place = Transform::from_xyz(0.0, 0.0, -DISTANCE).with_scale(Vec3::splat(DISTANCE));
        let hidden = (place, RenderLayers::layer(layer), NoFrustumCulling, Visibility::Hidden);
        let (ring, edge) = (Mesh3d(cloth.ring.clone()), MeshMaterial3d(cloth.edge.clone()));
        commands.spawn((Ring, ring, edge, hidden.clone(), ChildOf(eye)));
        let (curtain, dark) = (Mesh3d(cloth.curtain.clone()), MeshMaterial3d(cloth.dark.clone()));
        commands.spawn((Curtain, curtain, dark, hidden, ChildOf(eye)));
    }
}

/// Closes the rings while the body moves or turns, and opens them while it is at rest.
fn close(
    time: Res<Time>,
    body: Option<Single<&Transform, With<Body>>>,
    mut before: Local<Option<(Vec3, f32)>>,
    mut comfort: ResMut<Comfort>,
    mut rings: Query<(&mut Transform, &mut Visibility), (With<Ring>, Without<Body>)>,
) {
    let seconds = time.delta_secs();
    let Some(body) = body.filter(|_| seconds > 0.0) else { return };
    let now = (body.translation, body.rotation.to_euler(EulerRot::YXZ).0);
    let motion = before.replace(now).map_or(0.0, |before| motion(before, now, seconds));
    let wanted = if comfort.vignette { motion } else { 0.0 };
    let step = seconds / EASE;
    comfort.closed += (wanted - comfort.closed).clamp(-step, step);
    let size = (OPEN + (1.0 - OPEN) * comfort.closed) * DISTANCE;
    for (mut transform, mut visibility) in &mut rings {
        transform.scale = Vec3::new(size, size, DISTANCE);
        visibility.set_if_neq(if comfort.closed > 0.0 { Visibility::Inherited } else { Visibility::Hidden });
    }
}

/// Returns the strength of a motion between two poses in `seconds`: 0 at rest or for a jump, 1 from [`FAST`] on.
fn motion(before: (Vec3, f32), now: (Vec3, f32), seconds: f32) -> f32 {
    let (speed, turn) = (before.0.distance(now.0) / seconds, wrapped(now.1 - before.1).abs() / seconds);
    if speed > JUMP[0] || turn > JUMP[1] { 0.0 } else { (speed.max(turn) / FAST).min(1.0) }
}

/// Draws the curtains while teleporting.
fn darken(
    teleport: Res<Teleport>,
    cloth: Res<Cloth>,
    mut materials: ResMut<Assets<StandardMaterial>>,
    mut curtains: Query<&mut Visibility, With<Curtain>>,
) {
    if !teleport.is_changed() {
        return;
    }
    let dark = teleport.dark();
    if let Some(mut material) = materials.get_mut(&cloth.dark) {
        material.base_color = Color::BLACK.with_alpha(dark);
    }
    for mut visibility in &mut curtains {
        visibility.set_if_neq(if dark > 0.0 { Visibility::Inherited } else { Visibility::Hidden });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bevy::time::TimeUpdateStrategy;
    use std::f32::consts::{FRAC_PI_6, PI};
    use std::time::Duration;

    const FRAME: f32 = 1.0 / 60.0;

    #[test]
    fn walking_and_turning_close_the_vignette() {
        let still = (Vec3::new(1.0, 0.0, 2.0), 0.5);
        assert_eq!(motion(still, still, FRAME), 0.0, "a body at rest has no motion");
        let walked = (still.0 + Vec3::X * 1.5 * FRAME, still.1);
        assert_eq!(motion(still, walked, FRAME), 1.0, "walking closes the vignette");
        let slow = motion(still, (still.0 + Vec3::X * 0.4 * FRAME, still.1), FRAME);
        assert!((slow - 0.5).abs() < 1e-3, "half of the full speed closes it by half, not by {slow}");
        let turned = motion((still.0, PI - 0.01), (still.0, 0.01 - PI), FRAME);
        assert_eq!(turned, 1.0, "turning across the angle of half a turn closes the vignette");
    }

    #[test]
    fn a_jump_does_not_close_the_vignette() {
        let before = (Vec3::ZERO, 0.0);
        assert_eq!(motion(before, (Vec3::new(2.0, 0.0, -1.0), 0.0), FRAME), 0.0, "a teleport is a jump");
        assert_eq!(motion(before, (Vec3::ZERO, FRAC_PI_6), FRAME), 0.0, "a snap turn is a jump");
    }

    /// Returns whether the ring is visible, and its size relative to its distance, after the body has moved `step`
    /// meters in each of `frames` frames.
    fn walk(app: &mut App, step: f32, frames: usize) -> (bool, f32) {
        for _ in 0..frames {
            let mut body = app.world_mut().query_filtered::<&mut Transform, With<Body>>();
            body.single_mut(app.world_mut()).expect("one body").translation.z += step;
            app.update();
        }
        let mut rings = app.world_mut().query_filtered::<(&Transform, &Visibility), With<Ring>>();
        let (transform, visibility) = rings.single(app.world()).expect("one ring for one eye");
        (*visibility != Visibility::Hidden, transform.scale.x / DISTANCE)
    }

    #[test]
    fn the_vignette_closes_while_the_body_walks_and_opens_at_rest() {
        let mut app = App::new();
        app.add_plugins((MinimalPlugins, AssetPlugin::default()));
        app.init_asset::<Mesh>().init_asset::<StandardMaterial>().init_resource::<Teleport>();
        app.add_plugins(ComfortPlugin);
        app.insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_millis(50)));
        app.world_mut().spawn((Body::default(), Transform::default()));
        app.world_mut().spawn((EyeView(0), Transform::default()));
        assert!(!walk(&mut app, 0.0, 3).0, "the ring is hidden at rest");
        let (shows, size) = walk(&mut app, 0.05, 10);
        assert!(shows && (size - 1.0).abs() < 1e-3, "half a second of walking closes the ring, not to {size}");
        assert!(!walk(&mut app, 0.0, 10).0, "half a second of rest opens the ring");
        app.world_mut().resource_mut::<Comfort>().vignette = false;
        assert!(!walk(&mut app, 0.05, 10).0, "the ring stays hidden while the vignette is off");
    }
}
