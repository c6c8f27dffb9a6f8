//! A device that binds little at once, as if scenes were much larger than they are.
//!
//! In: nothing. Out: a renderer on the usual adapter whose storage buffers end at [`BINDING`] bytes.

use crate::skip::skip;
use bevy_gs4d::renderer::{GpuContext, Headless, ShaderChecks};
use pollster::block_on;

/// Most bytes that can be bound.
pub const BINDING: u64 = 1 << 21;

/// The renderer; nothing, said aloud, where there is no adapter.
pub fn headless() -> Option<Headless> {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor {
        backends: wgpu::Backends::PRIMARY,
        ..wgpu::InstanceDescriptor::new_without_display_handle()
    });
    let fastest = wgpu::RequestAdapterOptions {
        power_preference: wgpu::PowerPreference::HighPerformance,
        ..wgpu::RequestAdapterOptions::default()
    };
    let adapter = match block_on(instance.request_adapter(&fastest)) {
        Ok(adapter) => adapter,
        Err(error) => {
            skip(format_args!("no GPU adapter: {error}"));
            return None;
        }
    };
    let limits = wgpu::Limits { max_storage_buffer_binding_size: BINDING, ..adapter.limits() };
    let (device, queue) = block_on(adapter.request_device(&wgpu::DeviceDescriptor {
        label: Some("cramped"),
        required_limits: limits,
        ..Default::default()
    }))
    .expect("less than the adapter can do");
    let context = GpuContext { device, queue, info: adapter.get_info() };
    Some(Headless::new(context, ShaderChecks::On).expect("the passes compile"))
}
