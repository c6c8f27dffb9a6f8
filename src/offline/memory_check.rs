//! The check that the pictures of a command fit the memory and the GPU, before the first picture is loaded or drawn.
//!
//! In: the sizes of the pictures that are held at once, and their use ([`Pictures`]). Out: an error with the memory needed,
//! the memory available, and the option that makes pictures smaller or fewer. Every estimate of memory by pixels is here.

use super::OfflineError;
use super::dataset::TrainingView;
use super::fine_tune::require_bindings;
use super::metrics::MetricSet;
use crate::renderer::{GpuError, Headless};
use crate::view::View;
use glam::UVec2;
use std::fs;

/// The remedy for views of a dataset.
pub(crate) const BY_RESOLUTION: &str = "--resolution makes pictures smaller, by a divisor or a width";
/// The remedy for views of a camera file or an orbit.
pub(crate) const BY_SIZE: &str = "--size makes pictures smaller";
/// The remedy for pictures that are compared with pictures of another scene.
pub(crate) const BY_SIZE_OR_COUNT: &str = "--size makes pictures smaller, --verify fewer";
/// The remedy for levels of detail.
pub(crate) const BY_DIRECTIONS: &str = "--directions and --times make pictures fewer";
/// The remedy for callers of the library.
const SMALLER: &str = "draw smaller ones, or fewer at once";

/// Bytes for each pixel while the CPU reference draws: color, transmittance and two depths of each pixel, and the frame made of them.
const ON_CPU: u64 = 24 + 24;
/// Bytes for each pixel on the host while a frame is read back: its color, its depths as mapped, copied and without padding, and the mapped
/// buffers of the frame before, which are released late.
const READ_BACK: u64 = 2 * 16 + 3 * 8 + 16 + 8;
/// Bytes for each pixel of the targets on the GPU: color and depths.
const TARGETS: u64 = 16 + 8;
/// Bytes for each pixel on the GPU while it trains: slopes of similarity, gradients of color and of depth, an image.
const TRAINING: u64 = 48 + 16 + 4 + 4;

/// Bytes for each pixel of a picture.
const PICTURE: u64 = 12;
/// Bytes for each pixel of an image in memory: color and coverage.
const IMAGE: u64 = 4;
/// Bytes for each pixel of an image while it is decoded and resampled, with the image that results.
const LOADING: u64 = 12;
/// Bytes for each pixel of a picture that is written: its bytes.
const WRITTEN: u64 = 3;
/// Bytes for each pixel while FLIP compares two pictures, as measured with pictures of 1024x1024 and 2048x2048 pixels.
const FLIP: u64 = 150;
/// Bytes for each pixel while MS-SSIM compares two pictures: their halves, and the halves of these.
const MS_SSIM: u64 = 8;
/// Bytes for each pixel while reference, render and difference are put side by side: a clamped copy, the difference, all three.
const SIDE_BY_SIDE: u64 = PICTURE + PICTURE + 3 * (PICTURE + WRITTEN);

/// Bytes for each pixel of an image that is compared: as a picture and as it was loaded. The render, also clamped, comes beside.
const COMPARED: u64 = PICTURE + IMAGE;
/// Most bytes of views that are compared at once, unless a single one needs more.
const COMPARED_BYTES: u64 = 1 << 30;

/// Bytes that are assumed to be available without a check.
const LITTLE: u64 = 1 << 28;

/// The pictures that are in memory at the same time.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct Pictures {
    /// Number of pictures held.
    count: u64,
    /// Bytes of all pictures held.
    held: u64,
    /// Size of the largest picture that is drawn or loaded, pixels.
    largest: UVec2,
    /// Bytes for each pixel of the largest picture in memory while it is drawn.
    beside: u64,
    /// Bytes for each pixel of the largest picture in memory while it is loaded or compared, and not drawn.
    work: u64,
    /// Whether a GPU trains on the pictures.
    trained: bool,
}

impl Pictures {
    /// Returns a picture that is drawn, with `beside` bytes for each of its pixels in memory.
    pub(crate) fn drawn(size: UVec2, beside: u64) -> Self {
        Self { largest: size, beside, ..Self::default() }
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
        let sizes = || views.iter().map(|view| view.size);
        // A picture, and both clamped.
        Self { work: 3 * PICTURE, ..Self::held(sizes(), PICTURE) }
    }

    /// Returns images that are held as pictures, while pictures are compared with them.
    pub(crate) fn compared<'a>(views: impl IntoIterator<Item = &'a TrainingView>) -> Self {
        let held = Self::held(views.into_iter().map(|view| view.camera.size), PICTURE);
        Self { work: (2 * PICTURE).max(loading(held.count)), ..held }
    }

    /// Returns images that are compared with pictures, [some at a time](compared_at_once); `kept`: whether both are also put side by side.
    pub(crate) fn evaluated(views: &[TrainingView], metrics: MetricSet, kept: bool) -> Self {
        let at_once = compared_at_once(views, metrics) as u64;
        let side_by_side = if kept { SIDE_BY_SIDE } else { 0 };
        let work = at_once * comparing(metrics) + side_by_side;
        Self { work, ..Self::drawn(largest(sizes(views)), at_once * COMPARED) }
    }

    /// Returns images that a GPU trains on, of these sizes.
    pub(crate) fn trained(sizes: impl Iterator<Item = UVec2>) -> Self {
        let held = Self::held(sizes, IMAGE);
        // A validation image is compared as a picture.
        Self { beside: PICTURE, work: loading(held.count), trained: true, ..held }
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

    /// Checks that there is memory for the pictures, and that the GPU can draw the largest, if a GPU draws; else the CPU does. If
    /// the available memory is unknown, all pictures pass.
    ///
    /// # Errors
    /// The needed and the available memory, with `remedy`.
    pub(crate) fn require(&self, headless: Option<&Headless>, remedy: &'static str) -> Result<(), OfflineError> {
        let Some(headless) = headless else { return self.require_bytes(ON_CPU, remedy, available) };
        let limited = |reason: GpuError| OfflineError::Limit { reason, remedy };
        if self.largest != UVec2::ZERO {
            headless.require_picture(self.largest).map_err(limited)?;
        }
        let mut device = TARGETS;
        if self.trained {
            require_bindings(headless, self.largest).map_err(limited)?;
            device += TRAINING;
        }
        let shares_memory = match headless.context().info.device_type {
            wgpu::DeviceType::Cpu | wgpu::DeviceType::IntegratedGpu => device,
            _ => 0,
        };
        self.require_bytes(READ_BACK + shares_memory, remedy, available)
    }

    /// Checks that there is memory for the pictures while none is drawn.
    ///
    /// # Errors
    /// The error of [`require`](Self::require).
    pub(crate) fn require_loaded(&self, remedy: &'static str) -> Result<(), OfflineError> {
        self.require_bytes(0, remedy, available)
    }

    /// Checks that there is memory if drawing needs `drawing` bytes for each pixel.
    fn require_bytes(
        &self,
        drawing: u64,
        remedy: &'static str,
        available: impl FnOnce() -> Option<u64>,
    ) -> Result<(), OfflineError> {
        let each = (self.beside + drawing).max(self.work);
        let needed = pixels(self.largest).saturating_mul(each).saturating_add(self.held);
        require_of(needed, available).map_err(|available| {
            let (count, size) = (self.count.max(1), self.largest);
            OfflineError::Memory { count, size, needed, available, remedy }
        })
    }
}

/// Returns the bytes for each pixel of an image while it is compared with a picture.
fn comparing(metrics: MetricSet) -> u64 {
    let measured = [(metrics.flip, FLIP), (metrics.ms_ssim, MS_SSIM)];
    COMPARED + 2 * PICTURE + measured.iter().filter(|(wanted, _)| *wanted).map(|(_, bytes)| *bytes).max().unwrap_or(0)
}

/// Returns how many views are compared with their images at once: one for each thread, as far as that takes little memory, and at least one.
pub(crate) fn compared_at_once(views: &[TrainingView], metrics: MetricSet) -> usize {
    let each = pixels(largest(sizes(views))).saturating_mul(comparing(metrics)).max(1);
    rayon::current_num_threads().min((COMPARED_BYTES / each) as usize).max(1)
}

/// Checks that there is memory and that the GPU can draw, for a picture that is drawn now.
pub(super) fn require(size: UVec2, headless: Option<&Headless>) -> Result<(), OfflineError> {
    Pictures::drawn(size, 0).require(headless, SMALLER)
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

fn pixels(size: UVec2) -> u64 {
    size.as_u64vec2().element_product()
}

/// Returns the bytes of memory for images that are read once in place of whenever they are needed: three quarters of what is available.
pub(crate) fn room_for_images() -> u64 {
    available().map_or(u64::MAX, |bytes| bytes / 4 * 3)
}

/// Checks that there are so many bytes of memory. If the available memory is unknown, all are there.
///
/// # Errors
/// The available bytes.
pub(super) fn require_bytes(needed: u64) -> Result<(), u64> {
    require_of(needed, available)
}

/// Checks as [`require_bytes`], with what is available.
fn require_of(needed: u64, available: impl FnOnce() -> Option<u64>) -> Result<(), u64> {
    match (needed > LITTLE).then(available).flatten() {
        Some(available) if needed > available => Err(available),
        _ => Ok(()),
    }
}

/// Returns the bytes available to this program: those of the system without swapping, or the rest of its address space if that is limited
/// to less; `None` if they are unknown.
fn available() -> Option<u64> {
    let read = |path: &str| fs::read_to_string(path).unwrap_or_default();
    let system = kilobytes(&read("/proc/meminfo"), "MemAvailable:")?;
    let used = kilobytes(&read("/proc/self/status"), "VmSize:").unwrap_or(0);
    let limit = address_space(&read("/proc/self/limits")).map_or(u64::MAX, |limit| limit.saturating_sub(used));
    Some(system.min(limit))
}

/// Returns the number after a name in the lists of memory of Linux, bytes.
fn kilobytes(list: &str, name: &str) -> Option<u64> {
    let line = list.lines().find_map(|line| line.strip_prefix(name))?;
    let kilobytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    kilobytes.checked_mul(1024)
}

/// Returns the limit of the address space from Linux's list of limits, bytes; `None` if there is none.
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
    fn needed_and_available_memory_are_named_with_the_remedy() {
        let there = || kilobytes(MEMORY, "MemAvailable:");
        let large = Pictures::drawn(UVec2::splat(16_384), 0);
        let message = large.require_bytes(ON_CPU, BY_SIZE, there).expect_err("12.9 of 8.2 GB").to_string();
        let expected = "a picture of 16384x16384 pixels needs 12.9 GB of memory, and 8.2 GB are available: --size makes pictures smaller";
        assert_eq!(message, expected, "size, need, available memory and remedy");
        Pictures::drawn(UVec2::splat(4096), 0).require_bytes(ON_CPU, BY_SIZE, there).expect("the picture fits");
        Pictures::drawn(UVec2::splat(400), 0)
            .require_bytes(ON_CPU, BY_SIZE, || Some(0))
            .expect("small pictures are not checked");
        large.require_bytes(ON_CPU, BY_SIZE, || None).expect("all pictures pass if the available memory is unknown");
    }

    #[test]
    fn pictures_that_are_held_add_up() {
        let sizes = [UVec2::new(4000, 3000); 100];
        let held = Pictures::held(sizes.into_iter(), PICTURE);
        assert_eq!((held.count, held.held), (100, 14_400_000_000), "each has 12 bytes for each of 12,000,000 pixels");
        let message =
            held.require_bytes(ON_CPU, BY_RESOLUTION, || Some(8 << 30)).expect_err("15 of 8.6 GB").to_string();
        assert!(message.starts_with("100 pictures of up to 4000x3000 pixels need 15.0 GB"), "the count: {message}");
        held.require_bytes(ON_CPU, BY_RESOLUTION, || Some(16 << 30)).expect("15 of 17.2 GB");
        assert_eq!(Pictures::held([UVec2::MAX; 2].into_iter(), 1 << 40).held, u64::MAX, "without overflow");
    }
}
