//! A device for commands, tests and pages. An app with a device of its own needs none.
//!
//! In: the name or index of an adapter, or a surface to draw to, if any. Out: a [`GpuContext`].

use super::error::GpuError;
use pollster::block_on;

/// A device, its queue and its adapter.
#[derive(Debug)]
pub struct GpuContext {
    /// The device.
    pub device: wgpu::Device,
    /// Its queue.
    pub queue: wgpu::Queue,
    /// Description of the adapter.
    pub info: wgpu::AdapterInfo,
}

impl GpuContext {
    /// Opens a device on the adapter with index `wanted` or with a name that contains `wanted`; if `None`, on the adapter with the highest
    /// performance.
    ///
    /// # Errors
    /// When there is no such adapter (the message names the packages to install) or the adapter does not provide a device.
    pub fn headless(wanted: Option<&str>) -> Result<Self, GpuError> {
        match wanted {
            Some(wanted) => block_on(Self::of(choose(wanted)?)),
            None => block_on(Self::open(&instance(), None)),
        }
    }

    /// Opens a device on the adapter with the highest performance that can draw to the surface, if one is given. It waits without blocking: in
    /// browsers nothing may block.
    ///
    /// # Errors
    /// As [`headless`](Self::headless).
    pub async fn open(instance: &wgpu::Instance, surface: Option<&wgpu::Surface<'_>>) -> Result<Self, GpuError> {
        let options = wgpu::RequestAdapterOptions {
            power_preference: wgpu::PowerPreference::HighPerformance,
            compatible_surface: surface,
            ..Default::default()
        };
        let adapter = instance.request_adapter(&options).await;
        Self::of(adapter.map_err(|error| GpuError::NoAdapter { reason: error.to_string() })?).await
    }

    /// Opens a device on an adapter, with its limits.
    async fn of(adapter: wgpu::Adapter) -> Result<Self, GpuError> {
        let info = adapter.get_info();
        // Timestamps are for benchmarks, subgroups for tile bins. Both are optional.
        let timestamps = wgpu::Features::TIMESTAMP_QUERY | wgpu::Features::TIMESTAMP_QUERY_INSIDE_PASSES;
        let wanted_features = timestamps | wgpu::Features::SUBGROUP;
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("gs4d"),
            required_features: adapter.features() & wanted_features,
            required_limits: adapter.limits(),
            ..Default::default()
        };
        let device = adapter.request_device(&descriptor).await;
        let no_device = |error: wgpu::RequestDeviceError| GpuError::NoDevice {
            adapter: info.name.clone(),
            reason: error.to_string(),
        };
        let (device, queue) = device.map_err(no_device)?;
        Ok(Self { device, queue, info })
    }

    /// Returns all adapters of this machine.
    pub fn adapters() -> Vec<wgpu::AdapterInfo> {
        all().iter().map(wgpu::Adapter::get_info).collect()
    }
}

fn backends() -> wgpu::Backends {
    // If DX12 is not included, wgpu adds no hidden dispatch to validate each indirect dispatch.
    if cfg!(target_family = "wasm") {
        wgpu::Backends::BROWSER_WEBGPU
    } else if cfg!(windows) {
        wgpu::Backends::DX12 | wgpu::Backends::VULKAN
    } else {
        wgpu::Backends::VULKAN | wgpu::Backends::METAL
    }
}

fn instance() -> wgpu::Instance {
    wgpu::Instance::new(wgpu::InstanceDescriptor {
        backends: backends(),
        ..wgpu::InstanceDescriptor::new_without_display_handle()
    })
}

fn all() -> Vec<wgpu::Adapter> {
    block_on(instance().enumerate_adapters(backends()))
}

fn choose(wanted: &str) -> Result<wgpu::Adapter, GpuError> {
    let adapters = all();
    if adapters.is_empty() {
        return Err(GpuError::NoAdapter { reason: "the list of adapters is empty".into() });
    }
    let names: Vec<String> = adapters.iter().map(|a| a.get_info().name).collect();
    let by_name = || names.iter().position(|name| name.to_lowercase().contains(&wanted.to_lowercase()));
    let index = wanted.parse::<usize>().ok().filter(|&i| i < adapters.len()).or_else(by_name);
    match index.and_then(|i| adapters.into_iter().nth(i)) {
        Some(adapter) => Ok(adapter),
        None => {
            let found = names.iter().enumerate().map(|(i, name)| format!("{i}: {name}")).collect::<Vec<_>>().join(", ");
            Err(GpuError::AdapterNotFound { wanted: wanted.into(), found })
        }
    }
}
