//! Arrays of an `.npz` archive, as NumPy writes it.
//!
//! In: an archive and the name of an array. Out: the header of the array and the bytes of its values.

use std::fs::File;
use std::io::Read;
use std::path::Path;

/// Reads an array. Returns its header, which contains type and shape, and the bytes of its values.
pub fn array(path: &Path, array: &str) -> (String, Vec<u8>) {
    let mut archive =
        zip::ZipArchive::new(File::open(path).expect("the archive exists")).expect("the file is a zip archive");
    let mut bytes = Vec::new();
    let mut entry = archive.by_name(&format!("{array}.npy")).expect("the array is in the archive");
    entry.read_to_end(&mut bytes).expect("the array can be unpacked");
    assert_eq!(&bytes[..8], b"\x93NUMPY\x01\x00", "the array is a .npy file of version 1");
    let start = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    let values = bytes.split_off(start);
    (String::from_utf8(bytes.split_off(10)).expect("the header is text"), values)
}
