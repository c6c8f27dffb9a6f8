//! The memory that a `.4dgs` file takes when it is read.
//!
//! In: the bytes of a file; the numbers of Gaussians and coefficients of a written file. Out: an error, or a sentence.

use super::exact::OPCODE;
use crate::codec::budget::{Budget, OverBudget};
use fourdgs::opcode::{CHUNK, SH_BAND_STREAM};
use fourdgs::records::parse_chunk;
use fourdgs::serialization::{MAGIC, MAX_STREAM_BYTES, Records};

/// Bytes of a Gaussian without view-dependent color in the crate `fourdgs`: decoded in a chunk and collected.
const DECODED: u64 = 80 + 96;
/// Bytes of a Gaussian in the streams of its chunk while that is decoded, and in
/// [`Columns`](crate::codec::import::columns::Columns).
const OTHERS: u64 = 168 + 140;
/// Bytes of a value of view-dependent color in the crate.
const VALUE: u64 = 9;
/// Bytes of such a value in `Columns`.
const FLOAT: u64 = 4;
/// Bytes of a Gaussian in the record of this program.
const RESIDUALS: u64 = 48 * 12;

/// Checks the memory that the Gaussians of a file take, before any is decoded. Damaged records are left to the reader.
///
/// # Errors
/// More than a file of this length may take.
pub(super) fn check(file: &[u8]) -> Result<(), OverBudget> {
    let mut budget = Budget::of(file.len() as u64);
    let (mut count, mut all) = (0, 0_u64);
    for record in Records::new(file, MAGIC.len()).map_while(Result::ok) {
        match record.opcode {
            CHUNK => {
                let Ok((head, _)) = parse_chunk(record.content) else { break };
                count = u64::from(head.count);
                all = all.saturating_add(count);
                budget.take(count * (DECODED + OTHERS))?;
                if !head.compression.is_empty() {
                    budget.take(head.uncompressed_size)?;
                }
            }
            SH_BAND_STREAM => {
                let band = u64::from(record.content.first().copied().unwrap_or_default());
                budget.take(count * 3 * (2 * band + 1) * (VALUE + FLOAT))?;
            }
            OPCODE => budget.take(all.saturating_mul(RESIDUALS))?,
            _ => {}
        }
    }
    Ok(())
}

/// Returns the sentence about a file that the crate does not read, since it holds a limited number of bytes.
pub(crate) fn too_large(count: usize, coefficients: usize) -> Option<String> {
    let bytes = count as u64 * (DECODED + 3 * coefficients as u64 * VALUE);
    (bytes > MAX_STREAM_BYTES).then(|| {
        let [bytes, limit] = [bytes, MAX_STREAM_BYTES].map(|bytes| bytes >> 20);
        format!(
            "Players that read with the crate fourdgs, as gs4d does, hold at most {limit} MiB of a file; this one takes {bytes} MiB, and they refuse it."
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use fourdgs::records::encode_chunk;
    use fourdgs::serialization::put_record;

    #[test]
    fn a_chunk_of_more_gaussians_than_the_file_may_hold_is_refused() {
        let file = |counts: &[u32]| {
            let mut file = MAGIC.to_vec();
            for &count in counts {
                file.extend(encode_chunk(0.0, 1.0, 0, count, &[]));
                put_record(&mut file, SH_BAND_STREAM, &[3]);
            }
            file
        };
        assert_eq!(check(&file(&[50_000])), Ok(()), "a small file may have some constant Gaussians");
        for counts in [&[u32::MAX][..], &[100_000, 100_000, 100_000]] {
            let over = check(&file(counts)).expect_err("too many").to_string();
            assert!(over.contains("may take"), "{counts:?}: {over}");
        }
    }

    #[test]
    fn a_file_too_large_for_the_crate_is_stated() {
        assert_eq!(too_large(900_000, 15), None, "a file within the limit");
        assert!(too_large(950_000, 15).is_some_and(|sentence| sentence.contains("526 MiB")), "a file beyond the limit");
    }
}
