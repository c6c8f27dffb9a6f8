//! The compiled passes of both designs and of motion, each compiled when a view first needs it.
//!
//! In: a device, bind group layouts, the variants that a view draws with. Out: pipelines; an error if the device refuses one, which is not kept.

use super::compiler::Compiler;
use super::design::Design;
use super::error::GpuError;
use super::global_sort::SortPasses;
use super::layouts::Layouts;
use super::shaders::{BINNED, ShaderChecks, Storage};
use super::tile_bins::BinPasses;
use std::sync::{Arc, OnceLock};

/// The passes of a device, shared with the thread that compiles in the background.
#[derive(Debug)]
pub(super) struct Passes {
    pub global_sort: SortPasses,
    pub tile_bins: BinPasses,
    /// `motion` of global sort and of tile bins, indexed by the storage of the capture (order of [`Storage::ALL`]).
    motion: [[OnceLock<wgpu::ComputePipeline>; 3]; 2],
    compiler: Arc<Compiler>,
}

impl Passes {
    /// Returns the passes of a device, none of them compiled.
    pub(super) fn new(device: &wgpu::Device, layouts: Arc<Layouts>, checks: ShaderChecks) -> Self {
        let compiler = Arc::new(Compiler::new(device, layouts, checks));
        Self {
            global_sort: SortPasses::new(compiler.clone()),
            tile_bins: BinPasses::new(compiler.clone()),
            motion: Default::default(),
            compiler,
        }
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
        let layouts = &self.compiler.layouts;
        let (binned, own): (&[&str], _) = match design {
            Design::GlobalSort => (&[], &layouts.global_sort.motion),
            Design::Auto | Design::TileBins => (BINNED, &layouts.tile_bins.motion),
        };
        for storage in storages {
            if self.motion(storage, design).is_none() {
                let definitions = [binned, &self.compiler.reading(storage, false).0[..]].concat();
                let [geometry, _] = &layouts.captures[storage as usize];
                let groups = [own, geometry, &layouts.active].map(Some);
                let made = self.compiler.pass(device, "motion", &definitions, &groups)?;
                self.motion[usize::from(design != Design::GlobalSort)][storage as usize].get_or_init(|| made);
            }
        }
        Ok(())
    }

    /// Returns `motion` of a design for this storage, if it has been compiled.
    pub(super) fn motion(&self, storage: Storage, design: Design) -> Option<&wgpu::ComputePipeline> {
        self.motion[usize::from(design != Design::GlobalSort)][storage as usize].get()
    }
}
