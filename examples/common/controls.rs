//! Shared by the examples with an orbiting camera and a window: arguments and the mouse.
//!
//! In: the command line, mouse input. Out: the file to show and the folder for pictures; orbiting cameras.

use crate::common::Orbit;
use crate::common::arguments::{Arguments, parse};
use bevy::input::mouse::{AccumulatedMouseMotion, AccumulatedMouseScroll, MouseScrollUnit};
use bevy::prelude::*;

/// `[FILE] [--headless FOLDER] [--frames N]`: a window, or eight pictures.
pub fn arguments(file: &str) -> Result<Arguments> {
    parse(Arguments { file: file.into(), headless: None, frames: 8 }, |_, _| Ok(false))
}

/// Puts cameras where they orbit.
pub fn follow(mut cameras: Query<(&Orbit, &mut Transform)>) {
    for (orbit, mut transform) in &mut cameras {
        *transform = orbit.transform();
    }
}

/// Drag with the left button: go round; wheel: nearer and farther.
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
    orbit.distance = (orbit.distance * 0.9f32.powf(notches)).clamp(0.05, 1e4);
}
