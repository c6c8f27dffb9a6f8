//! The check that pictures fit the memory and the GPU, before the first picture is loaded or drawn.
//!
//! In: the sizes of the pictures that are held at once and how they are used ([`Pictures`]), and their [`Purpose`].
//! Out: an [`EngineError`] with the memory needed and the memory available, or with the limit of the GPU.

use super::error::EngineError;
use super::purpose::Purpose;
use crate::offline::dataset::TrainingView;
use crate::renderer::Headless;
use crate::view::View;
use glam::UVec2;
use std::fs;

/// Bytes for each pixel while the CPU reference draws: color, transmittance and two depths of each pixel, and the frame
/// made of them.
const ON_CPU: u64 = 24 + 24;
/// Bytes for each pixel on the host while a frame is read back: its color, its depths as mapped, copied and without
/// padding, and the mapped buffers of the frame before, which are released late.
const READ_BACK: u64 = 2 * 16 + 3 * 8 + 16 + 8;
/// Bytes for each pixel of the targets on the GPU: color and depths.
const TARGETS: u64 = 16 + 8;
/// Bytes for each pixel on the GPU while it trains: slopes of similarity, gradients of color and of depth, an image.
const TRAINING: u64 = 48 + 16 + 4 + 4;

/// Bytes for each pixel of a picture.
pub(crate) const PICTURE: u64 = 12;
/// Bytes for each pixel of an image in memory: color and coverage.
pub(crate) const IMAGE: u64 = 4;
/// Bytes for each pixel of the 8-bit copy of a picture that is written.
pub(crate) const WRITTEN: u64 = 3;
/// Bytes for each pixel of an image while it is decoded and resampled, including the resulting image.
const LOADING: u64 = 12;

/// Bytes that are assumed to be available without a check.
const LITTLE: u64 = 1 << 28;

/// The pictures that are in memory at the same time. Default: none.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct Pictures {
    /// Number of pictures held.
    count: u64,
    /// Bytes of all pictures held.
    held: u64,
    /// Size of the largest picture that is drawn or loaded, pixels.
    largest: UVec2,
    /// Bytes in memory for each pixel of the largest picture while it is drawn.
    beside: u64,
    /// Bytes in memory for each pixel of the largest picture while it is loaded or compared, and not drawn.
    work: u64,
    /// Bytes on the GPU for each pixel of the largest picture, besides its targets.
    on_gpu: u64,
}

impl Pictures {
    /// Returns a picture that is drawn, with `beside` bytes for each of its pixels in memory.
    pub(crate) fn drawn(size: UVec2, beside: u64) -> Self {
        Self { largest: size, beside, ..Self::default() }
    }

    /// Returns these pictures, with `work` bytes in memory for each pixel of the largest while it is loaded or
    /// compared, and not drawn.
    pub(crate) fn with_work(self, work: u64) -> Self {
        Self { work, ..self }
    }

    /// Returns pictures that are drawn one after the other while at most `waiting` are written.
    pub(crate) fn written(sizes: impl IntoIterator<Item = UVec2>, waiting: u64) -> Self {
        Self::drawn(largest(sizes), waiting * (PICTURE + WRITTEN))
    }

    /// Returns views that are drawn one after the other, and are not kept.
    pub(crate) fn looked_at(views: &[TrainingView]) -> Self {
        Self::drawn(largest(sizes(views)), 0)
    }

    /// Returns `count` frames of one size that are held, with `bytes` for each pixel.
    pub(crate) fn frames(size: UVec2, count: u64, bytes: u64) -> Self {
        let held = pixels(size).saturating_mul(count).saturating_mul(bytes);
        Self { count, held, ..Self::drawn(size, 0) }
    }

    /// Returns pictures of these views that are held, while other pictures are compared with them.
    pub(crate) fn originals(views: &[View]) -> Self {
        // A picture and its clamped copy.
        Self::held(views.iter().map(|view| view.size), PICTURE).with_work(2 * PICTURE)
    }

    /// Returns images that are held as pictures, while pictures are compared with them.
    pub(crate) fn compared<'a>(views: impl IntoIterator<Item = &'a TrainingView>) -> Self {
        let held = Self::held(views.into_iter().map(|view| view.camera.size), PICTURE);
        held.with_work((2 * PICTURE).max(loading(held.count)))
    }

    /// Returns images of these sizes that a GPU trains on.
    pub(crate) fn trained(sizes: impl Iterator<Item = UVec2>) -> Self {
        let held = Self::held(sizes, IMAGE);
        // A validation image is compared as a picture.
        Self { beside: PICTURE, work: loading(held.count), on_gpu: TRAINING, ..held }
    }

    /// Returns pictures that are held with `bytes` bytes for each of their pixels.
    fn held(sizes: impl Iterator<Item = UVec2>, bytes: u64) -> Self {
        sizes.fold(Self::default(), |all, size| Self {
            count: all.count + 1,
            held: all.held.saturating_add(pixels(size).saturating_mul(bytes)),
            largest: largest([all.largest, size]),
            ..all
        })
    }

    /// Returns the size of the largest picture, pixels; zero if there is none.
    pub(crate) fn largest(&self) -> UVec2 {
        self.largest
    }

    /// Checks that there is memory for the pictures, and that the GPU can draw the largest; without a GPU, the CPU
    /// draws. If the available memory is unknown, all pictures pass.
    ///
    /// # Errors
    /// The needed and the available memory, or the limit of the GPU.
    pub(crate) fn require(&self, headless: Option<&Headless>, purpose: Purpose) -> Result<(), EngineError> {
        let Some(headless) = headless else { return self.require_bytes(ON_CPU, purpose, available) };
        if self.largest != UVec2::ZERO {
            headless.require_picture(self.largest).map_err(|reason| EngineError::Limit { reason, purpose })?;
        }
        let on_gpu = match headless.context().info.device_type {
            wgpu::DeviceType::Cpu | wgpu::DeviceType::IntegratedGpu => TARGETS + self.on_gpu,
            // Memory of its own.
            _ => 0,
        };
        self.require_bytes(READ_BACK + on_gpu, purpose, available)
    }

    /// Checks that there is memory for the pictures while none is drawn.
    ///
    /// # Errors
    /// The needed and the available memory.
    pub(crate) fn require_loaded(&self, purpose: Purpose) -> Result<(), EngineError> {
        self.require_bytes(0, purpose, available)
    }

    /// Checks that there is memory if drawing needs `drawing` bytes for each pixel.
    fn require_bytes(
        &self,
        drawing: u64,
        purpose: Purpose,
        available: impl FnOnce() -> Option<u64>,
    ) -> Result<(), EngineError> {
        let each = (self.beside + drawing).max(self.work);
        let needed = pixels(self.largest).saturating_mul(each).saturating_add(self.held);
        require_of(needed, available).map_err(|available| {
            let (count, size) = (self.count.max(1), self.largest);
            EngineError::Memory { count, size, needed, available, purpose }
        })
    }
}

/// Checks that there is memory and that the GPU can draw, for a picture that is drawn now.
///
/// # Errors
/// As [`Pictures::require`].
pub(crate) fn require(size: UVec2, headless: Option<&Headless>) -> Result<(), EngineError> {
    Pictures::drawn(size, 0).require(headless, Purpose::Other)
}

/// Returns the bytes for each pixel while as many of `count` images are loaded as there are threads.
fn loading(count: u64) -> u64 {
    LOADING * count.min(rayon::current_num_threads() as u64)
}

fn sizes(views: &[TrainingView]) -> impl Iterator<Item = UVec2> {
    views.iter().map(|view| view.camera.size)
}

/// Returns the size with the most pixels; zero if there is none.
fn largest(sizes: impl IntoIterator<Item = UVec2>) -> UVec2 {
    sizes.into_iter().max_by_key(|size| pixels(*size)).unwrap_or_default()
}

/// Returns the number of pixels of a picture of this size.
pub(crate) fn pixels(size: UVec2) -> u64 {
    size.as_u64vec2().element_product()
}

/// Returns the bytes of memory for images that stay in memory between their uses: three quarters of the available
/// bytes.
pub(crate) fn room_for_images() -> u64 {
    available().map_or(u64::MAX, |bytes| bytes / 4 * 3)
}

/// Checks that `needed` bytes of memory are available. If the available memory is unknown, the check passes.
///
/// # Errors
/// The available bytes.
pub(crate) fn require_bytes(needed: u64) -> Result<(), u64> {
    require_of(needed, available)
}

/// Checks as [`require_bytes`], with a function that returns the available bytes.
fn require_of(needed: u64, available: impl FnOnce() -> Option<u64>) -> Result<(), u64> {
    match (needed > LITTLE).then(available).flatten() {
        Some(available) if needed > available => Err(available),
        _ => Ok(()),
    }
}

/// Returns the bytes available to this process without swapping, or the rest of its address space if a limit leaves
/// less; `None` if they are unknown.
fn available() -> Option<u64> {
    let read = |path: &str| fs::read_to_string(path).unwrap_or_default();
    let system = kilobytes(&read("/proc/meminfo"), "MemAvailable:")?;
    let used = kilobytes(&read("/proc/self/status"), "VmSize:").unwrap_or(0);
    let limit = address_space(&read("/proc/self/limits")).map_or(u64::MAX, |limit| limit.saturating_sub(used));
    Some(system.min(limit))
}

/// Returns the value of an entry of `/proc/meminfo` or `/proc/PID/status`, bytes.
fn kilobytes(list: &str, name: &str) -> Option<u64> {
    let line = list.lines().find_map(|line| line.strip_prefix(name))?;
    let kilobytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    kilobytes.checked_mul(1024)
}

/// Returns the soft limit of the address space from `/proc/PID/limits`, bytes; `None` if there is none.
fn address_space(list: &str) -> Option<u64> {
    let line = list.lines().find_map(|line| line.strip_prefix("Max address space"))?;
    line.split_whitespace().next()?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    const MEMORY: &str = "MemTotal:       16384000 kB\nMemAvailable:    8000000 kB\nBuffers: 0 kB\n";

    #[test]
    fn the_memory_of_the_system_is_read() {
        assert_eq!(kilobytes(MEMORY, "MemAvailable:"), Some(8_192_000_000), "kilobytes of 1024 bytes");
        assert_eq!(kilobytes("MemTotal: 1 kB\n", "MemAvailable:"), None, "a list without the name");
        assert_eq!(kilobytes("MemAvailable: many\n", "MemAvailable:"), None, "a value that is not a number");
        let limits =
            |soft: &str| format!("Limit  Soft Limit  Hard Limit  Units\nMax address space  {soft}  unlimited  bytes\n");
        assert_eq!(address_space(&limits("4096000")), Some(4_096_000), "the soft limit");
        assert_eq!(address_space(&limits("unlimited")), None, "no limit");
    }

    #[test]
    fn needed_and_available_memory_are_named() {
        let there = || kilobytes(MEMORY, "MemAvailable:");
        let large = Pictures::drawn(UVec2::splat(16_384), 0);
        let message = large.require_bytes(ON_CPU, Purpose::Drawn, there).expect_err("12.9 of 8.2 GB").to_string();
        let expected = "a picture of 16384x16384 pixels needs 12.9 GB of memory, and 8.2 GB are available";
        assert_eq!(message, expected, "size, need and available memory");
        Pictures::drawn(UVec2::splat(4096), 0).require_bytes(ON_CPU, Purpose::Drawn, there).expect("the picture fits");
        Pictures::drawn(UVec2::splat(400), 0)
            .require_bytes(ON_CPU, Purpose::Drawn, || Some(0))
            .expect("small pictures are not checked");
        large
            .require_bytes(ON_CPU, Purpose::Drawn, || None)
            .expect("all pictures pass if the available memory is unknown");
    }

    #[test]
    fn pictures_that_are_held_add_up() {
        let sizes = [UVec2::new(4000, 3000); 100];
        let held = Pictures::held(sizes.into_iter(), PICTURE);
        assert_eq!((held.count, held.held), (100, 14_400_000_000), "each has 12 bytes for each of 12,000,000 pixels");
        let message =
            held.require_bytes(ON_CPU, Purpose::Dataset, || Some(8 << 30)).expect_err("15 of 8.6 GB").to_string();
        assert!(message.starts_with("100 pictures of up to 4000x3000 pixels need 15.0 GB"), "the count: {message}");
        held.require_bytes(ON_CPU, Purpose::Dataset, || Some(16 << 30)).expect("15 of 17.2 GB");
        assert_eq!(Pictures::held([UVec2::MAX; 2].into_iter(), 1 << 40).held, u64::MAX, "without overflow");
    }
}
