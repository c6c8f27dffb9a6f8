//! The rows of an array of NumPy.
//!
//! In: the bytes of a `.npy` file. Out: its rows of `N` values in double precision, or the reason why it has none.

use crate::codec::npy::Array;

/// Returns the rows of a two-dimensional array of numbers, in either order of bytes and of rows and columns. Errors use
/// the name of the file.
pub(crate) fn rows<const N: usize>(bytes: &[u8], file: &str) -> Result<Vec<[f64; N]>, String> {
    let array = Array::read(bytes).ok_or("not a whole .npy file: copy it again")?;
    let (size, read) = number(array.kind).ok_or_else(|| {
        let kind = crate::codec::text::printable(array.kind);
        format!("its values are of the type {kind}, not real numbers: in Python, beside it: {}", remedy(file))
    })?;
    let [count, columns] = array.shape[..] else {
        return Err(format!("its shape is ({}), not rows x {N}", array.shape_in_words()));
    };
    if columns != N {
        return Err(format!("its shape is ({}), not rows x {N}", array.shape_in_words()));
    }
    if !array.is_whole(size) {
        return Err(format!(
            "its header says {count} rows, and it has {} bytes of values: copy it again",
            array.values.len()
        ));
    }
    let value = |row: usize, column: usize| {
        let index = if array.is_fortran { column * count + row } else { row * N + column };
        read(&array.values[index * size..(index + 1) * size])
    };
    Ok((0..count).map(|row| std::array::from_fn(|column| value(row, column))).collect())
}

/// Returns Python code that saves an array of any numbers so that it can be read, run in the folder of the file.
fn remedy(file: &str) -> String {
    format!(
        "import numpy; numpy.save('{file}', numpy.ascontiguousarray(numpy.load('{file}', allow_pickle=True), \
         dtype='<f8'))"
    )
}

/// Returns the size of a number of a type, and the function that reads its bytes.
fn number(kind: &str) -> Option<(usize, fn(&[u8]) -> f64)> {
    let read: fn(&[u8]) -> f64 = match kind {
        "<f8" => |bytes| f64::from_le_bytes(all(bytes)),
        ">f8" => |bytes| f64::from_be_bytes(all(bytes)),
        "<f4" => |bytes| f32::from_le_bytes(all(bytes)).into(),
        ">f4" => |bytes| f32::from_be_bytes(all(bytes)).into(),
        "<i8" => |bytes| i64::from_le_bytes(all(bytes)) as f64,
        ">i8" => |bytes| i64::from_be_bytes(all(bytes)) as f64,
        "<i4" => |bytes| i32::from_le_bytes(all(bytes)).into(),
        ">i4" => |bytes| i32::from_be_bytes(all(bytes)).into(),
        _ => return None,
    };
    Some((if kind.ends_with('8') { 8 } else { 4 }, read))
}

/// Returns the bytes of one number, of which there are `N`.
fn all<const N: usize>(bytes: &[u8]) -> [u8; N] {
    bytes.try_into().unwrap_or([0; N])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::codec::npy::tests::npy;

    const HEADER: &str = "{'descr': '<f8', 'fortran_order': False, 'shape': (2, 3), }\n";

    fn file(header: &str, values: &[f64]) -> Vec<u8> {
        npy(header, &values.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>())
    }

    #[test]
    fn rows_are_read_only_from_whole_arrays_of_their_shape() {
        let found = rows::<3>(&file(HEADER, &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]), "a.npy");
        assert_eq!(found, Ok(vec![[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]), "two rows");
        for (changed, reason) in [
            (HEADER.replace("<f8", "<c16"), "numpy.save('a.npy'"),
            (HEADER.replace("<f8", "|O"), "type |O"),
            (HEADER.replace("<f8", "<f4"), "48 bytes"),
            (HEADER.replace("(2, 3)", "(3, 2)"), "shape"),
            (HEADER.replace("(2, 3)", "(2,)"), "shape"),
            (HEADER.replace("(2, 3)", "(99999999999999999, 3)"), "rows"),
            (HEADER.replace("shape", "form"), "not a whole"),
        ] {
            let error = rows::<3>(&file(&changed, &[0.0; 6]), "a.npy").expect_err("the array is refused");
            assert!(error.contains(reason), "{changed}: {reason:?} is not in: {error}");
        }
        let whole = file(HEADER, &[0.0; 6]);
        for length in 0..whole.len() {
            assert!(rows::<3>(&whole[..length], "a.npy").is_err(), "an array cut off at {length} bytes is refused");
        }
    }

    #[test]
    fn numbers_of_any_order_and_type_are_read() {
        let values = [1.0f64, 2.0, 3.0, 4.0, 5.0, -6.0];
        let expected = Ok(vec![[1.0, 2.0, 3.0], [4.0, 5.0, -6.0]]);
        let columns = HEADER.replace("False", "True");
        assert_eq!(rows::<3>(&file(&columns, &[1.0, 4.0, 2.0, 5.0, 3.0, -6.0]), "a.npy"), expected, "column by column");
        let of = |kind: &str, bytes: Vec<u8>| rows::<3>(&npy(&HEADER.replace("<f8", kind), &bytes), "a.npy");
        let single = values.map(|value| value as f32);
        let (long, short) = (values.map(|value| value as i64), values.map(|value| value as i32));
        for (kind, bytes) in [
            (">f8", values.map(f64::to_be_bytes).concat()),
            ("<f4", single.map(f32::to_le_bytes).concat()),
            (">f4", single.map(f32::to_be_bytes).concat()),
            ("<i8", long.map(i64::to_le_bytes).concat()),
            (">i8", long.map(i64::to_be_bytes).concat()),
            ("<i4", short.map(i32::to_le_bytes).concat()),
            (">i4", short.map(i32::to_be_bytes).concat()),
        ] {
            assert_eq!(of(kind, bytes), expected, "{kind}");
        }
    }
}
