//! Arrays of NumPy.
//!
//! In: the bytes of a `.npy` file. Out: its rows of `N` float64 values, or the reason why it has none.

/// The first bytes of an array.
const MAGIC: &[u8] = b"\x93NUMPY";

/// Returns the rows of a two-dimensional array of little-endian float64 values in C order.
pub(super) fn rows<const N: usize>(bytes: &[u8]) -> Result<Vec<[f64; N]>, String> {
    let damaged = || "not a whole .npy file: copy it again".to_owned();
    let rest = bytes.strip_prefix(MAGIC).ok_or_else(damaged)?;
    let (&[major, _minor], rest) = rest.split_first_chunk::<2>().ok_or_else(damaged)?;
    let (length, rest) = if major == 1 {
        let (length, rest) = rest.split_first_chunk::<2>().ok_or_else(damaged)?;
        (usize::from(u16::from_le_bytes(*length)), rest)
    } else {
        let (length, rest) = rest.split_first_chunk::<4>().ok_or_else(damaged)?;
        (u32::from_le_bytes(*length) as usize, rest)
    };
    let (header, values) = rest.split_at_checked(length).ok_or_else(damaged)?;
    let header = std::str::from_utf8(header).map_err(|_| damaged())?;
    let entry = |name: &str| {
        let (_, after) = header.split_once(&format!("'{name}'"))?;
        Some(after.trim_start().strip_prefix(':')?.trim_start())
    };
    let (order, shape) = (entry("fortran_order").ok_or_else(damaged)?, entry("shape").ok_or_else(damaged)?);
    if !entry("descr").ok_or_else(damaged)?.starts_with("'<f8'") || !order.starts_with("False") {
        return Err(
            "its values must be float64 in C order: save it with numpy.save(path, poses.astype('<f8'))".to_owned()
        );
    }
    let shape = shape.strip_prefix('(').and_then(|shape| shape.split_once(')')).ok_or_else(damaged)?.0;
    let shape: Vec<&str> = shape.split(',').map(str::trim).filter(|side| !side.is_empty()).collect();
    let count = match shape[..] {
        [rows, columns] if columns.parse::<usize>() == Ok(N) => rows.parse::<usize>().map_err(|_| damaged())?,
        _ => {
            return Err(format!(
                "its shape is ({}), not cameras x {N}",
                crate::codec::text::printable(&shape.join(", "))
            ));
        }
    };
    if count.checked_mul(8 * N) != Some(values.len()) {
        return Err(format!(
            "its header says {count} rows, and it has {} bytes of values: copy it again",
            values.len()
        ));
    }
    let value = |bytes: &[u8; 8]| f64::from_le_bytes(*bytes);
    let values: Vec<f64> = values.as_chunks::<8>().0.iter().map(value).collect();
    Ok(values.as_chunks::<N>().0.to_vec())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(header: &str, values: &[f64]) -> Vec<u8> {
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((header.len() as u16).to_le_bytes());
        bytes.extend(header.bytes());
        bytes.extend(values.iter().flat_map(|value| value.to_le_bytes()));
        bytes
    }

    #[test]
    fn rows_are_read_only_from_whole_arrays_of_their_shape() {
        let header = "{'descr': '<f8', 'fortran_order': False, 'shape': (2, 3), }\n";
        let found = rows::<3>(&file(header, &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]));
        assert_eq!(found, Ok(vec![[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]), "two rows");
        for (changed, reason) in [
            (header.replace("<f8", "<f4"), "float64"),
            (header.replace("False", "True"), "C order"),
            (header.replace("(2, 3)", "(3, 2)"), "shape"),
            (header.replace("(2, 3)", "(2,)"), "shape"),
            (header.replace("(2, 3)", "(99999999999999999, 3)"), "rows"),
            (header.replace("shape", "form"), "not a whole"),
        ] {
            let error = rows::<3>(&file(&changed, &[0.0; 6])).expect_err("the array is refused");
            assert!(error.contains(reason), "{changed}: {reason:?} is not in: {error}");
        }
        let whole = file(header, &[0.0; 6]);
        for length in 0..whole.len() {
            assert!(rows::<3>(&whole[..length]).is_err(), "an array cut off at {length} bytes is refused");
        }
    }
}
