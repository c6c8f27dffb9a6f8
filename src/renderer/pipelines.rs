//! The pipelines: one [`Renderer`] for each device.
//!
//! In: a device. Out: the compiled passes, and the bind group layouts of the passes, for the buffers of views and captures.

use super::bind::{Bind, group_layout, pipeline};
use super::design::Design;
use super::error::GpuError;
use super::layout::{self, INSTANCES_BOUND};
use super::memory::{Allocator, catch_known};
use super::shaders::{
    AtOnce, BINNED, COPIED_INSTANCE, FEW_BINS, FastVariant, Lists, Pixels, SUBGROUPS_OF_32, ShaderChecks, Storage,
    module,
};
use super::work::WorkCounters;
use std::sync::OnceLock;

/// All pipelines and bind group layouts of a device.
#[derive(Debug)]
pub struct Renderer {
    pub(super) layouts: Layouts,
    pub(super) activate_count: wgpu::ComputePipeline,
    pub(super) activate_scan: wgpu::ComputePipeline,
    pub(super) activate_write: wgpu::ComputePipeline,
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
    /// Whether [`Design::Auto`] is the reference design: on software drivers, where it is faster, and in browsers, where the fast design is
    /// untested.
    prefers_reference: bool,
    /// Whether the driver is a software driver: threads copy the uniforms of their instance even in a dispatch of a single instance, and the
    /// loops of a thread may end early.
    pub(super) is_software: bool,
    /// [`SUBGROUPS_OF_32`], or empty if the subgroup size of the device is not always 32.
    subgroups: &'static [&'static str],
    /// Bound instead of a list of active Gaussians if all Gaussians are drawn.
    pub(super) no_list: wgpu::BindGroup,
    work: WorkCounters,
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

/// Bind group layouts, in the order of the shaders' bindings.
#[derive(Debug)]
pub(super) struct Layouts {
    pub activate: wgpu::BindGroupLayout,
    pub filter: wgpu::BindGroupLayout,
    pub active: wgpu::BindGroupLayout,
    pub project: wgpu::BindGroupLayout,
    /// Geometry and color, indexed by the storage of the capture (order of [`Storage::ALL`]).
    pub captures: [[wgpu::BindGroupLayout; 2]; 3],
    pub sort: wgpu::BindGroupLayout,
    pub arguments: wgpu::BindGroupLayout,
    pub bin: wgpu::BindGroupLayout,
    pub ranges: wgpu::BindGroupLayout,
    pub blend: wgpu::BindGroupLayout,
    /// Uniforms, background, opaque depth and targets of the pixels, in the order of [`Pixels::ALL`].
    pub pixel: [wgpu::BindGroupLayout; 4],
    pub project_bin: wgpu::BindGroupLayout,
    pub sort_bins: wgpu::BindGroupLayout,
    pub colors: wgpu::BindGroupLayout,
    pub blend_blocks: wgpu::BindGroupLayout,
    /// `motion` of the reference design and of the fast design.
    pub motion: [wgpu::BindGroupLayout; 2],
}

impl Renderer {
    /// Compiles the passes that both designs need, and creates the layouts of all passes. The other passes are compiled when a view first
    /// needs them.
    ///
    /// # Errors
    /// When a limit of the device is too low for the passes, or a shader does not compile.
    pub fn new(device: &wgpu::Device, checks: ShaderChecks) -> Result<Self, GpuError> {
        check_limits(&device.limits())?;
        let layouts = Layouts::new(device);
        let activate = module(device, "activate", &[], checks)?;
        let info = device.adapter_info();
        let sizes = [info.subgroup_min_size, info.subgroup_max_size];
        let software = info.device_type == wgpu::DeviceType::Cpu;
        let work = WorkCounters::default();
        let allocator = Allocator { device, work: &work };
        let no_list = allocator.buffer("gs4d no active list", 4, wgpu::BufferUsages::STORAGE);
        let pipeline = |module: &wgpu::ShaderModule, entry: &str, groups: &[&wgpu::BindGroupLayout]| {
            let groups: Vec<_> = groups.iter().copied().map(Some).collect();
            pipeline(device, module, entry, &groups)
        };
        Ok(Self {
            activate_count: pipeline(&activate, "count", &[&layouts.activate, &layouts.filter]),
            activate_scan: pipeline(&activate, "scan", &[&layouts.activate, &layouts.filter]),
            activate_write: pipeline(&activate, "write", &[&layouts.activate, &layouts.filter]),
            project: Default::default(),
            blend: Default::default(),
            reference: OnceLock::new(),
            project_bin: Default::default(),
            colors: Default::default(),
            sort_bins: Default::default(),
            blend_blocks: Default::default(),
            motion: Default::default(),
            checks,
            prefers_reference: software || info.backend == wgpu::Backend::BrowserWebGpu,
            is_software: software,
            subgroups: if device.features().contains(wgpu::Features::SUBGROUP) && sizes == [32, 32] {
                SUBGROUPS_OF_32
            } else {
                &[]
            },
            no_list: allocator.bind_group("gs4d no active list", &layouts.active, &[no_list.as_entire_binding()]),
            layouts,
            work,
        })
    }

    /// Returns the renderer with these counters instead of its own: for a renderer that replaces another after a lost device.
    pub fn counting(self, work: WorkCounters) -> Self {
        Self { work, ..self }
    }

    /// Returns the counters of resources created, bytes uploaded and lists recorded for this renderer.
    pub fn work(&self) -> &WorkCounters {
        &self.work
    }

    /// Returns an allocator for the resources of its views, its captures and its clients. The device must be the one
    /// the renderer was created on.
    pub fn allocator<'a>(&'a self, device: &'a wgpu::Device) -> Allocator<'a> {
        Allocator { device, work: &self.work }
    }

    /// Resolves [`Design::Auto`] for this device: returns [`Design::Fast`] or [`Design::Reference`].
    pub(super) fn resolve(&self, design: Design) -> Design {
        match design {
            Design::Auto if self.prefers_reference => Design::Reference,
            Design::Auto => Design::Fast,
            chosen @ (Design::Fast | Design::Reference) => chosen,
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

    /// Compiles the passes that the first frame of captures with this storage needs, as far as they are known.
    ///
    /// # Errors
    /// When a shader does not compile.
    pub(super) fn compile_ahead(
        &self,
        device: &wgpu::Device,
        design: Design,
        storage: Storage,
    ) -> Result<(), GpuError> {
        let drawn = std::iter::once((storage, false));
        match self.resolve(design) {
            Design::Reference => self.compile_reference(device, drawn, Pixels::default(), AtOnce::One),
            Design::Auto | Design::Fast => {
                let lists = Lists::suiting(&device.limits(), 0);
                self.compile_fast(device, drawn, FastVariant { lists, ..FastVariant::default() })
            }
        }
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

    /// Returns the bind group layouts of geometry in single precision and of lists of active Gaussians.
    pub(super) fn capture_layouts(&self) -> [&wgpu::BindGroupLayout; 2] {
        [&self.layouts.captures[Storage::Sliced as usize][0], &self.layouts.active]
    }

    /// Creates the bind groups of the geometry and the color of one part of a capture. The buffers are in the order of the shaders' bindings.
    pub(super) fn capture_bind_groups(
        &self,
        device: &wgpu::Device,
        storage: Storage,
        [geometry, color]: [&[wgpu::Buffer]; 2],
    ) -> [wgpu::BindGroup; 2] {
        let layouts = &self.layouts.captures[storage as usize];
        let group = |layout: &wgpu::BindGroupLayout, buffers: &[wgpu::Buffer]| {
            let resources: Vec<_> = buffers.iter().map(wgpu::Buffer::as_entire_binding).collect();
            self.allocator(device).bind_group("gs4d capture", layout, &resources)
        };
        [group(&layouts[0], geometry), group(&layouts[1], color)]
    }
}

impl Layouts {
    fn new(device: &wgpu::Device) -> Self {
        use Bind::{Depth, Depths, Read, Target, Uniform, UniformAt, Write};
        const FRAME: usize = size_of::<layout::FrameUniforms>();
        const INSTANCE: Bind = UniformAt(INSTANCES_BOUND as usize);
        const BEFORE: Bind = UniformAt(size_of::<layout::MotionUniforms>());
        let new = |label, bindings: &[Bind]| group_layout(device, label, bindings);
        let pixel = |pixels: Pixels| {
            let opaque = if pixels.multisampled { Depths } else { Depth };
            let targets = [pixels.precision.format(), wgpu::TextureFormat::Rg32Float].map(Target);
            new("gs4d pixel", &[Uniform(FRAME), Read, opaque, targets[0], targets[1]])
        };
        Self {
            activate: new("gs4d activate", &[UniformAt(size_of::<layout::Activation>()), Write, Write]),
            filter: new("gs4d filter", &[Read]),
            active: new("gs4d active list", &[Read]),
            project: new("gs4d project", &[INSTANCE, Write, Write]),
            captures: Storage::ALL.map(|storage| {
                let (geometry, color): (&[Bind], &[Bind]) = match storage {
                    Storage::Sliced => (&[Read, Read], &[Read]),
                    Storage::Packed => (&[Read, Read], &[Read]),
                    Storage::Coded => (&[Read, Read], &[Read, Read]),
                };
                [new("gs4d geometry", geometry), new("gs4d color", color)]
            }),
            sort: new(
                "gs4d sort",
                &[UniformAt(size_of::<layout::SortStep>()), Uniform(FRAME), Write, Read, Read, Write, Write, Write],
            ),
            arguments: new("gs4d arguments", &[Write]),
            bin: new("gs4d bin", &[Uniform(FRAME), Write, Read, Read, Write, Write, Write]),
            ranges: new("gs4d ranges", &[Uniform(FRAME), Read, Read, Write]),
            blend: new("gs4d blend", &[Read, Read, Read, Read, Read, Read]),
            pixel: Pixels::ALL.map(pixel),
            project_bin: new("gs4d project_bin", &[INSTANCE, Write, Write, Write, Write]),
            // The shader does not read the last buffer, the list of the visible splats. Because it is bound, the memory barrier for the
            // buffers that `project_bin` writes and `colors` reads comes before `sort_bins`, not between `sort_bins` and `colors`, so that
            // these two run at the same time.
            sort_bins: new("gs4d sort_bins", &[Uniform(FRAME), Read, Write, Read, Write, Write, Read]),
            colors: new("gs4d colors", &[INSTANCE, Read, Read, Write]),
            blend_blocks: new("gs4d blend_blocks", &[Read, Read, Read, Read, Read]),
            motion: [
                new("gs4d motion", &[INSTANCE, BEFORE, Read, Write]),
                new("gs4d motion", &[INSTANCE, BEFORE, Read, Read, Read, Write]),
            ],
        }
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

fn check_limits(limits: &wgpu::Limits) -> Result<(), GpuError> {
    let needs = [
        ("max_compute_invocations_per_workgroup", limits.max_compute_invocations_per_workgroup.into(), 256),
        ("max_compute_workgroup_size_x", limits.max_compute_workgroup_size_x.into(), 256),
        ("max_storage_buffers_per_shader_stage", limits.max_storage_buffers_per_shader_stage.into(), 8),
        ("max_uniform_buffer_binding_size", limits.max_uniform_buffer_binding_size, INSTANCES_BOUND.into()),
        // Three arrays of `blend`, and the arrays of its scan.
        (
            "max_compute_workgroup_storage_size",
            limits.max_compute_workgroup_storage_size.into(),
            16 * 256 * 3 + 16 * 75,
        ),
    ];
    for (what, found, needed) in needs {
        if found < needed {
            return Err(GpuError::Limit { what, found, needed });
        }
    }
    Ok(())
}
