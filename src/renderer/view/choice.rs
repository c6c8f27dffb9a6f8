//! The design of a view.
//!
//! In: the design that the client sets, the device, the number of splats, counters of earlier frames. Out: the design of the next frame.

use super::resources::DesignBuffers;
use super::view_renderer::ViewRenderer;
use crate::renderer::design::Design;
use crate::renderer::layout::Counters;
use crate::renderer::pipelines::Renderer;
use crate::renderer::tile_bins::{self, Crowd, Lists};

impl ViewRenderer {
    /// Sets the design with which the view is drawn from the next [`prepare`](Self::prepare) on. Default: [`Design::Auto`]. A change ends the
    /// [measurement](Self::measure) of GPU time.
    pub fn set_design(&mut self, renderer: &Renderer, design: Design) {
        if self.wanted == design {
            return;
        }
        self.wanted = design;
        self.crowded = false;
        let design = renderer.resolve(design);
        if self.design != design {
            self.design = design;
            self.timing = None;
            self.free();
        }
    }

    /// Returns whether the last frame, which had these counters, may be incomplete because a software driver has ended loops early. If so, the
    /// view is drawn with [`Design::GlobalSort`] until it is [released](Self::release) or another design is set.
    pub(in crate::renderer) fn must_draw_again(&mut self, renderer: &Renderer, counters: &Counters) -> bool {
        let made = self.resources.as_ref().filter(|made| matches!(made.buffers, DesignBuffers::TileBins(_)));
        let Some(made) = made.filter(|_| renderer.is_software).map(|made| made.sizes) else { return false };
        let (slots, fullest, lists) = (self.slots, counters.pairs_wanted, self.bins.variant.lists);
        let searches = self.bins.lacks_room(&made, self.picture, counters);
        self.crowded = !tile_bins::is_complete(Crowd { slots, fullest, searches, lists });
        self.crowded
    }

    /// Chooses the design of a frame of at most `slots` splats.
    pub(super) fn choose_design(&mut self, device: &wgpu::Device, renderer: &Renderer, slots: usize) {
        let slots = u32::try_from(slots).unwrap_or(u32::MAX);
        // Without counters the fullest bin may contain all splats.
        let lists = Lists::suiting(&device.limits(), slots);
        let at_worst = Crowd { slots, fullest: slots, searches: true, lists };
        let unsafe_loops =
            renderer.is_software && (self.crowded || !(self.draws_again || tile_bins::is_complete(at_worst)));
        let design = match (self.wanted, renderer.resolve(self.wanted)) {
            (Design::Auto, _) if slots > tile_bins::MAX_SLOTS => Design::GlobalSort,
            (_, Design::TileBins) if unsafe_loops => Design::GlobalSort,
            (_, resolved) => resolved,
        };
        if self.design != design {
            self.design = design;
            self.free();
        }
    }
}
