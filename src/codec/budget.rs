//! The memory that a compressed file may take, one rule for every reader.
//!
//! In: the length of a file; what each of its parts would unpack to, or a stream that is unpacked. Out: the unpacked bytes, or an error that
//! states the claim and the limit. A claim is compared before memory is allocated for it, so that a small file cannot take much.
//!
//! A reader makes one [`Budget`] for a file, with the length of what is stored, and takes from it what every part unpacks to, and the Gaussians
//! that are made of it if they are much larger than the part.

use std::io::{self, Read};

/// Bytes that a file of any length may take: a picture of one color has 133 MB, in 4K with single precision or in 8K with 8 bits and alpha, and
/// hardly any bytes in its file.
const FLOOR: u64 = 128 << 20;
/// Further bytes for each byte of the file. Textures of Gaussians need 44 with the Gaussians made of them, arrays of numbers 2. A file that is made to
/// fill the memory has 1,000.
const PER_BYTE: u64 = 64;

/// The bytes that the parts of a compressed file may still take.
#[derive(Debug, Clone)]
pub(crate) struct Budget {
    length: u64,
    limit: u64,
    left: u64,
}

/// A part that would take more bytes than are left. The message follows the name of the part.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("takes {claim} bytes or more, and all parts of a file of {length} bytes may take {limit}")]
pub(crate) struct OverBudget {
    /// Bytes that the part takes at least.
    claim: u64,
    /// Bytes of the file.
    length: u64,
    /// Bytes that all parts of the file may take.
    limit: u64,
}

/// Why a part was not unpacked. The message follows the name of the part.
#[derive(Debug, thiserror::Error)]
pub(crate) enum UnpackError {
    /// It would take too much memory.
    #[error(transparent)]
    OverBudget(#[from] OverBudget),
    /// It has another length than the file states, in bytes.
    #[error("does not unpack to the {0} bytes that are stated; copy the file again")]
    Length(u64),
    /// Its stream is damaged or cut.
    #[error("cannot be unpacked: {0}; copy the file again")]
    Stream(#[from] io::Error),
}

impl Budget {
    /// Returns the budget of a file that has `length` bytes as it is stored.
    pub(crate) fn of(length: u64) -> Self {
        let limit = length.saturating_mul(PER_BYTE).saturating_add(FLOOR).min(isize::MAX as u64);
        Self { length, limit, left: limit }
    }

    /// Takes bytes of those that are left.
    ///
    /// # Errors
    /// More bytes than are left; nothing is taken then.
    pub(crate) fn take(&mut self, bytes: u64) -> Result<(), OverBudget> {
        self.left = self.left.checked_sub(bytes).ok_or_else(|| self.over(bytes))?;
        Ok(())
    }

    /// Unpacks a part of which `length` bytes are stated, as those of a zip archive are.
    ///
    /// # Errors
    /// More bytes than are left; another length than that stated; a damaged stream.
    pub(crate) fn unpack_stated(&mut self, reader: impl Read, length: u64) -> Result<Vec<u8>, UnpackError> {
        self.take(length)?;
        let mut bytes = Vec::new();
        // The checksum is compared at the end of a part.
        reader.take(length.saturating_add(1)).read_to_end(&mut bytes)?;
        if bytes.len() as u64 == length { Ok(bytes) } else { Err(UnpackError::Length(length)) }
    }

    /// Unpacks a part whose length is not known, as that of a gzip stream.
    ///
    /// # Errors
    /// More bytes than are left; a damaged stream.
    pub(crate) fn unpack(&mut self, reader: impl Read) -> Result<Vec<u8>, UnpackError> {
        let mut bytes = Vec::new();
        reader.take(self.left.saturating_add(1)).read_to_end(&mut bytes)?;
        self.take(bytes.len() as u64)?;
        Ok(bytes)
    }

    /// Returns the error about a part of so many bytes.
    fn over(&self, claim: u64) -> OverBudget {
        OverBudget { claim, length: self.length, limit: self.limit }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_parts_together_have_one_limit_that_grows_with_the_file() {
        let mut budget = Budget::of(1000);
        let limit = FLOOR + 64_000;
        assert_eq!(budget.take(limit - 10), Ok(()), "below the limit");
        let over = budget.take(11).expect_err("one byte too many");
        let message = format!("takes 11 bytes or more, and all parts of a file of 1000 bytes may take {limit}");
        assert_eq!(over.to_string(), message, "the claim, the file and the limit");
        assert_eq!(budget.take(10), Ok(()), "a refused part takes nothing");
        assert!(Budget::of(u64::MAX).take(isize::MAX as u64).is_ok(), "the limit does not overflow");
    }

    #[test]
    fn a_stream_is_unpacked_to_its_limit_and_no_further() {
        let mut budget = Budget::of(0);
        assert_eq!(budget.unpack(io::repeat(7).take(5)).expect("few bytes"), [7; 5], "all bytes");
        let error = budget.unpack(io::repeat(7)).expect_err("an endless stream");
        let left = FLOOR - 5;
        assert!(error.to_string().starts_with(&format!("takes {} bytes or more", left + 1)), "{error}");
    }

    #[test]
    fn a_part_must_have_the_length_that_is_stated() {
        let mut budget = Budget::of(0);
        assert_eq!(budget.unpack_stated(&[1, 2, 3][..], 3).expect("as stated"), [1, 2, 3], "all bytes");
        for stated in [2, 4] {
            let error = budget.unpack_stated(&[1, 2, 3][..], stated).expect_err("another length").to_string();
            assert!(error.contains(&format!("the {stated} bytes that are stated")), "{error}");
        }
        let error = budget.unpack_stated(io::repeat(0), FLOOR).expect_err("beyond the limit").to_string();
        assert!(error.contains("may take"), "a claim is refused before anything is unpacked: {error}");
    }
}
