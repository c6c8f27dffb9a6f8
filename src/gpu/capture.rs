//! A capture on the GPU.
//!
//! In: a [`RuntimeScene`]. Out: buffers that stay as long as the capture does. Large captures are split into parts, so that no
//! binding grows over what the device allows; a part is drawn by one dispatch of `project`.

use super::renderer::bind_group as bind_group_of;
use super::{GpuError, Renderer, layout};
use crate::gaussian::{Gaussian, ShDirection};
use crate::scene::{ActiveSets, RuntimeScene, TemporalFilter, segment_of};
use layout::BLOCK;
use std::sync::atomic::{AtomicU64, Ordering};
use wgpu::util::DeviceExt;

/// A capture on the GPU: its Gaussians, colour and environment map in buffers, in as many parts as bindings ask for.
#[derive(Debug)]
pub struct GpuCapture {
    pub(super) parts: Vec<Part>,
    pub(super) environment: Option<EnvironmentBuffer>,
    /// Tells captures apart, as long as the program runs.
    pub(super) id: u64,
    filter: Option<Filter>,
    /// Colour and time settings of an [`layout::Instance`]; the rest is zero.
    settings: layout::Instance,
    len: usize,
}

/// As many Gaussians as fit one binding.
#[derive(Debug)]
pub(super) struct Part {
    pub count: u32,
    pub bind_group: wgpu::BindGroup,
    /// Its share of the filter, if there is one.
    pub filter: Option<wgpu::BindGroup>,
}

/// What the host needs to know of a filter.
#[derive(Debug)]
struct Filter {
    mode: u32,
    segments: u32,
    interval: [f32; 2],
}

#[derive(Debug)]
pub(super) struct EnvironmentBuffer {
    pub buffer: wgpu::Buffer,
    pub size: [u32; 2],
}

impl GpuCapture {
    /// Uploads a scene.
    ///
    /// # Errors
    /// When the environment map is larger than the device binds.
    pub fn upload(
        device: &wgpu::Device,
        _queue: &wgpu::Queue,
        renderer: &Renderer,
        scene: &RuntimeScene,
    ) -> Result<Self, GpuError> {
        let harmonics = &scene.harmonics;
        let evaluated = harmonics.evaluated();
        let stride = (evaluated * 3).div_ceil(4);
        let limits = device.limits();
        let record = size_of::<Gaussian>().max(stride * 16) as u64;
        let threads = u64::from(limits.max_compute_workgroups_per_dimension) * 256;
        // A multiple of what one block of `activate` takes.
        let per_part = ((binding_limit(&limits) / record).min(threads) as usize / BLOCK as usize) * BLOCK as usize;
        if per_part == 0 {
            let (needed, limit) = (record * u64::from(BLOCK), binding_limit(&limits));
            return Err(GpuError::TooLarge { what: "the Gaussians", needed, limit });
        }
        let mut parts = Vec::new();
        for first in (0..scene.gaussians.len()).step_by(per_part) {
            let count = per_part.min(scene.gaussians.len() - first);
            let gaussians = gaussian_buffer(device, &scene.gaussians[first..first + count]);
            let colors = harmonics_buffer(device, scene, first, count, stride);
            let bind_group = renderer.capture_bind_group(device, &gaussians, &colors);
            let filter = scene.filter.as_ref().map(|filter| {
                let sets = filter_buffer(device, filter, first, count);
                bind_group_of(device, "gs4d filter", &renderer.layouts.filter, &[sets.as_entire_binding()])
            });
            parts.push(Part { count: count as u32, bind_group, filter });
        }
        let environment = scene.environment.as_ref().map(|map| EnvironmentBuffer {
            buffer: device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
                label: Some("gs4d environment"),
                contents: bytemuck::cast_slice(&map.texels),
                usage: wgpu::BufferUsages::STORAGE,
            }),
            size: [map.width, map.height],
        });
        if let Some(map) = &environment
            && map.buffer.size() > binding_limit(&limits)
        {
            let (needed, limit) = (map.buffer.size(), binding_limit(&limits));
            return Err(GpuError::TooLarge { what: "the environment map", needed, limit });
        }
        let settings = layout::Instance {
            degree: harmonics.degree,
            degree_t: if harmonics.degree == 3 { harmonics.degree_t } else { 0 },
            stride: stride as u32,
            displaced: u32::from(scene.trained_with.sh_direction == ShDirection::Displaced),
            time_span: scene.trained_with.time_span(),
            ..bytemuck::Zeroable::zeroed()
        };
        let filter = scene.filter.as_ref().map(|filter| Filter {
            mode: match filter.sets {
                ActiveSets::Bits(_) => layout::FILTER_BITS,
                ActiveSets::Intervals(_) => layout::FILTER_INTERVALS,
            },
            segments: filter.segments,
            interval: scene.trained_with.time_interval,
        });
        let id = NEXT_ID.fetch_add(1, Ordering::Relaxed);
        Ok(Self { parts, environment, id, filter, settings, len: scene.gaussians.len() })
    }

    /// Number of Gaussians.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether there is no Gaussian.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Whether it has an environment map.
    pub fn has_environment(&self) -> bool {
        self.environment.is_some()
    }

    /// Whether it has a temporal filter.
    pub fn has_filter(&self) -> bool {
        self.filter.is_some()
    }

    /// The segment of a time, if there is a filter.
    pub(super) fn segment(&self, time: f32) -> Option<u32> {
        self.filter.as_ref().map(|filter| segment_of(time, filter.interval, filter.segments))
    }

    /// The uniform of part `index`, whose splats begin at `first_slot`; all of it is drawn without a segment.
    pub(super) fn instance(
        &self,
        index: usize,
        first_slot: u32,
        segment: Option<u32>,
        view: &layout::Instance,
    ) -> layout::Instance {
        let filter_mode = match (&self.filter, segment) {
            (Some(filter), Some(_)) => filter.mode,
            _ => layout::FILTER_NONE,
        };
        layout::Instance {
            filter_mode,
            segment: segment.unwrap_or_default(),
            first_slot,
            count: self.parts[index].count,
            degree: self.settings.degree,
            degree_t: self.settings.degree_t,
            stride: self.settings.stride,
            displaced: self.settings.displaced,
            time_span: self.settings.time_span,
            ..*view
        }
    }
}

static NEXT_ID: AtomicU64 = AtomicU64::new(0);

/// The sets of Gaussians `first..first + count`: the words of each segment in turn, or one word of interval for each.
fn filter_buffer(device: &wgpu::Device, filter: &TemporalFilter, first: usize, count: usize) -> wgpu::Buffer {
    let words = match &filter.sets {
        ActiveSets::Bits(bits) => {
            // Parts begin at multiples of 32.
            let all = TemporalFilter::words(filter.count);
            let own = first / 32..(first + count).div_ceil(32);
            bits.chunks_exact(all).flat_map(|segment| &segment[own.clone()]).copied().collect()
        }
        ActiveSets::Intervals(intervals) => {
            let own = &intervals[first..first + count];
            own.iter().map(|[first, last]| u32::from(*first) | u32::from(*last) << 16).collect::<Vec<u32>>()
        }
    };
    device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
        label: Some("gs4d filter"),
        contents: bytemuck::cast_slice(&words),
        usage: wgpu::BufferUsages::STORAGE,
    })
}

/// Largest storage buffer that can be made and bound whole.
pub(super) fn binding_limit(limits: &wgpu::Limits) -> u64 {
    limits.max_storage_buffer_binding_size.min(limits.max_buffer_size)
}

/// The records as they are, but for `1/σ_t` in the place of `σ_t`: zero, not infinity, for what is always there.
fn gaussian_buffer(device: &wgpu::Device, gaussians: &[Gaussian]) -> wgpu::Buffer {
    mapped_buffer(device, "gs4d gaussians", gaussians.len(), size_of::<Gaussian>(), |index, record| {
        let gaussian = gaussians[index];
        record.copy_from_slice(bytemuck::bytes_of(&Gaussian { sigma_t: gaussian.sigma_t.recip(), ..gaussian }));
    })
}

/// The coefficients that are evaluated, padded to whole four-vectors per Gaussian.
fn harmonics_buffer(
    device: &wgpu::Device,
    scene: &RuntimeScene,
    first: usize,
    count: usize,
    stride: usize,
) -> wgpu::Buffer {
    let used = scene.harmonics.evaluated() * 3;
    mapped_buffer(device, "gs4d harmonics", count, stride * 16, |index, record| {
        record[..used * 4].copy_from_slice(bytemuck::cast_slice(&scene.harmonics.of(first + index)[..used]));
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
