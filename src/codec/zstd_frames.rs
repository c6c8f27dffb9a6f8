//! Zstandard frames: by libzstd, and in browsers, for which a C compiler is seldom there, by a decoder in Rust.
//!
//! In: bytes. Out: a frame of them; and from a frame the bytes, piece by piece, so that the caller can pause between pieces.

use std::io::{self, Cursor, Read};

#[cfg(not(target_arch = "wasm32"))]
type Inner = zstd::stream::read::Decoder<'static, Cursor<Vec<u8>>>;
#[cfg(target_arch = "wasm32")]
type Inner = ruzstd::decoding::StreamingDecoder<Cursor<Vec<u8>>, ruzstd::decoding::FrameDecoder>;

/// The decompression of a frame.
pub(crate) struct Decoder(Inner);

impl Decoder {
    /// Begins to decompress a frame.
    ///
    /// # Errors
    /// Bytes that do not begin like a frame.
    pub(crate) fn new(frame: Vec<u8>) -> io::Result<Self> {
        let frame = Cursor::new(frame);
        #[cfg(not(target_arch = "wasm32"))]
        let inner = Inner::with_buffer(frame)?;
        #[cfg(target_arch = "wasm32")]
        let inner = Inner::new(frame).map_err(io::Error::other)?;
        Ok(Self(inner))
    }

    /// Decompresses the next bytes until `to` is full or the frame ends; returns the number of bytes.
    ///
    /// # Errors
    /// A damaged frame.
    pub(crate) fn fill(&mut self, to: &mut [u8]) -> io::Result<usize> {
        let mut filled = 0;
        while let Some(rest) = to.get_mut(filled..).filter(|rest| !rest.is_empty()) {
            match self.0.read(rest)? {
                0 => break,
                count => filled += count,
            }
        }
        Ok(filled)
    }

    /// Returns the memory of the frame, for the next one.
    pub(crate) fn into_frame(self) -> Vec<u8> {
        #[cfg(not(target_arch = "wasm32"))]
        let frame = self.0.finish();
        #[cfg(target_arch = "wasm32")]
        let frame = self.0.into_inner();
        frame.into_inner()
    }
}

/// Decompresses a frame. `limit` bytes are allocated: the caller has compared the number with the length of the file.
///
/// # Errors
/// A damaged frame; one that holds more than `limit` bytes.
pub(crate) fn decompress(frame: &[u8], limit: usize) -> io::Result<Vec<u8>> {
    let mut decoder = Decoder::new(frame.to_vec())?;
    let mut bytes = vec![0; limit];
    let filled = decoder.fill(&mut bytes)?;
    if decoder.fill(&mut [0])? > 0 {
        return Err(io::Error::new(io::ErrorKind::InvalidData, format!("it holds more than {limit} bytes")));
    }
    bytes.truncate(filled);
    Ok(bytes)
}

/// Compresses bytes into a frame. The level is from 1 (fast) to 19 (small); browsers have the fastest alone.
///
/// # Errors
/// Too little memory.
#[cfg(not(target_arch = "wasm32"))]
pub(crate) fn compress(bytes: &[u8], level: i32) -> io::Result<Vec<u8>> {
    zstd::bulk::compress(bytes, level)
}

/// Compresses bytes into a frame. The level is from 1 (fast) to 19 (small); browsers have the fastest alone.
#[cfg(target_arch = "wasm32")]
pub(crate) fn compress(bytes: &[u8], _: i32) -> io::Result<Vec<u8>> {
    Ok(ruzstd::encoding::compress_to_vec(bytes, ruzstd::encoding::CompressionLevel::Fastest))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_is_decompressed_in_pieces() {
        let bytes: Vec<u8> = (0..300_000u32).map(|i| (i.wrapping_mul(i) >> 7) as u8).collect();
        let frame = compress(&bytes, 3).expect("it is compressed");
        let mut decoder = Decoder::new(frame.clone()).expect("a frame");
        let mut found = vec![0; bytes.len()];
        for piece in found.chunks_mut(7_001) {
            assert_eq!(decoder.fill(piece).expect("intact"), piece.len(), "every piece is full");
        }
        assert!(found == bytes, "the bytes return");
        assert_eq!(decoder.fill(&mut [0]).expect("the end"), 0, "nothing follows");
        assert_eq!(decoder.into_frame(), frame, "the memory of the frame returns");
    }

    #[test]
    fn a_frame_that_holds_more_than_the_limit_is_refused() {
        let frame = compress(&[7; 1000], 3).expect("a frame");
        assert_eq!(decompress(&frame, 1000).expect("all bytes"), [7; 1000], "the limit itself is allowed");
        assert!(decompress(&frame, 999).is_err(), "one byte more than the limit");
        assert!(decompress(&frame[..frame.len() - 1], 1000).is_err(), "a frame that is cut");
    }

    #[test]
    fn a_damaged_frame_is_an_error() {
        let frame = compress(&[7; 10_000], 3).expect("it is compressed");
        let cut = frame[..frame.len() - 2].to_vec();
        let read = |frame| Decoder::new(frame)?.fill(&mut [0; 20_000]);
        assert!(read(cut).is_err(), "a frame that is cut off");
        assert!(read(b"no frame at all".to_vec()).is_err(), "other bytes");
    }
}
