//! Asynchronous read-back of buffers from the GPU.
//!
//! In: copies recorded into a frame. Out: the copied bytes, some frames later. While a copy is in progress, no other copy is
//! started.

use crate::renderer::device::memory::Allocator;
use std::sync::{Arc, Mutex, PoisonError};

/// A buffer that is repeatedly filled by a copy, mapped and read.
#[derive(Debug)]
pub(super) struct Readback {
    buffer: wgpu::Buffer,
    state: State,
}

#[derive(Debug)]
enum State {
    /// No copy is in progress.
    Idle,
    /// A recorded frame copies into the buffer.
    Recorded,
    /// The buffer is being mapped.
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
    pub(super) fn new(allocator: Allocator<'_>, label: &str, size: u64) -> Self {
        Self { buffer: allocator.buffer(label, size, wgpu::BufferUsages::MAP_READ), state: State::Idle }
    }

    /// Returns whether a copy can be started.
    pub(super) fn is_idle(&self) -> bool {
        matches!(self.state, State::Idle)
    }

    /// Records a copy from `source`, starting at `offset`, that fills the buffer, unless a copy is in progress.
    pub(super) fn copy(&mut self, encoder: &mut wgpu::CommandEncoder, source: &wgpu::Buffer, offset: u64) {
        if self.is_idle() {
            encoder.copy_buffer_to_buffer(source, offset, &self.buffer, 0, self.buffer.size());
            self.state = State::Recorded;
        }
    }

    /// Advances by one state; returns the bytes if they have arrived, otherwise `None`. Call it once per frame, before the
    /// frame is recorded.
    pub(super) fn poll(&mut self) -> Option<Vec<u8>> {
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
            // The buffer is not used again: views are created again on the next device.
            Arrival::Lost => None,
        }
    }

    /// Starts to map the buffer. The callback copies the bytes: later the device may be lost, and reading the buffer would
    /// panic.
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
