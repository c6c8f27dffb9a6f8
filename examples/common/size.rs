//! Shared by the examples with a size of pictures on the command line.
//!
//! In: the text after `--size`. Out: a size in pixels.

use bevy::prelude::*;

/// Returns the size in a text such as `640x480`; `None` if it is another text, or a side is 0.
pub fn parse_size(text: &str) -> Option<UVec2> {
    let (width, height) = text.split_once('x')?;
    let size = UVec2::new(width.parse().ok()?, height.parse().ok()?);
    (size.min_element() > 0).then_some(size)
}
