//! The buffers of a capture, which `project` and `activate` read.
//!
//! In: the [`Form`] of a scene and a range of its Gaussians. Out: storage buffers in the order of the shader's
//! bindings. Packed scenes are uploaded without unpacking.

use crate::gaussian::{Gaussian, Harmonics};
use crate::renderer::memory::Allocator;
use crate::scene::packed::{BLOCK, BLOCK_RANGES, COLOR_WORDS, RECORD_WORDS, SHARED_RANGES};
use crate::scene::{ActiveSets, CodedColors, Form, PackedColors, TemporalFilter};
use std::ops::Range;

/// Number of records that are written together.
const RECORDS_AT_ONCE: usize = 1 << 14;

/// The device and the queue with which buffers are created and written.
#[derive(Clone, Copy)]
pub(super) struct Gpu<'a> {
    pub allocator: Allocator<'a>,
    pub queue: &'a wgpu::Queue,
}

/// Returns the bytes of one Gaussian in the largest buffer. `stride` is the number of four-vectors of whole
/// coefficients per Gaussian.
pub(super) fn largest_record(form: &Form, stride: usize) -> u64 {
    let whole = stride * size_of::<[f32; 4]>();
    let (geometry, color) = match form {
        Form::Sliced(_) => (size_of::<Gaussian>(), whole),
        Form::Packed(packed) => {
            let color = match &packed.colors {
                PackedColors::Whole(_) => whole,
                PackedColors::Coded(_) => size_of::<[u32; COLOR_WORDS]>(),
            };
            (size_of::<[u32; RECORD_WORDS]>(), color)
        }
    };
    geometry.max(color) as u64
}

/// Creates the buffers of the geometry of some Gaussians, the first at a multiple of a block.
pub(super) fn geometry(gpu: Gpu<'_>, form: &Form, own: Range<usize>) -> Vec<wgpu::Buffer> {
    match form {
        Form::Sliced(sliced) => {
            let own = &sliced.gaussians[own];
            vec![gaussians(gpu, own), lifespans(gpu, own)]
        }
        Form::Packed(packed) => {
            let blocks = own.start / BLOCK * BLOCK_RANGES..own.end.div_ceil(BLOCK) * BLOCK_RANGES;
            let (shared, blocks) = (&packed.ranges[..SHARED_RANGES], &packed.ranges[SHARED_RANGES..][blocks]);
            vec![
                plain(gpu, "gs4d records", bytemuck::cast_slice(&packed.records[own])),
                plain(gpu, "gs4d ranges", bytemuck::cast_slice(&[shared, blocks].concat())),
            ]
        }
    }
}

/// Creates the buffer of the color of some Gaussians, without codebooks. `stride` as for [`largest_record`].
pub(super) fn color(gpu: Gpu<'_>, form: &Form, own: Range<usize>, stride: usize) -> wgpu::Buffer {
    match form {
        Form::Sliced(sliced) => harmonics(gpu, &sliced.harmonics, own, stride),
        Form::Packed(packed) => match &packed.colors {
            PackedColors::Whole(whole) => harmonics(gpu, whole, own, stride),
            PackedColors::Coded(coded) => plain(gpu, "gs4d color records", bytemuck::cast_slice(&coded.records[own])),
        },
    }
}

/// Returns the words of one entry of a codebook on the GPU: 48 values of half precision for each time harmonic, whatever the spatial
/// degree.
pub(super) fn entry_words(colors: &CodedColors) -> usize {
    colors.words_per_entry().next_multiple_of(12) * 2
}

/// Creates the buffer of all codebooks.
pub(super) fn codebooks(gpu: Gpu<'_>, colors: &CodedColors) -> wgpu::Buffer {
    let words = entry_words(colors);
    let mut halves = Vec::with_capacity(colors.codebooks.len() / colors.words_per_entry() * words * 2);
    for (entry, scales) in colors.all_entries() {
        let end = halves.len() + words * 2;
        halves.extend(entry.iter().zip(scales).flat_map(|(&word, scale)| CodedColors::values(word, scale)));
        halves.resize(end, half::f16::ZERO);
    }
    // A binding of no bytes is not allowed.
    halves.resize(halves.len().max(8), half::f16::ZERO);
    plain(gpu, "gs4d codebooks", bytemuck::cast_slice(&halves))
}

/// Creates the buffer of the sets of some Gaussians: the words of each segment in turn, or one word of interval for
/// each Gaussian.
pub(super) fn filter(gpu: Gpu<'_>, filter: &TemporalFilter, own: Range<usize>) -> wgpu::Buffer {
    let words = match &filter.sets {
        ActiveSets::Bits(bits) => {
            // Parts begin at multiples of 32.
            let all = TemporalFilter::words(filter.count);
            let own = own.start / 32..own.end.div_ceil(32);
            bits.chunks_exact(all).flat_map(|segment| &segment[own.clone()]).copied().collect()
        }
        ActiveSets::Intervals(intervals) => intervals[own].to_vec(),
    };
    plain(gpu, "gs4d filter", bytemuck::cast_slice(&words))
}

pub(super) fn plain(gpu: Gpu<'_>, label: &'static str, contents: &[u8]) -> wgpu::Buffer {
    filled(gpu, label, contents, wgpu::BufferUsages::STORAGE)
}

/// Creates a buffer and writes it through the queue: mapping would panic on a device that has just been lost.
fn filled(gpu: Gpu<'_>, label: &'static str, contents: &[u8], usage: wgpu::BufferUsages) -> wgpu::Buffer {
    let made = gpu.allocator.buffer(label, contents.len() as u64, usage);
    gpu.queue.write_buffer(&made, 0, contents);
    made
}

/// Creates the buffer of the records, with `1/σ_t` in place of `σ_t`: zero instead of infinity.
fn gaussians(gpu: Gpu<'_>, gaussians: &[Gaussian]) -> wgpu::Buffer {
    records(gpu, "gs4d gaussians", gaussians.len(), size_of::<Gaussian>(), |index, record| {
        let gaussian = gaussians[index];
        record.copy_from_slice(bytemuck::bytes_of(&Gaussian { sigma_t: gaussian.sigma_t.recip(), ..gaussian }));
    })
}

/// Creates the buffer of `mean_t` and `1/σ_t`, once more.
fn lifespans(gpu: Gpu<'_>, gaussians: &[Gaussian]) -> wgpu::Buffer {
    records(gpu, "gs4d lifespans", gaussians.len(), size_of::<[f32; 2]>(), |index, record| {
        let Gaussian { mean_t, sigma_t, .. } = gaussians[index];
        record.copy_from_slice(bytemuck::bytes_of(&[mean_t, sigma_t.recip()]));
    })
}

/// Creates the buffer of the coefficients that are evaluated, padded to whole four-vectors per Gaussian.
fn harmonics(gpu: Gpu<'_>, harmonics: &Harmonics, own: Range<usize>, stride: usize) -> wgpu::Buffer {
    let used = harmonics.evaluated() * 3;
    records(gpu, "gs4d harmonics", own.len(), stride * 16, |index, record| {
        record[..used * 4].copy_from_slice(bytemuck::cast_slice(&harmonics.of(own.start + index)[..used]));
    })
}

/// Creates a storage buffer of records, written in chunks to avoid a second copy of all of them on the host.
fn records(
    gpu: Gpu<'_>,
    label: &'static str,
    count: usize,
    size: usize,
    fill: impl Fn(usize, &mut [u8]),
) -> wgpu::Buffer {
    let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC;
    let made = gpu.allocator.buffer(label, (count * size) as u64, usage);
    let mut chunk = Vec::new();
    for first in (0..count).step_by(RECORDS_AT_ONCE) {
        let own = RECORDS_AT_ONCE.min(count - first);
        // What is not filled is zero.
        chunk.clear();
        chunk.resize(own * size, 0);
        for (index, record) in chunk.chunks_exact_mut(size).enumerate() {
            fill(first + index, record);
        }
        gpu.queue.write_buffer(&made, (first * size) as u64, &chunk);
    }
    made
}
