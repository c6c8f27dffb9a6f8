//! The unpacked size of an EXR picture, before it is decoded: the decoder unpacks all channels of all parts, also those
//! that are not used.
//!
//! In: the bytes of a file. Out: the bytes that its pixels unpack to, by the headers of its parts.

/// The first bytes: four of the format, four of the version.
const START: usize = 8;
/// Bytes of a channel after its name: type, linearity and distance of samples.
const CHANNEL: usize = 16;

/// Returns the bytes of all pixels. Damaged headers are left to the decoder.
pub(super) fn unpacked(bytes: &[u8]) -> u64 {
    let (mut rest, mut sum) = (bytes.get(START..).unwrap_or_default(), 0_u64);
    // The headers of a file of several parts end with an empty one.
    while let Some((header, after)) = header(rest) {
        sum = sum.saturating_add(header.pixels.saturating_mul(header.pixel));
        rest = after;
    }
    sum
}

/// The size of a part, by its header.
#[derive(Debug, Default)]
struct Header {
    /// Number of pixels.
    pixels: u64,
    /// Bytes of all channels of a pixel.
    pixel: u64,
}

/// Reads a header, and returns the bytes after it; `None` if there is no whole header.
fn header(mut rest: &[u8]) -> Option<(Header, &[u8])> {
    let mut found = Header::default();
    let mut is_empty = true;
    loop {
        let (name, after) = text(rest)?;
        if name.is_empty() {
            return if is_empty { None } else { Some((found, after)) };
        }
        is_empty = false;
        let (_, after) = text(after)?;
        let (length, after) = after.split_first_chunk()?;
        let (value, after) = after.split_at_checked(u32::from_le_bytes(*length) as usize)?;
        match name {
            b"dataWindow" => found.pixels = pixels(value)?,
            b"channels" => found.pixel = channels(value)?,
            _ => {}
        }
        rest = after;
    }
}

/// Returns the number of pixels of a window: its first and its last column and row are part of it.
fn pixels(window: &[u8]) -> Option<u64> {
    let sides = window.as_chunks::<4>().0.iter().map(|side| i64::from(i32::from_le_bytes(*side)));
    let sides: Vec<i64> = sides.collect();
    let &[left, top, right, bottom] = sides.first_chunk()?;
    Some((right - left + 1).max(0).unsigned_abs().saturating_mul((bottom - top + 1).max(0).unsigned_abs()))
}

/// Returns the bytes of all channels of a pixel: two of half precision, four of other numbers.
fn channels(mut list: &[u8]) -> Option<u64> {
    let mut sum = 0;
    loop {
        let (name, after) = text(list)?;
        if name.is_empty() {
            return Some(sum);
        }
        let (channel, after) = after.split_at_checked(CHANNEL)?;
        sum += if channel.starts_with(&[1, 0, 0, 0]) { 2 } else { 4 };
        list = after;
    }
}

/// Splits a text that ends with a zero from the bytes after it.
fn text(bytes: &[u8]) -> Option<(&[u8], &[u8])> {
    let end = bytes.iter().position(|&byte| byte == 0)?;
    Some((&bytes[..end], &bytes[end + 1..]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{ExtendedColorType, ImageEncoder};
    use std::io::Cursor;

    /// Returns a header of one part, with channels of these types.
    fn header_of(window: [i32; 4], types: &[u8]) -> Vec<u8> {
        let channel = |kind: &u8| [&b"R\0"[..], &[*kind, 0, 0, 0], &[0; 12]].concat();
        let mut channels: Vec<u8> = types.iter().flat_map(channel).collect();
        channels.push(0);
        let window: Vec<u8> = window.iter().flat_map(|side| side.to_le_bytes()).collect();
        let attribute =
            |name: &[u8], value: &[u8]| [name, b"\0kind\0", &(value.len() as u32).to_le_bytes(), value].concat();
        [attribute(b"channels", &channels), attribute(b"dataWindow", &window), vec![0]].concat()
    }

    #[test]
    fn all_channels_of_all_parts_count() {
        let start = [0; START];
        let one = [&start[..], &header_of([-5, 0, 4, 1], &[1, 2, 0])].concat();
        assert_eq!(unpacked(&one), 20 * 10, "10 x 2 pixels of half, float and integer");
        let many = [&one[..], &header_of([0, 0, 9, 0], &[2]), &[0], &header_of([0; 4], &[2])].concat();
        assert_eq!(unpacked(&many), 200 + 40, "two parts, up to the empty header");
        let huge = [&one[..], &header_of([0, 0, i32::MAX, i32::MAX], &[2])].concat();
        assert_eq!(unpacked(&huge), u64::MAX, "no number overflows");
        for length in 0..one.len() {
            assert!(unpacked(&one[..length]) <= 200, "a file that is cut at {length}");
        }
    }

    #[test]
    fn a_picture_that_is_written_has_the_size_of_its_pixels() {
        let mut bytes = Vec::new();
        let pixels = vec![0; 37 * 21 * 16];
        image::codecs::openexr::OpenExrEncoder::new(Cursor::new(&mut bytes))
            .write_image(&pixels, 37, 21, ExtendedColorType::Rgba32F)
            .expect("it can be encoded");
        assert_eq!(unpacked(&bytes), 37 * 21 * 16, "four channels of single precision");
    }
}
