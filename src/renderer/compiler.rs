//! Compilation of single passes.
//!
//! In: the name of a pass, its definitions and its groups. Out: a pipeline; an error if the device refuses it.

use super::device::GpuError;
use super::device::bind::pipeline;
use super::device::memory::catch_known;
use super::layouts::Layouts;
use super::shaders::{COPIED_INSTANCE, SHADERS, SUBGROUPS_OF_8, SUBGROUPS_OF_32, ShaderChecks, Storage};
use std::sync::Arc;

/// What a device determines about the passes.
#[derive(Debug)]
pub(super) struct Compiler {
    pub layouts: Arc<Layouts>,
    checks: ShaderChecks,
    /// Whether the driver is a software driver, where threads copy the uniforms of their instance even in a dispatch of a single instance.
    is_software: bool,
    /// [`SUBGROUPS_OF_32`]; [`SUBGROUPS_OF_8`] on software drivers; empty if the subgroup size of the device is another one, or varies.
    pub subgroups: &'static [&'static str],
}

impl Compiler {
    /// Returns the compiler for a device.
    pub(super) fn new(device: &wgpu::Device, layouts: Arc<Layouts>, checks: ShaderChecks) -> Self {
        let info = device.adapter_info();
        let sizes = [info.subgroup_min_size, info.subgroup_max_size];
        let is_software = info.device_type == wgpu::DeviceType::Cpu;
        let subgroups: &[_] = match sizes {
            _ if !device.features().contains(wgpu::Features::SUBGROUP) => &[],
            [32, 32] => SUBGROUPS_OF_32,
            [8, 8] if is_software => SUBGROUPS_OF_8,
            _ => &[],
        };
        Self { layouts, checks, is_software, subgroups }
    }

    /// Returns the index of pipelines of passes that read a capture: 1 for pipelines that copy their instance first. `batched`: a dispatch
    /// draws several instances.
    pub(super) fn copied(&self, batched: bool) -> usize {
        usize::from(batched || self.is_software)
    }

    /// Returns the shader definitions of passes that read a capture, and the index of their pipelines.
    pub(super) fn reading(&self, storage: Storage, batched: bool) -> (Vec<&'static str>, usize) {
        let copied = self.copied(batched);
        ([storage.definitions(), if copied == 1 { COPIED_INSTANCE } else { &[] }].concat(), copied)
    }

    /// Compiles the entry point of a pass with the same name.
    ///
    /// # Errors
    /// When the shader does not compile.
    pub(super) fn pass(
        &self,
        device: &wgpu::Device,
        name: &'static str,
        definitions: &[&str],
        groups: &[Option<&wgpu::BindGroupLayout>],
    ) -> Result<wgpu::ComputePipeline, GpuError> {
        self.pipelines(device, name, definitions, |shader| pipeline(device, shader, name, groups))
    }

    /// Creates pipelines of a pass. An invalid pipeline is an error and is not kept.
    ///
    /// # Errors
    /// When the shader does not compile.
    pub(super) fn pipelines<T>(
        &self,
        device: &wgpu::Device,
        name: &'static str,
        definitions: &[&str],
        create: impl FnOnce(&wgpu::ShaderModule) -> T,
    ) -> Result<T, GpuError> {
        let create = || Ok(create(&SHADERS.module(device, name, definitions, self.checks)?));
        catch_known(device, 0, create).unwrap_or_else(|error| match error {
            GpuError::Refused(reason) => Err(GpuError::Shader { name, reason }),
            other => Err(other),
        })
    }
}
