//! The check that pictures fit the memory, before they are drawn.
//!
//! In: the size of a picture, bytes for each of its pixels. Out: an error with the needed and the available bytes.

use super::OfflineError;
use super::dataset::TrainingView;
use crate::renderer::Headless;
use glam::UVec2;
use std::fs;

/// Bytes for each pixel while the CPU reference draws: color, transmittance and two depths of each pixel, and the frame made of them.
pub(super) const ON_CPU: u64 = 24 + 24;
/// Bytes for each pixel of a picture that waits to be written, including pictures being written.
pub(super) const PICTURE: u64 = 12 + 3;
/// Bytes for each pixel on the host while a frame is read back: its color, and its depths as mapped, copied and without padding.
const READ_BACK: u64 = 2 * 16 + 3 * 8;
/// Bytes for each pixel of the targets on the GPU: color and depths.
const TARGETS: u64 = 16 + 8;

/// Bytes for each pixel of a training image in memory: color and coverage.
const TRAINING_IMAGE: u64 = 4;

/// Bytes that are assumed to be available without a check.
const LITTLE: u64 = 1 << 28;

/// Returns the bytes of the host's memory for each pixel while a GPU draws; a GPU without its own memory has its targets there, too.
pub(super) fn on_gpu(headless: &Headless) -> u64 {
    match headless.context().info.device_type {
        wgpu::DeviceType::Cpu | wgpu::DeviceType::IntegratedGpu => READ_BACK + TARGETS,
        _ => READ_BACK,
    }
}

/// Checks that there is memory to draw a picture. If the available memory is unknown, any picture passes.
pub(super) fn require(size: UVec2, bytes_per_pixel: u64) -> Result<(), OfflineError> {
    require_of(size, bytes_per_pixel, || available(&fs::read_to_string("/proc/meminfo").ok()?))
}

/// Checks that there is memory for the images of these views, before any of them is loaded.
pub(super) fn require_images<'a>(views: impl Iterator<Item = &'a TrainingView>) -> Result<(), OfflineError> {
    let sizes = views.map(|view| view.camera.size.as_u64vec2().element_product());
    let (count, pixels) = sizes.fold((0, 0u64), |(count, sum), pixels| (count + 1, sum.saturating_add(pixels)));
    let needed = pixels.saturating_mul(TRAINING_IMAGE);
    let there = || available(&fs::read_to_string("/proc/meminfo").ok()?);
    match (needed > LITTLE).then(there).flatten() {
        Some(available) if needed > available => Err(OfflineError::Images { count, needed, available }),
        _ => Ok(()),
    }
}

fn require_of(size: UVec2, bytes_per_pixel: u64, available: impl FnOnce() -> Option<u64>) -> Result<(), OfflineError> {
    let needed = size.as_u64vec2().element_product().saturating_mul(bytes_per_pixel);
    match (needed > LITTLE).then(available).flatten() {
        Some(available) if needed > available => Err(OfflineError::Memory { size, needed, available }),
        _ => Ok(()),
    }
}

/// Returns the bytes available to programs without swapping, from the text of `/proc/meminfo`.
fn available(list: &str) -> Option<u64> {
    let line = list.lines().find_map(|line| line.strip_prefix("MemAvailable:"))?;
    let kilobytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    kilobytes.checked_mul(1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_name_the_needed_and_the_available_bytes() {
        let list = "MemTotal:       16384000 kB\nMemAvailable:    8000000 kB\nBuffers: 0 kB\n";
        let there = available(list);
        assert_eq!(there, Some(8_192_000_000), "the available bytes");
        let large = UVec2::splat(16_384);
        let message = require_of(large, ON_CPU, || there).expect_err("too large").to_string();
        for part in ["16384x16384", "12.9 GB", "8.2 GB"] {
            assert!(message.contains(part), "{part}: {message}");
        }
        require_of(UVec2::splat(4096), ON_CPU, || there).expect("the picture fits");
        require_of(UVec2::splat(400), ON_CPU, || Some(0)).expect("small pictures are not checked");
        require_of(large, ON_CPU, || None).expect("any picture passes if the available memory is unknown");
        assert_eq!(available("MemTotal: 1 kB\n"), None, "a list without available memory");
        assert_eq!(available("MemAvailable: many\n"), None, "a value that is not a number");
    }
}
