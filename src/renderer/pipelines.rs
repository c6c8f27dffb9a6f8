//! The pipelines: one [`Renderer`] for each device.
//!
//! In: a device. Out: the compiled passes, and the bind group layouts of the passes, for the buffers of views and captures.

use super::capture::SharedCodebooks;
use super::compiling::Compiling;
use super::device::GpuError;
use super::device::WorkCounters;
use super::device::bind::pipeline;
use super::device::memory::Allocator;
use super::frame::Design;
use super::layout::INSTANCES_BOUND;
use super::layouts::Layouts;
use super::passes::Passes;
use super::shaders::{ColorPrecision, SHADERS, ShaderChecks, Storage};
use super::tile_bins::Scratch;
use crate::renderer::frame::Blending;
use std::sync::Arc;
use std::thread::JoinHandle;

/// All pipelines and bind group layouts of a device.
#[derive(Debug)]
pub struct Renderer {
    pub(super) layouts: Arc<Layouts>,
    /// The entry points of `activate`: `count`, `scan`, `store`.
    pub(super) activate: [wgpu::ComputePipeline; 3],
    /// The passes of both designs and of motion.
    pub(super) passes: Arc<Passes>,
    /// The passes that are compiled on another thread; `None` if every pass is compiled by the thread that needs it.
    pub(super) compiling: Option<Compiling>,
    /// Whether the driver is a software driver: threads copy the uniforms of their instance even in a dispatch of a single instance, and the
    /// loops of a thread may end early.
    pub(super) is_software: bool,
    /// Bound instead of a list of active Gaussians if all Gaussians are drawn.
    pub(super) no_list: wgpu::BindGroup,
    /// The working buffers that views share.
    pub(super) scratch: Scratch,
    /// The codebooks that captures share.
    pub(super) codebooks: SharedCodebooks,
    work: WorkCounters,
}

impl Renderer {
    /// Compiles the passes that both designs need, and creates the layouts of all passes. The other passes are compiled when a view first
    /// needs them.
    ///
    /// # Errors
    /// When a limit of the device is too low for the passes, or a shader does not compile.
    pub fn new(device: &wgpu::Device, checks: ShaderChecks) -> Result<Self, GpuError> {
        check_limits(&device.limits())?;
        let layouts = Arc::new(Layouts::new(device));
        let activate = SHADERS.module(device, "activate", &[], checks)?;
        let info = device.adapter_info();
        let software = info.device_type == wgpu::DeviceType::Cpu;
        let work = WorkCounters::default();
        let allocator = Allocator { device, work: &work };
        let no_list = allocator.buffer("gs4d no active list", 4, wgpu::BufferUsages::STORAGE);
        let groups = [&layouts.activate, &layouts.filter].map(Some);
        Ok(Self {
            activate: ["count", "scan", "store"].map(|entry| pipeline(device, &activate, entry, &groups)),
            passes: Arc::new(Passes::new(device, layouts.clone(), checks)),
            compiling: None,
            is_software: software,
            no_list: allocator.bind_group("gs4d no active list", &layouts.active, &[no_list.as_entire_binding()]),
            layouts,
            scratch: Scratch::default(),
            codebooks: SharedCodebooks::default(),
            work,
        })
    }

    /// Returns the renderer with these counters instead of its own: for a renderer that replaces another after a lost device.
    pub fn counting(self, work: WorkCounters) -> Self {
        Self { work, ..self }
    }

    /// Returns the renderer, which compiles further variants of passes on another thread from now on, and draws with other variants of the
    /// same passes until they are compiled. Browsers have no such thread.
    pub fn compiling_in_background(self) -> Self {
        Self { compiling: cfg!(not(target_family = "wasm")).then(Compiling::default), ..self }
    }

    /// Returns the counters of resources created, bytes uploaded and lists recorded for this renderer.
    pub fn work(&self) -> &WorkCounters {
        &self.work
    }

    /// Makes later captures share nothing with those so far: after an upload that has failed, whose buffers may be invalid.
    pub fn forget_shared(&self) {
        self.codebooks.forget();
    }

    /// Returns an allocator for the resources of its views, its captures and its clients. The device must be the one
    /// the renderer was created on.
    pub fn allocator<'a>(&'a self, device: &'a wgpu::Device) -> Allocator<'a> {
        Allocator { device, work: &self.work }
    }

    /// Resolves [`Design::Auto`] for this device: returns [`Design::TileBins`], or on software drivers, where it is faster,
    /// [`Design::GlobalSort`]. In browsers a software driver cannot be told from a GPU.
    pub(super) fn resolve(&self, design: Design) -> Design {
        match design {
            Design::Auto if self.is_software => Design::GlobalSort,
            Design::Auto => Design::TileBins,
            chosen @ (Design::TileBins | Design::GlobalSort) => chosen,
        }
    }

    /// Begins to compile, in the background, the passes that draw captures with this storage in an app: in half precision, behind surfaces with
    /// one or with several samples per pixel. Returns the thread; `None` if nothing is compiled in the background.
    pub fn begin_ahead(&self, device: &wgpu::Device, storage: Storage) -> Option<JoinHandle<()>> {
        let compiling = self.compiling.as_ref()?;
        let (passes, device, design) = (Arc::clone(&self.passes), device.clone(), self.resolve(Design::Auto));
        compiling.thread(move || {
            for blending in [Blending::ColorBehindSurfaces, Blending::ColorBehindSamples] {
                // A view that needs a refused pass returns the error.
                let _ = passes.compile_ahead(&device, design, storage, blending, ColorPrecision::Half);
            }
        })
    }
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
