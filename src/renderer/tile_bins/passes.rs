//! The compiled passes of tile bins, each compiled when a view first needs it.
//!
//! In: a device, the variants that a view draws with. Out: pipelines; an error if the device refuses one, which is not kept.

use super::variant::BinVariant;
use crate::renderer::compiler::Compiler;
use crate::renderer::device::GpuError;
use crate::renderer::shaders::Storage;
use std::sync::{Arc, OnceLock};

/// The passes of a device.
#[derive(Debug)]
pub(in crate::renderer) struct BinPasses {
    compiler: Arc<Compiler>,
    /// In the order of [`Pixels::ALL`].
    find_surfaces: [OnceLock<wgpu::ComputePipeline>; 4],
    /// Indexed by whether hidden splats are left out, by whether there are few bins, by whether instances are copied, and by the storage of the
    /// capture (order of [`Storage::ALL`]).
    project_bin: [[[[OnceLock<wgpu::ComputePipeline>; 3]; 2]; 2]; 2],
    /// Indexed by whether instances are copied, and by the storage.
    colors: [[OnceLock<wgpu::ComputePipeline>; 3]; 2],
    /// `place_bins` and `fill_bins`.
    counted: OnceLock<[wgpu::ComputePipeline; 2]>,
    /// Indexed by whether bins are counted before they are filled, and by [`BinVariant::lists`].
    sort_bins: [[OnceLock<wgpu::ComputePipeline>; 3]; 2],
    /// By [`BinVariant::blend_index`].
    blend_blocks: [OnceLock<wgpu::ComputePipeline>; BinVariant::BLENDS],
}

impl BinPasses {
    /// Returns the passes of a device, none of them compiled.
    pub(in crate::renderer) fn new(compiler: Arc<Compiler>) -> Self {
        Self {
            compiler,
            find_surfaces: Default::default(),
            project_bin: Default::default(),
            colors: Default::default(),
            counted: OnceLock::new(),
            sort_bins: Default::default(),
            blend_blocks: Default::default(),
        }
    }

    /// Compiles the passes that are not compiled yet, for these storages and for one or (`true`) several instances in a dispatch.
    ///
    /// # Errors
    /// When a shader does not compile.
    pub(in crate::renderer) fn compile(
        &self,
        device: &wgpu::Device,
        drawn: impl Iterator<Item = (Storage, bool)>,
        variant: BinVariant,
    ) -> Result<(), GpuError> {
        let compiler = &self.compiler;
        let (layouts, own) = (&compiler.layouts, &compiler.layouts.tile_bins);
        for (storage, batched) in drawn {
            let [geometry, color] = &layouts.captures[storage as usize];
            let (definitions, copied) = compiler.reading(storage, batched);
            if self.project_bin(storage, batched, variant).is_none() {
                let groups = [&own.project_bin, geometry, &layouts.active].map(Some);
                let definitions = [variant.project_definitions(), definitions.clone()].concat();
                let made = compiler.pass(device, "project_bin", &definitions, &groups)?;
                self.project_bins(variant)[copied][storage as usize].get_or_init(|| made);
            }
            if self.colors(storage, batched).is_none() {
                let groups = [Some(&own.colors), Some(geometry), None, Some(color)];
                let made = compiler.pass(device, "colors", &definitions, &groups)?;
                self.colors[copied][storage as usize].get_or_init(|| made);
            }
        }
        if variant.blending.leaves_out_hidden() && self.find_surfaces(variant).is_none() {
            let pixels = variant.pixels();
            let groups = [&layouts.pixel[pixels.index()], &own.find_surfaces].map(Some);
            let made = compiler.pass(device, "find_surfaces", &pixels.definitions(), &groups)?;
            self.find_surfaces[pixels.index()].get_or_init(|| made);
        }
        if variant.counted && self.counted().is_none() {
            let pass = |name| compiler.pass(device, name, &[], &[Some(&own.fill_bins)]);
            let made = [pass("place_bins")?, pass("fill_bins")?];
            self.counted.get_or_init(|| made);
        }
        if self.sort_bins(variant).is_none() {
            let definitions = [&variant.sort_definitions(), compiler.subgroups].concat();
            let made = compiler.pass(device, "sort_bins", &definitions, &[Some(&own.sort_bins)])?;
            self.sort_bins[usize::from(variant.counted)][variant.lists as usize].get_or_init(|| made);
        }
        if self.blend_blocks(variant).is_none() {
            let definitions = [&variant.blend_definitions(), compiler.subgroups].concat();
            let groups = [&layouts.pixel[variant.pixels().index()], &own.blend_blocks].map(Some);
            let made = compiler.pass(device, "blend_blocks", &definitions, &groups)?;
            self.blend_blocks[variant.blend_index()].get_or_init(|| made);
        }
        Ok(())
    }

    /// Returns `find_surfaces`, if it has been compiled.
    pub(super) fn find_surfaces(&self, variant: BinVariant) -> Option<&wgpu::ComputePipeline> {
        self.find_surfaces[variant.pixels().index()].get()
    }

    /// Returns the pipelines of `project_bin` of a variant.
    fn project_bins(&self, variant: BinVariant) -> &[[OnceLock<wgpu::ComputePipeline>; 3]; 2] {
        &self.project_bin[usize::from(variant.blending.leaves_out_hidden())][usize::from(variant.few_bins)]
    }

    /// Returns `project_bin` for this storage, for one or several instances in a dispatch, if it has been compiled.
    pub(super) fn project_bin(
        &self,
        storage: Storage,
        batched: bool,
        variant: BinVariant,
    ) -> Option<&wgpu::ComputePipeline> {
        self.project_bins(variant)[self.compiler.copied(batched)][storage as usize].get()
    }

    /// Returns `colors` for this storage, for one or several instances in a dispatch, if it has been compiled.
    pub(super) fn colors(&self, storage: Storage, batched: bool) -> Option<&wgpu::ComputePipeline> {
        self.colors[self.compiler.copied(batched)][storage as usize].get()
    }

    /// Returns `place_bins` and `fill_bins`, if they have been compiled.
    pub(super) fn counted(&self) -> Option<&[wgpu::ComputePipeline; 2]> {
        self.counted.get()
    }

    /// Returns `sort_bins`, if it has been compiled.
    pub(super) fn sort_bins(&self, variant: BinVariant) -> Option<&wgpu::ComputePipeline> {
        self.sort_bins[usize::from(variant.counted)][variant.lists as usize].get()
    }

    /// Returns `blend_blocks`, if it has been compiled.
    pub(in crate::renderer) fn blend_blocks(&self, variant: BinVariant) -> Option<&wgpu::ComputePipeline> {
        self.blend_blocks[variant.blend_index()].get()
    }

    /// Returns whether the passes are compiled for these storages and this variant.
    pub(in crate::renderer) fn has(
        &self,
        mut drawn: impl Iterator<Item = (Storage, bool)>,
        variant: BinVariant,
    ) -> bool {
        let reads = |(storage, batched)| {
            self.project_bin(storage, batched, variant).is_some() && self.colors(storage, batched).is_some()
        };
        let fills = !variant.counted || self.counted().is_some();
        let finds = !variant.blending.leaves_out_hidden() || self.find_surfaces(variant).is_some();
        fills && finds && self.sort_bins(variant).is_some() && self.blend_blocks(variant).is_some() && drawn.all(reads)
    }
}
