//! Arrays of NumPy.
//!
//! In: the bytes of a `.npy` file. Out: [`Array`]: the type of its values, its shape, and the bytes of the values.

/// The first bytes of an array.
const MAGIC: &[u8] = b"\x93NUMPY";

/// An array.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Array<'a> {
    /// Type of the values: `<f4` are little-endian values of single precision.
    pub kind: &'a str,
    /// Whether the first index changes fastest.
    pub is_fortran: bool,
    /// Number of values along each index.
    pub shape: Vec<usize>,
    /// The bytes of the values, as many as the file has.
    pub values: &'a [u8],
}

impl<'a> Array<'a> {
    /// Reads an array; `None` if the bytes are not a whole header, or none that NumPy writes.
    pub(crate) fn read(bytes: &'a [u8]) -> Option<Self> {
        let rest = bytes.strip_prefix(MAGIC)?;
        let (&[major, _minor], rest) = rest.split_first_chunk::<2>()?;
        let (length, rest) = if major == 1 {
            let (length, rest) = rest.split_first_chunk::<2>()?;
            (usize::from(u16::from_le_bytes(*length)), rest)
        } else {
            let (length, rest) = rest.split_first_chunk::<4>()?;
            (u32::from_le_bytes(*length) as usize, rest)
        };
        let (header, values) = rest.split_at_checked(length)?;
        let header = std::str::from_utf8(header).ok()?;
        let entry = |name: &str| {
            let (_, after) = header.split_once(&format!("'{name}'"))?;
            Some(after.trim_start().strip_prefix(':')?.trim_start())
        };
        let kind = entry("descr")?.strip_prefix('\'')?.split_once('\'')?.0;
        let is_fortran = !entry("fortran_order")?.starts_with("False");
        let shape = entry("shape")?.strip_prefix('(')?.split_once(')')?.0;
        let sides = shape.split(',').map(str::trim).filter(|side| !side.is_empty());
        let shape = sides.map(|side| side.parse().ok()).collect::<Option<_>>()?;
        Some(Self { kind, is_fortran, shape, values })
    }

    /// Returns whether the values are as many as the shape says, of `size` bytes each.
    pub(crate) fn is_whole(&self, size: usize) -> bool {
        let count = self.shape.iter().try_fold(size, |product, &side| product.checked_mul(side));
        count == Some(self.values.len())
    }

    /// Returns the shape in words: `2 x 3`.
    pub(crate) fn shape_in_words(&self) -> String {
        let sides: Vec<String> = self.shape.iter().map(usize::to_string).collect();
        if sides.is_empty() { "one value".to_owned() } else { sides.join(" x ") }
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// Returns the bytes of an array with this header.
    pub(crate) fn npy(header: &str, values: &[u8]) -> Vec<u8> {
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((header.len() as u16).to_le_bytes());
        bytes.extend(header.bytes());
        bytes.extend(values);
        bytes
    }

    #[test]
    fn arrays_are_read_with_type_order_and_shape() {
        let bytes = npy("{'descr': '<f4', 'fortran_order': False, 'shape': (2, 3), }\n", &[7; 24]);
        let found = Array::read(&bytes).expect("a whole array");
        assert_eq!(found, Array { kind: "<f4", is_fortran: false, shape: vec![2, 3], values: &[7; 24] }, "its parts");
        assert!(found.is_whole(4) && !found.is_whole(8), "24 bytes are six values of four bytes");
        assert_eq!(found.shape_in_words(), "2 x 3", "its shape");
        let bytes = npy("{'descr': '|u1', 'fortran_order': True, 'shape': (), }", &[]);
        let found = Array::read(&bytes).expect("a whole header");
        assert!(found.is_fortran && found.shape.is_empty(), "the order, and no index");
    }

    #[test]
    fn damaged_headers_are_refused() {
        let header = "{'descr': '<f8', 'fortran_order': False, 'shape': (2, 3), }\n";
        for changed in [header.replace("shape", "form"), header.replace("(2", "(-2"), header.replace("'<f8'", "<f8")] {
            assert_eq!(Array::read(&npy(&changed, &[0; 48])), None, "{changed}");
        }
        let whole = npy(header, &[0; 48]);
        for length in 0..whole.len() {
            let is_whole = Array::read(&whole[..length]).is_some_and(|array| array.is_whole(8));
            assert!(!is_whole, "an array cut off at {length} bytes is not whole");
        }
        let huge = npy(&header.replace("(2, 3)", "(99999999999999999, 999)"), &[0; 48]);
        assert!(Array::read(&huge).is_some_and(|array| !array.is_whole(8)), "more values than there can be");
    }
}
