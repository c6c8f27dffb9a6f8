//! Codebooks on the GPU that several captures share: those of the chunk files of a capture.
//!
//! In: the coded colors of a scene. Out: the buffer of their codebooks, which scenes with the same codebooks share, and
//! what has to be written into it.

use super::buffers::{self, Filling};
use crate::renderer::device::memory::Allocator;
use crate::scene::{CodedColors, ColorCodebooks};
use std::sync::atomic::AtomicBool;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::{Arc, Mutex, PoisonError, Weak};

/// The buffers of all codebooks of a device that scenes in memory have.
#[derive(Debug, Default)]
pub(in crate::renderer) struct SharedCodebooks(Mutex<Vec<Shared>>);

#[derive(Debug)]
struct Shared {
    of: Weak<ColorCodebooks>,
    /// Words of an entry in the buffer.
    words: usize,
    buffer: wgpu::Buffer,
    /// Whether all of it has been written.
    is_filled: Arc<AtomicBool>,
}

impl SharedCodebooks {
    /// Forgets all buffers, which captures that have them keep: one of them may be invalid, or not be filled.
    pub(in crate::renderer) fn forget(&self) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clear();
    }

    /// Returns the buffer of the codebooks of these colors, and how it is filled, unless it has been filled.
    pub(super) fn claim(&self, allocator: Allocator<'_>, colors: &CodedColors) -> (wgpu::Buffer, Option<Filling>) {
        let mut all = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        all.retain(|shared| shared.of.strong_count() > 0);
        let words = buffers::entry_words(colors);
        let is_of = |shared: &&Shared| {
            std::ptr::eq(shared.of.as_ptr(), Arc::as_ptr(&colors.codebooks)) && shared.words == words
        };
        if let Some(Shared { buffer, is_filled, .. }) = all.iter().find(is_of) {
            let filling = || buffers::codebooks_in(buffer.clone(), colors, is_filled.clone());
            return (buffer.clone(), (!is_filled.load(Relaxed)).then(filling));
        }
        let (buffer, is_filled) = (buffers::codebooks(allocator, colors), Arc::default());
        let filling = buffers::codebooks_in(buffer.clone(), colors, Arc::clone(&is_filled));
        all.push(Shared { of: Arc::downgrade(&colors.codebooks), words, buffer: buffer.clone(), is_filled });
        (buffer, Some(filling))
    }
}
