//! Zstandard frames: by libzstd, and in browsers, for which a C compiler is seldom there, by a decoder in Rust.
//!
//! In: bytes. Out: a frame of them; and from a frame the bytes, piece by piece, so that the caller can pause between pieces.

#[cfg(not(target_arch = "wasm32"))]
use std::io::Write;
use std::io::{self, Cursor, Read};

#[cfg(target_arch = "wasm32")]
use ruzstd::decoding::{BlockDecodingStrategy, FrameDecoder};

/// Memory for a frame and its decompression, which the next one uses again.
#[derive(Default)]
pub(crate) struct Memory {
    /// The bytes of the frame.
    pub(crate) frame: Vec<u8>,
    #[cfg(target_arch = "wasm32")]
    decoder: FrameDecoder,
}

impl Memory {
    /// Returns memory with the bytes of a frame.
    fn of(frame: Vec<u8>) -> Self {
        Self {
            frame,
            #[cfg(target_arch = "wasm32")]
            decoder: FrameDecoder::new(),
        }
    }
}

/// The decompression of a frame.
pub(crate) struct Decoder {
    #[cfg(not(target_arch = "wasm32"))]
    inner: zstd::stream::read::Decoder<'static, Cursor<Vec<u8>>>,
    #[cfg(target_arch = "wasm32")]
    inner: FrameDecoder,
    #[cfg(target_arch = "wasm32")]
    frame: Cursor<Vec<u8>>,
}

impl Decoder {
    /// Begins to decompress a frame.
    ///
    /// # Errors
    /// Bytes that do not begin like a frame.
    #[cfg(not(target_arch = "wasm32"))]
    pub(crate) fn new(memory: Memory) -> io::Result<Self> {
        Ok(Self { inner: zstd::stream::read::Decoder::with_buffer(Cursor::new(memory.frame))? })
    }

    /// Begins to decompress a frame.
    ///
    /// # Errors
    /// Bytes that do not begin like a frame.
    #[cfg(target_arch = "wasm32")]
    pub(crate) fn new(memory: Memory) -> io::Result<Self> {
        let (mut inner, mut frame) = (memory.decoder, Cursor::new(memory.frame));
        inner.reset(&mut frame).map_err(io::Error::other)?;
        Ok(Self { inner, frame })
    }

    /// Decompresses bytes, and returns how many are in `to`: 0 while the frame refers back to all of them. `None` at its end.
    #[cfg(not(target_arch = "wasm32"))]
    fn some(&mut self, to: &mut [u8]) -> io::Result<Option<usize>> {
        Ok(Some(self.inner.read(to)?).filter(|&count| count > 0))
    }

    /// Decompresses bytes, and returns how many are in `to`: 0 while the frame refers back to all of them. `None` at its end.
    #[cfg(target_arch = "wasm32")]
    fn some(&mut self, to: &mut [u8]) -> io::Result<Option<usize>> {
        let (found, is_finished) = (self.inner.can_collect(), self.inner.is_finished());
        if is_finished && found == 0 {
            return Ok(None);
        }
        if !is_finished && found < to.len() {
            let about = BlockDecodingStrategy::UptoBytes(to.len());
            self.inner.decode_blocks(&mut self.frame, about).map_err(io::Error::other)?;
        }
        self.inner.read(to).map(Some)
    }

    /// Decompresses about as many bytes as `to` has. Returns how many of them are in `to`, which may be none while the frame refers back to them, and
    /// whether it has ended.
    ///
    /// # Errors
    /// A damaged frame.
    pub(crate) fn advance(&mut self, to: &mut [u8]) -> io::Result<(usize, bool)> {
        let mut filled = 0;
        while let Some(rest) = to.get_mut(filled..).filter(|rest| !rest.is_empty()) {
            match self.some(rest)? {
                None => return Ok((filled, true)),
                Some(0) => break,
                Some(count) => filled += count,
            }
        }
        Ok((filled, false))
    }

    /// Decompresses the next bytes until `to` is full or the frame ends; returns the number of bytes.
    ///
    /// # Errors
    /// A damaged frame.
    pub(crate) fn fill(&mut self, to: &mut [u8]) -> io::Result<usize> {
        let mut filled = 0;
        while let Some(rest) = to.get_mut(filled..).filter(|rest| !rest.is_empty()) {
            let (count, has_ended) = self.advance(rest)?;
            filled += count;
            if has_ended {
                break;
            }
        }
        Ok(filled)
    }

    /// Returns the memory, for the next frame.
    #[cfg(not(target_arch = "wasm32"))]
    pub(crate) fn into_memory(self) -> Memory {
        Memory { frame: self.inner.finish().into_inner() }
    }

    /// Returns the memory, for the next frame.
    #[cfg(target_arch = "wasm32")]
    pub(crate) fn into_memory(self) -> Memory {
        Memory { frame: self.frame.into_inner(), decoder: self.inner }
    }
}

/// Decompresses a frame. `limit` bytes are allocated: the caller has compared the number with the length of the file.
///
/// # Errors
/// A damaged frame; one that holds more than `limit` bytes.
pub(crate) fn decompress(frame: &[u8], limit: usize) -> io::Result<Vec<u8>> {
    let mut decoder = Decoder::new(Memory::of(frame.to_vec()))?;
    let mut bytes = vec![0; limit];
    let filled = decoder.fill(&mut bytes)?;
    if decoder.fill(&mut [0])? > 0 {
        return Err(io::Error::new(io::ErrorKind::InvalidData, format!("it holds more than {limit} bytes")));
    }
    bytes.truncate(filled);
    Ok(bytes)
}

/// Compresses bytes into a frame. `level` is from 1 (fast) to 19 (small). A block ends after every `run` bytes, for
/// bytes that consist of runs of similar ones: a block has one code for all its bytes, and libzstd by itself seldom ends
/// blocks between runs in which nothing repeats.
///
/// # Errors
/// Too little memory.
#[cfg(not(target_arch = "wasm32"))]
pub(crate) fn compress(bytes: &[u8], run: usize, level: i32) -> io::Result<Vec<u8>> {
    if run == 0 || run >= bytes.len() {
        return zstd::bulk::compress(bytes, level);
    }
    let mut encoder = zstd::Encoder::new(Vec::new(), level)?;
    encoder.set_pledged_src_size(Some(bytes.len() as u64))?;
    for run in bytes.chunks(run) {
        encoder.write_all(run)?;
        encoder.flush()?;
    }
    encoder.finish()
}

/// Compresses bytes into a frame: in browsers by the fastest level, in blocks of any bytes.
///
/// # Errors
/// Too little memory.
#[cfg(target_arch = "wasm32")]
pub(crate) fn compress(bytes: &[u8], _: usize, _: i32) -> io::Result<Vec<u8>> {
    Ok(ruzstd::encoding::compress_to_vec(bytes, ruzstd::encoding::CompressionLevel::Fastest))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_is_decompressed_in_pieces() {
        let bytes: Vec<u8> = (0..300_000u32).map(|i| (i.wrapping_mul(i) >> 7) as u8).collect();
        let frame = compress(&bytes, bytes.len(), 3).expect("it is compressed");
        let mut decoder = Decoder::new(Memory::of(frame.clone())).expect("a frame");
        let mut found = vec![0; bytes.len()];
        for piece in found.chunks_mut(7_001) {
            assert_eq!(decoder.fill(piece).expect("intact"), piece.len(), "every piece is full");
        }
        assert!(found == bytes, "the bytes return");
        assert_eq!(decoder.fill(&mut [0]).expect("the end"), 0, "nothing follows");
        assert_eq!(decoder.into_memory().frame, frame, "the memory of the frame returns");
    }

    #[test]
    fn runs_of_different_bytes_are_in_blocks_of_their_own() {
        // Each run has random bytes of sixteen values, which differ from run to run: four bits for each byte.
        let (run, mut state) = (4_000, 1_u32);
        let bytes: Vec<u8> = (0..8 * run)
            .map(|i| {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                (i / run * 16) as u8 + (state >> 28) as u8
            })
            .collect();
        let lengths = [run, bytes.len()].map(|run| {
            let frame = compress(&bytes, run, 3).expect("it is compressed");
            assert!(decompress(&frame, bytes.len()).expect("intact") == bytes, "the bytes return");
            frame.len()
        });
        assert!(lengths[0] < 8 * run / 2 + 1_000, "{lengths:?}: four bits for each byte, and a code for each run");
        assert!(lengths[1] > lengths[0] * 3 / 2, "{lengths:?}: one block has one code for all of them");
    }

    #[test]
    fn a_frame_that_holds_more_than_the_limit_is_refused() {
        let frame = compress(&[7; 1000], 1000, 3).expect("a frame");
        assert_eq!(decompress(&frame, 1000).expect("all bytes"), [7; 1000], "the limit itself is allowed");
        assert!(decompress(&frame, 999).is_err(), "one byte more than the limit");
        assert!(decompress(&frame[..frame.len() - 1], 1000).is_err(), "a frame that is cut");
    }

    #[test]
    fn a_damaged_frame_is_an_error() {
        let frame = compress(&[7; 10_000], 10_000, 3).expect("it is compressed");
        let cut = frame[..frame.len() - 2].to_vec();
        let read = |frame| Decoder::new(Memory::of(frame))?.fill(&mut [0; 20_000]);
        assert!(read(cut).is_err(), "a frame that is cut off");
        assert!(read(b"no frame at all".to_vec()).is_err(), "other bytes");
    }
}
