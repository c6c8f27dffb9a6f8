//! The buffers of the passes after the picture.
//!
//! In: a recorded frame. Out: [`Backward`]: the buffers for that frame, which are created only if sizes have changed,
//! and the sums of the loss over views.

use super::totals::Totals;
use super::view_buffers::ViewBuffers;
use super::workspace::Workspace;
use crate::renderer::device::memory::with_room;
use crate::renderer::{GpuError, Headless};
use glam::UVec2;
use wgpu::BufferUsages;

/// Buffers of the passes after the picture, and the sums over views.
#[derive(Debug)]
pub(crate) struct Backward {
    totals: wgpu::Buffer,
    view: Option<ViewBuffers>,
}

impl Backward {
    /// Creates the sums over views, which are 0.
    pub(crate) fn new(headless: &Headless) -> Self {
        let usage = BufferUsages::STORAGE | BufferUsages::COPY_SRC;
        Self { totals: headless.allocator().buffer("gs4d totals", 16, usage), view: None }
    }

    /// Returns the buffers for the frame that was recorded last, which has this size; `None` before the first frame.
    /// Creates them only if sizes have changed.
    pub(crate) fn fit(&mut self, work: &Workspace<'_>, size: UVec2) -> Result<Option<&ViewBuffers>, GpuError> {
        let headless = &*work.headless;
        let Some(frame) = headless.finished() else { return Ok(self.view.as_ref()) };
        if !self.view.as_ref().is_some_and(|made| made.fits(&frame, size)) {
            let create = || ViewBuffers::new(work, &self.totals, &frame, size);
            self.view = Some(with_room(&headless.context().device, ViewBuffers::bytes(size), create)??);
        }
        Ok(self.view.as_ref())
    }

    /// Returns the sums over the views since the last call, and begins new ones.
    pub(crate) fn totals(&self, headless: &Headless) -> Result<Totals, GpuError> {
        let bytes = headless.copy_out(&self.totals, 16)?;
        headless.context().queue.write_buffer(&self.totals, 0, &[0; 16]);
        Ok(Totals::of(bytemuck::pod_read_unaligned(&bytes)))
    }
}
