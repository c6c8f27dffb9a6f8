//! The buffers of a capture: what `project` and `activate` read.
//!
//! In: a [`RuntimeScene`] and a range of its Gaussians. Out: storage buffers in the order of the shader's bindings. Packed scenes go
//! up as they are.

use super::{Storage, note_created};
use crate::gaussian::Gaussian;
use crate::scene::packed::{BLOCK, BLOCK_RANGES, MAX_STAGES, SHARED_RANGES};
use crate::scene::{ActiveSets, CodedColors, RuntimeScene, TemporalFilter};
use std::ops::Range;
use wgpu::util::DeviceExt;

/// Four-vectors of the uniform of codebook scales: 36 for each codebook of 48 coefficients.
pub(super) const CODEBOOK_SCALES: usize = MAX_STAGES * 36;

/// How this scene is stored.
pub(super) fn storage_of(scene: &RuntimeScene) -> Storage {
    match (&scene.packed, scene.coded_colors()) {
        (None, _) => Storage::Full,
        (Some(_), None) => Storage::Packed,
        (Some(_), Some(_)) => Storage::Coded,
    }
}

/// Bytes that one Gaussian takes in the largest buffer.
pub(super) fn largest_record(storage: Storage, stride: usize) -> u64 {
    let (geometry, color) = match storage {
        Storage::Full => (size_of::<Gaussian>(), stride * 16),
        Storage::Packed => (32, stride * 16),
        Storage::Coded => (32, 12),
    };
    geometry.max(color) as u64
}

/// Geometry and colour of some Gaussians, the first at a multiple of a block; codebooks aside. `stride` are the four-vectors of whole
/// coefficients per Gaussian.
pub(super) fn part(device: &wgpu::Device, scene: &RuntimeScene, own: Range<usize>, stride: usize) -> Vec<wgpu::Buffer> {
    let mut buffers = match &scene.packed {
        None => vec![gaussians(device, &scene.gaussians[own.clone()])],
        Some(packed) => {
            let blocks = own.start / BLOCK * BLOCK_RANGES..own.end.div_ceil(BLOCK) * BLOCK_RANGES;
            let (shared, blocks) = (&packed.ranges[..SHARED_RANGES], &packed.ranges[SHARED_RANGES..][blocks]);
            vec![
                plain(device, "gs4d records", bytemuck::cast_slice(&packed.records[own.clone()])),
                plain(device, "gs4d ranges", bytemuck::cast_slice(&[shared, blocks].concat())),
            ]
        }
    };
    buffers.push(match scene.coded_colors() {
        Some(colors) => plain(device, "gs4d color records", bytemuck::cast_slice(&colors.records[own])),
        None => harmonics(device, scene, own, stride),
    });
    buffers
}

/// All codebooks, and their scales.
pub(super) fn codebooks(device: &wgpu::Device, colors: &CodedColors) -> [wgpu::Buffer; 2] {
    let mut scales = colors.scales.clone();
    scales.resize(CODEBOOK_SCALES, [0.0; 4]);
    // A binding of no bytes is not allowed.
    let or_zero = |bytes: &[u8]| if bytes.is_empty() { vec![0; 16] } else { bytes.to_vec() };
    note_created();
    [
        plain(device, "gs4d codebooks", &or_zero(bytemuck::cast_slice(&colors.codebooks))),
        device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
            label: Some("gs4d codebook scales"),
            contents: bytemuck::cast_slice(&scales),
            usage: wgpu::BufferUsages::UNIFORM,
        }),
    ]
}

/// The sets of some Gaussians: the words of each segment in turn, or one word of interval for each.
pub(super) fn filter(device: &wgpu::Device, filter: &TemporalFilter, own: Range<usize>) -> wgpu::Buffer {
    let words = match &filter.sets {
        ActiveSets::Bits(bits) => {
            // Parts begin at multiples of 32.
            let all = TemporalFilter::words(filter.count);
            let own = own.start / 32..own.end.div_ceil(32);
            bits.chunks_exact(all).flat_map(|segment| &segment[own.clone()]).copied().collect()
        }
        ActiveSets::Intervals(intervals) => intervals[own].to_vec(),
    };
    plain(device, "gs4d filter", bytemuck::cast_slice(&words))
}

pub(super) fn plain(device: &wgpu::Device, label: &'static str, contents: &[u8]) -> wgpu::Buffer {
    let usage = wgpu::BufferUsages::STORAGE;
    note_created();
    device.create_buffer_init(&wgpu::util::BufferInitDescriptor { label: Some(label), contents, usage })
}

/// The records as they are, but for `1/σ_t` in the place of `σ_t`: zero, not infinity, for what is always there.
fn gaussians(device: &wgpu::Device, gaussians: &[Gaussian]) -> wgpu::Buffer {
    mapped_buffer(device, "gs4d gaussians", gaussians.len(), size_of::<Gaussian>(), |index, record| {
        let gaussian = gaussians[index];
        record.copy_from_slice(bytemuck::bytes_of(&Gaussian { sigma_t: gaussian.sigma_t.recip(), ..gaussian }));
    })
}

/// The coefficients that are evaluated, padded to whole four-vectors per Gaussian.
fn harmonics(device: &wgpu::Device, scene: &RuntimeScene, own: Range<usize>, stride: usize) -> wgpu::Buffer {
    let used = scene.harmonics.evaluated() * 3;
    mapped_buffer(device, "gs4d harmonics", own.len(), stride * 16, |index, record| {
        record[..used * 4].copy_from_slice(bytemuck::cast_slice(&scene.harmonics.of(own.start + index)[..used]));
    })
}

/// A storage buffer of records, written straight into mapped memory: no second copy on the host.
fn mapped_buffer(
    device: &wgpu::Device,
    label: &'static str,
    count: usize,
    record_size: usize,
    fill: impl Fn(usize, &mut [u8]),
) -> wgpu::Buffer {
    note_created();
    let buffer = device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(label),
        size: (count * record_size) as u64,
        usage: wgpu::BufferUsages::STORAGE,
        mapped_at_creation: true,
    });
    let mut record = vec![0; record_size];
    {
        let mut mapped = buffer.slice(..).get_mapped_range_mut();
        for index in 0..count {
            fill(index, &mut record);
            mapped.slice(index * record_size..(index + 1) * record_size).copy_from_slice(&record);
        }
    }
    buffer.unmap();
    buffer
}
