//! The bins of a view from frame to frame.
//!
//! In: the size of the picture, counts of earlier frames. Out: [`BinState`]: the size of the bins, their wanted capacity, whose counters are in
//! use.

use super::bins::{bin_grid, stamp};
use super::variant::BinVariant;
use crate::renderer::view::Sizes;
use glam::UVec2;

/// The bins of a view: of the frame prepared last, unless something else is said.
#[derive(Debug)]
pub(in crate::renderer) struct BinState {
    /// Tiles along each side of a bin.
    pub side: u32,
    pub variant: BinVariant,
    /// Whether the counters of odd frames are used.
    pub odd: bool,
    /// Number of frames that have been recorded.
    pub frames: u32,
    /// Number of splats of the fullest bin of an earlier frame.
    pub fullest: u32,
    /// Number of bins that the frame recorded last has cleared for the next frame.
    pub cleared: u32,
    /// The wanted capacity.
    pub room: BinRoom,
}

impl Default for BinState {
    fn default() -> Self {
        Self {
            side: 1,
            variant: BinVariant::default(),
            odd: false,
            frames: 0,
            fullest: 0,
            cleared: 0,
            room: BinRoom::default(),
        }
    }
}

impl BinState {
    /// Returns 1 if the counters of odd frames are used, otherwise 0.
    pub(in crate::renderer) fn parity(&self) -> usize {
        usize::from(self.odd)
    }

    /// Returns the number of bins across and down a picture.
    pub(in crate::renderer) fn grid(&self, picture: UVec2) -> UVec2 {
        bin_grid(picture, self.side)
    }

    /// Returns the number of bins of a picture.
    pub(in crate::renderer) fn count(&self, picture: UVec2) -> u32 {
        self.grid(picture).element_product()
    }

    /// Returns the uniform `binning` of a part in a picture.
    pub(in crate::renderer) fn uniform(&self, sizes: &Sizes, picture: UVec2, part: u32) -> [u32; 4] {
        [self.side | (stamp(self.frames) << 8), sizes.entries / self.count(picture), part, sizes.parts]
    }
}

/// The wanted capacity of all bins together, in splats: the number of bins times the number of splats in the fullest bin, and a reserve.
#[derive(Debug, Default)]
pub(in crate::renderer) struct BinRoom {
    wanted: u32,
    /// The largest capacity that a frame has needed since the last reset, and the number of frames since then.
    peak: u32,
    frames: u32,
}

/// Number of frames over which the largest needed capacity is determined.
const FRAMES_OF_PEAK: u32 = 1200;
/// The capacity is reduced if it is too large by more than this factor.
const MUCH: u32 = 4;

impl BinRoom {
    /// Creates the capacity with this initial number of wanted splats.
    pub(in crate::renderer) fn of(wanted: u32) -> Self {
        Self { wanted, ..Self::default() }
    }

    /// Returns the wanted capacity in splats.
    pub(in crate::renderer) fn wanted(&self) -> u32 {
        self.wanted
    }

    /// Processes the capacity that a frame needed, and the `capacity` that it had. A frame that exceeds its capacity is slow: the wanted
    /// capacity grows before it is exceeded, and is reduced only after many frames that did not need it.
    pub(in crate::renderer) fn note(&mut self, needed: u32, capacity: u32) {
        let with_reserve = |needed: u32| needed.saturating_add(needed / 2);
        if needed > capacity / 4 * 3 {
            self.wanted = self.wanted.max(with_reserve(needed));
        }
        self.peak = self.peak.max(needed);
        self.frames += 1;
        if self.frames == FRAMES_OF_PEAK {
            if self.wanted / MUCH > with_reserve(self.peak) {
                self.wanted = with_reserve(self.peak);
            }
            (self.peak, self.frames) = (0, 0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn capacity_grows_before_it_is_exceeded() {
        let mut room = BinRoom::default();
        room.note(700, 1000);
        assert_eq!(room.wanted(), 0, "70 % of the capacity does not grow it");
        room.note(800, 1000);
        assert_eq!(room.wanted(), 1200, "80 % of the capacity grows it to 1.5 times the need");
    }

    #[test]
    fn alternating_views_keep_the_capacity_of_the_fullest_view() {
        let mut room = BinRoom::default();
        for frame in 0..10 * FRAMES_OF_PEAK {
            room.note(if frame % 60 == 0 { 9000 } else { 10 }, room.wanted().max(1000));
        }
        assert_eq!(room.wanted(), 13_500, "every sixtieth frame needs this capacity");
    }

    #[test]
    fn unneeded_capacity_is_reduced() {
        let mut room = BinRoom::default();
        room.note(9000, 1000);
        for _ in 0..2 * FRAMES_OF_PEAK {
            room.note(100, room.wanted());
        }
        assert_eq!(room.wanted(), 150, "the need and a reserve of one half");
    }
}
