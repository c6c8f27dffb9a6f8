//! The sound file that a capture carries.
//!
//! In: the bytes of a file, Ogg Vorbis or WAV. Out: the same bytes, held as the words that a package stores. They are
//! not decoded here: `codec::sound` does that.

use bytemuck::{cast_slice, cast_slice_mut};

/// The bytes of a sound file, which begins with the first moment of the capture.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SoundFile {
    /// Number of bytes.
    length: usize,
    /// The bytes, filled up with zeros.
    words: Vec<u32>,
}

impl SoundFile {
    /// Most bytes of a sound file: more than an hour of Ogg Vorbis at 128 kbit/s.
    pub const MOST_BYTES: usize = 64 << 20;

    /// Creates a sound file of these bytes.
    ///
    /// # Errors
    /// No bytes, or more than [`MOST_BYTES`](Self::MOST_BYTES).
    pub fn new(bytes: &[u8]) -> Result<Self, &'static str> {
        Self::check_length(bytes.len())?;
        let mut words = vec![0u32; bytes.len().div_ceil(4)];
        cast_slice_mut::<u32, u8>(&mut words)[..bytes.len()].copy_from_slice(bytes);
        Ok(Self { length: bytes.len(), words })
    }

    /// Returns the bytes of the file.
    pub fn bytes(&self) -> &[u8] {
        cast_slice(&self.words).get(..self.length).unwrap_or_default()
    }

    /// Checks the number of bytes of a file.
    pub(crate) fn check_length(length: usize) -> Result<(), &'static str> {
        match length {
            0 => Err("a sound file without bytes"),
            1..=Self::MOST_BYTES => Ok(()),
            _ => Err("a sound file of more than 64 MiB"),
        }
    }

    /// Checks that it has the words of its bytes.
    pub(crate) fn check(&self) -> Result<(), &'static str> {
        Self::check_length(self.length)?;
        match self.words.len() == self.length.div_ceil(4) {
            true => Ok(()),
            false => Err("a sound file whose words are not those of its bytes"),
        }
    }

    /// Returns a file of this many bytes without its words.
    pub(crate) fn blank(length: usize) -> Self {
        Self { length, words: Vec::new() }
    }

    /// Returns the number of bytes.
    pub(crate) fn len(&self) -> usize {
        self.length
    }

    /// Returns the bytes as words, the last one filled up with zeros.
    pub(crate) fn words(&self) -> &[u32] {
        &self.words
    }

    /// Returns the words, for a reader.
    pub(crate) fn words_mut(&mut self) -> &mut Vec<u32> {
        &mut self.words
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sound_file_returns_its_bytes() {
        for count in [1usize, 3, 4, 5, 8] {
            let bytes: Vec<u8> = (1..=count as u8).collect();
            let file = SoundFile::new(&bytes).expect("the file has bytes");
            assert_eq!(file.bytes(), bytes, "{count} bytes come back");
            assert_eq!((file.len(), file.words().len()), (count, count.div_ceil(4)), "the numbers of {count} bytes");
            assert_eq!(file.check(), Ok(()), "a good file");
        }
    }

    #[test]
    fn wrong_sizes_are_refused() {
        assert!(SoundFile::new(&[]).is_err(), "no bytes");
        assert!(SoundFile::check_length(SoundFile::MOST_BYTES + 1).is_err(), "too many bytes");
        let blank = SoundFile::blank(5);
        assert!(blank.check().is_err(), "a file without its words");
        assert_eq!(blank.bytes(), [0u8; 0], "a file without its words has no bytes");
    }
}
