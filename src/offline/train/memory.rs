//! The memory that training takes for Gaussians, and the check that there is as much, before any picture is loaded.
//!
//! In: a number of Gaussians, the degrees of their colors, a device. Out: bytes; an error that says what is lacking.

use super::error::TrainError;
use crate::gaussian::Gaussian;
use crate::gaussian::harmonics::evaluated;
use crate::offline::engine::layout::TrainedRecord;
use crate::offline::engine::memory::require_bytes;
use crate::renderer::device::memory::{binding_limit, with_room};
use crate::renderer::{GpuError, Headless};

/// Largest buffer that is created to see whether the GPU has memory, bytes.
const PIECE: u64 = 1 << 30;

/// States that the host holds at once: the best, the last, and the file of both that is written.
const STATES: u64 = 4;

/// Returns the four-vectors of the color of each Gaussian with these degrees.
pub(crate) fn stride(degree: u32, degree_t: u32) -> u32 {
    (evaluated(degree, degree_t) * 3).div_ceil(4) as u32
}

/// Returns the bytes of one kind of values of each Gaussian: the values themselves, their gradients, or one of two
/// moments.
fn each(stride: u32) -> u64 {
    size_of::<TrainedRecord>() as u64 + 16 * u64::from(stride)
}

/// Returns the bytes on the GPU of so many Gaussians with colors of `stride` four-vectors: values, gradients and
/// moments; slices; notes.
pub(crate) fn bytes(count: u64, stride: u32) -> u64 {
    let sliced = size_of::<Gaussian>() + size_of::<[f32; 2]>();
    count.saturating_mul(4 * each(stride) + sliced as u64 + 8)
}

/// Checks that the GPU and the host have room for so many Gaussians with colors of these degrees, before there are any.
///
/// # Errors
/// The bytes that are needed, and the limit or the lack of memory.
pub(crate) fn require_room(headless: &Headless, count: usize, degree: u32, degree_t: u32) -> Result<(), TrainError> {
    let limited = |reason| TrainError::Limit { reason };
    let (count, stride) = (count as u64, stride(degree, degree_t));
    require_gaussians(headless, count).map_err(limited)?;
    let needed = count.saturating_mul(3 * each(stride)).saturating_mul(STATES);
    let lacking = |available| TrainError::Memory { count, needed, available };
    require_bytes(needed).map_err(lacking)?;
    require_memory(headless, bytes(count, stride)).map_err(limited)
}

/// Checks that the GPU has so much memory, by taking it for a moment.
fn require_memory(headless: &Headless, needed: u64) -> Result<(), GpuError> {
    let (device, allocator) = (&headless.context().device, headless.allocator());
    let piece = device.limits().max_buffer_size.min(PIECE);
    let sizes = (0..needed).step_by(piece as usize).map(|done| piece.min(needed - done).next_multiple_of(4));
    let take = |size| allocator.buffer("gs4d room", size, wgpu::BufferUsages::STORAGE);
    let taken: Vec<wgpu::Buffer> = with_room(device, needed, || sizes.map(take).collect())?;
    taken.iter().for_each(wgpu::Buffer::destroy);
    // The device frees destroyed buffers when it is polled.
    device.poll(wgpu::PollType::Poll).map(|_| ()).map_err(|error| GpuError::Device(error.to_string()))
}

/// Checks that raw parameters of so many Gaussians fit one binding, and one thread for each a dispatch.
pub(crate) fn require_gaussians(headless: &Headless, count: u64) -> Result<(), GpuError> {
    let limits = headless.context().device.limits();
    let each = size_of::<TrainedRecord>() as u64;
    let threads = u64::from(limits.max_compute_workgroups_per_dimension) * 256;
    let (needed, limit) = (count.saturating_mul(each), binding_limit(&limits).min(threads * each));
    match needed > limit {
        true => Err(GpuError::TooLarge { what: "the Gaussians that are trained", needed, limit }),
        false => Ok(()),
    }
}
