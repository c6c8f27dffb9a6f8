//! The size of the codebooks that the setup of a Vorbis file declares.
//!
//! In: the identification and setup headers of a Vorbis track. Out: an error if the decoder would unpack them into more
//! memory than real files need: a codebook of a few bytes can declare millions of values.

use super::SoundError;

/// Most entries, and most values of vectors, that the codebooks of a file may have together. Files by common encoders
/// have less than a tenth of them.
const MOST_VALUES: u64 = 4 << 20;
/// Bytes of the identification header.
const IDENTIFICATION: usize = 30;
/// What the setup header begins with.
const SETUP: &[u8] = b"\x05vorbis";
/// What a codebook begins with, 24 bits.
const CODEBOOK: u32 = 0x564342;

/// Checks the codebooks of the headers of a track, one after the other. The check ends, without an error, at what is
/// not a codebook: the decoder refuses it as well.
///
/// # Errors
/// Codebooks with more than [`MOST_VALUES`].
pub(super) fn check_codebooks(headers: &[u8]) -> Result<(), SoundError> {
    let Some(setup) = headers.get(IDENTIFICATION..).and_then(|setup| setup.strip_prefix(SETUP)) else { return Ok(()) };
    let mut bits = Bits { bytes: setup, at: 0 };
    let mut values = 0;
    for _ in 0..=bits.take(8).unwrap_or(0) {
        let Some([dimensions, entries]) = bits.size() else { break };
        values += u64::from(entries) * u64::from(dimensions.max(1));
        if values > MOST_VALUES {
            return Err(SoundError::Damaged(format!("its codebooks have more than {MOST_VALUES} values")));
        }
        if bits.skip_codebook(dimensions, entries).is_none() {
            break;
        }
    }
    Ok(())
}

/// Bits of the setup header, the lowest of each byte first (Vorbis I, section 2.1.4).
struct Bits<'a> {
    bytes: &'a [u8],
    /// The position in bits.
    at: u64,
}

impl Bits<'_> {
    /// Reads a number of up to 32 bits; `None` beyond the end.
    fn take(&mut self, count: u32) -> Option<u32> {
        let mut value = 0;
        for bit in 0..count {
            let byte = *self.bytes.get(usize::try_from(self.at / 8).ok()?)?;
            value |= u32::from(byte >> (self.at % 8) & 1) << bit;
            self.at += 1;
        }
        Some(value)
    }

    /// Reads the dimensions and the entries at the beginning of a codebook.
    fn size(&mut self) -> Option<[u32; 2]> {
        (self.take(24)? == CODEBOOK).then_some(())?;
        Some([self.take(16)?, self.take(24)?])
    }

    /// Skips what follows the [size](Self::size) of a codebook: the lengths of its words and the table of its vectors
    /// (Vorbis I, section 3.2.1).
    fn skip_codebook(&mut self, dimensions: u32, entries: u32) -> Option<()> {
        let is_ordered = self.take(1)? == 1;
        if is_ordered {
            self.take(5)?;
            let mut rest = entries;
            while rest > 0 {
                rest = rest.checked_sub(self.take(u32::BITS - rest.leading_zeros())?)?;
            }
        } else {
            let is_sparse = self.take(1)? == 1;
            for _ in 0..entries {
                if !is_sparse || self.take(1)? == 1 {
                    self.take(5)?;
                }
            }
        }
        let lookup = self.take(4)?;
        if lookup == 0 {
            return Some(());
        }
        self.take(32)?;
        self.take(32)?;
        let value_bits = self.take(4)? + 1;
        self.take(1)?;
        let values = match lookup {
            1 => u64::from(values_of_lattice(dimensions, entries)),
            2 => u64::from(entries) * u64::from(dimensions),
            _ => return None,
        };
        self.at += values * u64::from(value_bits);
        Some(())
    }
}

/// Returns the largest number whose power of `dimensions` is at most `entries` (Vorbis I, section 9.2.3).
fn values_of_lattice(dimensions: u32, entries: u32) -> u32 {
    let fits = |number: u32| number.checked_pow(dimensions).is_some_and(|power| power <= entries);
    // Both sides of the estimate, which is rounded.
    let estimate = f64::from(entries).powf(1.0 / f64::from(dimensions.max(1))) as u32;
    if fits(estimate + 1) {
        estimate + 1
    } else if fits(estimate) {
        estimate
    } else {
        estimate.saturating_sub(1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Headers with these codebooks, whose words are in order and whose vectors are a lattice.
    fn headers(codebooks: &[[u32; 2]]) -> Vec<u8> {
        let mut bits: Vec<bool> = Vec::new();
        let mut put = |(value, count): (u32, u32)| bits.extend((0..count).map(|bit| value >> bit & 1 == 1));
        put((codebooks.len() as u32 - 1, 8));
        for &[dimensions, entries] in codebooks {
            [(CODEBOOK, 24), (dimensions, 16), (entries, 24), (1, 1), (15, 5)].into_iter().for_each(&mut put);
            put((entries, u32::BITS - entries.leading_zeros()));
            [(1, 4), (0, 32), (0, 32), (3, 4), (0, 1)].into_iter().for_each(&mut put);
            (0..values_of_lattice(dimensions, entries)).for_each(|value| put((value, 4)));
        }
        let byte = |bits: &[bool]| bits.iter().rev().fold(0, |byte, &bit| byte << 1 | u8::from(bit));
        let setup = bits.chunks(8).map(byte);
        [0; IDENTIFICATION].into_iter().chain(SETUP.iter().copied()).chain(setup).collect()
    }

    #[test]
    fn codebooks_that_unpack_to_much_memory_are_refused() {
        assert_eq!(
            check_codebooks(&headers(&[[2, 625], [8, 6561], [1, 0], [4, 81]])),
            Ok(()),
            "as encoders write them"
        );
        let large = [20, 1 << 17];
        assert_eq!(check_codebooks(&headers(&[large])), Ok(()), "one that the decoder still reads");
        let two = headers(&[[2, 625], large, large]);
        assert!(two.len() < 300, "{} bytes", two.len());
        assert!(matches!(check_codebooks(&two), Err(SoundError::Damaged(_))), "two of them");
        let cut = &two[..two.len() - 70];
        assert_eq!(check_codebooks(cut), Ok(()), "headers that end before the second");
        assert_eq!(check_codebooks(b"OpusHead"), Ok(()), "headers of another codec");
    }

    #[test]
    fn the_lattice_of_a_codebook_has_the_largest_base() {
        for (dimensions, entries, expected) in [(2, 625, 25), (2, 624, 24), (8, 6561, 3), (3, 7, 1), (1, 99, 99)] {
            assert_eq!(values_of_lattice(dimensions, entries), expected, "{entries} entries of {dimensions}");
        }
    }
}
