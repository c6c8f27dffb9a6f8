//! Shared by the examples with an orbiting camera and a window: arguments and mouse input.
//!
//! In: the command line, mouse input. Out: the file to show and the folder for pictures; the poses of orbiting cameras.

use crate::common::Orbit;
use crate::common::arguments::{Arguments, parse};
use bevy::input::mouse::{AccumulatedMouseMotion, AccumulatedMouseScroll, MouseScrollUnit};
use bevy::prelude::*;

/// Reads `[FILE] [--headless FOLDER] [--frames N]`, and with `more` the options of one example. Default: a window, or
/// eight pictures.
///
/// # Errors
/// Those of [`parse`].
pub fn arguments(
    file: &str,
    more: impl FnMut(&str, &mut dyn Iterator<Item = String>) -> Result<bool>,
) -> Result<Arguments> {
    parse(Arguments { file: file.into(), headless: None, frames: 8 }, more)
}

/// Moves cameras to their positions on the orbit.
pub fn follow(mut cameras: Query<(&Orbit, &mut Transform, &mut Projection)>) {
    for (orbit, mut transform, mut projection) in &mut cameras {
        orbit.place(&mut transform, &mut projection);
    }
}

/// Orbits while the left button is dragged; the wheel moves the camera nearer and farther.
pub fn mouse(
    buttons: Res<ButtonInput<MouseButton>>,
    motion: Res<AccumulatedMouseMotion>,
    scroll: Res<AccumulatedMouseScroll>,
    mut orbit: Single<&mut Orbit>,
) {
    if buttons.pressed(MouseButton::Left) {
        orbit.yaw -= motion.delta.x * 0.006;
        orbit.pitch = (orbit.pitch + motion.delta.y * 0.006).clamp(-1.5, 1.5);
    }
    let notches = scroll.delta.y * if scroll.unit == MouseScrollUnit::Pixel { 0.01 } else { 1.0 };
    orbit.distance = (orbit.distance * 0.9f32.powf(notches)).clamp(1e-5, 1e7);
}
