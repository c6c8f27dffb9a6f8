//! The fast renderer of a view: three dispatches instead of the global sorts.
//!
//! In: what the reference design takes: instances, sizes, the bind group of the pixels. Out: the same picture.
//!
//! | pass | reads | writes |
//! |---|---|---|
//! | `project_bin` | active list, Gaussians, color coefficients | splats, bins of a few tiles, in no order |
//! | `sort_bins` | bins | pairs of each tile, in order of depth |
//! | `blend_blocks` | pairs, splats, opaque depth | color and transmittance, expected and median depth |

use super::bins::{FastResources, bin_capacity, bin_grid, bin_side};
use super::record::mark;
use super::resources::{Resources, Sizes};
use super::{Instance, ViewRenderer};
use crate::renderer::layout::BIN_COUNTERS;
use crate::renderer::pipelines::Renderer;
use crate::renderer::timing::PassTimer;
use crate::view::tiles;

impl ViewRenderer {
    /// Returns the index of the first counter of a frame.
    fn first_counter(&self, sizes: &Sizes, odd: bool) -> u32 {
        let grid = bin_grid(sizes.picture);
        if odd { BIN_COUNTERS + grid.x * grid.y } else { 0 }
    }

    /// Returns where the counters of the frame prepared last are, in bytes.
    pub(in crate::renderer) fn counters_offset(&self) -> u64 {
        self.resources
            .as_ref()
            .filter(|made| made.fast.is_some())
            .map_or(0, |made| u64::from(self.first_counter(&made.sizes, self.odd)) * 4)
    }

    /// Returns the uniform `binning` of the frame that is prepared.
    pub(super) fn binning(&self, sizes: &Sizes) -> [u32; 4] {
        let counters = [self.odd, !self.odd].map(|odd| self.first_counter(sizes, odd));
        // Never 0, which is the stamp of a new buffer.
        let frame = self.frames % 0xffff + 1;
        [bin_side(sizes.picture) | (frame << 8), bin_capacity(sizes.picture, sizes.entries), counters[0], counters[1]]
    }

    /// Records the passes of the fast design.
    pub(super) fn record_fast(
        &self,
        renderer: &Renderer,
        made: &Resources,
        fast: &FastResources,
        pass: &mut wgpu::ComputePass<'_>,
        instances: &[Instance<'_>],
        timer: Option<&PassTimer>,
    ) {
        // project_bin
        self.project(renderer, |storage| renderer.project_bin(storage), &fast.project_bin, pass, instances);
        mark(timer, pass);

        // sort_bins
        let (Some(sort_bins), Some(blend_blocks)) =
            (renderer.sort_bins(self.lists), renderer.blend_blocks(self.blending, self.large_batches))
        else {
            return;
        };
        let bins = bin_grid(made.sizes.picture);
        pass.set_pipeline(sort_bins);
        pass.set_bind_group(0, &fast.sort_bins, &[]);
        pass.dispatch_workgroups(bins.x, bins.y, 1);
        mark(timer, pass);

        // blend_blocks
        let tiles = tiles(made.sizes.picture);
        pass.set_pipeline(blend_blocks);
        pass.set_bind_group(0, &made.pixel, &[]);
        pass.set_bind_group(1, &made.blend, &[]);
        pass.dispatch_workgroups(tiles.x, tiles.y, 1);
        mark(timer, pass);
    }
}
