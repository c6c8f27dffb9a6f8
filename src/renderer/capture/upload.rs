//! The upload of a capture, at once or distributed over several frames.
//!
//! In: a [`RuntimeScene`], and the number of bytes per step. Out: a complete [`GpuCapture`]. Its buffers are created at the beginning. The
//! records are converted and copied in chunks, which can take long for a large capture.

use super::buffers::Filling;
use super::gpu_capture::GpuCapture;
use crate::renderer::device::GpuError;
use crate::renderer::pipelines::Renderer;
use crate::scene::RuntimeScene;
use std::borrow::Borrow;

/// An upload of a capture in progress. `S` is the scene, or a pointer to it.
#[derive(Debug)]
pub struct CaptureUpload<S> {
    scene: S,
    capture: GpuCapture,
    /// Buffers that are not complete; the last is filled first.
    fillings: Vec<Filling>,
    /// Scratch memory for the conversion of a chunk.
    chunk: Vec<u8>,
}

impl<S: Borrow<RuntimeScene>> CaptureUpload<S> {
    /// Creates the buffers of a scene, without uploading data.
    ///
    /// # Errors
    /// When the environment map, or the smallest part of the Gaussians, is larger than the device can bind, or the
    /// parts of the scene are inconsistent.
    pub fn new(device: &wgpu::Device, renderer: &Renderer, scene: S) -> Result<Self, GpuError> {
        let (capture, fillings) = GpuCapture::allocate(device, renderer, scene.borrow())?;
        Ok(Self { scene, capture, fillings, chunk: Vec::new() })
    }

    /// Returns the bytes that have not been uploaded.
    pub fn bytes_left(&self) -> u64 {
        self.fillings.iter().map(Filling::bytes_left).sum()
    }

    /// Returns the largest number of Gaussians that the capture draws at any time, if its temporal filter is used.
    pub fn most_drawn(&self) -> usize {
        self.capture.filter.as_ref().map_or(self.capture.len(), |filter| filter.most as usize)
    }

    /// Uploads at most `bytes` of the remaining bytes, but at least the record of one Gaussian. Returns the number of bytes uploaded: 0 if the
    /// capture was complete.
    pub fn advance(&mut self, queue: &wgpu::Queue, renderer: &Renderer, bytes: u64) -> u64 {
        let mut written = 0;
        while let Some(filling) = self.fillings.last_mut() {
            if filling.bytes_left() == 0 {
                self.fillings.pop();
                continue;
            }
            let left = bytes.saturating_sub(written);
            if written > 0 && left < filling.record_size() {
                break;
            }
            written += filling.fill(queue, self.scene.borrow(), left, &mut self.chunk);
        }
        renderer.work().add_uploaded(written);
        written
    }

    /// Uploads all remaining bytes, and returns the capture.
    pub fn finish(mut self, queue: &wgpu::Queue, renderer: &Renderer) -> GpuCapture {
        self.advance(queue, renderer, u64::MAX);
        self.capture
    }
}

impl GpuCapture {
    /// Uploads a whole scene at once. [`CaptureUpload`] uploads it in chunks.
    ///
    /// # Errors
    /// When the environment map, or the smallest part of the Gaussians, is larger than the device can bind, or the
    /// parts of the scene are inconsistent.
    pub fn upload(
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        renderer: &Renderer,
        scene: &RuntimeScene,
    ) -> Result<Self, GpuError> {
        Ok(CaptureUpload::new(device, renderer, scene)?.finish(queue, renderer))
    }
}
