//! The work that a file may ask for: it may show its Gaussians several times, but not without end.
//!
//! In: the number of bytes of its buffers, and the numbers that are about to be read. Out: an error about a file that
//! repeats its meshes or accessors too often.

use crate::codec::import::error::ImportError;

/// Numbers that the Gaussians of a small file may take: repeated meshes multiply them.
const NUMBERS: usize = 16 << 20;
/// Numbers for each byte of a file.
const NUMBERS_PER_BYTE: usize = 16;

/// The numbers that may still be read.
#[derive(Debug)]
pub(super) struct Work {
    left: usize,
}

impl Work {
    /// Returns the work for a file whose buffers have so many bytes.
    pub(super) fn of(bytes: usize) -> Self {
        Self { left: bytes.saturating_mul(NUMBERS_PER_BYTE).max(NUMBERS) }
    }

    /// Takes numbers of those that are left.
    ///
    /// # Errors
    /// More numbers than are left.
    pub(super) fn take(&mut self, numbers: usize) -> Result<(), ImportError> {
        let too_often = || ImportError::damaged("it repeats its meshes or accessors too often for its size");
        self.left = self.left.checked_sub(numbers).ok_or_else(too_often)?;
        Ok(())
    }
}
