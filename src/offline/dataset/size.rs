//! The limit on picture sizes.
//!
//! In: nothing. Out: a number that camera files, images and options are checked against.

/// The longest side of a picture that is accepted, in pixels.
pub const MAX_SIDE: u32 = 16_384;
