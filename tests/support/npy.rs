//! Plain arrays of an `.npz` archive, as NumPy writes it.
//!
//! In: an archive and the name of an array. Out: its bytes, without the header.

use std::fs::File;
use std::io::Read;
use std::path::Path;

/// Reads the values' bytes of an array whose type NumPy calls `kind`, such as `<f4`.
pub fn values(path: &Path, array: &str, kind: &str) -> Vec<u8> {
    let mut archive = zip::ZipArchive::new(File::open(path).expect("the archive is there")).expect("a zip archive");
    let mut bytes = Vec::new();
    let mut entry = archive.by_name(&format!("{array}.npy")).expect("the array is in the archive");
    entry.read_to_end(&mut bytes).expect("the array can be unpacked");
    assert_eq!(&bytes[..8], b"\x93NUMPY\x01\x00", "a .npy file of version 1");
    let start = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    let header = std::str::from_utf8(&bytes[10..start]).expect("the header is text");
    assert!(header.contains(&format!("'{kind}'")), "values of type {kind}: {header}");
    bytes.split_off(start)
}

/// Reads a column of float32.
pub fn floats(path: &Path, array: &str) -> Vec<f32> {
    let bytes = values(path, array, "<f4");
    bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect()
}
