//! Recording of a frame.
//!
//! In: a prepared view and the instances for which it was prepared. Out: one compute pass, in the order of the table in [`crate::renderer`].

use super::view_renderer::ViewRenderer;
use crate::renderer::frame::{Instance, Recording};
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
        self.design.clear(encoder, self.slots);
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some("gs4d"),
            timestamp_writes: timer.and_then(PassTimer::frame_writes),
        });
        let Self { picture, slots, has_colors, .. } = *self;
        let frame = Recording { renderer, instances, picture, slots, has_colors, pixel: &made.pixel, timer };
        self.design.record(&frame, &mut pass);
        if let Some(motion) = &self.motion {
            self.design.record_motion(&Recording { pixel: &motion.pixel, ..frame }, &motion.motion, &mut pass);
        }
        drop(pass);
        if let Some((counters, offset)) = self.design.counters().filter(|_| self.readback.is_idle()) {
            self.readback.copy(encoder, counters, offset);
            (self.copied, self.copied_from) = (self.design.counted(self.at_most), self.generation);
        }
    }
}
