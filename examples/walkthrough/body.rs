//! The body: walks, turns and carries the head.
//!
//! In: mouse and keys. Out: the transforms of body and head.

use bevy::input::mouse::AccumulatedMouseMotion;
use bevy::prelude::*;
use bevy_gs4d::stereo::StereoRig;
use std::f32::consts::FRAC_PI_6;

/// Height of the head above the floor, in meters.
pub const EYE_HEIGHT: f32 = 1.6;
/// Start pose of the body.
pub const START: Transform = Transform::from_xyz(0.0, 0.0, 3.3);
/// Walking speed, in meters per second.
const SPEED: f32 = 1.5;
/// Rate at which the velocity approaches the wanted one, per second.
const EAGERNESS: f32 = 8.0;
/// Rotation per motion of the mouse, in radians per pixel.
const SENSITIVITY: f32 = 0.004;

/// The body: it stands on the floor and turns only about the vertical. With a headset, it is the tracking space of the
/// head.
#[derive(Component, Default)]
pub struct Body {
    velocity: Vec3,
}

/// The viewpoint for walking and aiming: the head of the stereo rig, or one eye of a headset.
#[derive(Component)]
pub struct Head;

/// The set of systems that move the body.
#[derive(SystemSet, Debug, Clone, PartialEq, Eq, Hash)]
pub struct Moves;

/// Turns the body and, without a headset, tilts the head with the mouse.
pub fn look_around(
    buttons: Res<ButtonInput<MouseButton>>,
    motion: Res<AccumulatedMouseMotion>,
    mut body: Single<&mut Transform, With<Body>>,
    head: Option<Single<&mut Transform, (With<StereoRig>, Without<Body>)>>,
) {
    if !buttons.pressed(MouseButton::Left) {
        return;
    }
    body.rotate_y(-motion.delta.x * SENSITIVITY);
    if let Some(mut head) = head {
        let (_, pitch, _) = head.rotation.to_euler(EulerRot::YXZ);
        head.rotation = Quat::from_rotation_x((pitch - motion.delta.y * SENSITIVITY).clamp(-1.5, 1.5));
    }
}

/// Walks in the direction of view, with smooth starts and stops.
pub fn walk(
    time: Res<Time>,
    keys: Res<ButtonInput<KeyCode>>,
    body: Single<(&mut Body, &mut Transform)>,
    head: Single<&GlobalTransform, With<Head>>,
) {
    let (mut body, mut place) = body.into_inner();
    let pressed = |key: KeyCode| f32::from(u8::from(keys.pressed(key)));
    let forward = head.forward().with_y(0.0).normalize_or_zero();
    let way = forward * (pressed(KeyCode::KeyW) - pressed(KeyCode::KeyS))
        + forward.cross(Vec3::Y) * (pressed(KeyCode::KeyD) - pressed(KeyCode::KeyA));
    let seconds = time.delta_secs();
    let eased = 1.0 - (-EAGERNESS * seconds).exp();
    body.velocity = body.velocity.lerp(way.normalize_or_zero() * SPEED, eased);
    place.translation += body.velocity * seconds;
}

/// Turns the body by 30 degrees about the head in one step, because a smooth turn may cause motion sickness.
pub fn snap_turn(
    keys: Res<ButtonInput<KeyCode>>,
    mut body: Single<&mut Transform, With<Body>>,
    head: Single<&GlobalTransform, With<Head>>,
) {
    let turns = i32::from(keys.just_pressed(KeyCode::KeyQ)) - i32::from(keys.just_pressed(KeyCode::KeyE));
    if turns != 0 {
        body.rotate_around(head.translation(), Quat::from_rotation_y(turns as f32 * FRAC_PI_6));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_snap_turn_keeps_the_head_in_place() {
        let body = Transform::from_xyz(1.0, 0.0, 2.0).with_rotation(Quat::from_rotation_y(0.4));
        let head = Transform::from_xyz(0.3, EYE_HEIGHT, -0.2);
        for (key, angle) in [(KeyCode::KeyQ, FRAC_PI_6), (KeyCode::KeyE, -FRAC_PI_6)] {
            let mut keys = ButtonInput::default();
            keys.press(key);
            let mut app = App::new();
            app.insert_resource(keys).add_systems(Update, snap_turn);
            let entity = app.world_mut().spawn((Body::default(), body)).id();
            app.world_mut().spawn((Head, GlobalTransform::from(body * head)));
            app.update();
            let turned = *app.world().get::<Transform>(entity).expect("a body");
            let [before, after] = [body, turned].map(|body| (body * head).translation);
            assert!(before.abs_diff_eq(after, 1e-5), "the head moved from {before} to {after}");
            let turn = turned.rotation * body.rotation.inverse();
            assert!(
                turn.abs_diff_eq(Quat::from_rotation_y(angle), 1e-5),
                "the body turned by {turn}, not by 30 degrees"
            );
        }
    }
}
