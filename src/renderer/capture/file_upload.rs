//! The upload of a chunk file into the pages of a capture, distributed over several frames.
//!
//! In: the [`RuntimeScene`] of a file, and the number of bytes per step. Out: a [`GpuCapture`] that draws the file with the
//! others. Until the file is complete, it has pages, and is not drawn.

use super::buffers::BYTES_AT_ONCE;
use super::gpu_capture::GpuCapture;
use crate::renderer::device::GpuError;
use crate::renderer::layout::PAGE;
use crate::renderer::pipelines::Renderer;
use crate::scene::{RuntimeScene, TemporalFilter};
use std::borrow::Borrow;

/// An upload of a chunk file in progress. `S` is the scene of the file, or a pointer to it.
#[derive(Debug)]
pub struct FileUpload<S> {
    scene: S,
    file: usize,
    /// Its filter with sets as those of the other files, if it has others.
    filter: Option<TemporalFilter>,
    /// Number of its pages that have been written.
    done: usize,
    /// Scratch memory for the conversion of pages.
    bytes: Vec<u8>,
}

impl<S: Borrow<RuntimeScene>> FileUpload<S> {
    /// Takes pages for a file of this number, which replaces the one that is there.
    ///
    /// # Errors
    /// When the capture has no [pages](GpuCapture::open_pages), or the scene is not a file of the capture: the file that
    /// was there stays. When it has [too few](GpuCapture::has_room) pages: the file that was there is removed.
    pub fn new(capture: &mut GpuCapture, file: usize, scene: S) -> Result<Self, GpuError> {
        let no_pages = GpuError::Scene("its index has no pages for it");
        let Some(paged) = &capture.pages else { return Err(no_pages) };
        let own = scene.borrow();
        paged.check(file, own)?;
        let filter = own.filter.as_ref().map(|filter| paged.converted(filter)).transpose()?.flatten();
        capture.remove_file(file);
        let Some(paged) = &mut capture.pages else { return Err(no_pages) };
        if !paged.place(file, own.len(), filter.as_ref().or(own.filter.as_ref())) {
            return Err(GpuError::Scene("too few pages are free for it"));
        }
        Ok(Self { scene, file, filter, done: 0, bytes: Vec::new() })
    }

    /// Returns the bytes that have not been uploaded.
    pub fn bytes_left(&self, capture: &GpuCapture) -> u64 {
        let paged = capture.pages.as_ref();
        paged.map_or(0, |paged| paged.pages.of(self.file).len().saturating_sub(self.done) as u64 * paged.written_bytes)
    }

    /// Returns whether the file is drawn.
    pub fn is_complete(&self, capture: &GpuCapture) -> bool {
        self.bytes_left(capture) == 0
    }

    /// Uploads at most `bytes` of the remaining bytes, but at least a page. The file is drawn once it is complete. Returns
    /// the number of bytes uploaded: 0 if it was complete.
    ///
    /// # Errors
    /// When the capture has no pages for the file any more.
    pub fn advance(
        &mut self,
        queue: &wgpu::Queue,
        renderer: &Renderer,
        capture: &mut GpuCapture,
        bytes: u64,
    ) -> Result<u64, GpuError> {
        let gone = GpuError::Scene("the pages of its capture are others now");
        let Some(paged) = &mut capture.pages else { return Err(gone) };
        let (scene, mut written) = (self.scene.borrow(), 0);
        let filter = self.filter.as_ref().or(scene.filter.as_ref());
        let own = paged.pages.of(self.file).to_vec();
        if own.len() != scene.len().div_ceil(PAGE as usize) {
            return Err(gone);
        }
        while self.done < own.len() {
            let most = bytes.saturating_sub(written) / paged.written_bytes;
            if most == 0 && written > 0 {
                break;
            }
            let (part, to) = paged.pages.local(own[self.done]);
            let at_once = (BYTES_AT_ONCE / paged.written_bytes).min(most).max(1) as usize;
            let follows = |(count, page): &(usize, &u32)| paged.pages.local(**page) == (part, to + *count as u32);
            let run = own[self.done..].iter().enumerate().take(at_once).take_while(follows).count();
            for buffer in &paged.buffers[part] {
                written += buffer.write(queue, scene, filter, self.done..self.done + run, to, &mut self.bytes);
            }
            self.done += run;
        }
        if self.done == own.len() {
            paged.pages.fill(self.file);
            capture.len = paged.pages.gaussians();
        }
        renderer.work().add_uploaded(written);
        Ok(written)
    }
}
