//! Checks of every scene that a reader accepts.
//!
//! In: a scene. Out: whether it was drawn ([`Outcome`]), or the defect: a value of a picture that is not finite, or a file written from it that
//! cannot be read or is another scene.

use crate::readers::Outcome;
use crate::support::packed_scene::{self, BLACK, settings};
use bevy_gs4d::codec::package::{self, PackageError, WriteSettings};
use bevy_gs4d::offline::orbit::orbit;
use bevy_gs4d::offline::quantize::compress;
use bevy_gs4d::reference;
use bevy_gs4d::scene::{Bounds, BoundsOverTime, GaussianScene, RuntimeScene};
use bevy_gs4d::view::Frame;
use glam::UVec2;
use std::io::Cursor;

/// Most Gaussians of a scene that is drawn.
const DRAWN: usize = 4096;
/// Most Gaussians of a scene that is compressed.
const COMPRESSED: usize = 512;
/// Size of the pictures from cameras around the scene, pixels.
const SIZE: UVec2 = UVec2::new(24, 16);

/// Checks a scene as it was read. One that cannot be drawn counts as refused.
pub fn check(scene: GaussianScene) -> Result<Outcome, String> {
    rewrite(&scene)?;
    let runtime = match scene.into_runtime() {
        Ok(runtime) => runtime,
        Err(error) => return Ok(Outcome::Refused(error.to_string())),
    };
    runtime.check().map_err(|reason| format!("is accepted, but {reason}"))?;
    if runtime.len() > DRAWN {
        return Ok(Outcome::Accepted);
    }
    draw(&runtime)?;
    if runtime.len() <= COMPRESSED {
        for codebooks in [&[] as &[usize], &[4, 4]] {
            compress_and_read(&runtime, codebooks)?;
        }
    }
    Ok(Outcome::Drawn)
}

/// Returns the package of a scene; `None` if it compresses so well that readers would refuse it as a bomb.
fn pack(scene: &GaussianScene) -> Result<Option<Vec<u8>>, PackageError> {
    let mut file = Vec::new();
    match package::write(&mut file, scene, &WriteSettings { level: 1 }) {
        Ok(()) => Ok(Some(file)),
        Err(PackageError::TooLarge { .. }) => Ok(None),
        Err(error) => Err(error),
    }
}

/// Checks that a scene can be written, and that the file holds the same scene. Writing is deterministic and without loss, so that
/// bytes are compared, including those of NaNs.
fn rewrite(scene: &GaussianScene) -> Result<(), String> {
    let written =
        |scene: &GaussianScene| pack(scene).map_err(|error| format!("is accepted and cannot be written: {error}"));
    let Some(file) = written(scene)? else { return Ok(()) };
    let again = package::read(Cursor::new(&file)).map_err(|error| format!("is written and cannot be read: {error}"))?;
    if written(&again)? == Some(file) { Ok(()) } else { Err("is written and read as another scene".to_owned()) }
}

/// Compresses a scene. If compression accepts it, the written package must be readable and drawable.
pub fn compress_and_read(scene: &RuntimeScene, codebooks: &[usize]) -> Result<(), String> {
    let Ok((compressed, _)) = compress(scene.clone(), &settings(codebooks)) else { return Ok(()) };
    let Ok(Some(file)) = pack(&compressed) else { return Ok(()) };
    let again =
        package::read(Cursor::new(file)).map_err(|error| format!("is compressed and cannot be read: {error}"))?;
    let again = again.into_runtime().map_err(|error| format!("is compressed and cannot be drawn: {error}"))?;
    draw(&again).map_err(|defect| format!("is compressed, and {defect}"))
}

/// Draws a scene from the camera of synthetic scenes at the middle of its time, and from cameras around the scene at its first, middle and
/// last time.
pub fn draw(scene: &RuntimeScene) -> Result<(), String> {
    let [first, last] = scene.trained_with.time_interval;
    let middle = 0.5 * first + 0.5 * last;
    check_frame(&reference::render(scene, &packed_scene::view(middle), BLACK), middle)?;
    // A scene without Gaussians has no bounds to place cameras around.
    for shot in orbit(scene, 3, SIZE).unwrap_or_default() {
        if !shot.camera.world_to_camera.is_finite() {
            return Err("the cameras around it are not finite".to_owned());
        }
        let frame = reference::render(scene, &shot.view(scene), scene.trained_background());
        check_frame(&frame, shot.time)?;
    }
    let bounds = BoundsOverTime::of(scene.iter(), [first, last]);
    let finite = |bounds: Bounds| bounds.min.is_finite() && bounds.max.is_finite();
    if bounds.and_then(|bounds| bounds.at(first)).is_none_or(finite) {
        Ok(())
    } else {
        Err("its bounds are not finite".to_owned())
    }
}

/// Checks that every value of a picture is finite.
pub fn check_frame(frame: &Frame, time: f32) -> Result<(), String> {
    let color: Vec<f32> = frame.picture.pixels.iter().flat_map(|pixel| pixel.to_array()).collect();
    let planes = [
        ("color", &color),
        ("transmittance", &frame.transmittance),
        ("depth", &frame.depth),
        ("median depth", &frame.median_depth),
    ];
    for (name, values) in planes {
        if let Some(value) = values.iter().find(|value| !value.is_finite()) {
            return Err(format!("is drawn with a {name} of {value} at time {time}"));
        }
    }
    Ok(())
}
