//! What the interactive examples share: arguments and the mouse.
//!
//! In: the command line, mouse input. Out: what to show and where to write pictures; cameras that circle.

use crate::common::Orbit;
use bevy::input::mouse::{AccumulatedMouseMotion, AccumulatedMouseScroll, MouseScrollUnit};
use bevy::prelude::*;
use std::path::PathBuf;

/// What the command line says.
pub struct Arguments {
    pub file: String,
    /// Where pictures go; nothing for a window.
    pub headless: Option<PathBuf>,
    pub frames: u32,
}

/// `[FILE] [--headless FOLDER] [--frames N]`; without a display, pictures are written all the same.
pub fn arguments(file: &str) -> Result<Arguments> {
    let mut parsed = Arguments { file: file.into(), headless: None, frames: 8 };
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        match argument.as_str() {
            "--headless" => parsed.headless = Some(arguments.next().ok_or("--headless: which folder?")?.into()),
            "--frames" => parsed.frames = arguments.next().ok_or("--frames: how many?")?.parse()?,
            option if option.starts_with('-') => return Err(format!("{option}: no such option").into()),
            _ => parsed.file = argument,
        }
    }
    if parsed.headless.is_none() && !has_display() {
        eprintln!("no display: writing pictures instead");
        parsed.headless = Some("out".into());
    }
    Ok(parsed)
}

fn has_display() -> bool {
    // The feature `viewer` opens X11 windows on Linux.
    !cfg!(target_os = "linux") || std::env::var_os("DISPLAY").is_some_and(|display| !display.is_empty())
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
