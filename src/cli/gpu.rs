//! The GPU: which one, and with which checks.
//!
//! In: `--adapter` and `--checks`. Out: a headless renderer.

use super::failure::Failure;
use crate::renderer::{GpuContext, Headless, ShaderChecks};
use serde_json::{Value, json};

/// Which GPU draws, and how carefully.
#[derive(clap::Args)]
#[command(next_help_heading = "GPU")]
pub struct GpuArgs {
    /// The adapter: part of its name in any case, or its index. A wrong one lists those there are [default: the fastest].
    #[arg(long, value_name = "NAME|INDEX")]
    adapter: Option<String>,
    /// Have shaders check every array index (slower; to look for defects).
    #[arg(long)]
    checks: bool,
}

impl GpuArgs {
    /// Whether a certain adapter was asked for.
    pub fn is_chosen(&self) -> bool {
        self.adapter.is_some()
    }

    /// Opens the adapter and compiles the passes.
    ///
    /// # Errors
    /// No such adapter, or one that cannot run the passes.
    pub fn open(&self) -> Result<Headless, Failure> {
        let context = GpuContext::headless(self.adapter.as_deref())?;
        Ok(Headless::new(context, self.shader_checks())?)
    }

    /// Opens the fastest adapter if that is a real GPU. A driver in software is slower than the CPU twins.
    pub fn open_hardware(&self) -> Option<Headless> {
        let context = GpuContext::headless(None).ok()?;
        let software = context.info.device_type == wgpu::DeviceType::Cpu;
        if software { None } else { Headless::new(context, self.shader_checks()).ok() }
    }

    fn shader_checks(&self) -> ShaderChecks {
        if self.checks { ShaderChecks::On } else { ShaderChecks::Off }
    }
}

/// Name of the adapter, for people.
pub fn adapter_name(headless: &Headless) -> String {
    let info = &headless.context().info;
    format!("{} ({}, {} {})", info.name, info.backend, info.driver, info.driver_info)
}

/// The adapter, for programs.
pub fn adapter_json(headless: &Headless) -> Value {
    let info = &headless.context().info;
    json!({
        "name": info.name,
        "backend": info.backend.to_string(),
        "driver": info.driver,
        "driver_info": info.driver_info,
    })
}
