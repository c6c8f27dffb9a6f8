//! The passes of the fast design: four dispatches instead of the global sorts.
//!
//! In: a prepared view and its instances. Out: the passes, recorded into the compute pass of the frame. They draw the same picture as the
//! reference design.
//!
//! | pass | reads | writes |
//! |---|---|---|
//! | `project_bin` | active list, Gaussians | splats, list of the visible splats, unordered bins of a few tiles |
//! | `sort_bins` | bins | pairs of each tile, in order of depth |
//! | `colors` | visible splats, color coefficients | colors of splats |
//! | `blend_blocks` | pairs, splats and their colors, opaque depth | color and transmittance, expected and median depth |
//!
//! `sort_bins` and `colors` do not depend on each other and run at the same time, if each frame has its own encoder: wgpu inserts a barrier
//! between two passes of an encoder for each buffer that the second pass writes and an earlier pass used. Therefore the counters of even and
//! odd frames are in separate buffers, and so are splats and their colors. The bins are sorted first, since `sort_bins` occupies few threads
//! for a long time: `colors` uses the remaining threads.

use super::bins::FastResources;
use super::dispatch::mark;
use super::parameters::Instance;
use super::resources::Resources;
use super::view_renderer::ViewRenderer;
use crate::renderer::pipelines::Renderer;
use crate::renderer::shaders::Storage;
use crate::renderer::timing::PassTimer;
use crate::view::tiles;

/// Number of Gaussians of a part from which on each thread of `project_bin` processes two, and four Gaussians. If many Gaussians are absent,
/// workgroups of more Gaussians are better utilized, but small parts need as many workgroups as possible.
const MANY_GAUSSIANS: u32 = 1 << 18;
const VERY_MANY_GAUSSIANS: u32 = 1 << 20;

/// Returns the number of Gaussians per thread of `project_bin`.
pub(super) fn per_thread(count: u32) -> u32 {
    match count {
        0..MANY_GAUSSIANS => 1,
        MANY_GAUSSIANS..VERY_MANY_GAUSSIANS => 2,
        VERY_MANY_GAUSSIANS.. => 4,
    }
}

/// Returns the number of splats per workgroup of `colors`, four threads per splat: `SPLATS` of the shader.
fn colors_of_group(storage: Storage) -> u32 {
    match storage {
        Storage::Coded => 32,
        Storage::Sliced | Storage::Packed => 64,
    }
}

/// The largest number of workgroups of `colors`, which loop over the visible splats: enough to occupy any GPU.
const COLOR_GROUPS: u32 = 8192;

impl ViewRenderer {
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
        let odd = usize::from(self.odd);
        // project_bin
        let groups = |_, count: u32| count.div_ceil(256 * per_thread(count));
        self.project(
            |storage, batched| renderer.passes.project_bin(storage, batched, self.variant),
            renderer,
            &fast.project_bin[odd],
            groups,
            pass,
            instances,
        );
        mark(timer, pass);

        // sort_bins
        let (Some(sort_bins), Some(blend_blocks)) =
            (renderer.passes.sort_bins(self.variant.lists), renderer.passes.blend_blocks(self.variant))
        else {
            return;
        };
        let bins = self.bin_grid();
        pass.set_pipeline(sort_bins);
        pass.set_bind_group(0, &fast.sort_bins[odd], &[]);
        pass.dispatch_workgroups(bins.x, bins.y, 1);
        mark(timer, pass);

        // colors
        if self.has_colors {
            let groups = |storage, count: u32| count.div_ceil(colors_of_group(storage)).min(COLOR_GROUPS);
            let pipeline = |storage, batched| renderer.passes.colors(storage, batched);
            self.project(pipeline, renderer, &fast.colors[odd], groups, pass, instances);
        }
        mark(timer, pass);

        // blend_blocks
        let tiles = tiles(self.picture);
        pass.set_pipeline(blend_blocks);
        pass.set_bind_group(0, &made.pixel, &[]);
        pass.set_bind_group(1, &fast.blend_blocks, &[]);
        pass.dispatch_workgroups(tiles.x, tiles.y, 1);
        mark(timer, pass);
    }
}
