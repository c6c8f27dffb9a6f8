//! The upload of a capture, over as many frames as it should take.
//!
//! In: a [`RuntimeScene`], and how many bytes at a time. Out: a [`GpuCapture`], once it is whole. Its buffers are created at first; what
//! takes time with a large capture, converting and copying, is done in pieces.

use super::buffers::Filling;
use super::gpu_capture::GpuCapture;
use crate::renderer::error::GpuError;
use crate::renderer::pipelines::Renderer;
use crate::scene::RuntimeScene;
use std::borrow::Borrow;

/// A capture on its way to the GPU. `S` is the scene, or a pointer to it.
#[derive(Debug)]
pub struct CaptureUpload<S> {
    scene: S,
    capture: GpuCapture,
    /// What is not whole yet; the last is filled first.
    fillings: Vec<Filling>,
    /// Memory of the piece that is being converted.
    chunk: Vec<u8>,
}

impl<S: Borrow<RuntimeScene>> CaptureUpload<S> {
    /// Creates the buffers of a scene, and uploads nothing yet.
    ///
    /// # Errors
    /// When the environment map, or the smallest part of the Gaussians, is larger than the device can bind, or the
    /// parts of the scene do not fit together.
    pub fn new(device: &wgpu::Device, renderer: &Renderer, scene: S) -> Result<Self, GpuError> {
        let (capture, fillings) = GpuCapture::allocate(device, renderer, scene.borrow())?;
        Ok(Self { scene, capture, fillings, chunk: Vec::new() })
    }

    /// Returns the bytes that have not been uploaded.
    pub fn bytes_left(&self) -> u64 {
        self.fillings.iter().map(Filling::bytes_left).sum()
    }

    /// Uploads no more than `bytes` of what is left, but the record of one Gaussian in any case. Returns how many bytes
    /// that were: 0 if it was whole already.
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

    /// Uploads all that is left, and returns the capture.
    pub fn finish(mut self, queue: &wgpu::Queue, renderer: &Renderer) -> GpuCapture {
        self.advance(queue, renderer, u64::MAX);
        self.capture
    }
}

impl GpuCapture {
    /// Uploads a scene, all of it at once; a [`CaptureUpload`] does it piece by piece.
    ///
    /// # Errors
    /// When the environment map, or the smallest part of the Gaussians, is larger than the device can bind, or the
    /// parts of the scene do not fit together.
    pub fn upload(
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        renderer: &Renderer,
        scene: &RuntimeScene,
    ) -> Result<Self, GpuError> {
        Ok(CaptureUpload::new(device, renderer, scene)?.finish(queue, renderer))
    }
}
