//! Checks of every scene that a reader accepts.
//!
//! In: a scene. Out: whether it was drawn ([`Outcome`]), or the defect: a value of a picture beyond the limits of the
//! scene, a picture that the CPU reference and the designs of the GPU draw differently, or a file written from the
//! scene that cannot be read or is another scene.

use crate::designs::{self, Expected};
use crate::limits::Limits;
use crate::readers::Outcome;
use crate::support::packed_scene::{self, BLACK, settings};
use bevy_gs4d::codec::package::{self, PackageError, WriteSettings};
use bevy_gs4d::offline::compress::compress;
use bevy_gs4d::offline::draw::orbit;
use bevy_gs4d::reference;
use bevy_gs4d::scene::{Bounds, BoundsOverTime, GaussianScene, RuntimeScene};
use glam::UVec2;
use std::io::Cursor;

/// Most Gaussians of a scene that is drawn.
const DRAWN: usize = 4096;
/// Most Gaussians of a scene that is compressed.
const COMPRESSED: usize = 512;
/// Size of the pictures from cameras around the scene, pixels.
const SIZE: UVec2 = UVec2::new(24, 16);

/// The renderers that draw a scene.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum DrawnBy {
    /// The CPU reference.
    Cpu,
    /// The CPU reference, and both designs of the GPU if there is one.
    CpuAndGpu,
}

/// Checks a scene as it was read. One that cannot be drawn counts as refused.
pub fn check(scene: GaussianScene, by: DrawnBy) -> Result<Outcome, String> {
    rewrite(&scene)?;
    let runtime = match scene.into_runtime() {
        Ok(runtime) => runtime,
        Err(error) => return Ok(Outcome::Refused(error.to_string())),
    };
    runtime.check().map_err(|reason| format!("is accepted, but {reason}"))?;
    if runtime.len() > DRAWN {
        return Ok(Outcome::Accepted);
    }
    draw(&runtime, by)?;
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

/// Checks that a scene can be written, and that the file holds the same scene. Writing is deterministic and without
/// loss, so that bytes are compared, including those of NaNs.
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
    draw(&again, DrawnBy::Cpu).map_err(|defect| format!("is compressed, and {defect}"))
}

/// Draws a scene from the camera of synthetic scenes at the middle of its time, and from cameras around the scene at
/// its first, middle and last time.
pub fn draw(scene: &RuntimeScene, by: DrawnBy) -> Result<(), String> {
    let [first, last] = scene.trained_with.time_interval;
    let mut views = vec![(packed_scene::view(0.5 * first + 0.5 * last), BLACK)];
    // A scene without Gaussians has no bounds to place cameras around.
    for shot in orbit(scene, 3, SIZE).unwrap_or_default() {
        if !shot.camera.world_to_camera.is_finite() {
            return Err("the cameras around it are not finite".to_owned());
        }
        views.push((shot.view(scene), scene.trained_background()));
    }
    let limits = Limits::of(scene);
    let mut expected = Vec::new();
    for (view, background) in views {
        let frame = reference::render(scene, &view, background);
        limits.check(&frame, &view, background)?;
        expected.push(Expected { view, background, frame });
    }
    if by == DrawnBy::CpuAndGpu {
        designs::compare(scene, &limits, &expected)?;
    }
    let bounds =
        BoundsOverTime::of(scene.iter(), [first, last], scene.trained_with.marginal_cutoff, scene.filter.as_ref());
    let finite = |bounds: Bounds| bounds.min.is_finite() && bounds.max.is_finite();
    if bounds.and_then(|bounds| bounds.at(first)).is_none_or(finite) {
        Ok(())
    } else {
        Err("its bounds are not finite".to_owned())
    }
}
