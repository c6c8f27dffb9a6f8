//! The bins of a view from frame to frame.
//!
//! In: the size of the picture, counts of earlier frames. Out: [`BinState`]: the size of the bins, their wanted capacity, whose counters are in
//! use.

use super::bins::bin_grid;
use super::stamps::stamp;
use super::variant::BinVariant;
use crate::renderer::frame::{CountedFrame, Sizes};
use crate::renderer::layout::Counters;
use glam::UVec2;

/// The bins of a view: of the frame prepared last, unless something else is said.
#[derive(Debug, Default)]
pub(in crate::renderer) struct BinState {
    /// Size of the picture, and tiles along each side of a bin.
    pub picture: UVec2,
    pub side: u32,
    pub variant: BinVariant,
    /// The variant with which motions are blended: without depths.
    pub motion: BinVariant,
    /// Whether the counters of odd frames are used.
    pub odd: bool,
    /// Whether the frame has been recorded.
    pub recorded: bool,
    /// Number of the frame among those of all views.
    pub frame: u32,
    /// Number of splats of the fullest bin of an earlier frame, and number of entries that its bins needed, with room for as many in each.
    pub fullest: u32,
    pub needed: u32,
    /// Number of visible splats of an earlier frame, if they have been counted.
    pub visible: Option<u32>,
    /// The largest number of splats at any time of the captures of the newest frame of which some were visible.
    counted_of: usize,
    /// Number of bins that the frame recorded last has cleared for the next frame.
    pub cleared: u32,
    /// The wanted capacity.
    room: BinRoom,
}

impl BinState {
    /// Returns the bins of another view, with the wanted capacity of this view, whose bins have so many entries.
    pub(super) fn another(&self, entries: u32) -> Self {
        let made = if self.variant.counted { 0 } else { entries };
        let BinRoom { wanted, is_known, .. } = self.room;
        let room = BinRoom { wanted: wanted.max(made), is_known, ..BinRoom::default() };
        Self { room, counted_of: self.counted_of, ..Self::default() }
    }

    /// Returns 1 if the counters of odd frames are used, otherwise 0.
    pub(in crate::renderer) fn parity(&self) -> usize {
        usize::from(self.odd)
    }

    /// Returns the number of bins across and down the picture.
    pub(super) fn grid(&self) -> UVec2 {
        bin_grid(self.picture, self.side)
    }

    /// Returns the number of bins of the picture.
    pub(super) fn count(&self) -> u32 {
        self.grid().element_product()
    }

    /// Returns the uniform `binning` of a part, given the sizes of the view.
    pub(super) fn uniform(&self, sizes: &Sizes, part: u32) -> [u32; 4] {
        [self.side | (stamp(self.frame) << 8), self.capacity(sizes), part, sizes.parts]
    }

    /// Returns the capacity of each bin; 0 if bins are counted before they are filled.
    fn capacity(&self, sizes: &Sizes) -> u32 {
        if self.variant.counted { 0 } else { sizes.entries / self.count() }
    }

    /// Returns whether the counts of an earlier frame tell something of a frame of at most so many splats: those of few splats say nothing of
    /// many.
    pub(super) fn is_known(&self, at_most: usize) -> bool {
        at_most <= 2 * self.counted_of
    }

    /// Returns whether bins must be counted before they are filled, because room for the same number of splats in each would be more than
    /// `most` entries. `guess` is the number of these entries before splats have been counted.
    pub(super) fn must_count(&self, guess: u32, most: u32) -> bool {
        most < if self.room.is_known { self.room.wanted } else { guess }
    }

    /// Returns the number of entries of all bins of a view of so many pairs. `guess` and `most` are those of [`must_count`](Self::must_count).
    pub(super) fn entries(&self, guess: u32, most: u32, pairs: u32) -> u32 {
        // Each entry has at least one pair.
        if self.variant.counted { pairs } else { self.room.wanted.max(guess).min(most) }
    }

    /// Returns whether some entries or pairs of a frame with these counts may have no room.
    pub(super) fn lacks_room(&self, sizes: &Sizes, counters: &Counters) -> bool {
        let fullest = counters.pairs_wanted;
        let too_many = if self.variant.counted {
            fullest.saturating_mul(self.count()).min(counters.pairs) > sizes.entries.min(sizes.ordered)
        } else {
            fullest > self.capacity(sizes)
        };
        too_many || counters.pairs > sizes.pairs
    }

    /// Returns what the counters of a frame with these sizes count, of captures with at most so many splats.
    pub(super) fn counted(&self, sizes: &Sizes, at_most: usize) -> CountedFrame {
        let entries = if self.variant.counted { 0 } else { sizes.entries };
        CountedFrame { at_most, bins: self.count(), entries }
    }

    /// Processes the counters of an earlier frame.
    pub(super) fn note(&mut self, counters: &Counters, frame: CountedFrame) {
        if counters.visible > 0 {
            self.counted_of = frame.at_most;
        }
        (self.fullest, self.visible) = (counters.pairs_wanted, Some(counters.visible));
        self.needed = self.fullest.saturating_mul(frame.bins);
        self.room.note(self.needed, frame.entries);
    }
}

/// The wanted capacity of all bins together with equal rooms, in splats: the number of bins times the number of splats in the fullest bin, and
/// a reserve.
#[derive(Debug, Default)]
struct BinRoom {
    wanted: u32,
    /// Whether splats have been counted.
    is_known: bool,
    /// The largest capacity that a frame has needed since the last reset, and the number of frames since then.
    peak: u32,
    frames: u32,
}

/// Number of frames over which the largest needed capacity is determined.
const FRAMES_OF_PEAK: u32 = 1200;
/// The capacity is reduced if it is too large by more than this factor.
const MUCH: u32 = 4;

impl BinRoom {
    /// Processes the capacity that a frame needed, and the `capacity` that it had, 0 if bins were counted. A frame that exceeds its capacity is
    /// slow: the wanted capacity grows before it is exceeded, and is reduced only after many frames that did not need it.
    fn note(&mut self, needed: u32, capacity: u32) {
        self.is_known = true;
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
    fn bins_are_counted_if_equal_rooms_would_be_too_large() {
        let guess = 5000;
        let mut bins = BinState { picture: UVec2::new(3840, 2160), side: 4, ..BinState::default() };
        assert!(bins.must_count(guess, 4999), "nothing is known yet: the guess decides");
        assert!(!bins.must_count(guess, 5000), "the guess fits");
        let counters = Counters { visible: 300, pairs: 700, pairs_wanted: 100, padding: 0 };
        let sizes = Sizes { pairs: 700, entries: 5000, ordered: 700, ..Sizes::default() };
        bins.note(&counters, bins.counted(&sizes, 900));
        let needed = bins.count() * 100;
        assert!(bins.must_count(guess, needed), "the fullest bin is known, and needs a reserve of one half");
        assert!(!bins.must_count(guess, needed + needed / 2), "equal rooms with their reserve fit");
        assert_eq!(bins.entries(guess, 2 * needed, 700), needed + needed / 2, "equal rooms");
        assert!(bins.lacks_room(&sizes, &counters), "the fullest bin has no room");
        bins.variant.counted = true;
        assert_eq!(bins.entries(guess, needed, 700), 700, "an entry for each pair");
        assert_eq!(bins.uniform(&sizes, 0)[1], 0, "the bins have no capacity each");
        assert!(!bins.lacks_room(&sizes, &counters), "all entries have room");
        let few = Sizes { ordered: 699, ..sizes };
        assert!(bins.lacks_room(&few, &counters), "there may be as many entries as pairs");
    }

    #[test]
    fn counters_count_the_bins_of_their_own_frame() {
        let mut bins = BinState { picture: UVec2::new(400, 400), side: 2, ..BinState::default() };
        let sizes = Sizes { entries: 1 << 20, ..Sizes::default() };
        let frame = bins.counted(&sizes, 900);
        (bins.picture, bins.side, bins.variant.counted) = (UVec2::new(3840, 2160), 4, true);
        bins.note(&Counters { visible: 300, pairs: 9000, pairs_wanted: 5000, padding: 0 }, frame);
        assert_eq!(bins.needed, 13 * 13 * 5000, "the picture of 400 x 400 pixels has 13 x 13 bins of 2 x 2 tiles");
        assert_eq!(bins.counted(&sizes, 900).entries, 0, "the newest frame has its bins counted first");
    }

    #[test]
    fn counts_of_few_splats_say_nothing_of_many() {
        let mut bins = BinState { picture: UVec2::new(640, 480), side: 4, ..BinState::default() };
        assert!(!bins.is_known(1), "no frame has been counted");
        let none = Counters { visible: 0, pairs: 0, pairs_wanted: 0, padding: 0 };
        let of = |at_most| CountedFrame { at_most, bins: 1, entries: 0 };
        bins.note(&none, of(4_000_000));
        assert!(!bins.is_known(4_000_000), "nothing was visible");
        bins.note(&Counters { visible: 500, ..none }, of(1000));
        assert_eq!([1000, 2000, 2001].map(|splats| bins.is_known(splats)), [true, true, false]);
        assert!(bins.another(0).is_known(2000), "a view that begins as this one");
    }

    #[test]
    fn capacity_grows_before_it_is_exceeded() {
        let mut room = BinRoom::default();
        room.note(700, 1000);
        assert_eq!(room.wanted, 0, "70 % of the capacity does not grow it");
        room.note(800, 1000);
        assert_eq!(room.wanted, 1200, "80 % of the capacity grows it to 1.5 times the need");
    }

    #[test]
    fn alternating_views_keep_the_capacity_of_the_fullest_view() {
        let mut room = BinRoom::default();
        for frame in 0..10 * FRAMES_OF_PEAK {
            room.note(if frame % 60 == 0 { 9000 } else { 10 }, room.wanted.max(1000));
        }
        assert_eq!(room.wanted, 13_500, "every sixtieth frame needs this capacity");
    }

    #[test]
    fn unneeded_capacity_is_reduced() {
        let mut room = BinRoom::default();
        room.note(9000, 1000);
        for _ in 0..2 * FRAMES_OF_PEAK {
            room.note(100, room.wanted);
        }
        assert_eq!(room.wanted, 150, "the need and a reserve of one half");
    }
}
