//! The compiled passes of both designs and of motion, each compiled when a view first needs it.
//!
//! In: a device, bind group layouts, the variants that a view draws with. Out: pipelines; an error if the device refuses one, which is not kept.

use super::bind::pipeline;
use super::design::Design;
use super::error::GpuError;
use super::layouts::Layouts;
use super::memory::catch_known;
use super::shaders::{
    AtOnce, BINNED, COPIED_INSTANCE, FEW_BINS, FastVariant, Lists, Pixels, SUBGROUPS_OF_32, ShaderChecks, Storage,
    module,
};
use std::sync::{Arc, OnceLock};

/// The passes of a device, shared with the thread that compiles in the background.
#[derive(Debug)]
pub(super) struct Passes {
    layouts: Arc<Layouts>,
    /// Passes of the reference design, compiled on first use: `project`, indexed by whether instances are copied and by the storage of the
    /// capture (order of [`Storage::ALL`]), `blend` (order of [`AtOnce::ALL`], then of [`Pixels::ALL`]), and the passes between them.
    project: [[OnceLock<wgpu::ComputePipeline>; 3]; 2],
    blend: [[OnceLock<wgpu::ComputePipeline>; 4]; 3],
    reference: OnceLock<ReferencePasses>,
    /// Passes of the fast design, each compiled on first use: `project_bin`, indexed by whether there are few bins and then as `project`,
    /// `colors`, indexed as `project`, `sort_bins` (order of [`Lists::ALL`]), and `blend_blocks` (by [`FastVariant::blend_index`]).
    project_bin: [[[OnceLock<wgpu::ComputePipeline>; 3]; 2]; 2],
    colors: [[OnceLock<wgpu::ComputePipeline>; 3]; 2],
    sort_bins: [OnceLock<wgpu::ComputePipeline>; 3],
    blend_blocks: [OnceLock<wgpu::ComputePipeline>; FastVariant::BLENDS],
    /// `motion` of the reference design and of the fast design, compiled on first use, indexed by the storage of the capture (order of
    /// [`Storage::ALL`]).
    motion: [[OnceLock<wgpu::ComputePipeline>; 3]; 2],
    checks: ShaderChecks,
    /// Whether the driver is a software driver, where threads copy the uniforms of their instance even in a dispatch of a single instance.
    is_software: bool,
    /// [`SUBGROUPS_OF_32`], or empty if the subgroup size of the device is not always 32.
    subgroups: &'static [&'static str],
}

/// The passes of the reference design between `project` and `blend`.
#[derive(Debug)]
pub(super) struct ReferencePasses {
    pub sort_count: wgpu::ComputePipeline,
    pub sort_scan: wgpu::ComputePipeline,
    pub sort_visible: wgpu::ComputePipeline,
    pub sort_scatter: wgpu::ComputePipeline,
    pub bin_count: wgpu::ComputePipeline,
    pub bin_scan: wgpu::ComputePipeline,
    pub bin_offset: wgpu::ComputePipeline,
    pub bin_emit: wgpu::ComputePipeline,
    pub ranges: wgpu::ComputePipeline,
}

impl ReferencePasses {
    fn new(device: &wgpu::Device, layouts: &Layouts, checks: ShaderChecks) -> Result<Self, GpuError> {
        let shader = |name| module(device, name, &[], checks);
        let (sort, bin, ranges) = (shader("sort")?, shader("bin")?, shader("ranges")?);
        let pipeline = |module: &wgpu::ShaderModule, entry: &str, groups: &[&wgpu::BindGroupLayout]| {
            let groups: Vec<_> = groups.iter().copied().map(Some).collect();
            pipeline(device, module, entry, &groups)
        };
        Ok(Self {
            sort_count: pipeline(&sort, "count", &[&layouts.sort]),
            sort_scan: pipeline(&sort, "scan", &[&layouts.sort]),
            sort_visible: pipeline(&sort, "visible", &[&layouts.sort, &layouts.arguments]),
            sort_scatter: pipeline(&sort, "scatter", &[&layouts.sort]),
            bin_count: pipeline(&bin, "count", &[&layouts.bin]),
            bin_scan: pipeline(&bin, "scan", &[&layouts.bin, &layouts.arguments]),
            bin_offset: pipeline(&bin, "offset", &[&layouts.bin]),
            bin_emit: pipeline(&bin, "emit", &[&layouts.bin]),
            ranges: pipeline(&ranges, "ranges", &[&layouts.ranges]),
        })
    }
}

impl Passes {
    /// Returns the passes of a device, none of them compiled.
    pub(super) fn new(device: &wgpu::Device, layouts: Arc<Layouts>, checks: ShaderChecks) -> Self {
        let info = device.adapter_info();
        let sizes = [info.subgroup_min_size, info.subgroup_max_size];
        let is_32 = device.features().contains(wgpu::Features::SUBGROUP) && sizes == [32, 32];
        Self {
            layouts,
            project: Default::default(),
            blend: Default::default(),
            reference: OnceLock::new(),
            project_bin: Default::default(),
            colors: Default::default(),
            sort_bins: Default::default(),
            blend_blocks: Default::default(),
            motion: Default::default(),
            checks,
            is_software: info.device_type == wgpu::DeviceType::Cpu,
            subgroups: if is_32 { SUBGROUPS_OF_32 } else { &[] },
        }
    }

    /// Returns the shader definitions of passes that read a capture, and the index of their pipelines. `batched`: a dispatch draws several
    /// instances.
    fn reading(&self, storage: Storage, batched: bool) -> (Vec<&'static str>, usize) {
        let copied = self.copied(batched);
        ([storage.definitions(), if copied == 1 { COPIED_INSTANCE } else { &[] }].concat(), copied)
    }

    /// Returns the index of pipelines of passes that read a capture: 1 for pipelines that copy their instance first.
    fn copied(&self, batched: bool) -> usize {
        usize::from(batched || self.is_software)
    }

    /// Compiles the entry point of a pass.
    ///
    /// # Errors
    /// When the shader does not compile.
    fn compiled(
        &self,
        device: &wgpu::Device,
        name: &'static str,
        entry: &str,
        definitions: &[&str],
        groups: &[Option<&wgpu::BindGroupLayout>],
    ) -> Result<wgpu::ComputePipeline, GpuError> {
        checked(device, name, || {
            let shader = module(device, name, definitions, self.checks)?;
            Ok(pipeline(device, &shader, entry, groups))
        })
    }

    /// Compiles the passes of the reference design that are not compiled yet, for these storages and for one or (`true`) several instances in
    /// a dispatch.
    ///
    /// # Errors
    /// When a shader does not compile.
    pub(super) fn compile_reference(
        &self,
        device: &wgpu::Device,
        drawn: impl Iterator<Item = (Storage, bool)>,
        pixels: Pixels,
        at_once: AtOnce,
    ) -> Result<(), GpuError> {
        let layouts = &self.layouts;
        for (storage, batched) in drawn {
            if self.project(storage, batched).is_none() {
                let (definitions, copied) = self.reading(storage, batched);
                let [geometry, color] = &layouts.captures[storage as usize];
                let groups = [&layouts.project, geometry, &layouts.active, color].map(Some);
                let made = self.compiled(device, "project", "project", &definitions, &groups)?;
                self.project[copied][storage as usize].get_or_init(|| made);
            }
        }
        if self.reference().is_none() {
            let made = checked(device, "sort", || ReferencePasses::new(device, layouts, self.checks))?;
            self.reference.get_or_init(|| made);
        }
        if self.blend(pixels, at_once).is_none() {
            let definitions = [&pixels.definitions(), at_once.definitions()].concat();
            let groups = [&layouts.pixel[pixels.index()], &layouts.blend].map(Some);
            let made = self.compiled(device, "blend", "blend", &definitions, &groups)?;
            self.blend[at_once as usize][pixels.index()].get_or_init(|| made);
        }
        Ok(())
    }

    /// Returns `project` for this storage, for one or several instances in a dispatch, if it has been compiled.
    pub(super) fn project(&self, storage: Storage, batched: bool) -> Option<&wgpu::ComputePipeline> {
        self.project[self.copied(batched)][storage as usize].get()
    }

    /// Returns `blend` for pixels of this kind and for this number of splats at once, if it has been compiled.
    pub(super) fn blend(&self, pixels: Pixels, at_once: AtOnce) -> Option<&wgpu::ComputePipeline> {
        self.blend[at_once as usize][pixels.index()].get()
    }

    /// Returns the other passes of the reference design, if they have been compiled.
    pub(super) fn reference(&self) -> Option<&ReferencePasses> {
        self.reference.get()
    }

    /// Compiles the passes of the fast design that are not compiled yet, for these storages and for one or (`true`) several instances in a
    /// dispatch.
    ///
    /// # Errors
    /// When a shader does not compile.
    pub(super) fn compile_fast(
        &self,
        device: &wgpu::Device,
        drawn: impl Iterator<Item = (Storage, bool)>,
        variant: FastVariant,
    ) -> Result<(), GpuError> {
        let layouts = &self.layouts;
        for (storage, batched) in drawn {
            let [geometry, color] = &layouts.captures[storage as usize];
            if self.project_bin(storage, batched, variant).is_none() {
                let (definitions, copied) = self.reading(storage, batched);
                let few = if variant.few_bins { FEW_BINS } else { &[] };
                let definitions = [BINNED, few, &definitions[..]].concat();
                let groups = [&layouts.project_bin, geometry, &layouts.active].map(Some);
                let made = self.compiled(device, "project", "project_bin", &definitions, &groups)?;
                self.project_bin[usize::from(variant.few_bins)][copied][storage as usize].get_or_init(|| made);
            }
            if self.colors(storage, batched).is_none() {
                let (definitions, copied) = self.reading(storage, batched);
                let groups = [Some(&layouts.colors), Some(geometry), None, Some(color)];
                let made = self.compiled(device, "colors", "colors", &definitions, &groups)?;
                self.colors[copied][storage as usize].get_or_init(|| made);
            }
        }
        let lists = variant.lists;
        if self.sort_bins(lists).is_none() {
            let definitions = [lists.definitions(), self.subgroups].concat();
            let made = self.compiled(device, "sort_bins", "sort_bins", &definitions, &[Some(&layouts.sort_bins)])?;
            self.sort_bins[lists as usize].get_or_init(|| made);
        }
        if self.blend_blocks(variant).is_none() {
            let definitions = [&variant.blend_definitions(), self.subgroups].concat();
            let groups = [&layouts.pixel[variant.pixels().index()], &layouts.blend_blocks].map(Some);
            let made = self.compiled(device, "blend_blocks", "blend_blocks", &definitions, &groups)?;
            self.blend_blocks[variant.blend_index()].get_or_init(|| made);
        }
        Ok(())
    }

    /// Compiles `motion` of a design for these storages, unless it is compiled.
    ///
    /// # Errors
    /// When the shader does not compile.
    pub(super) fn compile_motion(
        &self,
        device: &wgpu::Device,
        storages: impl Iterator<Item = Storage>,
        design: Design,
    ) -> Result<(), GpuError> {
        let fast = design != Design::Reference;
        let binned = if fast { BINNED } else { &[] };
        for storage in storages {
            if self.motion(storage, design).is_none() {
                let definitions = [binned, &self.reading(storage, false).0[..]].concat();
                let [geometry, _] = &self.layouts.captures[storage as usize];
                let groups = [&self.layouts.motion[usize::from(fast)], geometry, &self.layouts.active].map(Some);
                let made = self.compiled(device, "motion", "motion", &definitions, &groups)?;
                self.motion[usize::from(fast)][storage as usize].get_or_init(|| made);
            }
        }
        Ok(())
    }

    /// Returns `motion` of a design for this storage, if it has been compiled.
    pub(super) fn motion(&self, storage: Storage, design: Design) -> Option<&wgpu::ComputePipeline> {
        self.motion[usize::from(design != Design::Reference)][storage as usize].get()
    }

    /// Returns `project_bin` for this storage, for one or several instances in a dispatch, if it has been compiled.
    pub(super) fn project_bin(
        &self,
        storage: Storage,
        batched: bool,
        variant: FastVariant,
    ) -> Option<&wgpu::ComputePipeline> {
        self.project_bin[usize::from(variant.few_bins)][self.copied(batched)][storage as usize].get()
    }

    /// Returns `colors` for this storage, for one or several instances in a dispatch, if it has been compiled.
    pub(super) fn colors(&self, storage: Storage, batched: bool) -> Option<&wgpu::ComputePipeline> {
        self.colors[self.copied(batched)][storage as usize].get()
    }

    /// Returns `sort_bins` for lists of this length, if it has been compiled.
    pub(super) fn sort_bins(&self, lists: Lists) -> Option<&wgpu::ComputePipeline> {
        self.sort_bins[lists as usize].get()
    }

    /// Returns `blend_blocks`, if it has been compiled.
    pub(super) fn blend_blocks(&self, variant: FastVariant) -> Option<&wgpu::ComputePipeline> {
        self.blend_blocks[variant.blend_index()].get()
    }

    /// Returns whether the passes of the fast design are compiled for these storages and this variant.
    pub(super) fn has_fast(&self, mut drawn: impl Iterator<Item = (Storage, bool)>, variant: FastVariant) -> bool {
        let reads = |(storage, batched)| {
            self.project_bin(storage, batched, variant).is_some() && self.colors(storage, batched).is_some()
        };
        self.sort_bins(variant.lists).is_some() && self.blend_blocks(variant).is_some() && drawn.all(reads)
    }
}

/// Creates pipelines of the shader `name`. An invalid pipeline is an error and is not kept.
fn checked<T>(
    device: &wgpu::Device,
    name: &'static str,
    create: impl FnOnce() -> Result<T, GpuError>,
) -> Result<T, GpuError> {
    catch_known(device, 0, create).unwrap_or_else(|error| match error {
        GpuError::Refused(reason) => Err(GpuError::Shader { name, reason }),
        other => Err(other),
    })
}
