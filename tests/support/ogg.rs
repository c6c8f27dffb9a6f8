//! Pages of Ogg.
//!
//! In: the bytes of a file. Out: the same bytes, in which each page has the checksum of its contents.

/// Sets the checksum of every page, so that a changed page is read.
pub fn set_checksums(file: &mut [u8]) {
    let mut start = 0;
    while let Some(length) = page(&file[start..]) {
        let page = &mut file[start..start + length];
        page[22..26].fill(0);
        let sum = checksum(page);
        page[22..26].copy_from_slice(&sum.to_le_bytes());
        start += length;
    }
}

/// Returns the length of the page at the start of some bytes; `None` if there is none, or not all of it.
fn page(bytes: &[u8]) -> Option<usize> {
    let segments = usize::from(*bytes.get(26).filter(|_| bytes.starts_with(b"OggS"))?);
    let lengths = bytes.get(27..27 + segments)?;
    let length = 27 + segments + lengths.iter().map(|&length| usize::from(length)).sum::<usize>();
    (length <= bytes.len()).then_some(length)
}

/// The checksum of Ogg: polynomial 0x04c11db7, from the highest bit on.
fn checksum(bytes: &[u8]) -> u32 {
    bytes.iter().fold(0u32, |sum, &byte| {
        (0..8).fold(sum ^ u32::from(byte) << 24, |sum, _| (sum << 1) ^ if sum >> 31 == 1 { 0x04c1_1db7 } else { 0 })
    })
}
