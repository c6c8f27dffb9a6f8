//! The check that the palette of a PNG has complete colors. The decoder does not check it.
//!
//! In: the bytes of a file. Out: whether its palette can be used; the decoder panics if not.

/// Bytes of the signature.
const SIGNATURE: usize = 8;
/// Bytes of the length of a chunk.
const LENGTH: usize = 4;
/// Bytes of the type of a chunk.
const TYPE: usize = 4;
/// Bytes of the checksum of a chunk.
const CHECKSUM: usize = 4;

/// Returns whether every palette has from 1 to 256 complete colors. Chunks after the first chunk that is cut off are not read.
pub(super) fn has_whole_palette(bytes: &[u8]) -> bool {
    let mut rest = bytes.get(SIGNATURE..).unwrap_or_default();
    while let Some((length, after)) = rest.split_first_chunk::<LENGTH>() {
        let length = u32::from_be_bytes(*length) as usize;
        let Some((kind, after)) = after.split_first_chunk::<TYPE>() else { break };
        if kind == b"PLTE" && !(length.is_multiple_of(3) && (3..=768).contains(&length)) {
            return false;
        }
        let Some(next) = length.checked_add(CHECKSUM).and_then(|size| after.get(size..)) else { break };
        rest = next;
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(chunks: &[(&[u8; TYPE], usize)]) -> Vec<u8> {
        let mut bytes = vec![0; SIGNATURE];
        for (kind, length) in chunks {
            bytes.extend((*length as u32).to_be_bytes());
            bytes.extend_from_slice(*kind);
            bytes.extend(vec![0; length + CHECKSUM]);
        }
        bytes
    }

    #[test]
    fn palettes_with_incomplete_colors_are_refused() {
        assert!(has_whole_palette(&file(&[(b"IHDR", 13), (b"IDAT", 7)])), "a file without a palette is accepted");
        assert!(
            has_whole_palette(&file(&[(b"IHDR", 13), (b"PLTE", 768), (b"IDAT", 7)])),
            "a palette of 256 colors is accepted"
        );
        for length in [0, 1, 4, 771] {
            assert!(
                !has_whole_palette(&file(&[(b"IHDR", 13), (b"PLTE", length)])),
                "a palette of {length} bytes is refused"
            );
        }
        assert!(has_whole_palette(b"short"), "a file that is not a picture is refused by the decoder, not here");
    }
}
