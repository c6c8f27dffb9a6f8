//! A device with low limits, on which small scenes reach the limits that huge scenes reach on other devices.
//!
//! In: the default adapter, a number of bytes. Out: a renderer on that adapter with storage buffer bindings of at most
//! this size.

use crate::support::no_gpu::no_gpu;
use bevy_gs4d::renderer::{GpuContext, Headless, ShaderChecks};
use pollster::block_on;

/// Largest storage buffer binding in bytes, unless stated.
pub const BINDING: u64 = 1 << 21;

/// Returns a renderer with shader checks on; without an adapter, reports the skipped test and returns `None`.
pub fn headless() -> Option<Headless> {
    binding(BINDING)
}

/// Returns the renderer of [`headless`] with storage buffer bindings of at most `bytes` bytes.
pub fn binding(bytes: u64) -> Option<Headless> {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor {
        backends: wgpu::Backends::PRIMARY,
        ..wgpu::InstanceDescriptor::new_without_display_handle()
    });
    let fastest = wgpu::RequestAdapterOptions {
        power_preference: wgpu::PowerPreference::HighPerformance,
        ..wgpu::RequestAdapterOptions::default()
    };
    let Ok(adapter) = block_on(instance.request_adapter(&fastest)) else {
        no_gpu();
        return None;
    };
    let limits = wgpu::Limits { max_storage_buffer_binding_size: bytes, ..adapter.limits() };
    let (device, queue) = block_on(adapter.request_device(&wgpu::DeviceDescriptor {
        label: Some("limited"),
        required_limits: limits,
        ..Default::default()
    }))
    .expect("the limits are below those of the adapter");
    let context = GpuContext { device, queue, info: adapter.get_info() };
    Some(Headless::new(context, ShaderChecks::On).expect("the passes compile"))
}
