//! A capture on the GPU.
//!
//! In: a [`RuntimeScene`]. Out: buffers that stay as long as the capture does. Large captures are split into parts, so that no
//! binding grows over what the device allows; a part is drawn by one dispatch of `project`.

use super::{GpuError, Renderer, layout};
use crate::gaussian::{Gaussian, ShDirection};
use crate::scene::RuntimeScene;
use wgpu::util::DeviceExt;

/// A capture on the GPU: its Gaussians, colour and environment map in buffers, in as many parts as bindings ask for.
#[derive(Debug)]
pub struct GpuCapture {
    pub(super) parts: Vec<Part>,
    pub(super) environment: Option<EnvironmentBuffer>,
    /// Colour and time settings of an [`layout::Instance`]; the rest is zero.
    settings: layout::Instance,
    len: usize,
}

/// As many Gaussians as fit one binding.
#[derive(Debug)]
pub(super) struct Part {
    pub count: u32,
    pub bind_group: wgpu::BindGroup,
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
        let per_part = (binding_limit(&limits) / record).min(threads) as usize;
        let mut parts = Vec::new();
        for first in (0..scene.gaussians.len()).step_by(per_part) {
            let count = per_part.min(scene.gaussians.len() - first);
            let gaussians = gaussian_buffer(device, &scene.gaussians[first..first + count]);
            let colors = harmonics_buffer(device, scene, first, count, stride);
            let bind_group = renderer.capture_bind_group(device, &gaussians, &colors);
            parts.push(Part { count: count as u32, bind_group });
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
        Ok(Self { parts, environment, settings, len: scene.gaussians.len() })
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

    /// The uniform of part `index`, whose splats begin at `first_slot`.
    pub(super) fn instance(&self, index: usize, first_slot: u32, view: &layout::Instance) -> layout::Instance {
        layout::Instance {
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
