//! Room for the lists of several placements of one capture, so that one dispatch reads all of them.
//!
//! In: a device, the length of a list. Out: buffers with a place for each of several lists; a
//! place is free again when its list is dropped, and a buffer is freed with its last list.

use super::device::memory::binding_limit;
use super::layout::INSTANCES_AT_ONCE;
use super::pipelines::Renderer;
use std::sync::{Arc, Mutex, PoisonError, Weak};
use wgpu::BufferUsages;

/// Bytes up to which a buffer has places for lists to come: the first buffer of a capture, and each further one.
const AHEAD: [u64; 2] = [64 << 10, 8 << 20];

/// The buffers of the lists of one capture.
#[derive(Debug, Default)]
pub(super) struct ListRooms(Mutex<Vec<Weak<ListRoom>>>);

/// A buffer with places for lists of one length.
#[derive(Debug)]
struct ListRoom {
    buffer: wgpu::Buffer,
    /// The buffer, as the passes of a frame read it.
    group: wgpu::BindGroup,
    /// Entries of a place.
    length: u32,
    free: Mutex<Vec<u32>>,
}

/// The place of a list in a buffer.
#[derive(Debug)]
pub(super) struct ListPlace {
    room: Arc<ListRoom>,
    index: u32,
}

impl ListRooms {
    /// Returns a free place for a list of at most `length` entries; creates a buffer if there is none.
    pub(super) fn place(&self, device: &wgpu::Device, renderer: &Renderer, length: u32) -> ListPlace {
        let mut rooms = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        rooms.retain(|room| room.strong_count() > 0);
        let alive = rooms.iter().filter_map(Weak::upgrade).filter(|room| room.length == length);
        let alive: Vec<Arc<ListRoom>> = alive.collect();
        if let Some(place) = alive.iter().find_map(ListRoom::place) {
            return place;
        }
        let room = Arc::new(ListRoom::new(device, renderer, length, alive.len()));
        rooms.push(Arc::downgrade(&room));
        ListPlace { room, index: 0 }
    }
}

impl ListRoom {
    /// Creates a buffer whose first place is taken. `others` is the number of other buffers of such lists.
    fn new(device: &wgpu::Device, renderer: &Renderer, length: u32, others: usize) -> Self {
        let allocator = renderer.allocator(device);
        let bytes = u64::from(length.max(1)) * 4;
        let most = binding_limit(&device.limits()).min(AHEAD[others.min(1)]) / bytes;
        let places = most.clamp(1, u64::from(INSTANCES_AT_ONCE)) as u32;
        let buffer = allocator.buffer("gs4d active lists", bytes * u64::from(places), BufferUsages::STORAGE);
        let group = allocator.bind_group("gs4d active lists", &renderer.layouts.active, &[buffer.as_entire_binding()]);
        Self { buffer, group, length, free: Mutex::new((1..places).rev().collect()) }
    }

    /// Takes a free place, if there is one.
    fn place(self: &Arc<Self>) -> Option<ListPlace> {
        let index = self.free.lock().unwrap_or_else(PoisonError::into_inner).pop()?;
        Some(ListPlace { room: Arc::clone(self), index })
    }
}

impl ListPlace {
    /// Returns the index of the first entry of the list in its buffer.
    pub(super) fn first(&self) -> u32 {
        self.index * self.room.length
    }

    /// Returns the buffer.
    pub(super) fn buffer(&self) -> &wgpu::Buffer {
        &self.room.buffer
    }

    /// Returns the buffer, as the passes of a frame read it.
    pub(super) fn group(&self) -> &wgpu::BindGroup {
        &self.room.group
    }

    /// Returns whether another list is in the same buffer.
    pub(super) fn is_beside(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.room, &other.room)
    }
}

impl Drop for ListPlace {
    fn drop(&mut self) {
        self.room.free.lock().unwrap_or_else(PoisonError::into_inner).push(self.index);
    }
}
