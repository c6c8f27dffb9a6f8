//! The working buffers of tile bins that all views of a device share. Views are drawn one after another, and a frame reads nothing that an
//! earlier frame has written there.
//!
//! In: the room that each view needs. Out: a [`Claim`] for each view: buffers with room for any of the views, which exist as long as a view
//! uses them.

use super::stamps::stamp_round;
use crate::renderer::device::memory::Allocator;
use crate::renderer::frame::Sizes;
use crate::renderer::layout::{SplatShape, VisibleSplat};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Arc, Mutex, PoisonError, Weak};
use wgpu::BufferUsages;

/// Bytes of the color of a splat.
const COLOR_BYTES: usize = 16;
/// Buffers that are too large for every view by more than this factor are replaced.
const OVERSIZE_FACTOR: u32 = 4;

/// Numbers of elements of the buffers: slots, pairs, entries, ordered entries.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Room([u32; 4]);

impl Room {
    fn of(sizes: &Sizes) -> Self {
        Self([sizes.slots, sizes.pairs, sizes.entries.max(1), sizes.ordered.max(1)])
    }

    fn largest(self, other: Self) -> Self {
        Self(std::array::from_fn(|i| self.0[i].max(other.0[i])))
    }

    /// Returns whether buffers of this room suit views that need `wanted`: none is too small, and none far too large.
    fn suits(self, wanted: Self) -> bool {
        let mut both = self.0.into_iter().zip(wanted.0);
        both.all(|(made, wanted)| made >= wanted && made / OVERSIZE_FACTOR <= wanted)
    }
}

/// The buffers.
#[derive(Debug)]
pub(super) struct ScratchBuffers {
    room: Room,
    pub bytes: u64,
    /// One [`SplatShape`] for each slot.
    pub splats: wgpu::Buffer,
    /// One [`VisibleSplat`] for each slot.
    pub visible: wgpu::Buffer,
    /// Color of each slot.
    pub splat_colors: wgpu::Buffer,
    /// Slot of each pair.
    pub pair_splats: wgpu::Buffer,
    /// Entries of all bins together.
    pub entries: wgpu::Buffer,
    /// Entries in order of parts, if bins are counted.
    pub ordered: wgpu::Buffer,
    /// Number of frames prepared so far, of all views.
    frames: AtomicU32,
    /// The [round](stamp_round) of stamps in the list of the visible splats.
    round: AtomicU32,
}

impl ScratchBuffers {
    fn new(allocator: Allocator<'_>, room: Room) -> Self {
        let mut bytes = 0;
        let mut storage = |label, count: u32, each: usize| {
            let size = u64::from(count) * each as u64;
            bytes += size;
            allocator.buffer(label, size, BufferUsages::STORAGE)
        };
        let Room([slots, pairs, entries, ordered]) = room;
        Self {
            room,
            splats: storage("gs4d splats", slots, size_of::<SplatShape>()),
            visible: storage("gs4d visible", slots, size_of::<VisibleSplat>()),
            splat_colors: storage("gs4d splat colors", slots, COLOR_BYTES),
            pair_splats: storage("gs4d pair splats", pairs, 4),
            entries: storage("gs4d bin entries", entries, 8),
            ordered: storage("gs4d ordered entries", ordered, 8),
            bytes,
            frames: AtomicU32::new(0),
            round: AtomicU32::new(0),
        }
    }

    /// Returns the number of a new frame. No two frames of a round have the same stamp, whichever view they are of.
    pub(super) fn next_frame(&self) -> u32 {
        self.frames.fetch_add(1, Ordering::Relaxed)
    }

    /// Returns whether the list of the visible splats may have stamps of another round than that of a frame, and must be cleared before it.
    pub(super) fn begins_round(&self, frame: u32) -> bool {
        self.round.swap(stamp_round(frame), Ordering::Relaxed) != stamp_round(frame)
    }
}

/// The buffers of a device, if a view uses them, and what each view needs of them.
#[derive(Debug, Default)]
pub(in crate::renderer) struct Scratch(Mutex<Claimed>);

#[derive(Debug, Default)]
struct Claimed {
    rooms: Vec<Weak<Room>>,
    buffers: Weak<ScratchBuffers>,
}

impl Claimed {
    /// Returns the room that the views need, or `None` if there is no view.
    fn wanted(&self) -> Option<Room> {
        self.rooms.iter().filter_map(Weak::upgrade).map(|room| *room).reduce(Room::largest)
    }
}

/// A view's part in the shared buffers.
#[derive(Debug)]
pub(in crate::renderer) struct Claim {
    /// What the view needs. The pool has a weak reference.
    _room: Arc<Room>,
    pub(super) buffers: Arc<ScratchBuffers>,
}

impl Claim {
    /// Makes `frame` the number of the next frame.
    #[cfg(test)]
    pub(in crate::renderer) fn skip_to(&self, frame: u32) {
        self.buffers.frames.store(frame, Ordering::Relaxed);
    }
}

impl Scratch {
    /// Returns buffers for a view of these sizes: those of the other views, or new ones if they do not suit. The other views then
    /// [no longer](Self::is_current) have the current ones.
    pub(super) fn claim(&self, allocator: Allocator<'_>, sizes: &Sizes) -> Claim {
        let mut claimed = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let room = Arc::new(Room::of(sizes));
        claimed.rooms.retain(|room| room.strong_count() > 0);
        claimed.rooms.push(Arc::downgrade(&room));
        let wanted = claimed.wanted().unwrap_or(*room);
        let made = claimed.buffers.upgrade().filter(|made| made.room.suits(wanted));
        let buffers = made.unwrap_or_else(|| Arc::new(ScratchBuffers::new(allocator, wanted)));
        claimed.buffers = Arc::downgrade(&buffers);
        Claim { _room: room, buffers }
    }

    /// Returns whether a claim has the newest buffers, and these suit all views that exist now.
    pub(in crate::renderer) fn is_current(&self, claim: &Claim) -> bool {
        let claimed = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let suits = claimed.wanted().is_none_or(|wanted| claim.buffers.room.suits(wanted));
        suits && claimed.buffers.ptr_eq(&Arc::downgrade(&claim.buffers))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn buffers_suit_if_they_are_large_enough_but_not_far_too_large() {
        let room = |slots, pairs| Room([slots, pairs, 100, 1]);
        let made = room(1000, 4000);
        assert!(made.suits(room(1000, 4000)), "the same room");
        assert!(made.suits(room(250, 1000)), "four times as large");
        assert!(!made.suits(room(1001, 4000)), "a splat has no room");
        assert!(!made.suits(room(199, 4000)), "more than four times as large");
        assert_eq!(room(10, 4000).largest(room(1000, 20)), made, "room for either view");
    }
}
