//! The limit on picture sizes.
//!
//! In: nothing. Out: the limit for the sizes in camera files, images and options.

/// The longest side of a picture that is accepted, in pixels.
pub const MAX_SIDE: u32 = 16_384;
