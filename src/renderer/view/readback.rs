//! Bytes on their way from the GPU to the host, without anybody waiting.
//!
//! In: copies recorded into a frame. Out: their bytes, some frames later. While one copy is under way no other is begun.

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
            // It will not be used again: views are made anew on the next device.
            Arrival::Lost => None,
        }
    }

    /// Begins to map. Bytes are taken where it is said that they are there: later the device may have been lost, and a look into the
    /// buffer would panic.
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
