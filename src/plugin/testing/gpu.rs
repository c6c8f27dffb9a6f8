//! The GPU that apps draw with.
//!
//! In: the adapters that wgpu finds. Out: whether there is one, and the backends that Bevy uses.

use crate::renderer::GpuContext;
use bevy::render::settings::Backends;
use std::sync::OnceLock;

/// Returns whether this machine has a GPU adapter; a software driver counts.
pub fn has_gpu() -> bool {
    static FOUND: OnceLock<bool> = OnceLock::new();
    *FOUND.get_or_init(|| !GpuContext::adapters().is_empty())
}

/// Returns the backends to use, on Linux only Vulkan: without DX12, wgpu adds no dispatch to validate indirect ones.
pub(super) fn backends() -> Backends {
    if cfg!(target_os = "linux") { Backends::VULKAN } else { Backends::PRIMARY }
}
