//! Recording of a frame.
//!
//! In: a prepared view and the instances for which it was prepared. Out: one compute pass, in the order of the table in [`crate::renderer`].

use super::bins::{FastResources, stamps_repeat};
use super::parameters::Instance;
use super::view_renderer::ViewRenderer;
use crate::renderer::layout::BIN_COUNTERS;
use crate::renderer::pipelines::Renderer;
use crate::renderer::timing::PassTimer;

impl ViewRenderer {
    /// Records the frame: one compute pass, in the order of the table in [`crate::renderer`].
    pub fn record(&mut self, renderer: &Renderer, encoder: &mut wgpu::CommandEncoder, instances: &[Instance<'_>]) {
        let timing = self.timing.take();
        let timer = timing.as_ref().filter(|(_, readback)| readback.is_idle()).map(|(timer, _)| timer);
        self.record_timed(renderer, encoder, instances, timer);
        self.timing = timing.map(|(timer, mut readback)| {
            if readback.is_idle() {
                timer.resolve(encoder);
                readback.copy(encoder, timer.resolved(), 0);
            }
            (timer, readback)
        });
    }

    /// Records the frame, with timestamps if a timer is given.
    pub(in crate::renderer) fn record_timed(
        &mut self,
        renderer: &Renderer,
        encoder: &mut wgpu::CommandEncoder,
        instances: &[Instance<'_>],
        timer: Option<&PassTimer>,
    ) {
        let Some(made) = &self.resources else { return };
        let fast = made.fast.as_ref();
        if let Some(fast) = fast {
            self.clear(encoder, fast);
        }
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some("gs4d"),
            timestamp_writes: timer.and_then(PassTimer::frame_writes),
        });
        match fast {
            Some(fast) => self.record_fast(renderer, made, fast, &mut pass, instances, timer),
            None => self.record_reference(renderer, made, &mut pass, instances, timer),
        }
        self.record_motion(renderer, made, &mut pass, instances, timer);
        drop(pass);
        if self.readback.is_idle() {
            let (counters, offset) = self.counters();
            let counters = counters.clone();
            self.readback.copy(encoder, &counters, offset);
            self.copied_from = self.generation;
        }
        self.cleared_bins = self.bin_count();
        self.recorded = true;
    }

    /// Clears buffers of the fast design that the passes of earlier frames have not cleared.
    fn clear(&self, encoder: &mut wgpu::CommandEncoder, fast: &FastResources) {
        if self.cleared_bins != self.bin_count() {
            // The previous frame has cleared only its own number of bins.
            for bins in &fast.bins {
                encoder.clear_buffer(bins, 0, None);
            }
        }
        if self.slots == 0 {
            // No workgroup of `project_bin` runs, which clears the last two counters for the next frame.
            let first = u64::from(BIN_COUNTERS - 2) * 4;
            encoder.clear_buffer(&fast.bins[usize::from(self.odd)], first, Some(8));
        }
        if stamps_repeat(self.frames) {
            encoder.clear_buffer(&fast.visible, 0, None);
        }
    }
}
