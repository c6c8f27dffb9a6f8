//! Asynchronous read-back of buffers from the GPU.
//!
//! In: copies recorded into a frame. Out: their bytes, some frames later. While one copy is in progress no other is
//! started.

use crate::renderer::memory::Allocator;
use std::sync::{Arc, Mutex, PoisonError};

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
    /// Being mapped.
    Mapping(Arc<Mutex<Arrival>>),
}

#[derive(Debug, Default)]
enum Arrival {
    #[default]
    Expected,
    Bytes(Vec<u8>),
    /// The device was lost.
    Lost,
}

impl Readback {
    pub fn new(allocator: Allocator<'_>, label: &str, size: u64) -> Self {
        Self { buffer: allocator.buffer(label, size, wgpu::BufferUsages::MAP_READ), state: State::Idle }
    }

    /// Returns whether a copy can be started.
    pub fn is_idle(&self) -> bool {
        matches!(self.state, State::Idle)
    }

    /// Records a copy from the beginning of `source` that fills the buffer, unless one is in progress.
    pub fn copy(&mut self, encoder: &mut wgpu::CommandEncoder, source: &wgpu::Buffer, offset: u64) {
        if self.is_idle() {
            encoder.copy_buffer_to_buffer(source, offset, &self.buffer, 0, self.buffer.size());
            self.state = State::Recorded;
        }
    }

    /// Advances by one state; returns the bytes if they have arrived, else `None`. Call it once a frame, before the
    /// next is recorded.
    pub fn poll(&mut self) -> Option<Vec<u8>> {
        let arrival = match &self.state {
            State::Idle => return None,
            State::Recorded => {
                self.state = State::Mapping(self.map());
                return None;
            }
            State::Mapping(arrival) => std::mem::take(&mut *arrival.lock().unwrap_or_else(PoisonError::into_inner)),
        };
        match arrival {
            Arrival::Expected => None,
            Arrival::Bytes(bytes) => {
                self.state = State::Idle;
                Some(bytes)
            }
            // It will not be used again: views are created again on the next device.
            Arrival::Lost => None,
        }
    }

    /// Starts to map the buffer. The bytes are copied in the callback: later the device may have been lost, and reading
    /// the buffer would panic.
    fn map(&self) -> Arc<Mutex<Arrival>> {
        let arrival = Arc::new(Mutex::new(Arrival::Expected));
        let (buffer, to) = (self.buffer.clone(), arrival.clone());
        self.buffer.slice(..).map_async(wgpu::MapMode::Read, move |result| {
            let arrived = match result {
                Ok(()) => {
                    let bytes = buffer.slice(..).get_mapped_range().to_vec();
                    buffer.unmap();
                    Arrival::Bytes(bytes)
                }
                Err(_) => Arrival::Lost,
            };
            *to.lock().unwrap_or_else(PoisonError::into_inner) = arrived;
        });
        arrival
    }
}
