//! The compiled passes of global sort, each compiled when a view first needs it.
//!
//! In: a device, the variants that a view draws with. Out: pipelines; an error if the device refuses one, which is not kept.

use super::at_once::AtOnce;
use crate::renderer::compiler::Compiler;
use crate::renderer::device::GpuError;
use crate::renderer::device::bind::pipeline;
use crate::renderer::shaders::{Pixels, Storage};
use std::sync::{Arc, OnceLock};

/// The passes of a device.
#[derive(Debug)]
pub(in crate::renderer) struct SortPasses {
    compiler: Arc<Compiler>,
    /// Indexed by whether instances are copied and by the storage of the capture (order of [`Storage::ALL`]).
    project: [[OnceLock<wgpu::ComputePipeline>; 3]; 2],
    steps: OnceLock<StepPasses>,
    /// In the order of [`AtOnce::ALL`], then of [`Pixels::ALL`].
    blend: [[OnceLock<wgpu::ComputePipeline>; 4]; 3],
}

/// The passes between `project` and `blend`.
#[derive(Debug)]
pub(super) struct StepPasses {
    /// `count`, `scan`, `visible`, `scatter`.
    pub sort: [wgpu::ComputePipeline; 4],
    /// `count`, `scan`, `offset`, `emit`.
    pub bin: [wgpu::ComputePipeline; 4],
    pub ranges: wgpu::ComputePipeline,
}

impl StepPasses {
    fn new(device: &wgpu::Device, compiler: &Compiler) -> Result<Self, GpuError> {
        let layouts = &compiler.layouts.global_sort;
        let (sort, bin, arguments) = (&layouts.sort, &layouts.bin, &layouts.arguments);
        let of_sort: [(_, &[_]); 4] =
            [("count", &[sort]), ("scan", &[sort]), ("visible", &[sort, arguments]), ("scatter", &[sort])];
        let of_bin: [(_, &[_]); 4] =
            [("count", &[bin]), ("scan", &[bin, arguments]), ("offset", &[bin]), ("emit", &[bin])];
        Ok(Self {
            sort: pipelines(device, compiler, "sort", of_sort)?,
            bin: pipelines(device, compiler, "bin", of_bin)?,
            ranges: compiler.pass(device, "ranges", &[], &[Some(&layouts.ranges)])?,
        })
    }
}

/// Compiles entry points of one shader, each with its groups.
fn pipelines<const N: usize>(
    device: &wgpu::Device,
    compiler: &Compiler,
    name: &'static str,
    entries: [(&str, &[&wgpu::BindGroupLayout]); N],
) -> Result<[wgpu::ComputePipeline; N], GpuError> {
    compiler.pipelines(device, name, &[], |shader| {
        entries.map(|(entry, groups)| {
            let groups: Vec<_> = groups.iter().copied().map(Some).collect();
            pipeline(device, shader, entry, &groups)
        })
    })
}

impl SortPasses {
    /// Returns the passes of a device, none of them compiled.
    pub(in crate::renderer) fn new(compiler: Arc<Compiler>) -> Self {
        Self { compiler, project: Default::default(), steps: OnceLock::new(), blend: Default::default() }
    }

    /// Compiles the passes that are not compiled yet, for these storages and for one or (`true`) several instances in a dispatch.
    ///
    /// # Errors
    /// When a shader does not compile.
    pub(in crate::renderer) fn compile(
        &self,
        device: &wgpu::Device,
        drawn: impl Iterator<Item = (Storage, bool)>,
        pixels: Pixels,
        at_once: AtOnce,
    ) -> Result<(), GpuError> {
        let layouts = &self.compiler.layouts;
        for (storage, batched) in drawn {
            if self.project(storage, batched).is_none() {
                let (definitions, copied) = self.compiler.reading(storage, batched);
                let [geometry, color] = &layouts.captures[storage as usize];
                let groups = [&layouts.global_sort.project, geometry, &layouts.active, color].map(Some);
                let made = self.compiler.pass(device, "project", &definitions, &groups)?;
                self.project[copied][storage as usize].get_or_init(|| made);
            }
        }
        if self.steps().is_none() {
            let made = StepPasses::new(device, &self.compiler)?;
            self.steps.get_or_init(|| made);
        }
        if self.blend(pixels, at_once).is_none() {
            let definitions = [&pixels.definitions(), at_once.definitions(), self.compiler.subgroups].concat();
            let groups = [&layouts.pixel[pixels.index()], &layouts.global_sort.blend].map(Some);
            let made = self.compiler.pass(device, "blend", &definitions, &groups)?;
            self.blend[at_once as usize][pixels.index()].get_or_init(|| made);
        }
        Ok(())
    }

    /// Returns `project` for this storage, for one or several instances in a dispatch, if it has been compiled.
    pub(super) fn project(&self, storage: Storage, batched: bool) -> Option<&wgpu::ComputePipeline> {
        self.project[self.compiler.copied(batched)][storage as usize].get()
    }

    /// Returns the passes between `project` and `blend`, if they have been compiled.
    pub(super) fn steps(&self) -> Option<&StepPasses> {
        self.steps.get()
    }

    /// Returns `blend` for pixels of this kind and for this number of splats at once, if it has been compiled.
    pub(in crate::renderer) fn blend(&self, pixels: Pixels, at_once: AtOnce) -> Option<&wgpu::ComputePipeline> {
        self.blend[at_once as usize][pixels.index()].get()
    }
}
