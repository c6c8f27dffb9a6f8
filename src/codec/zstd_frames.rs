//! Frames of zstd.
//!
//! In: a frame and the most bytes that it may hold. Out: the bytes that it holds. Packages and SPZ files are decompressed here and nowhere else.

use std::io;

/// Decompresses a frame. `limit` bytes may be allocated: the caller has compared the number with the length of the file.
///
/// # Errors
/// A damaged frame; one that holds more than `limit` bytes.
pub(crate) fn decompress(frame: &[u8], limit: usize) -> io::Result<Vec<u8>> {
    zstd::bulk::decompress(frame, limit)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_that_holds_more_than_the_limit_is_refused() {
        let frame = zstd::bulk::compress(&[7; 1000], 3).expect("a frame");
        assert_eq!(decompress(&frame, 1000).expect("all bytes"), [7; 1000], "the limit itself is allowed");
        assert!(decompress(&frame, 999).is_err(), "one byte more than the limit");
        assert!(decompress(&frame[..frame.len() - 1], 1000).is_err(), "a frame that is cut");
    }
}
