//! Gzip.
//!
//! In: bytes. Out: a gzip file of them.

use flate2::Compression;
use flate2::write::GzEncoder;
use std::io::Write;

/// Returns the bytes compressed as a gzip file.
pub fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut writer = GzEncoder::new(Vec::new(), Compression::fast());
    writer.write_all(bytes).expect("memory can be written to");
    writer.finish().expect("memory can be written to")
}
