//! Comfort: black in front of the eyes, which closes in from the edges while the body moves, and covers the view while it teleports.
//!
//! In: the motion of the body. Out: for each eye a ring and a curtain, meshes that only this eye sees.

use super::body::{Body, Moves};
use super::path::wrapped;
use super::teleport::Teleport;
use bevy::asset::RenderAssetUsages;
use bevy::camera::visibility::{NoFrustumCulling, RenderLayers};
use bevy::mesh::{Indices, PrimitiveTopology};
use bevy::prelude::*;
use std::f32::consts::TAU;

/// Distance from the eye, meters: behind the near plane (a headset's is at 0.1), before everything else.
const DISTANCE: f32 = 0.15;
/// The ring's radii as tangents of the angle from the middle, and how much they hide, while it is closed.
const RADII: [(f32, f32); 3] = [(0.45, 0.0), (0.75, 1.0), (12.0, 1.0)];
/// Factor on the ring's size just before it disappears.
const OPEN: f32 = 4.0;
const SEGMENTS: u32 = 48;
/// Seconds until the ring is closed, and until it is open.
const EASE: f32 = 0.25;
/// Meters and radians per second at which it closes entirely.
const FAST: f32 = 0.8;
/// Meters and radians per second above which a motion is a jump: a teleport or a snap turn.
const JUMP: [f32; 2] = [12.0, 10.0];

/// A camera that is one of the eyes; 0 is the left one.
#[derive(Component)]
pub struct EyeView(pub usize);

#[derive(Component)]
struct Ring;

#[derive(Component)]
struct Curtain;

/// Whether the edges close, and how far they are closed, 0 to 1.
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

/// Adds everything for comfort. Add it after `DefaultPlugins`.
pub struct ComfortPlugin;

impl Plugin for ComfortPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<Comfort>()
            .init_resource::<Cloth>()
            .add_systems(Update, (hang, close, darken).chain().after(Moves));
    }
}

/// Returns a ring about the −z axis, at distance 1: clear inside, black outside.
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

/// Gives every new eye its own ring and curtain, on a layer of its own.
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

/// Closes the rings while the body moves or turns, and opens them while it stands.
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

/// Returns the motion from one place and direction to another in `seconds`: 0 for none or a jump, 1 from [`FAST`] on.
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
    fn walking_and_turning_are_motion() {
        let still = (Vec3::new(1.0, 0.0, 2.0), 0.5);
        assert_eq!(motion(still, still, FRAME), 0.0, "who stands does not move");
        let walked = (still.0 + Vec3::X * 1.5 * FRAME, still.1);
        assert_eq!(motion(still, walked, FRAME), 1.0, "walking closes the edges");
        let slow = motion(still, (still.0 + Vec3::X * 0.4 * FRAME, still.1), FRAME);
        assert!((slow - 0.5).abs() < 1e-3, "half as fast as what closes them, {slow}");
        let turned = motion((still.0, PI - 0.01), (still.0, 0.01 - PI), FRAME);
        assert_eq!(turned, 1.0, "turning does, too, also past half a turn");
    }

    #[test]
    fn a_jump_is_no_motion() {
        let before = (Vec3::ZERO, 0.0);
        assert_eq!(motion(before, (Vec3::new(2.0, 0.0, -1.0), 0.0), FRAME), 0.0, "a teleport");
        assert_eq!(motion(before, (Vec3::ZERO, FRAC_PI_6), FRAME), 0.0, "a snap turn");
    }

    /// Returns whether the ring shows, and how large it is for its distance, after the body has gone `step` meters in
    /// each of `frames` frames.
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
    fn the_edges_close_while_the_body_walks_and_open_when_it_stands() {
        let mut app = App::new();
        app.add_plugins((MinimalPlugins, AssetPlugin::default()));
        app.init_asset::<Mesh>().init_asset::<StandardMaterial>().init_resource::<Teleport>();
        app.add_plugins(ComfortPlugin);
        app.insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_millis(50)));
        app.world_mut().spawn((Body::default(), Transform::default()));
        app.world_mut().spawn((EyeView(0), Transform::default()));
        assert!(!walk(&mut app, 0.0, 3).0, "at rest nothing is in the way");
        let (shows, size) = walk(&mut app, 0.05, 10);
        assert!(shows && (size - 1.0).abs() < 1e-3, "half a second of walking closes them, to {size}");
        assert!(!walk(&mut app, 0.0, 10).0, "half a second of rest opens them");
        app.world_mut().resource_mut::<Comfort>().vignette = false;
        assert!(!walk(&mut app, 0.05, 10).0, "unless it is switched off");
    }
}
