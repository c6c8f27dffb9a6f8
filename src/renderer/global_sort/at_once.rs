//! The number of splats that `blend` blends in an iteration, on software drivers that end long loops.
//!
//! In: the number of slots of a frame. Out: the variant of `blend` that draws the frame completely.

use crate::renderer::iterations::{MOST_ITERATIONS, OTHERS};

/// Number of splats that `blend` blends in an iteration once it has blended the first splats of a tile. Mesa's software driver ends all loops
/// of a thread after 65,535 iterations; long lists are blended completely if an iteration blends many splats. Hardware blends one: the code
/// for many is long.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum AtOnce {
    /// One splat.
    #[default]
    One,
    /// 16 splats.
    Sixteen,
    /// 64 splats.
    SixtyFour,
}

impl AtOnce {
    /// All numbers, ascending.
    pub const ALL: [Self; 3] = [Self::One, Self::Sixteen, Self::SixtyFour];

    /// Returns the number of splats.
    fn splats(self) -> u32 {
        match self {
            Self::One => 1,
            Self::Sixteen => 16,
            Self::SixtyFour => 64,
        }
    }

    /// Returns the definitions of `blend`.
    pub fn definitions(self) -> &'static [&'static str] {
        match self {
            Self::One => &[],
            Self::Sixteen => &["MANY_AT_ONCE", "SIXTEEN_AT_ONCE"],
            Self::SixtyFour => &["MANY_AT_ONCE", "SIXTY_FOUR_AT_ONCE"],
        }
    }
}

/// Splats of a list that `blend` blends in an iteration each, whatever the variant: `ONE_BY_ONE` of the shader.
const ONE_BY_ONE: u64 = 8192;

/// Returns an upper bound of the iterations of a thread of `blend`, if all splats of the slots cover its tile and some have no pair. In each
/// iteration many splats are blended; batches have 256 splats, and the loop over a batch ends in an iteration without a splat.
fn of_blend(slots: u64, at_once: AtOnce) -> u64 {
    let (batches, each) = (slots.div_ceil(256), u64::from(at_once.splats()));
    slots.div_ceil(each) + 3 * batches + ONE_BY_ONE.min(slots) + OTHERS
}

/// Returns the variant of `blend` that draws this number of slots completely: the smallest one. `None` if there are too many slots.
pub(super) fn at_once(slots: usize) -> Option<AtOnce> {
    AtOnce::ALL.into_iter().find(|&at_once| of_blend(slots as u64, at_once) <= MOST_ITERATIONS)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_splats_are_blended_at_once_the_more_slots_there_are() {
        for (slots, expected) in [
            (0, Some(AtOnce::One)),
            (45_000, Some(AtOnce::One)),
            (70_000, Some(AtOnce::Sixteen)),
            (700_000, Some(AtOnce::Sixteen)),
            (2_000_000, Some(AtOnce::SixtyFour)),
            (2_500_000, None),
        ] {
            assert_eq!(at_once(slots), expected, "{slots} slots");
        }
    }
}
