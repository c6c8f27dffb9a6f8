//! Bytes on their way from the GPU to the host, without anybody waiting.
//!
//! In: copies recorded into a frame. Out: their bytes, some frames later. While one copy is under way no other is begun.

use super::buffer;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// A buffer that is copied into, mapped and read, in turn.
#[derive(Debug)]
pub(super) struct Readback {
    buffer: wgpu::Buffer,
    state: State,
}

#[derive(Debug)]
enum State {
    /// Free to be copied into.
    Idle,
    /// A recorded frame copies into it.
    Recorded,
    /// Being mapped; the flag tells when.
    Mapping(Arc<AtomicBool>),
}

impl Readback {
    pub fn new(device: &wgpu::Device, label: &str, size: u64) -> Self {
        Self { buffer: buffer(device, label, size, wgpu::BufferUsages::MAP_READ), state: State::Idle }
    }

    /// Whether a copy can be begun.
    pub fn is_idle(&self) -> bool {
        matches!(self.state, State::Idle)
    }

    /// Records the copy of all of it from the beginning of `source`, if none is under way.
    pub fn copy(&mut self, encoder: &mut wgpu::CommandEncoder, source: &wgpu::Buffer) {
        if self.is_idle() {
            encoder.copy_buffer_to_buffer(source, 0, &self.buffer, 0, self.buffer.size());
            self.state = State::Recorded;
        }
    }

    /// Moves on by one state; the bytes when they have arrived. Call it once a frame, before the next is recorded.
    pub fn poll(&mut self) -> Option<Vec<u8>> {
        match &self.state {
            State::Idle => None,
            State::Recorded => {
                let ready = Arc::new(AtomicBool::new(false));
                let flag = ready.clone();
                self.buffer
                    .slice(..)
                    .map_async(wgpu::MapMode::Read, move |result| flag.store(result.is_ok(), Ordering::Release));
                self.state = State::Mapping(ready);
                None
            }
            State::Mapping(ready) if ready.load(Ordering::Acquire) => {
                let bytes = self.buffer.slice(..).get_mapped_range().to_vec();
                self.buffer.unmap();
                self.state = State::Idle;
                Some(bytes)
            }
            State::Mapping(_) => None,
        }
    }
}
