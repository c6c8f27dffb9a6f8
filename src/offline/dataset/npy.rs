//! The rows of an array of NumPy.
//!
//! In: the bytes of a `.npy` file. Out: its rows of `N` float64 values, or the reason why it has none.

use crate::codec::npy::Array;

/// Returns the rows of a two-dimensional array of little-endian float64 values in C order.
pub(super) fn rows<const N: usize>(bytes: &[u8]) -> Result<Vec<[f64; N]>, String> {
    let array = Array::read(bytes).ok_or("not a whole .npy file: copy it again")?;
    if array.kind != "<f8" || array.is_fortran {
        return Err(
            "its values must be float64 in C order: save it with numpy.save(path, poses.astype('<f8'))".to_owned()
        );
    }
    let [count, columns] = array.shape[..] else {
        return Err(format!("its shape is ({}), not cameras x {N}", array.shape_in_words()));
    };
    if columns != N {
        return Err(format!("its shape is ({}), not cameras x {N}", array.shape_in_words()));
    }
    if !array.is_whole(8) {
        return Err(format!(
            "its header says {count} rows, and it has {} bytes of values: copy it again",
            array.values.len()
        ));
    }
    let value = |bytes: &[u8; 8]| f64::from_le_bytes(*bytes);
    let values: Vec<f64> = array.values.as_chunks::<8>().0.iter().map(value).collect();
    Ok(values.as_chunks::<N>().0.to_vec())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::codec::npy::tests::npy;

    fn file(header: &str, values: &[f64]) -> Vec<u8> {
        npy(header, &values.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>())
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
