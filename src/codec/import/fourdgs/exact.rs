//! The record of this program in a `.4dgs` file: the residuals of colors, which the format rounds and clamps.
//!
//! In: the residuals of colors, in the order of the Gaussians in the file; the bytes of a file. Out: the record;
//! [`Residuals`], which are added to the colors of the file. Other players skip its opcode, one of those for
//! applications.

use crate::codec::import::ImportError;
use fourdgs::opcode::{A_COLOR, SH_BAND_STREAM};
use fourdgs::serialization::{Cursor, MAGIC, Records, STREAM_HEADER_SIZE, put_record};
use fourdgs::stream::{DecodedStream, decode_stream, encode_stream};

/// The opcode.
pub(super) const OPCODE: u8 = 0xc4;
/// The first bytes of the record, since other programs may use the opcode too.
const NAME: &[u8] = b"bevy_gs4d colors 1";
/// The step of the residuals of colors of degree 0, which the format holds from 0 to 1.
pub(crate) const COLOR: f64 = 1.0 / (1 << 16) as f64;
/// The step of the residuals of coefficients: a quarter of the step of their bytes.
pub(crate) const COEFFICIENT: f64 = 8.0 / 255.0 / 4.0;
/// The level of compression of streams.
pub(crate) const LEVEL: u32 = 6;
/// The place of the number of channels in the header of a stream.
const CHANNELS: usize = 4;

/// The residuals, which are added to the colors of a file.
#[derive(Debug, Clone)]
pub(super) struct Residuals {
    colors: DecodedStream,
    coefficients: Option<DecodedStream>,
}

impl Residuals {
    /// Returns the residual of a channel of the degree-0 color of a Gaussian.
    pub(super) fn color(&self, index: usize, channel: usize) -> f64 {
        self.colors.get(index, channel) as f64 * COLOR
    }

    /// Returns the residual of a coefficient of degree 1 and above; `number` counts those of red, of green, of blue.
    pub(super) fn coefficient(&self, index: usize, number: usize) -> f64 {
        self.coefficients.as_ref().map_or(0.0, |residuals| residuals.get(index, number) as f64 * COEFFICIENT)
    }
}

/// Returns the record of residuals: three of colors for each Gaussian, `width` of coefficients. `None` if all are 0.
///
/// # Errors
/// A residual that needs more than 32 bits.
pub(crate) fn record(colors: &[i64], coefficients: &[i64], width: usize) -> fourdgs::Result<Option<Vec<u8>>> {
    if colors.iter().chain(coefficients).all(|&residual| residual == 0) {
        return Ok(None);
    }
    let mut content = NAME.to_vec();
    content.extend(encode_stream(A_COLOR, colors, 3, fourdgs::codec::DEFLATE, LEVEL, false)?);
    if width > 0 {
        content.extend(encode_stream(SH_BAND_STREAM, coefficients, width, fourdgs::codec::DEFLATE, LEVEL, false)?);
    }
    let mut record = Vec::new();
    put_record(&mut record, OPCODE, &content);
    Ok(Some(record))
}

/// Returns the residuals in a file of `count` Gaussians with `width` coefficients each; `None` if it has none.
///
/// # Errors
/// A record of this program that does not fit the file.
pub(super) fn residuals(file: &[u8], count: usize, width: usize) -> Result<Option<Residuals>, ImportError> {
    let mut records = Records::new(file, MAGIC.len()).map_while(Result::ok).filter(|record| record.opcode == OPCODE);
    let Some(content) = records.find_map(|record| record.content.strip_prefix(NAME)) else { return Ok(None) };
    let damaged = || ImportError::damaged("its record of exact colors does not fit its Gaussians: copy it again");
    let mut cursor = Cursor::new(content);
    let colors = stream(&mut cursor, count, 3).ok_or_else(damaged)?;
    let coefficients = if width > 0 { Some(stream(&mut cursor, count, width).ok_or_else(damaged)?) } else { None };
    Ok(Some(Residuals { colors, coefficients }))
}

/// Returns a stream of `count` elements with so many channels; `None` if the next stream is another one. The number of
/// channels is compared before memory is allocated for it.
fn stream(cursor: &mut Cursor<'_>, count: usize, channels: usize) -> Option<DecodedStream> {
    let header = cursor.rest().get(..STREAM_HEADER_SIZE)?;
    if usize::from(header[CHANNELS]) != channels {
        return None;
    }
    Some(decode_stream(cursor, Some(count)).ok()?.1)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(record: &[u8]) -> Vec<u8> {
        let mut file = MAGIC.to_vec();
        put_record(&mut file, OPCODE, b"of another program");
        file.extend_from_slice(record);
        file
    }

    #[test]
    fn residuals_come_back() {
        let record =
            record(&[0, 70_000, -3, 0, 0, 0], &[1, -2, 0, 0, 2, 1], 3).expect("small numbers").expect("residuals");
        let found = residuals(&file(&record), 2, 3).expect("intact").expect("a record");
        assert_eq!(found.color(0, 1), 70_000.0 * COLOR, "a color beyond 1");
        assert_eq!(found.coefficient(1, 1), 2.0 * COEFFICIENT, "a coefficient of the second Gaussian");
        assert!(residuals(&file(&[]), 2, 3).expect("intact").is_none(), "records of others are skipped");
    }

    #[test]
    fn a_file_without_residuals_has_no_record() {
        assert!(record(&[0; 6], &[0; 6], 3).expect("zeros").is_none(), "all are 0");
    }

    #[test]
    fn a_record_that_does_not_fit_is_refused() {
        let record = record(&[0, 1, 0, 0, 0, 0], &[1, 0, 0, 0, 0, 0], 3).expect("small numbers").expect("residuals");
        for (count, width) in [(3, 3), (2, 8), (1, 0)] {
            let error = residuals(&file(&record), count, width).expect_err("another file").to_string();
            assert!(error.contains("exact colors"), "{count} with {width}: {error}");
        }
        // The record follows that of the other program, which has 9 bytes of framing and 18 of contents.
        let mut cut = file(&record);
        let at = MAGIC.len() + 9 + 18 + 9 + NAME.len();
        cut.truncate(at + 4);
        assert!(
            residuals(&cut, 2, 3).expect("no whole record").is_none(),
            "a record that is cut is left to the reader"
        );
    }
}
