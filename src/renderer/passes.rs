//! The compiled passes of both designs and of motion, each compiled when a view first needs it.
//!
//! In: a device, bind group layouts, the variants that a view draws with. Out: pipelines; an error if the device refuses one, which is not kept.

use super::compiler::Compiler;
use super::device::GpuError;
use super::frame::Design;
use super::global_sort::{AtOnce, SortPasses};
use super::layouts::Layouts;
use super::shaders::{BINNED, ColorPrecision, ShaderChecks, Storage};
use super::tile_bins::{BinPasses, BinVariant, Lists};
use crate::renderer::frame::Blending;
use std::sync::{Arc, OnceLock};

/// The passes of a device, shared with the thread that compiles in the background.
#[derive(Debug)]
pub(super) struct Passes {
    pub global_sort: SortPasses,
    pub tile_bins: BinPasses,
    /// `motion` of global sort and of tile bins.
    pub sort_motion: MotionPass,
    pub bin_motion: MotionPass,
}

impl Passes {
    /// Returns the passes of a device, none of them compiled.
    pub(super) fn new(device: &wgpu::Device, layouts: Arc<Layouts>, checks: ShaderChecks) -> Self {
        let compiler = Arc::new(Compiler::new(device, layouts, checks));
        let motion = |definitions: &'static [&'static str], own: &wgpu::BindGroupLayout| {
            let (compiler, own, pipelines) = (compiler.clone(), own.clone(), Default::default());
            MotionPass { compiler, definitions, own, pipelines }
        };
        let Layouts { global_sort, tile_bins, .. } = &*compiler.layouts;
        Self {
            sort_motion: motion(&[], &global_sort.motion),
            bin_motion: motion(BINNED, &tile_bins.motion),
            global_sort: SortPasses::new(compiler.clone()),
            tile_bins: BinPasses::new(compiler),
        }
    }

    /// Compiles the passes that the first frame of captures with this storage needs, as far as they are known. The design is not
    /// [`Design::Auto`].
    ///
    /// # Errors
    /// When a shader does not compile.
    pub(super) fn compile_ahead(
        &self,
        device: &wgpu::Device,
        design: Design,
        storage: Storage,
        blending: Blending,
        precision: ColorPrecision,
    ) -> Result<(), GpuError> {
        let (lists, drawn) = (Lists::suiting(&device.limits(), 0), std::iter::once((storage, false)));
        let variant = BinVariant { lists, blending, precision, ..BinVariant::default() };
        match design {
            Design::GlobalSort => self.global_sort.compile(device, drawn, variant.pixels(), AtOnce::One),
            Design::Auto | Design::TileBins => self.tile_bins.compile(device, drawn, variant),
        }
    }
}

/// `motion` of a design.
#[derive(Debug)]
pub(super) struct MotionPass {
    compiler: Arc<Compiler>,
    definitions: &'static [&'static str],
    own: wgpu::BindGroupLayout,
    /// Indexed by the storage of the capture (order of [`Storage::ALL`]).
    pipelines: [OnceLock<wgpu::ComputePipeline>; 3],
}

impl MotionPass {
    /// Compiles the pass for these storages, unless it is compiled.
    ///
    /// # Errors
    /// When the shader does not compile.
    pub(super) fn compile(
        &self,
        device: &wgpu::Device,
        drawn: impl Iterator<Item = (Storage, bool)>,
    ) -> Result<(), GpuError> {
        let layouts = &self.compiler.layouts;
        for (storage, _) in drawn {
            if self.pipeline(storage).is_none() {
                let definitions = [self.definitions, &self.compiler.reading(storage, false).0[..]].concat();
                let [geometry, _] = &layouts.captures[storage as usize];
                let groups = [&self.own, geometry, &layouts.active].map(Some);
                let made = self.compiler.pass(device, "motion", &definitions, &groups)?;
                self.pipelines[storage as usize].get_or_init(|| made);
            }
        }
        Ok(())
    }

    /// Returns the pass for this storage, if it has been compiled.
    pub(super) fn pipeline(&self, storage: Storage) -> Option<&wgpu::ComputePipeline> {
        self.pipelines[storage as usize].get()
    }
}
