//! The design of a view.
//!
//! In: the design that the client sets, the device, the number of splats, counters of earlier frames. Out: the design of the next frame.

use super::view_renderer::ViewRenderer;
use crate::renderer::frame::Design;
use crate::renderer::layout::Counters;
use crate::renderer::pipelines::Renderer;
use crate::renderer::tile_bins::{self, MAX_SLOTS};

impl ViewRenderer {
    /// Sets the design with which the view is drawn from the next [`prepare`](Self::prepare) on. Default: [`Design::Auto`].
    pub fn set_design(&mut self, renderer: &Renderer, design: Design) {
        if self.wanted == design {
            return;
        }
        self.wanted = design;
        self.crowded = false;
        let design = renderer.resolve(design);
        if self.design() != design {
            self.begin_design(design);
        }
    }

    /// Returns whether the last frame, which had these counters, may be incomplete because a software driver has ended loops early. If so, the
    /// view is drawn with [`Design::GlobalSort`] until it is [released](Self::release) or another design is set.
    pub(in crate::renderer) fn must_draw_again(&mut self, renderer: &Renderer, counters: &Counters) -> bool {
        let is_incomplete = renderer.is_software && !self.design.is_complete(self.slots, counters);
        self.crowded |= is_incomplete;
        is_incomplete
    }

    /// Chooses the design of a frame of at most `slots` splats.
    pub(super) fn choose_design(&mut self, device: &wgpu::Device, renderer: &Renderer, slots: usize) {
        let slots = u32::try_from(slots).unwrap_or(u32::MAX);
        let may_end_early = || !self.draws_again && !tile_bins::is_always_complete(&device.limits(), slots);
        let unsafe_loops = renderer.is_software && (self.crowded || may_end_early());
        let design = match (self.wanted, renderer.resolve(self.wanted)) {
            (Design::Auto, _) if slots > MAX_SLOTS => Design::GlobalSort,
            (_, Design::TileBins) if unsafe_loops => Design::GlobalSort,
            (_, resolved) => resolved,
        };
        if self.design() != design {
            self.begin_design(design);
        }
    }
}
