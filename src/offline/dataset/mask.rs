//! The limit of masks.
//!
//! Out: the value from which a pixel of a mask is inside, the same wherever a mask is used.

/// The least value, 0 to 255, of a pixel of a mask that is inside: of what moves, or of what is shown.
pub(crate) const INSIDE: u8 = 128;
