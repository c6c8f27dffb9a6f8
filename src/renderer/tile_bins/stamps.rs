//! Stamps of frames, by which the shaders tell visible splats of a frame from those of earlier frames.
//!
//! In: the number of a frame among those of all views. Out: its stamp, and the round in which no two frames have the same.

/// Frames after which stamps repeat. A stamp has 16 bits and is not 0, the stamp of a new buffer.
const STAMPS: u32 = 0xffff;

/// Returns the stamp of a frame, by which the shaders tell visible splats of this frame from older ones.
pub(super) fn stamp(frame: u32) -> u32 {
    frame % STAMPS + 1
}

/// Returns the round of stamps of a frame: in another round the same stamps belong to other frames.
pub(super) fn stamp_round(frame: u32) -> u32 {
    frame / STAMPS
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_stamps_of_a_round_are_distinct_and_not_zero() {
        // Around the repetition of stamps, and of the 32-bit frame number.
        for first in [0, u32::MAX - STAMPS - 10] {
            let mut seen = std::collections::HashSet::new();
            let mut round = stamp_round(first);
            for step in 0..2 * STAMPS + 100 {
                let frame = first.wrapping_add(step);
                if std::mem::replace(&mut round, stamp_round(frame)) != round {
                    seen.clear();
                }
                assert!(
                    stamp(frame) > 0 && stamp(frame) <= 0xffff,
                    "frame {frame}: the stamp has 16 bits and is not 0"
                );
                assert!(seen.insert(stamp(frame)), "frame {frame}: the stamp is not in use");
            }
        }
    }
}
